"""What the page's server does for a page of ours: measure, show, compare, save, browse."""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.support.made import read_ply, write_small_capture
from tests.support.printed import arc_s, says_angle, seconds_of, step
from tests.support.trees import read_tree
from tests.support.web_site import PAPER, Site, write_results
from wheelplane.batch.catalogue.rows import STATUSES
from wheelplane.batch.run.work import RECOGNISED, VANISHED
from wheelplane.errors import Doubt, InputError
from wheelplane.measurement.doubts import COPIED, FLOOR_ABOVE
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.notes import notes_in
from wheelplane.web.files import folders
from wheelplane.web.files.excerpt import failure

BAR = 'stroke="#8aa9c8"'  # of one value in the picture of a trend
WEB = Path(__file__).resolve().parents[2] / "pipeline" / "web"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    place = tmp_path_factory.mktemp("site")
    made = Site(place)
    made.copy(PAPER, "figure-4.txt")
    write_small_capture(made.allowed / "capture")
    (made.allowed / "plain").mkdir()
    yield made
    made.close()


@pytest.fixture(scope="module")
def five(site):
    return finished(site.measure({"root": 0, "path": "figure-4.txt"}))


@pytest.fixture(scope="module")
def dense(site):
    return finished(site.measure({"root": 0, "path": "capture"}))


def finished(job_state):
    assert job_state["state"] == "done", job_state
    return job_state["id"]


def file_of(site, job, name):
    answer = site.get(f"/api/jobs/{job}/{name}")
    assert answer.status_code == 200, answer.text
    return answer


# What can be opened


def test_the_folder_shows_what_can_be_opened(site):
    items = site.get("/api/files/0/").json["items"]
    kinds = {item["name"]: item["kind"] for item in items}
    assert kinds["capture"] == "capture"
    assert kinds["figure-4.txt"] == "five-point"
    assert kinds["plain"] == "folder"
    inside = {i["name"]: i["kind"] for i in site.get("/api/files/0/capture").json["items"]}
    assert inside["rr.ply"] == "cloud"
    assert "truth.json" not in inside


def test_a_folder_of_too_many_files_shows_the_first_by_name_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "MOST_LISTED", 20)
    site = Site(tmp_path)
    names = [f"{number:02d}.ply" for number in range(21)]
    for number in np.random.default_rng(1).permutation(20):
        (site.allowed / names[number]).touch()
    whole = site.get("/api/files/0/").json
    assert ([item["name"] for item in whole["items"]], whole["is_cut"]) == (names[:20], False)
    (site.allowed / "00.ply").unlink()
    (site.allowed / "20.ply").touch()
    (site.allowed / "00").mkdir()
    cut = site.get("/api/files/0/").json
    assert ([item["name"] for item in cut["items"]], cut["is_cut"]) == (["00", *names[1:20]], True)
    site.close()


# Measuring


def test_a_capture_is_measured_as_the_command_measures_it(site, dense):
    tree = file_of(site, dense, "measurement.json").json
    truth = json.loads((site.allowed / "capture" / "truth.json").read_text())
    wheels = {wheel["name"]: wheel for wheel in truth["wheels"]}
    assert len(tree["wheels"]) == 5
    for wheel in tree["wheels"]:
        for angle in ("toe", "camber"):
            error = wheel[f"{angle}_deg"] - wheels[wheel["name"]][f"{angle}_deg"]
            assert abs(error) < 5.0 * wheel[f"u_{angle}_deg"]
    assert tree["capture"] == "capture"  # no path of this machine


def test_an_allowed_folder_that_is_a_capture_is_measured_by_its_own_name(tmp_path):
    (tmp_path / "allowed").mkdir()
    site = Site(tmp_path)
    for name in ("RR", "RL", "FR"):
        (site.allowed / f"{name}.ply").touch()
    (site.allowed / "capture.toml").write_text(
        '[reference]\nRR = "RR.ply"\nRL = "RL.ply"\nFR = "FR.ply"\nFL = "../FL.ply"\n'
    )
    job_state = site.measure({"root": 0, "path": ""})
    assert job_state["name"] == "allowed"
    assert job_state["failure"]["text"].startswith("allowed: '../FL.ply' is outside")
    site.close()


def test_the_panel_says_the_same_in_every_unit_and_language(site, five):
    tree = file_of(site, five, "measurement.json").json
    expanded_of = {entry["quantity"]: entry["expanded_95"] for entry in tree["uncertainty"]}
    for language in LANGUAGES:
        panel = file_of(site, five, f"panel-{language}.json").json
        words = load_translations(language)
        wheels = panel["tables"]["default"]["rear-axle"]["dms"][0]
        toe = wheels["head"].index(words("quantity.toe"))
        degrees = panel["tables"]["default"]["rear-axle"]["deg"][0]
        for i, wheel in enumerate(tree["wheels"]):
            expanded = expanded_of[f"{wheel['name']}.toe"]
            assert says_angle(wheels["rows"][i][toe], wheel["toe_deg"], expanded)
            assert float(degrees["rows"][i][toe].strip("°").replace(",", ".")) == pytest.approx(
                wheel["toe_deg"], abs=0.51 * step(expanded)
            )
        assert panel["tables"]["default"]["thrust-line"]["dms"][0]["rows"] != wheels["rows"]


def test_other_conventions_turn_the_signs_of_headings_and_of_nothing_else(site, five):
    tables = file_of(site, five, "panel-en.json").json["tables"]
    rows = {name: tables[name]["centreline"]["deg"][2]["rows"] for name in tables}
    plain, iso = rows["default"], rows["iso-8855"]
    turned = [(one[1], other[1]) for one, other in zip(plain, iso, strict=True) if one != other]
    assert turned
    for before, after in turned:
        assert float(after.strip("°")) == -float(before.strip("°")) != 0.0
    assert len(rows["german-workshop"]) > len(plain)


def test_camber_is_measured_from_the_vertical_that_is_chosen(site, dense):
    given = {"root": 0, "path": "capture"}
    failed = site.measure({**given, "options": {"vertical": "gravity"}})
    assert failed["state"] == "failed"
    assert "gravity" in failed["failure"]["text"]
    capture = site.copy(site.allowed / "capture", "levelled")
    file = capture / "capture.toml"
    tree = file_of(site, dense, "measurement.json").json
    up = np.array(tree["frame"]["up"]) + 0.01 * np.array(tree["frame"]["left"])
    file.write_text(f"gravity = {[*map(float, -up)]}\ngravity_u_deg = 0.01\n" + file.read_text())
    job = finished(
        site.measure({"root": 0, "path": "levelled", "options": {"vertical": "gravity"}})
    )
    found = file_of(site, job, "measurement.json").json
    assert found["vertical_in_use"] == "gravity"
    for wheel, plain in zip(found["wheels"], tree["wheels"], strict=True):
        sense = 1.0 if wheel["name"].endswith("L") else -1.0
        turned = wheel["camber_deg"] - plain["camber_deg"]
        assert turned == pytest.approx(-sense * np.degrees(0.01), abs=0.01 * np.degrees(0.01))
    head = file_of(site, job, "panel-en.json").json["tables"]["default"]["rear-axle"]["dms"][0]
    assert any("gravity" in name for name in head["head"])
    refused = site.ended(site.post("/api/compare", {"first": job, "second": dense}).json["id"])
    assert refused["state"] == "failed"
    assert "gravity" in refused["failure"]["text"]
    five_points = {"root": 0, "path": "figure-4.txt", "options": {"vertical": "floor"}}
    assert "five points" in site.measure(five_points)["failure"]["text"]


def test_each_wheel_has_its_evidence(site, dense, five):
    panel = file_of(site, dense, "panel-en.json").json
    for wheel in panel["wheels"]:
        assert len(wheel["facts"]) > 5
        for drawing in wheel["drawings"]:
            answer = file_of(site, dense, drawing["file"])
            assert answer.content_type.startswith("image/svg+xml")
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert [len(wheel["drawings"]) for wheel in panel["wheels"]] == [3] * 5
    of_five = file_of(site, five, "panel-en.json").json["wheels"]
    assert [len(wheel["drawings"]) for wheel in of_five] == [1] * 8


def test_an_upload_of_several_files_is_a_capture(site):
    capture = site.allowed / "capture"
    upload = site.post("/api/uploads", {}).json["upload"]
    for path in capture.iterdir():
        if path.suffix in (".ply", ".toml"):
            answer = site.put(f"/api/uploads/{upload}/dropped/{path.name}", path.read_bytes())
            assert answer.status_code == 200
    job_state = site.measure({"upload": upload})
    job = finished(job_state)
    assert job_state["name"] == "dropped"
    assert site.app.config["state"].jobs.found(job).finished.wait(20)
    assert list((site.allowed.parent / "scratch").glob("upload-*")) == []  # nothing is left of it
    names = [wheel["name"] for wheel in file_of(site, job, "measurement.json").json["wheels"]]
    assert names == ["RR", "RL", "FR", "FL", "1"]


def test_a_zip_is_a_capture(site):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for path in (site.allowed / "capture").iterdir():
            archive.write(path, f"car/{path.name}")
    job_state = site.measure({"upload": site.send(car__zip=out.getvalue())})
    assert finished(job_state)
    assert job_state["name"] == "car.zip"


def test_progress_is_reported_and_cancelling_ends_the_work(site):
    job = site.post("/api/measure", {"root": 0, "path": "capture"}).json
    assert job["state"] in ("waiting", "running")
    assert site.post(f"/api/jobs/{job['id']}/cancel", {}).status_code == 200
    assert site.ended(job["id"])["state"] == "cancelled"
    assert site.get(f"/api/jobs/{job['id']}/measurement.json").status_code == 409
    process = site.app.config["state"].jobs.found(job["id"]).process
    assert process is None or process.wait(10) is not None


def test_limits_are_judged(site):
    given = {"root": 0, "path": "figure-4.txt", "options": {"tolerance": "example"}}
    panel = file_of(site, finished(site.measure(given)), "panel-en.json").json
    assert panel["headline"]["kind"] in ("conform", "not-conform", "undecided")
    assert panel["limits"]["default"]["rear-axle"]["dms"]["rows"]


def test_limits_are_found_by_the_vehicle_model(site):
    options = {"options": {"tolerance": "auto"}}
    failed = site.measure({"root": 0, "path": "figure-4.txt", **options})["failure"]
    assert "it names no vehicle_model" in failed["text"]
    declared = site.allowed / "capture" / "capture.toml"
    before = declared.read_text()
    declared.write_text('vehicle_model = "Example Saloon"\n' + before)
    job = site.measure({"root": 0, "path": "capture", **options})
    declared.write_text(before)
    panel = file_of(site, finished(job), "panel-en.json").json
    rows = panel["limits"]["default"]["rear-axle"]["dms"]["rows"]
    assert {row[1] for row in rows} >= {"RR", "FL", "vehicle"}


def test_scans_with_columns_of_their_own_are_read_by_the_names_that_are_given(site, dense):
    """An index before the coordinates changes no angle, once its column is named."""
    folder = site.copy(site.allowed / "capture", "indexed")
    for path in folder.glob("*.ply"):
        points, _ = read_ply(path)
        rows = "".join(f"{i} {x:.9f} {y:.9f} {z:.9f}\n" for i, (x, y, z) in enumerate(points))
        path.with_suffix(".xyz").write_text(rows)
        path.unlink()
    declared = folder / "capture.toml"
    declared.write_text(declared.read_text().replace(".ply", ".xyz"))
    given = {"root": 0, "path": "indexed"}
    assert site.measure(given)["state"] == "failed"
    job = finished(site.measure(given | {"options": {"columns": "-, x, y, z"}}))
    before, after = (
        [wheel["toe_deg"] for wheel in file_of(site, one, "measurement.json").json["wheels"]]
        for one in (dense, job)
    )
    assert after == pytest.approx(before, abs=1e-4)
    for options in ({"columns": "x,y"}, {"pitch": "1"}, {"columns": "x,y,z", "pitch": "1,1"}):
        answer = site.post("/api/measure", given | {"options": options})
        assert answer.status_code == 400
        assert all(name in answer.json["error"] for name in options)


@pytest.mark.slow
def test_what_was_measured_is_remembered_and_no_more_than_is_kept(tmp_path):
    site = Site(tmp_path, jobs=2)
    try:
        site.copy(PAPER, "figure-4.txt")
        made = [finished(site.measure({"root": 0, "path": "figure-4.txt"})) for _ in range(3)]
        site.measure({"root": 0, "path": "figure-4.txt", "options": {"read_as": "cloud"}})  # fails
        kept = [job["id"] for job in site.get("/api/jobs").json["jobs"]]
        assert kept == made[-1:]  # and the failed one, of which there is nothing to look at
        assert site.get(f"/api/jobs/{made[0]}").status_code == 404
        assert len(list((tmp_path / "scratch").glob("job-*"))) == 2
    finally:
        site.close()


# Errors at their line


def test_a_structure_error_shows_the_lines_of_the_file(site):
    rows = PAPER.read_text().splitlines()
    rows[16] = "1.0 2.0 x<i>3</i>"
    (site.allowed / "bad.txt").write_text("\n".join(rows))
    job_state = site.measure({"root": 0, "path": "bad.txt"})["failure"]
    assert "line 17" in job_state["text"]
    assert job_state["text"].startswith("bad.txt: ")
    assert (job_state["file"], job_state["first"], job_state["last"]) == (
        "bad.txt",
        17,
        17,
    )
    assert [number for number, _ in job_state["lines"]] == list(range(14, 21))
    assert dict(job_state["lines"])[17] == "1.0 2.0 x<i>3</i>"


def test_a_mistake_in_capture_toml_shows_its_line(site):
    folder = site.allowed / "mistaken"
    folder.mkdir()
    (folder / "capture.toml").write_text('vehicle = "x"\ntarget = disc\n')
    job_state = site.measure({"root": 0, "path": "mistaken"})["failure"]
    assert (job_state["file"], job_state["first"]) == ("capture.toml", 2)


def test_excerpts_hold_text_only(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"one\n" + b"x" * 100_000 + b"\n\x1b[31mred\xff\n")
    job_state = failure("a.txt: line 3: wrong", path)
    assert [number for number, _ in job_state["lines"]] == [1, 2, 3]
    assert all(text.isprintable() and len(text) <= 160 for _, text in job_state["lines"])
    path.write_bytes(b"\0\n\n\n")
    assert "lines" not in failure("a.txt: line 3: wrong", path)
    assert "lines" not in failure("a.txt: line 99: beyond", path)
    assert "lines" not in failure("no place named", path)
    assert "lines" not in failure("line 1", tmp_path / "gone.txt")


# Points


def test_points_are_sent_node_by_node(site, dense):
    head = file_of(site, dense, "points.json").json
    address = f"/api/jobs/{dense}/points.bin"
    data = site.get(address).data
    assert sum(len(node.xyz) for node in read_tree(head, data)) == head["count"]
    count = head["nodes"][0][-1]
    part = site.get(address, headers={"Range": f"bytes=16-{16 * count - 1}"})
    assert part.status_code == 206
    assert part.data == data[16 : 16 * count]
    assert part.headers["Content-Range"] == f"bytes 16-{16 * count - 1}/{len(data)}"
    beyond = site.get(address, headers={"Range": f"bytes={len(data)}-"})
    assert beyond.status_code == 416


# Reports


@pytest.mark.parametrize(
    ("kind", "begins"),
    [
        ("html", b"<!DOCTYPE html>"),
        ("txt", b"wheelplane "),
        ("json", b"{"),
        pytest.param("pdf", b"%PDF-", marks=pytest.mark.slow),
    ],
)
def test_a_report_is_saved_under_the_users_name(site, five, kind, begins):
    if kind == "pdf":
        pytest.importorskip("weasyprint", exc_type=ImportError)
    name = f"Wagen 3 é.{kind}"
    given = {"format": kind, "root": 0, "name": name, "language": "pt", "axis": "thrust-line"}
    answer = site.post(f"/api/jobs/{five}/save", given)
    assert answer.status_code == 200, answer.json
    place = site.allowed / name
    assert answer.json["saved"] == str(place)
    assert place.read_bytes()[: len(begins)].lower() == begins.lower()
    assert site.post(f"/api/jobs/{five}/save", given).status_code == 409  # nothing is overwritten
    place.unlink()


def test_a_report_can_be_shown_and_downloaded(site, five):
    shown = site.get(f"/api/jobs/{five}/report.html?language=en")
    assert "sandbox" in shown.headers["Content-Security-Policy"]
    assert shown.data != site.get(f"/api/jobs/{five}/report.html?language=pt").data
    loaded = site.get(f"/api/jobs/{five}/report.txt?download&name=a.txt")
    assert loaded.headers["Content-Disposition"] == "attachment; filename=a.txt"
    for wrong in (
        "report.exe",
        "report.html?language=xx",
        "report.txt?axis=x",
        "report.txt?style=mm",
        "report.txt?convention=x",
    ):
        assert site.get(f"/api/jobs/{five}/{wrong}").status_code == 400, wrong


# Comparing


def compared(site, first, second):
    answer = site.post("/api/compare", {"first": first, "second": second})
    job_state = site.ended(answer.json["id"])
    return job_state, site.get(f"/api/jobs/{job_state['id']}/comparison.json").json


def test_a_capture_agrees_with_its_five_points(site, dense):
    (site.allowed / "survey.txt").write_bytes(
        (site.allowed / "capture" / "five-point.txt").read_bytes()
    )
    five = finished(site.measure({"root": 0, "path": "survey.txt"}))
    job_state, found = compared(site, dense, five)
    assert job_state["state"] == "done"
    assert found["verdict"] == "agree"
    assert {row[0] for row in found["table"]["rows"]} == {"RR", "RL", "FR", "FL", "1"}
    dense_tree, five_tree = (file_of(site, job, "measurement.json").json for job in (dense, five))
    for row in found["table"]["rows"]:
        angles = [next(w for w in tree["wheels"] if w["name"] == row[0])[f"{row[1]}_deg"]
                  for tree in (dense_tree, five_tree)]  # fmt: skip
        expanded_s = arc_s(row[5])  # with two digits; the difference ends at the same place
        assert says_angle(row[4], angles[0] - angles[1], expanded_s / 3600.0)


def test_another_alignment_of_the_wheels_disagrees(site, dense):
    other = site.allowed / "turned"
    other.mkdir()
    capture = site.allowed / "capture"
    for path in capture.iterdir():
        name = {"rr.ply": "trial-1.ply", "trial-1.ply": "rr.ply"}.get(path.name, path.name)
        (other / name).write_bytes(path.read_bytes())
    job_state, found = compared(site, dense, finished(site.measure({"root": 0, "path": "turned"})))
    assert job_state["state"] == "done"
    assert found["verdict"] == "disagree"
    assert {row[0] for row in found["table"]["rows"] if row[-1] == "disagree"} >= {"RR", "1"}


def test_the_same_scans_agree_with_themselves_and_that_shows_nothing(site, five):
    site.copy(PAPER, "copy.txt")
    other = finished(site.measure({"root": 0, "path": "copy.txt"}))
    for second in (five, other):
        job_state, found = compared(site, five, second)
        assert job_state["state"] == "done"
        assert found["verdict"] == "cannot tell"
        (doubt,) = found["doubts"]
        assert "measured from the same files" in doubt
        assert doubt.partition(": ")[2] in " ".join(found["text"].split())


def test_two_cars_are_not_compared(site, dense, five):
    job_state, _ = compared(site, dense, five)
    assert job_state["state"] == "failed"
    assert "check the length units" in job_state["failure"]["text"]
    answer = site.post("/api/compare", {"first": dense, "second": "gone"})
    assert answer.status_code == 404


# The archive


@pytest.fixture(scope="module")
def results(site, five):
    tree = file_of(site, five, "measurement.json").json
    return write_results(site.allowed / "results", tree)


def test_an_archive_is_browsed(site, results):
    assert "results" in {i["kind"] for i in site.get("/api/files/0/").json["items"]}
    job_state = site.get("/api/archive/overview/0/results").json
    assert job_state["total"] == 12
    assert [n for status, _, n in job_state["statuses"] if status == "failed"] == [1]
    assert job_state["vehicles"] == ["AA-00", "AA-01", "AA-02"]
    page = site.get("/api/archive/captures/0/results?status=ok&text=car-0").json
    assert page["total"] == 10
    assert [row[0] for row in page["table"]["rows"]][:2] == ["2026/car-00", "2026/car-01"]
    one = site.get(f"/api/archive/capture/0/results?key={page['keys'][3]}").json
    assert one["name"] == "2026/car-03"
    assert one["tables"][0]["rows"][0][0] == "RR"
    assert one["record"] == f"measurements/{page['keys'][3][:2]}/{page['keys'][3]}.json"
    assert [name for _, name in one["before"]] == ["2026-01-01 2026/car-00"]
    asked = f"/api/archive/changes/0/results?key={page['keys'][3]}&before={one['before'][0][0]}"
    assert "toe_deg is -0.29798, but -0.32798 by its poses" in site.get(asked).json["error"]
    record = results / one["record"]
    tree = json.loads(record.read_text())
    tree["wheels"][0]["toe_deg"] -= 0.03
    record.write_text(json.dumps(tree))
    assert site.get(asked).json["table"]["rows"]
    (lost,) = site.get("/api/archive/captures/0/results?status=failed").json["keys"]
    none = site.get(f"/api/archive/capture/0/results?key={lost}").json
    assert (none["record"], none["before"]) == ("", [])
    assert site.get(f"/api/archive/changes/0/results?key={lost}&before=x").status_code == 404
    assert site.get("/api/archive/chart/0/results?quantity=RR+toe").json["unit"] == "\N{PRIME}"
    failed = site.get("/api/archive/failures/0/results").json["table"]["rows"]
    assert failed[0][:3] == ["1", "failed", "read"]
    assert "<b>copy it again</b>" in failed[0][3]  # text, which the page never takes for HTML


def test_cambers_from_unlike_verticals_are_named_and_can_be_chosen(site, five):
    """One vertical needs no notice; two are counted, each."""
    tree = file_of(site, five, "measurement.json").json
    place = write_results(site.allowed / "verticals", tree)
    address = "/api/archive/{}/0/verticals?quantity=RR+camber"
    overview = site.get(address.format("overview")).json["verticals"]
    assert [vertical for vertical, _ in overview] == ["wheels"]
    assert site.get(address.format("captures")).json["notice"] == ""
    for path in sorted(place.glob("measurements/*/*.json"))[:3]:
        changed = json.loads(path.read_text())
        if changed["wheels"]:
            path.write_text(json.dumps(changed | {"vertical_in_use": "floor"}))
    (place / "catalogue.sqlite").unlink(missing_ok=True)
    overview = site.get(address.format("overview")).json["verticals"]
    assert [vertical for vertical, _ in overview] == ["floor", "wheels"]
    for question in ("captures", "trends", "chart"):
        notice = site.get(address.format(question)).json["notice"]
        assert "floor" in notice
        assert "plane of the wheel centres" in notice
        chosen = site.get(f"{address.format(question)}&vertical=wheels").json
        assert chosen["notice"] == ""
    page = site.get(f"{address.format('captures')}&vertical=floor").json
    assert 1 <= page["total"] <= 3
    one = site.get(f"/api/archive/capture/0/verticals?key={page['keys'][0]}").json
    assert ["Camber, caster and SAI from", "floor"] in one["facts"]


def test_a_drift_is_shown(site, results):
    job_state = site.get("/api/archive/trends/0/results").json
    assert job_state["quantities"][0] == "RR toe"
    # 0.01 degrees a month over eleven months, stated for 30 days
    row = job_state["table"]["rows"][0]
    assert seconds_of(row[4]) == pytest.approx(0.12 * 3600 * 30 / 365.25, rel=0.03)
    assert seconds_of(row[4]) < float(row[5].rstrip('"'))
    assert row[-1] == "no"  # since it lies within its U
    assert site.get("/api/archive-plot/0/results?quantity=RR%20toe").data.startswith(b"<svg")
    assert site.get("/api/archive-plot/0/results?quantity=nothing").status_code in (400, 404)
    assert site.get("/api/archive/nothing/0/results").status_code == 404
    assert site.get("/api/archive/overview/0/plain").status_code == 404


def test_captures_in_doubt_are_marked_and_those_left_out_are_counted(site, five):
    """By the filter of the view, in the language of the page, and where numbers leave them out."""
    tree = file_of(site, five, "measurement.json").json
    place, note = site.allowed / "doubts", Doubt(COPIED, trial="1", name="RR")
    doubted = Doubt(FLOOR_ABOVE, height="0.31", names="RR, RL, FR, FL")
    write_results(place, tree)
    for path in place.glob("measurements/*/*.json"):
        changed = json.loads(path.read_text())
        if changed["capture"] == "2026/car-04":
            changed["doubts"] = [{"trial": None, "note": doubted}, {"trial": "1", "note": note}]
            changed["batch"]["reason"] = f"{doubted} {note}"
            path.write_text(json.dumps(changed))
    address = "/api/archive/{}/0/doubts?quantity=RR+toe"
    for language in LANGUAGES:
        words = load_translations(language)
        site.client.set_cookie("wheelplane-language", language, domain="127.0.0.1")
        listed = site.get(address.format("captures")).json
        marked = [row for row in listed["table"]["rows"] if row[3] != words("page.ok")][:-1]
        assert [row[0] for row in marked] == ["2026/car-04"]
        assert marked[0][3] == words("listing.in_doubt", status=words("page.ok"))
        assert listed["table"]["classes"].count("undecided") == 1
        said = " ".join(notes_in((doubted, note), words))
        assert listed["doubts"] == [f"2026/car-04: {said}"]
        one = site.get(f"{address.format('capture')}&key={listed['keys'][4]}").json
        assert [words("page.reason"), said] in one["facts"]
        for question in ("trends", "chart"):
            of_all = site.get(address.format(question)).json["notice"]
            assert of_all == words("listing.doubted", count="1")
            others = site.get(f"{address.format(question)}&vehicle=AA-00").json
            assert others["notice"] == ""
    site.client.delete_cookie("wheelplane-language", domain="127.0.0.1")


def test_the_picture_of_a_drift_shows_the_captures_of_the_filter(site, results):
    """As many bars as the table of the same filter counts values, each vehicle its own."""
    asked = "/{}/0/results?quantity=RR+toe&{}"
    drawn = {}
    for which in ("", "vehicle=AA-00", "vehicle=AA-01", "text=car-0", "status=ok"):
        trends = site.get("/api" + asked.format("archive/trends", which)).json
        row = trends["table"]["rows"][trends["quantities"].index("RR toe")]
        drawn[which] = site.get("/api" + asked.format("archive-plot", which)).text
        assert drawn[which].count(BAR) == int(row[trends["table"]["head"].index("n")])
    assert drawn[""] == drawn["status=ok"]
    assert len(set(drawn.values())) == len(drawn) - 1
    assert site.get("/api" + asked.format("archive-plot", "vehicle=other")).status_code == 404


@pytest.mark.parametrize("question", ["captures", "failures", "trends", "chart"])
def test_a_filter_of_an_unknown_kind_is_refused(site, results, question):
    address = f"/api/archive/{question}/0/results?quantity=RR+toe"
    assert site.get(f"{address}&status=&vertical=").status_code == 200
    for name, known in (("status", "quarantined"), ("vertical", "gravity")):
        answer = site.get(f"{address}&{name}=foo")
        assert answer.status_code == 400
        assert f"{name}: 'foo' is not one of" in answer.json["error"]
        assert known in answer.json["error"]


def test_results_behind_a_link_to_elsewhere_are_refused(site, results, tmp_path):
    write_results(tmp_path / "other", {"wheels": [{"toe_deg": 0.0}]}, 1)
    lure = site.allowed / "lure"
    lure.mkdir()
    (lure / "measurements").symlink_to(tmp_path / "other" / "measurements")
    assert site.get("/api/archive/overview/0/lure").status_code == 403


# Words


def test_every_text_of_the_page_is_there_in_every_language():
    english, *others = (load_translations(language).section("page") for language in LANGUAGES)
    for other in others:
        assert set(other) == set(english)
        for name, text in other.items():
            assert re.findall(r"\{\w+\}", text) == re.findall(r"\{\w+\}", english[name]), name


# Names that are made of parts, or that the program gives to what has a status.
BUILT = ("format_", "kind_", "option_", "region_", "read_as_", "coordinates_",
         "tolerance_", "convention_", "vertical_", "found_front_", "nelson_")  # fmt: skip
STATED = {*STATUSES, RECOGNISED.status, VANISHED.status, "agree", "disagree", "cannot_tell"}


def test_every_text_that_the_page_asks_for_is_there_and_none_besides():
    sources = [*WEB.glob("static/*.js"), *WEB.rglob("*.py"), *WEB.glob("templates/*.html")]
    code = "\n".join(path.read_text() for path in sources)
    asked = set(re.findall(r"""\bt\("(\w+)\"|["']page\.(\w+)["']""", code))
    asked = {one or other for one, other in asked} - set(BUILT) - {"html"}
    known = set(load_translations("en").section("page"))
    assert len(asked) > 50
    assert asked - known == set()
    quoted = set(re.findall(r'"(\w+)"', code))
    assert {name for name in known - asked - quoted - STATED if not name.startswith(BUILT)} == set()


def test_an_unknown_language_is_reported(site):
    assert site.post("/api/language/xx", {}).status_code == 400
    with pytest.raises(InputError):
        load_translations("xx")
