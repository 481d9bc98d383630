"""The page: what it says and in which order, in both languages, of good data and of bad."""

from __future__ import annotations

import ast
import base64
import functools
import json
import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from tests.support.printed import arc_step_s, two_digits
from tests.support.reported import ANGLES, MADE, lost, many, measured, renamed, scan
from tests.support.turning import WHEELS, Scene, rolled, swept
from wheelplane.config import ReportConfig
from wheelplane.errors import ConfigError, InputError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.evaluate import align, check_by_monte_carlo
from wheelplane.measurement.records import Naming
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.laboratory import Laboratory, read_laboratory
from wheelplane.report.format.language import FOLDER, LANGUAGES, load_translations
from wheelplane.report.format.view import PAPER, View
from wheelplane.report.format.writer import Table
from wheelplane.report.html.page import ReportOptions, html_report
from wheelplane.report.html.provenance import head_pairs, trouble
from wheelplane.report.json.measurement import to_json
from wheelplane.report.scene.scene import scene
from wheelplane.report.text.report import detailed_report
from wheelplane.vehicle.angles import deg_min_sec

ROOT = Path(__file__).parents[2]
FIGURE_4 = ROOT / "tests" / "data" / "paper" / "figure-4.txt"
VOID = {"meta", "col", "img", "br", "link", "input", "path", "rect", "image"}
BAD = '</script><script>alert("1")</script><img src=x onerror=alert(2)>{{ 7*7 }}\u202e\x07&'
EN, PT = load_translations("en"), load_translations("pt")
PLAIN = {words.language: ReportOptions(words, PAPER) for words in (EN, PT)}


class Page(HTMLParser):
    """A page read: its tags, its attributes, its text by the kind of element it stands in."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def inside(self, tag: str) -> list[str]:
        return [text for kind, text in self.texts if kind == tag]

    @property
    def words(self) -> str:
        """What is read: no script, no style."""
        kept = (text for kind, text in self.texts if kind not in ("script", "style"))
        return " ".join(" ".join(kept).split())


@cache
def page(language: str = "en") -> str:
    return html_report(measured(1), None, PLAIN[language])


def stated(measurement, conformity=None, language="en") -> Page:
    return Page(html_report(measurement, conformity, PLAIN[language], still=True))


def limits(low: float, high: float, **more):
    zone = {"camber": {"lower_deg": low, "upper_deg": high}}
    return Tolerance.model_validate({"front": zone, "rear": zone} | more)


# --- one file that needs nothing ----------------------------------------------------------------


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_page_is_whole_and_asks_for_nothing(language):
    read = Page(page(language))
    assert read.open == []
    assert read.tags[:2] == ["html", "head"]
    for name, value in read.attributes:
        if name in ("src", "href", "xlink:href", "action", "data", "srcset", "poster"):
            assert value.startswith(("data:image/", "#"))
    style = " ".join(read.inside("style"))
    assert "url(" not in style
    assert "@import" not in style
    assert any("default-src 'none'" in value for _, value in read.attributes)


@pytest.mark.parametrize("language", LANGUAGES)
def test_same_measurement_same_bytes(language):
    again = html_report(measured(1), None, PLAIN[language])
    assert again == page(language)
    assert not re.search(r"20[2-9]\d-\d\d-\d\d", Page(again).words)  # a date of today


@pytest.mark.parametrize("count", [4, 60])
def test_the_page_stays_small_however_many_wheels(count):
    """The pictures get coarser; at full size 64 of them alone take 3 MB."""
    assert len(html_report(many(count), None, PLAIN["en"]).encode()) < 5e6


def test_the_scene_can_be_read_back():
    read = Page(page())
    scenes = [text for text in read.inside("script") if text.startswith('{"cloud"')]
    assert len(scenes) == 1
    assert [wheel["name"] for wheel in json.loads(scenes[0])["wheels"]] == list(ANGLES)


# --- what users write is text and nothing else --------------------------------------------------


def test_names_are_inert():
    """A vehicle, a file and a trial that would all like to be scripts."""
    plain = Page(page())
    dress = replace(PLAIN["en"], laboratory=Laboratory(BAD, (BAD,), "", (BAD,)))
    text = html_report(renamed(BAD, BAD, BAD), None, dress)
    read = Page(text)
    assert read.open == []
    assert read.tags.count("script") == plain.tags.count("script")
    assert "img" not in read.tags
    assert not [name for name, _ in read.attributes if name.startswith("on")]
    assert "{{ 7*7 }}" in read.words
    assert "49" not in {word.strip("&\\") for word in read.words.split()}
    for raw in ("\u202e", "\x07"):
        assert raw not in text.replace("\\u202e", "")
    scene = next(text for text in read.inside("script") if text.startswith('{"cloud"'))
    assert json.loads(scene)["wheels"][-1]["name"] == BAD


def test_a_path_that_is_no_text_is_shown_as_a_code():
    text = html_report(renamed("x", "scan-\udcff.ply"), None, PLAIN["en"])
    assert "scan-\\udcff.ply" in Page(text).words
    text.encode()


# --- what it says -------------------------------------------------------------------------------


def test_the_verdict_comes_first_then_the_tables():
    read = stated(measured(1), assess(measured(1), limits(-5.0, 5.0))).words
    order = ["Conforming", "Axle by axle", "Toe and camber of each wheel", "Quantities with limits",
             "Vehicle frame", "Wheel by wheel", "Conventions", "Origin of the result",
             "End of the report"]  # fmt: skip
    places = [read.rindex(text) if text[0] in "VWCOE" and text != "Conforming" else read.index(text)
              for text in order]  # fmt: skip
    assert places == sorted(places)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_value_stands_in_the_table(language):
    """Deg-min-sec with sign, to the place of U, which is seconds here; u beside with two digits."""
    words = load_translations(language)
    read = stated(measured(1), language=language).words
    for result in measured(1).wheels:
        for angle, u in (
            (result.angles.toe_rad, result.u_toe_rad),
            (result.angles.camber_rad, result.u_camber_rad),
        ):
            assert arc_step_s(np.degrees(1.96 * u) * 3600) == 1.0
            seconds = f"{two_digits(np.degrees(u) * 3600):f}"
            assert f'{deg_min_sec(angle, 0)} {seconds}"' in read
    assert words("results.u_note", factor="").split(":")[0] in read
    if language == "pt":
        assert not re.search(r'\d\.\d+("| mm)', read)


@pytest.mark.parametrize(
    ("low", "high", "key"),
    [(-5.0, 5.0, "conform"), (0.5, 5.0, "not_conform"), (-1.15, 5.0, "undecided")],
)
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_verdict_is_said_in_a_word(low, high, key, language):
    """The trial's camber is measured as -1.156 degrees, its u 0.006."""
    words = load_translations(language)
    read = stated(measured(1), assess(measured(1), limits(low, high)), language)
    assert read.inside("p")[0].strip() == words(f"verdict.{key}")
    assert words(f"verdict.{key}_says") in read.words
    others = {"conform", "not_conform", "undecided"} - {key}
    assert not [k for k in others if words(f"verdict.{k}_says") in read.words]


def test_no_tolerance_no_verdict():
    read = stated(measured(1))
    assert read.inside("p")[0].strip() == EN("verdict.none")
    assert EN("verdict.table") not in read.words


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_was_not_measured_is_explained(language):
    words = load_translations(language)
    read = stated(lost(), assess(lost(), limits(-5.0, 5.0)), language).words
    for key in ("no_target", "no_target_means", "no_target_do"):
        assert words(f"status.{key}") in read
    assert "two planes, none of its size" in read  # as the program said it
    assert words("verdict.undecided_says") in read
    assert words("verdict.not_measured") in read
    assert words("wheel.no_picture") in read


@functools.cache
def statuses() -> set[str]:
    """Every status that the program's source can give."""
    found = set()
    for path in (ROOT / "pipeline").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "NotMeasuredError":
                found |= {a.value for a in node.args[:1] if isinstance(a, ast.Constant)}
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]).endswith("Status"):
                consts = [n for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
                found |= {c.value for c in consts}
    return found - {"ok", "agree", "disagree", "not-converged"}


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_status_is_explained_in_every_language(language):
    words = load_translations(language)
    assert len(statuses()) > 12
    for status in statuses():
        explained = trouble("RR", status, "", words)
        assert explained.means != words("status.other_means"), status
        assert explained.todo != words("status.other_do"), status
        assert explained.status != status.replace("-", " ") or language == "en"


def test_the_number_is_that_of_the_record():
    """An auditor can check the report against measurement.json."""
    import hashlib

    digest = hashlib.sha256(to_json(measured(1)).encode()).hexdigest()
    read = stated(measured(1)).words
    assert digest in read
    assert read.count(digest[:12]) >= 3
    for name, digest in measured(1).provenance.inputs.items():
        assert f"{name} {digest.removeprefix('sha256:')}" in read
    assert "wheelplane 1.2.3" in read
    assert "plane.edge_margin_m = 0.005" in read


def test_another_view_of_the_angles():
    view = View("thrust-line", "deg")
    read = Page(html_report(measured(1), None, ReportOptions(EN, view), still=True)).words
    trial = measured(1).wheels[-1].angles.camber_rad
    assert f"{np.degrees(trial):+.3f}°" in read  # U is 0.012 degrees
    full = replace(view, digits="full")
    read = Page(html_report(measured(1), None, ReportOptions(EN, full), still=True)).words
    assert f"{np.degrees(trial):+.5f}°" in read
    assert EN("conventions.digits_full") in read
    assert EN("axis.thrust_line") in read
    assert EN("conventions.units_deg") in read


def test_five_points_say_why_there_is_no_picture():
    read = stated(measure_five_point(read_five_point(FIGURE_4)))
    assert EN("wheel.no_picture_five") in read.words
    assert "image" not in read.tags
    assert EN("method.points") in read.words


def test_sweeps_and_run_outs_have_their_tables():
    made = Scene(seed=3).references()
    swept(made, "FL", 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    rolled(made, "RR", np.radians([0.0, 180.0]))
    read = stated(made.measure(), language="pt").words
    for key in ("turned.kingpins", "turned.caster", "turned.axial"):
        assert PT(key) in read
    assert PT("turned.runouts", shown=PT("turned.shown_targets")) in read


def with_bare(measurement, wheels_shown):
    """The measurement as if the scans of these wheels had shown them bare, by their flanges."""
    wheels = []
    for wheel in measurement.wheels:
        seen = wheel.observation
        if seen.wheel in wheels_shown:
            target = replace(seen.evidence.target, method="flange")
            seen = replace(seen, evidence=replace(seen.evidence, target=target))
        wheels.append(replace(wheel, observation=seen))
    return replace(measurement, wheels=tuple(wheels))


@pytest.mark.parametrize(
    ("bare", "shown"),
    [((), "targets"), (("RR",), "both"), (("RR", "RL", "FR", "FL"), "bare")],
)
def test_bare_wheels_have_no_target_s_method_points_or_run_outs(bare, shown):
    made = Scene(seed=3).references()
    rolled(made, "RR", np.radians([0.0, 180.0]))
    rolled(made, "FL", np.radians([0.0, 180.0]))
    found = with_bare(made.measure(), bare)
    assert len(found.runouts) == 2
    for words in (EN, PT):
        read = stated(found, language=words.language).words
        is_bare, has_targets = shown != "targets", shown != "bare"
        assert (words("conventions.bare_method") in read) == is_bare
        assert (words("conventions.scan_method") in read) == has_targets
        assert (words("wheel.points_bare") in read) == is_bare
        assert (words("wheel.points") in read) == has_targets
        title = words("turned.runouts", shown=words(f"turned.shown_{shown}"))
        assert title in read


def test_a_monte_carlo_check_is_reported():
    checked = check_by_monte_carlo(measured(1), 20_000, 0)
    said = {EN(f"checks.{key}", tolerance="5 %") for key in ("agree", "disagree", "not_converged")}
    assert any(text in stated(checked).words for text in said)


def test_the_laboratory_its_logo_and_its_signatures(tmp_path):
    logo = tmp_path / "logo.png"
    logo.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(20))
    config = ReportConfig(
        laboratory="Lab 7", address="A street\nA town", logo=str(logo), signatures=["Measured by"]
    )
    dress = replace(PLAIN["en"], laboratory=read_laboratory(config))
    read = Page(html_report(measured(1), None, dress, still=True))
    shown = next(value for name, value in read.attributes if name == "src")
    assert base64.b64decode(shown.removeprefix("data:image/png;base64,")) == logo.read_bytes()
    for text in ("Lab 7", "A street", "A town", "Measured by", EN("section.signatures")):
        assert text in read.words
    assert EN("section.signatures") not in stated(measured(1)).words


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be read"),
        (b"BM123", "no PNG"),
        (b"\x89PNG\r\n\x1a\n" + bytes(10**6), "smaller"),
    ],
    ids=["missing", "bitmap", "huge"],
)
def test_a_logo_that_cannot_be_used(content, says, tmp_path):
    if content is not None:
        (tmp_path / "logo").write_bytes(content)
    with pytest.raises(ConfigError, match=says):
        read_laboratory(ReportConfig(logo=str(tmp_path / "logo")))


# --- the languages ------------------------------------------------------------------------------


def test_all_languages_have_the_same_texts_with_the_same_parts():
    parts = {
        language: {key: set(re.findall(r"{(\w+)}", text)) for key, text in words.texts.items()}
        for language, words in ((name, load_translations(name)) for name in LANGUAGES)
    }
    assert len(parts["en"]) > 300
    for language in LANGUAGES:
        assert parts[language] == parts["en"], language


def test_no_text_is_left_over():
    """Each key stands in the source, or is one that a pattern there makes, or the name of a thing.

    The page of `view` has sections of its own.
    """
    named = ("language", "status", "quantity", "axis", "definition", "cause", "method", "role",
             "viewer", "target", "through", "checks", "page",
             "wheel_name", "frame_note", "turns_of", "method_label", "agreement",
             "fault", "item_fault", "note")  # fmt: skip
    folder, batch = ROOT / "pipeline" / "report", ROOT / "pipeline" / "batch" / "results"
    files = [path for suffix in ("py", "html", "css", "js") for path in folder.rglob(f"*.{suffix}")]
    files += [batch / name for name in ("tables.py", "page.py", "listing.py", "trend_plot.py")]
    source = "".join(path.read_text(encoding="utf-8") for path in files)
    patterns = {re.sub(r"{[^}]*}", r"\\w*", text.replace(".", r"\."))
                for text in re.findall(r"f[\"'](\w+\.[^\"']*{[^\"']*)[\"']", source)}  # fmt: skip
    known = set(re.findall(r"[\"'](\w+\.\w+)[\"']", source))
    keys = [key for key in EN.texts if key.split(".")[0] not in named]
    assert len(keys) > 150
    assert len(patterns) > 10
    made = re.compile("|".join(patterns))
    assert [key for key in keys if key not in known and not made.fullmatch(key)] == []


def test_no_english_is_left_in_a_portuguese_report():
    """None of the texts that differ between the two, nor any of their English words."""
    shown = [
        stated(lost(), assess(lost(), limits(-5.0, 5.0)), "pt"),
        stated(measured(1), language="pt"),
    ]
    shown.append(stated(measure_five_point(read_five_point(FIGURE_4)), language="pt"))
    own = " ".join(PT.texts.values()).lower()
    foreign = set(re.findall(r"[a-z]{4,}", " ".join(EN.texts.values()).lower()))
    foreign -= set(re.findall(r"[a-zà-ú]{4,}", own))
    assert len(foreign) > 300
    for read in shown:
        kept = [text for kind, text in read.texts if kind not in ("script", "style")]
        text = re.sub(r"\S+ = \S+|\S*/\S*|\w+(\.\w+)+", "", " ".join(kept))  # settings, files
        for said in (*measured(1).notes, *[w.observation.reason for w in lost().wheels]):
            text = text.replace(said, "") if said else text
        found = foreign & set(re.findall(r"[a-zà-ú]{4,}", text.lower()))
        assert found == set()


def test_nothing_is_left_untranslated():
    """Words that a text has in both languages are names, or words of both tongues."""
    names = {"jcgm", "student", "home", "scripts", "webgl", "sigma", "scanner", "capture", "toml",
             "monte", "carlo", "wheelplane", "json", "measurement", "html", "view",
             "batch", "cluster", "config", "certificate", "item", "readings", "xlsx", "validation",
             "hotelling", "validate", "archive", "bland", "altman", "york", "nees", "aiming",
             "divisor", "holm", "double", "fahrachswinkel", "radversatz",
             "radstandsdifferenz", "nelson", "results", "found",
             "left", "down", "unit", "positive", "axis", "clamp", "tilt", "target", "runout",
             "stand", "registration", "pointing", "urad"}  # fmt: skip
    both = names | {"normal", "total", "zero", "face", "manual", "linear", "vertical",
                    "longitudinal", "lateral", "axial", "regular", "terminal",
                    "javascript", "decimal", "capture", "toml", "gravity"}  # fmt: skip
    for key, text in EN.texts.items():
        english, own = (
            set(re.findall(r"[a-zà-ú]{4,}", re.sub(r"{\w+}", "", said).lower()))
            for said in (text, PT.texts[key])
        )
        assert english & own <= both, key


def test_a_language_that_is_not_there():
    with pytest.raises(InputError, match="known are en, pt"):
        load_translations("xx")


def test_a_language_is_one_file():
    assert {path.stem for path in FOLDER.glob("*.toml")} == set(LANGUAGES) == {"en", "pt"}


def test_columns_on_paper_are_as_wide_as_their_longest_cells_up_to_where_these_are_broken():
    table = Table(("name", "value"), (("a", "12345678"), ("abcdefgh", "1")))
    assert table.shares == [50.0, 50.0]
    narrow, wide = Table(("n", "text"), (("a", "w" * 40),)).shares
    assert wide == pytest.approx(14.0 * narrow, rel=1e-3)
    assert Table(("n", "text"), (("a", "w" * 400),)).shares == [narrow, wide]
    assert narrow + wide == pytest.approx(100.0, abs=0.02)


@pytest.mark.parametrize("language", ["en", "pt"])
def test_a_scan_of_a_wheel_and_of_its_run_out_is_counted_once(language):
    """As the points of the 3D view and the files of the provenance are."""
    words = load_translations(language)
    seen = [scan(name, 1).observation for name in ANGLES]
    again = replace(seen[0], name="RR turn 1", role="runout")
    points = sum(one.points_total for one in seen)
    for observations, count in ((seen, 5), ([*seen, again], 5)):
        found = align(observations, MADE)
        assert dict(head_pairs(found, "", words))[words("head.scans")] == words(
            "head.scans_of", points=words.count(points), count=count
        )
        assert found.points_read == {one.source: one.points_total for one in seen}
        assert f"Points read (pontos lidos): {points} in " in detailed_report(found)
        assert scene(found)["cloud"]["total"] == points


@pytest.mark.parametrize("files", [1, 2])
def test_clouds_of_a_vehicle_are_counted_once_each(files):
    """Four wheels in each, and in an E57 several stations."""
    words = load_translations("en")
    wheels = [
        replace(scan(name, 1).observation, points_total=1000 * file,
                name=name if file == 1 else f"{name} again", source=f"{file}.e57: {station}",
                role="reference" if file == 1 else "runout")
        for file in range(1, files + 1)
        for station, name in enumerate(WHEELS)
    ]  # fmt: skip
    found = align(wheels, replace(MADE, naming=Naming("front", "up")))
    assert found.points_read == {f"{file}.e57": 1000 * file for file in range(1, files + 1)}
    shown = dict(head_pairs(found, "", words))[words("head.scans")]
    one, two = "1\u00a0000 points in one cloud", "3\u00a0000 points in 2 clouds"
    assert shown == f"{one if files == 1 else two} of the vehicle"
