"""The options of `measure` and `five-point` that choose reports, language and plots."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.support.reported import ANGLES, measured
from wheelplane.cli import main
from wheelplane.commands.shared.reporting import plot_to, report_options, show_plot
from wheelplane.config import Config, ReportConfig, load_config
from wheelplane.errors import ConfigError
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.html.page import ReportOptions
from wheelplane.report.json.measurement import to_json
from wheelplane.report.plots.drawing_png import drawing_png
from wheelplane.report.plots.target_face import face_drawing
from wheelplane.report.write import ReportFiles, write_reports

FIGURE_4 = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
ALWAYS = {"measurement.json", "report.txt", "budget.svg"}
PICTURES = {f"target-{name}.png" for name in ANGLES}


@pytest.fixture
def wheelplane(capsys, monkeypatch):
    """Call the command in this process: exit code, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wheelplane", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        return (left.value.code, *capsys.readouterr())

    return call


@pytest.mark.parametrize(
    ("wanted", "more"),
    [
        (ReportFiles(), {"report.html"} | PICTURES),
        (ReportFiles(pictures=False), {"report.html"}),
        (ReportFiles(html=False), PICTURES),
        (ReportFiles(pictures=False, pdf=True), {"report.html", "report.pdf"}),
    ],
)
def test_what_is_wanted_is_written(wanted, more, tmp_path):
    written = write_reports(measured(1), tmp_path / "new" / "folder", wanted=wanted)
    assert {path.name for path in written} == ALWAYS | more
    assert all(path.stat().st_size > 1000 for path in written)


@pytest.mark.parametrize("language", LANGUAGES)
def test_pictures_are_in_the_language_of_the_report(language, tmp_path):
    words = load_translations(language)
    options = ReportOptions(words, PAPER)
    write_reports(measured(1), tmp_path, options=options, wanted=ReportFiles(html=False))
    budget = (tmp_path / "budget.svg").read_text(encoding="utf-8")
    assert f">{words('plot.budget_title')}<" in budget
    for wheel in measured(1).wheels:
        name = wheel.observation.name
        face = drawing_png(face_drawing(wheel, measured(1).frame, words))
        assert (tmp_path / f"target-{name}.png").read_bytes() == face


def test_no_report_of_an_earlier_measurement_stays_beside_a_new_one(tmp_path):
    """Other people's files stay, as do like names in a folder without a measurement."""
    own = {"report.pdf", "target-1.png", "target-FL.png", "report.html"}
    others = {"notes.txt", "measurement.pdf", "photo-1.png"}
    for name in own | others:
        (tmp_path / name).write_bytes(b"1")
    only = ReportFiles(pictures=False, html=False)
    write_reports(measured(1), tmp_path, wanted=only)
    assert {path.name for path in tmp_path.iterdir()} == ALWAYS | own | others
    write_reports(measured(1), tmp_path, wanted=only)
    assert {path.name for path in tmp_path.iterdir()} == ALWAYS | others


def test_an_earlier_measurement_is_not_written_over(wheelplane, tmp_path):
    """The earlier measurement would be lost; refused before anything is measured."""
    earlier = tmp_path / "measurement.json"
    earlier.write_text(to_json(measured(1)))
    (tmp_path / "same").symlink_to(tmp_path)
    for folder in (tmp_path, tmp_path / "same"):
        code, out, err = wheelplane("measure", "no-scans", "--before", earlier, "-o", folder)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert f"{folder / 'measurement.json'}: this command reads it: give another path" in err
    assert earlier.read_text() == to_json(measured(1))
    code, _, err = wheelplane("measure", "no-scans", "--before", earlier, "-o", tmp_path / "new")
    assert "no-scans: no such" in err


def test_the_report_is_of_the_file_beside_it(tmp_path):
    """Its number is the beginning of the digest of measurement.json, as any tool tells it."""
    import hashlib

    write_reports(measured(1), tmp_path, wanted=ReportFiles(pictures=False))
    digest = hashlib.sha256((tmp_path / "measurement.json").read_bytes()).hexdigest()
    assert digest in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_language_of_the_config_and_of_the_option():
    config = ReportConfig(language="pt")
    assert report_options(config, None, PAPER).words.language == "pt"
    assert report_options(config, "en", PAPER).words.language == "en"
    assert report_options(ReportConfig(), None, PAPER).words.language == "en"


def test_who_issues_the_report_changes_no_result(tmp_path):
    """The section is no part of the settings in effect."""
    assert "report" not in measured(1).provenance.config
    file = tmp_path / "lab.toml"
    file.write_text(
        '[report]\nlaboratory = "Lab 7"\nsignatures = ["Measured by"]\nlogo = "x.png"\n'
    )
    config = load_config(file)
    assert config.report.signatures == ("Measured by",)
    assert config.report.logo == str(tmp_path / "x.png")  # beside the config
    assert config.model_copy(update={"report": ReportConfig()}) == Config()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('laboratry = "x"', "did you mean 'laboratory'"),
        ("signatures = 3", "report.signatures"),
        ('language = "xx"', "known are en, pt"),
        ('logo = "no.png"', "no.png: cannot be read"),
    ],
)
def test_a_mistake_in_the_section_ends_in_one_line(text, says, wheelplane, tmp_path):
    (tmp_path / "lab.toml").write_text(f"[report]\n{text}\n")
    code, out, err = wheelplane("five-point", FIGURE_4, "--config", tmp_path / "lab.toml")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert says in err


def test_five_point_writes_page_pdf_and_plots(wheelplane, tmp_path):
    page, pdf, plots = (tmp_path / name for name in ("r.html", "r.pdf", "plots"))
    code, out, _ = wheelplane(
        "five-point", FIGURE_4, "--html", page, "--pdf", pdf, "--plot", plots, "--language", "pt"
    )
    assert code == 0
    assert [line for line in out.split("\n") if line.startswith("wrote ")] == [
        f"wrote {path}" for path in (page, pdf, plots)
    ]
    assert '<html lang="pt">' in page.read_text(encoding="utf-8")
    assert pdf.read_bytes().startswith(b"%PDF-")
    names = {path.name for path in plots.iterdir()}
    assert {"angles.svg", "angles.png", "angles.txt", "top.svg"} <= names
    assert not [name for name in names if name.startswith(("residuals", "histogram"))]


def test_two_reports_do_not_go_into_one_file(wheelplane, tmp_path):
    """The later one would replace the other, without a word."""
    one, same = tmp_path / "report", tmp_path / "." / "x" / ".." / "report"
    (tmp_path / "x").mkdir()
    for first, second in (("-o", "--html"), ("--html", "--pdf"), ("-o", "--pdf")):
        code, out, err = wheelplane("five-point", FIGURE_4, first, one, second, same)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert "two outputs go to this file: give a path for each" in err
        assert not one.exists()
    code, out, _ = wheelplane("five-point", FIGURE_4, "-o", "/dev/null", "--html", "/dev/null")
    assert (code, out.count("wrote /dev/null")) == (0, 2)


def test_plots_of_scans_of_an_earlier_measurement_do_not_stay(wheelplane, tmp_path):
    plots, mine = tmp_path / "plots", ("residuals.svg", "residuals-mine.txt", "notes.txt")
    stale = [f"{kind}-9.{form}" for kind in ("residuals", "histogram", "profile")
             for form in ("svg", "png")]  # fmt: skip
    plots.mkdir()
    for name in (*stale, *mine):
        (plots / name).write_text(name)
    wheelplane("five-point", FIGURE_4, "--plot", plots)
    kept = {path.name for path in plots.iterdir()}
    assert kept >= {*stale, *mine, "angles.txt"}  # of no measurement that a folder held
    wheelplane("five-point", FIGURE_4, "--plot", plots)
    assert {path.name for path in plots.iterdir()} == kept - set(stale)


def test_a_plot_in_the_terminal_leaves_json_alone(wheelplane):
    code, out, _ = wheelplane("five-point", FIGURE_4, "--plot", "-")
    assert code == 0
    assert out.count("●") == 2 * 8 + 1
    code, out, _ = wheelplane("five-point", FIGURE_4, "--plot", "-", "--json")
    assert code == 0
    assert len(json.loads(out)["wheels"]) == 8


def test_plots_go_where_they_are_reported(tmp_path, capsys):
    dress = ReportOptions(load_translations("en"), PAPER)
    assert plot_to(None, measured(1), None, dress) == []
    assert plot_to("-", measured(1), None, dress) == []
    assert plot_to(str(tmp_path / "p"), measured(1), None, dress) == [tmp_path / "p"]
    assert len(list((tmp_path / "p").iterdir())) == 1 + 2 * (4 + 2 * len(ANGLES))
    show_plot(None, measured(1), None, dress)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("option", ["--html", "--pdf", "--plot"])
def test_the_estimator_of_2013_keeps_its_printed_tables(option, wheelplane, tmp_path):
    code, out, err = wheelplane(
        "five-point", FIGURE_4, "--method", "tcgc-2013", option, tmp_path / "x"
    )
    assert (code, out) == (2, "")
    assert "tcgc-2013" in err
    assert not list(tmp_path.iterdir())


def test_a_pdf_needs_a_folder(wheelplane, tmp_path):
    code, out, err = wheelplane("measure", tmp_path, "--pdf")
    assert (code, out) == (2, "")
    assert "-o DIR" in err


def test_an_unknown_language_is_refused(wheelplane):
    code, _, err = wheelplane("five-point", FIGURE_4, "--language", "xx")
    assert code == 2
    assert "en" in err
    assert "pt" in err


def test_a_logo_that_is_no_picture_is_refused(tmp_path):
    (tmp_path / "logo.txt").write_text("hello")
    with pytest.raises(ConfigError, match="no PNG"):
        report_options(ReportConfig(logo=str(tmp_path / "logo.txt")), None, PAPER)


def test_a_table_of_2013_is_that_of_its_estimator(wheelplane):
    """By total least squares there is none: the option would be without effect."""
    code, out, err = wheelplane("five-point", FIGURE_4, "--print", "matrix")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--print matrix without --method tcgc-2013" in err
    assert wheelplane("five-point", FIGURE_4, "--print", "report")[0] == 0  # the default
