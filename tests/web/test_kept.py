"""Results that outlive the program, and stored measurements that are opened."""

from __future__ import annotations

import hashlib
import json
import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.made import write_small_capture
from tests.support.reported import measured
from tests.support.web_site import PAPER, Site
from wheelplane.commands.view import opened
from wheelplane.errors import InputError, Wording
from wheelplane.web.files.stored import load, load_records, store

NOT_KEPT = "this result is no longer kept: measure again"

SHOWN = ("measurement.json", "panel-en.json", "scene-pt.json", "points.json", "points.bin")


def started(place: Path) -> Site:
    results = place / "results"
    results.mkdir(exist_ok=True)
    return Site(place, results=results)


def test_a_result_survives_a_restart_with_points_reports_date_and_vehicle(tmp_path):
    site = started(tmp_path)
    folder = site.allowed / "capture"
    write_small_capture(folder)
    declared = (folder / "capture.toml").read_text().splitlines()
    rest = [line for line in declared if not line.startswith(("vehicle =", "date ="))]
    stated = ['vehicle = "AA-00-BB"', "date = 2026-03-01", *rest]
    (folder / "capture.toml").write_text("\n".join(stated))
    before = site.measure({"root": 0, "path": "capture"})
    assert (before["state"], before["vehicle"], before["date"]) == (
        "done",
        "AA-00-BB",
        "2026-03-01",
    )
    address = f"/api/jobs/{before['id']}"
    files = {name: site.get(f"{address}/{name}").data for name in SHOWN}
    report = site.get(f"{address}/report.html").data
    site.close()
    shutil.rmtree(tmp_path / "scratch")

    again = started(tmp_path)
    (after,) = again.get("/api/jobs").json["jobs"]
    assert after | {"progress": None} == before | {"progress": None}
    assert {name: again.get(f"{address}/{name}").data for name in SHOWN} == files
    assert not list((tmp_path / "results").glob("*/report-*"))  # of the settings of that time
    assert again.get(f"{address}/report.html").data == report
    again.close()


def test_results_that_were_removed_by_hand_are_said_to_be_so(tmp_path):
    site = started(tmp_path)
    site.copy(PAPER, "car.txt")
    job = site.measure({"root": 0, "path": "car.txt"})["id"]
    site.app.config["state"].jobs.found(job).finished.wait(60.0)  # its files are written
    shutil.rmtree(tmp_path / "results" / job)
    gone = site.get(f"/api/jobs/{job}/report.html")
    assert (gone.status_code, gone.json["error"]) == (404, NOT_KEPT)
    assert not (tmp_path / "results" / job).exists()
    shutil.rmtree(tmp_path / "results")
    refused = site.post("/api/measure", {"root": 0, "path": "car.txt"})
    assert refused.status_code == 507
    assert f"{tmp_path}/results: no result can be stored (No such file" in refused.json["error"]
    (tmp_path / "results").mkdir()
    assert site.measure({"root": 0, "path": "car.txt"})["state"] == "done"
    site.close()


def test_only_results_are_kept(tmp_path):
    site = started(tmp_path)
    (site.allowed / "bad.txt").write_text("1 2 3\n4 5\n")
    assert site.measure({"root": 0, "path": "bad.txt"})["state"] == "failed"
    site.close()
    assert list((tmp_path / "results").iterdir()) == []
    (tmp_path / "results" / "mine").mkdir()
    (tmp_path / "results" / "mine" / "result.json").write_text("{}")
    again = started(tmp_path)
    assert again.get("/api/jobs").json["jobs"] == []
    again.close()
    assert (tmp_path / "results" / "mine" / "result.json").is_file()


def test_many_results_are_all_kept(tmp_path):
    results = tmp_path / "results"
    results.mkdir()
    site = Site(tmp_path, results=results, jobs=2)
    for name in ("a.txt", "b.txt", "c.txt"):
        site.copy(PAPER, name)
        site.measure({"root": 0, "path": name})
    assert len(site.get("/api/jobs").json["jobs"]) == 3
    site.close()
    assert len(list(results.glob("*/result.json"))) == 3


def vehicles(site, tmp_path):
    """Ids of the same five points measured twice as one vehicle, and once as another; opened."""
    site.copy(PAPER, "figure-4.txt")
    measured = site.measure({"root": 0, "path": "figure-4.txt"})
    tree = site.get(f"/api/jobs/{measured['id']}/measurement.json").json
    found = []
    for name, vehicle in (("before.json", "AA-01"), ("now.json", "AA-01"), ("other.json", "BB-02")):
        changed = tree | {"capture": name, "vehicle_name": vehicle, "added_by_hand": 1}
        (site.allowed / name).write_text(json.dumps(changed))
        found.append(site.measure({"root": 0, "path": name})["id"])
    return found


@pytest.mark.slow
def test_the_number_of_a_report_is_that_of_the_measurement_that_is_downloaded(tmp_path):
    """In every view, of a new and of an opened measurement, alone and with an earlier one."""
    site = Site(tmp_path)
    before, now, _ = vehicles(site, tmp_path)
    first = site.get("/api/jobs").json["jobs"][0]["id"]
    numbers = set()
    for job, view in (
        (first, ""),
        (now, ""),
        (now, "?axis=thrust-line"),
        (now, f"?before={before}"),
    ):
        record = site.get(f"/api/jobs/{job}/report.json{view}").data
        page = site.get(f"/api/jobs/{job}/report.html{view}").text
        numbers.add(hashlib.sha256(record).hexdigest()[:12])
        assert hashlib.sha256(record).hexdigest()[:12] in page
    assert len(numbers) == 4
    site.close()


def test_an_earlier_measurement_is_named_as_on_the_page_and_refused_of_another_vehicle(tmp_path):
    site = Site(tmp_path)
    before, now, other = vehicles(site, tmp_path)
    for address in ("changes", "report.html", "report.txt", "report.json"):
        assert site.get(f"/api/jobs/{now}/{address}?before={before}").status_code == 200
        answer = site.get(f"/api/jobs/{now}/{address}?before={other}")
        assert answer.status_code == 400
        assert answer.json["error"].startswith("other.json: is of the vehicle 'BB-02', ")
        assert str(tmp_path) not in answer.json["error"]
    shown = site.get(f"/api/jobs/{now}/report.json?before={before}").text
    assert json.loads(shown)["before"]["file"] == "before.json"
    assert str(tmp_path) not in shown
    site.close()


@pytest.mark.parametrize("path", ["m.json", "stored"])
def test_a_stored_measurement_is_opened_with_its_tables_and_reports(tmp_path, path):
    site = Site(tmp_path)
    site.copy(PAPER, "figure-4.txt")
    measured = site.measure({"root": 0, "path": "figure-4.txt"})
    data = site.get(f"/api/jobs/{measured['id']}/measurement.json").data
    (site.allowed / "m.json").write_bytes(data)
    (site.allowed / "stored").mkdir()
    (site.allowed / "stored" / "measurement.json").write_bytes(data)
    kinds = {item["name"]: item["kind"] for item in site.get("/api/files/0/").json["items"]}
    assert (kinds["m.json"], kinds["stored"]) == ("measurement", "measurement")
    opened = site.measure({"root": 0, "path": path})
    assert (opened["state"], opened["at"]) == ("done", f"0/{path}"), opened
    panels = [
        site.get(f"/api/jobs/{job['id']}/panel-en.json").json["tables"]
        for job in (measured, opened)
    ]
    assert panels[0] == panels[1]
    asked = f"/api/jobs/{opened['id']}/report"
    assert site.get(f"{asked}.json").data == data
    turned = site.get(f"{asked}.json?axis=thrust-line").json
    assert turned | {"axis_in_use": "rear-axle"} == json.loads(data)
    assert b"RR" in site.get(f"{asked}.html").data
    assert site.get(f"{asked}.txt").data.startswith(b"wheelplane ")
    both = {"first": opened["id"], "second": measured["id"]}
    compared = site.ended(site.post("/api/compare", both).json["id"])
    assert compared["state"] == "done"
    asked = f"/api/jobs/{compared['id']}/report"
    assert b"<svg" in site.get(f"{asked}.html?language=pt").data
    assert site.get(f"{asked}.pdf").data.startswith(b"%PDF")
    assert site.get(f"{asked}.json").json["schema"] == "wheelplane/validation/1"
    assert b"RR" in site.get(f"{asked}.txt").data
    assert site.get(f"{asked}.xlsx").status_code == 400
    site.close()


def test_an_uploaded_measurement_is_opened(tmp_path):
    site = Site(tmp_path)
    site.copy(PAPER, "figure-4.txt")
    measured = site.measure({"root": 0, "path": "figure-4.txt"})
    data = site.get(f"/api/jobs/{measured['id']}/measurement.json").data
    opened = site.measure({"upload": site.send(mine__json=data)})
    assert (opened["state"], opened["task"], opened["at"]) == ("done", "open", "")
    site.close()


def test_a_damaged_measurement_is_refused_in_one_line(tmp_path):
    site = Site(tmp_path)
    (site.allowed / "m.json").write_text('{"schema": "wheelplane/measurement/1"}')
    failed = site.measure({"root": 0, "path": "m.json"})
    assert failed["failure"]["text"].startswith("m.json: ")
    outside = tmp_path / "outside.json"
    outside.write_text("{}")
    (site.allowed / "folder").mkdir()
    (site.allowed / "folder" / "measurement.json").symlink_to(outside)
    failed = site.measure({"root": 0, "path": "folder"})
    assert "outside the allowed folder" in failed["failure"]["text"]
    site.close()


class Evil:
    def __reduce__(self):
        return (Path.write_text, (Path("owned.txt"), "owned"))


@pytest.mark.parametrize("made", [Evil(), {"a": Evil()}, print, Path("x")])
def test_a_stored_file_from_elsewhere_runs_nothing(tmp_path, made, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "measurement.pickle").write_bytes(pickle.dumps(made))
    with pytest.raises(InputError, match="not stored by this version"):
        load_records(tmp_path / "measurement.pickle")
    assert not (tmp_path / "owned.txt").exists()


def test_what_another_version_stored_is_read_from_its_json(tmp_path):
    site = started(tmp_path)
    site.copy(PAPER, "figure-4.txt")
    site.measure({"root": 0, "path": "figure-4.txt"})
    site.close()
    (folder,) = (tmp_path / "results").iterdir()
    found, _ = load(folder)
    (folder / "measurement.pickle").write_bytes(b"\x80\x05K\x01.")
    again, _ = load(folder)
    assert again.vehicle == pytest.approx(found.vehicle)
    vars(found).pop("verticals")  # a field that is new
    (folder / "measurement.pickle").write_bytes(pickle.dumps((found, None)))
    assert load(folder)[0].verticals == ()


def test_the_command_opens_a_stored_measurement_file_or_folder(tmp_path):
    file = tmp_path / "measurement.json"
    file.write_text('{"schema": "wheelplane/measurement/1"}')
    assert opened(file, ()) == ((tmp_path,), "open=0/measurement.json")
    assert opened(tmp_path, ()) == ((tmp_path,), "open=0/")


def test_a_measurement_with_notes_comes_back_whole(tmp_path):
    """Require the pickle: there is no measurement.json, which lacks the points, to fall back on."""
    note = Wording("{name}: {choice}.", name="RR", choice=Wording("box {low}", low="1"))
    found = replace(measured(), notes=(note,)), None
    store(found, tmp_path / "measurement.pickle")
    again, _ = load(tmp_path)
    assert (again.notes[0], again.notes[0].template) == (note, note.template)
    assert again.notes[0].parts["choice"].parts == {"low": "1"}
