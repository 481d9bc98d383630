"""Calibrations in a batch: readings in the folder of a capture, their list, export and drift."""

from __future__ import annotations

import csv
import json
import shutil
from collections import Counter

import numpy as np
import pytest
from click.testing import CliRunner

from tests.support.calibration_bay import CAMBER, TOE, changed, item_of, machine
from tests.support.made import write_small_capture
from tests.support.web_site import Site
from wheelplane.batch.catalogue.calibration_row import CalibrationRow, calibration_row
from wheelplane.calibration import item_toml
from wheelplane.commands.batch import batch
from wheelplane.commands.calibrate import calibrate
from wheelplane.commands.results import results
from wheelplane.errors import InputError
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.writer import NONE
from wheelplane.web.archive.views import answer
from wheelplane.web.security import RefusedError
from wheelplane_synth.machine.forms import readings_csv
from wheelplane_synth.machine.indicate import indicate

DATED = r"\d{4}-\d\d-\d\d"


def run(command, *arguments):
    found = CliRunner().invoke(command, list(map(str, arguments)), standalone_mode=False)
    if found.exception and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Three calibrations of a machine that drifts by 3' a month, a faulty one, and a plain one."""
    place = tmp_path_factory.mktemp("archive")
    (place / "bays").mkdir()
    first = write_small_capture(place / "bays" / "2026-01-15")
    (first / "five-point.txt").unlink()
    (place / "bays" / "coarse.toml").unlink()
    truth = json.loads((first / "truth.json").read_text())
    for month, name in enumerate(("2026-01-15", "2026-02-15", "2026-03-15", "2026-04-15"), 0):
        folder = place / "bays" / name
        if folder != first:
            shutil.copytree(first, folder)
        tested = machine(toe=changed(TOE, zero=3.0 * month), camber=CAMBER)
        (folder / "item.toml").write_text(item_toml(item_of(tested)))
        table = readings_csv(indicate(truth, tested, np.random.default_rng(month)))
        (folder / "readings.csv").write_text(table)
    faulty, plain = place / "bays" / "2026-04-15", place / "bays" / "2026-05-15"
    shutil.copytree(faulty, plain)
    (plain / "item.toml").unlink()
    (plain / "readings.csv").unlink()
    text = (faulty / "readings.csv").read_text()
    (faulty / "readings.csv").write_text(text.replace(",min,", ",gon,"))
    arguments = ("-o", place / "results", "--date-in-name", DATED)
    assert run(batch, place / "bays", *arguments).return_value == 0
    return place


def listed(archive, *more):
    found = run(results, archive / "results", "--calibrations", "--json", *more)
    return json.loads(found.stdout)["calibrations"]


def trees(archive):
    found = (archive / "results" / "measurements").rglob("*.json")
    return {tree["capture"]: tree for tree in map(json.loads, (p.read_text() for p in found))}


def test_a_capture_with_readings_is_calibrated_as_the_command_calibrates_it(archive, monkeypatch):
    monkeypatch.chdir(archive / "bays")
    files = ("--item", "2026-01-15/item.toml", "--readings", "2026-01-15/readings.csv")
    alone = json.loads(run(calibrate, "2026-01-15", *files, "--json").stdout)
    tree = trees(archive)["2026-01-15"]["calibration"]
    assert tree["date"] == "2026-01-15"  # of the name, which the command does not know
    assert tree | {"date": None} == json.loads(json.dumps(alone))


def test_calibrations_are_listed_with_verdict_and_worst_error(archive):
    found = {one["name"]: one for one in listed(archive)}
    assert list(found) == ["2026-01-15", "2026-02-15", "2026-03-15", "2026-04-15"]
    for name, one in found.items():
        if name == "2026-04-15":
            continue
        points = [p for q in trees(archive)[name]["calibration"]["quantities"] for p in q["points"]]
        worst = max(abs(p["error"]["value_deg"]) / p["mpe_deg"] for p in points)
        assert (one["serial"], one["points"]) == ("7", len(points))
        assert one["worst"] == pytest.approx(worst)
        assert one["decision"] == trees(archive)[name]["calibration"]["decision"]
        assert one["error"] == ""
    assert found["2026-03-15"]["decision"] == "not conform"  # 6' of zero error and 6' of MPE
    assert listed(archive, "--since", "2026-02-01", "--until", "2026-02-28")[0]["name"] == (
        "2026-02-15"
    )


def test_a_limit_is_one_of_the_text_and_of_its_json(archive):
    names = [one["name"] for one in listed(archive, "--limit", "2")]
    text = run(results, archive / "results", "--calibrations", "--limit", "2").stdout
    assert names == [one["name"] for one in listed(archive) if one["name"] in text]
    assert len(names) == 2


def test_a_faulty_table_is_a_row_and_spoils_no_measurement(archive):
    faulty = {one["name"]: one for one in listed(archive)}["2026-04-15"]
    assert faulty["error"].startswith("readings.csv: row 2, column unit: 'gon' is no unit of toe")
    assert (faulty["serial"], faulty["decision"], faulty["points"]) == ("7", None, 0)
    tree, plain = trees(archive)["2026-04-15"], trees(archive)["2026-05-15"]
    assert tree["batch"]["status"] == "ok"
    assert tree["wheels"] == plain["wheels"]
    assert "calibration" not in plain
    text = run(results, archive / "results", "--calibrations").stdout
    assert "2026-04-15: readings.csv: row 2, column unit" in text
    assert "nonconforming" in text


def test_calibrations_are_exported(archive, tmp_path):
    path = tmp_path / "all.csv"
    run(results, archive / "results", "--calibrations", "--csv", path)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [row["name"] for row in rows] == [one["name"] for one in listed(archive)]
    assert float(rows[0]["worst"]) == listed(archive)[0]["worst"]
    assert rows[3]["worst"] == ""
    with_sql = run(results, archive / "results", "--sql", "SELECT decision FROM calibrations")
    assert len(with_sql.stdout.splitlines()) == 5


def test_drift_reads_the_catalogue_and_folders_alike(archive, tmp_path):
    by_catalogue = run(results, archive / "results", "--drift", "--item", "7", "--json")
    tree = json.loads(by_catalogue.stdout)
    assert tree["files"] == ["2026-01-15", "2026-02-15", "2026-03-15"]
    slope = next(one for one in tree["drift"] if one["quantity"] == "toe zero error")["slope"]
    assert slope * 60.0 * 30.0 == pytest.approx(3.0, abs=0.5)
    for name in tree["files"]:
        (tmp_path / name).mkdir()
        calibration = trees(archive)[name]["calibration"]
        (tmp_path / name / "calibration.json").write_text(json.dumps(calibration))
    of_folders = json.loads(run(results, tmp_path, "--drift", "--item", "7", "--json").stdout)
    assert of_folders["drift"] == tree["drift"]
    assert of_folders["intervals"] == tree["intervals"]
    with pytest.raises(InputError, match="no calibration of serial '8': there are those of 7"):
        run(results, archive / "results", "--drift", "--item", "8")


def test_files_that_belong_together_are_asked_for(archive, tmp_path):
    archive = shutil.copytree(archive, tmp_path / "archive")
    folder = archive / "bays" / "2026-05-15"
    source = archive / "bays" / "2026-01-15"
    cases = {
        ("item.toml",): "no readings beside item.toml",
        ("readings.csv",): "item.toml: cannot be read",
        ("item.toml", "readings.csv", "readings.xlsx"): "readings.csv and readings.xlsx beside",
    }
    for names, reason in cases.items():
        for name in names:
            shutil.copy(source / name.replace(".xlsx", ".csv"), folder / name)
        where = (archive / "bays", "-o", archive / "results")
        run(batch, *where, "--date-in-name", DATED, "--resume")
        (one,) = listed(archive, "--name", "2026-05-15", "--no-gone")[-1:]
        for name in names:
            (folder / name).unlink()
        assert reason in one["error"], names
        assert str(archive) not in one["error"]


def test_the_page_lists_calibrations_and_shows_each_point(archive):
    words = load_translations("en")
    found = answer("calibrations", archive / "results", {}, words)
    rows = {row[2]: row for row in found["table"]["rows"]}
    assert list(rows) == ["2026-01-15", "2026-02-15", "2026-03-15", "2026-04-15"]
    assert rows["2026-03-15"][:4] == ["7", "Synthetic Bay", "2026-03-15", "2026-03-15"]
    assert rows["2026-03-15"][4:6] == [NONE, "nonconforming"]  # as found: nothing was adjusted
    assert found["table"]["classes"][2:] == ["not-conform", "not-conform"]
    first, faulty = (
        answer("calibration", archive / "results", {"key": found["keys"][i]}, words) for i in (0, 3)
    )
    assert ["serial number", "7"] in [[a.lower(), b] for a, b in first["facts"]]
    (table,) = first["tables"]
    points = trees(archive)["2026-01-15"]["calibration"]["quantities"][0]["points"]
    assert [row[2] for row in table["rows"][: len(points)]] == [p["point"] for p in points]
    assert (
        table["rows"][0][-1]
        == {"conform": "conforming", "undecided": "undecided"}[points[0]["decision"]]
    )
    assert "gon" in str(faulty["facts"])
    assert faulty["tables"] == []
    portuguese = answer("calibrations", archive / "results", {}, load_translations("pt"))
    assert portuguese["table"]["rows"][2][5] == "não conforme"
    with pytest.raises(RefusedError):
        answer("calibration", archive / "results", {"key": "gone"}, words)


@pytest.fixture
def certified(archive, tmp_path, monkeypatch):
    """The archive on a page, the certificate of its first calibration below its results."""
    site = Site(tmp_path)
    copy = shutil.copytree(archive / "results", site.allowed / "results")
    monkeypatch.chdir(archive / "bays")
    files = ("--item", "2026-01-15/item.toml", "--readings", "2026-01-15/readings.csv")
    run(calibrate, "2026-01-15", *files, "-o", copy / "certificates" / "first")
    yield site
    site.close()


def test_the_page_opens_the_certificate_of_the_same_readings(certified):
    keys = certified.get("/api/archive/calibrations/0/results").json["keys"]
    found = [
        certified.get(f"/api/archive/calibration/0/results?key={key}").json["certificate"]
        for key in keys
    ]
    assert found == [True, False, False, False]
    address = "/api/archive-certificate/0/results?key={}"
    shown = certified.get(address.format(keys[0]))
    folder = certified.allowed / "results" / "certificates" / "first"
    assert shown.data == (folder / "certificate.html").read_bytes()
    assert "sandbox" in shown.headers["Content-Security-Policy"]
    for key in (keys[1], keys[3], "gone"):
        assert certified.get(address.format(key)).status_code == 404
    elsewhere = (folder / "certificate.html").rename(certified.allowed.parent / "elsewhere.html")
    (folder / "certificate.html").symlink_to(elsewhere)
    assert certified.get(address.format(keys[0])).status_code == 403


def test_a_calibration_with_its_certificate_below_the_results_counts_once(certified):
    found = run(results, certified.allowed / "results", "--drift", "--item", "7", "--json")
    assert json.loads(found.stdout)["files"] == ["2026-01-15", "2026-02-15", "2026-03-15"]


@pytest.mark.parametrize("form", ["zip", "tar", "gztar"])
def test_an_archive_is_calibrated_as_its_folder_is(archive, tmp_path, form):
    """Packed with its folder and without it; a faulty table is named without any path."""
    (tmp_path / "bays").mkdir()
    for name in ("2026-01-15", "2026-04-15"):
        source = archive / "bays" / name
        root, base = (source.parent, name) if form == "tar" else (source, None)
        shutil.make_archive(str(tmp_path / "bays" / name), form, root, base)
    assert run(batch, tmp_path / "bays", "-o", tmp_path / "results").return_value == 0
    suffix = {"zip": ".zip", "tar": ".tar", "gztar": ".tar.gz"}[form]
    packed = trees(tmp_path)
    found = packed[f"2026-01-15{suffix}"]["calibration"]
    folder = trees(archive)["2026-01-15"]["calibration"]
    assert found["quantities"] == folder["quantities"]
    assert found["readings"] == folder["readings"]
    assert found["item"]["serial"] == "7"
    error = packed[f"2026-04-15{suffix}"]["calibration"]["error"]
    assert error == trees(archive)["2026-04-15"]["calibration"]["error"]


def test_what_is_no_calibration_is_said_so():
    assert calibration_row(None) is None
    for tree in ({}, [], 3, {"item": 1}, {"item": {"serial": "7"}, "quantities": [{}]}):
        assert "no calibration" in calibration_row(tree).error
    error = {"schema": "x", "item": None, "error": "gone"}
    assert calibration_row(error) == CalibrationRow(error="gone")


def test_the_summary_counts_verdicts_and_names_readings_that_cannot_be_used(archive):
    """All captures are measured, so that the exit code is 0; the line says what is missing."""
    bays, to = archive / "bays", archive / "results"
    found = run(batch, bays, "-o", to, "--date-in-name", DATED)
    assert found.return_value == 0
    lines = found.stdout.splitlines()
    known = Counter(one["decision"] for one in listed(archive) if not one["error"])
    names = {"conform": "conforming", "undecided": "undecided", "not conform": "nonconforming"}
    shown = ", ".join(f"{known[key]} {name}" for key, name in names.items() if known[key])
    assert known.total() == 3
    at = lines.index(f"calibrations: {shown}, 1 without results")
    assert lines[at + 1].startswith(
        "      1 not calibrated: readings.csv: row 2, column unit: 'gon' is no unit of toe"
    )
    assert lines[at + 2] == f"        such as 2026-04-15: wheelplane results {to} --calibrations"
