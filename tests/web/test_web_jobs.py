"""Jobs of the page's server: what they do to one another, how many wait, and how they end."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from tests.support.web_site import PAPER, Site
from wheelplane.web.jobs import process
from wheelplane.web.security import RefusedError

# In place of the measuring process: it does plan["do"], or makes a report that says nothing.
STAND_IN = """
import json, os, pathlib, sys, time
plan = json.load(sys.stdin)
out, unpacked = pathlib.Path(plan["out"]), pathlib.Path(os.environ["TMPDIR"], "rr.ply")
unpacked.write_text("a scan")
def say(**job_state): print(json.dumps(job_state), flush=True)
def wait(name):
    while not (out / name).exists(): time.sleep(0.01)
if plan["task"] == "report" and "do" not in plan:
    (out / plan["file"]).write_text("a report")
exec(plan.get("do", "say(done=True)"))
"""
READY = "(out / 'measurement.json').write_text('{}'); say(ready=True); "
HANG = "wait('never')"


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    real = subprocess.Popen
    begin = lambda _, **rest: real([sys.executable, "-c", STAND_IN], **rest)  # noqa: E731
    monkeypatch.setattr(process.subprocess, "Popen", begin)


@pytest.fixture
def site(tmp_path):
    made = Site(tmp_path, workers=1, waiting=2, jobs=2)
    made.copy(PAPER, "figure-4.txt")
    yield made
    made.close()


def jobs_of(site):
    return site.app.config["state"].jobs


def started(site, do, task="measure", state="running", **rest):
    """A job that does this, once it is in that state."""
    job = jobs_of(site).start(task, "car", {"do": do}, **rest)
    until(lambda: job.state == state)
    return job


def ended(site, do, **rest):
    job = jobs_of(site).start("measure", "car", {"do": do}, **rest)
    assert job.finished.wait(60)
    return job


def until(holds):
    for _ in range(6000):
        if holds():
            return
        time.sleep(0.01)
    raise AssertionError("never so")


def test_a_report_leaves_alone_what_its_measurement_has_unpacked(site):
    gone = "say(failure={'text': 'the scan is gone'})"
    job = started(site, f"{READY}wait('go'); {gone} if not unpacked.exists() else say(done=True)",
                state="ready")  # fmt: skip
    assert site.get(f"/api/jobs/{job.id}/report.txt").text == "a report"
    (job.folder / "go").touch()
    job_state = site.ended(job.id)
    assert (job_state["state"], job_state["note"]) == ("done", "")
    assert job.finished.wait(60)
    assert list(site.allowed.parent.rglob("rr.ply")) == []  # none is left behind


@pytest.mark.parametrize(
    ("end", "said"),
    [
        ("say(failure={'text': 'rr.ply: it is gone'})", "rr.ply: it is gone"),
        ("os._exit(3)", "exit code 3"),
        ("os.kill(os.getpid(), 9)", "SIGKILL"),
    ],
)
def test_angles_that_are_ready_outlive_a_failure_of_the_points(site, end, said):
    job = ended(site, READY + end)
    job_state = site.get(f"/api/jobs/{job.id}").json
    assert job_state["state"] == "done"
    assert said in job_state["note"]
    assert job_state["failure"] is None
    assert site.get(f"/api/jobs/{job.id}/measurement.json").status_code == 200
    assert ended(site, end).state == "failed"  # which without angles it stays


def test_angles_that_are_ready_outlive_a_late_cancel(site):
    job = started(site, READY + HANG, state="ready")
    assert site.post(f"/api/jobs/{job.id}/cancel", {}).status_code == 200
    job_state = site.ended(job.id)
    assert (job_state["state"], job_state["note"]) == ("done", "cancelled")
    assert job.process.wait(60) == -signal.SIGKILL


def test_points_of_the_oldest_results_give_way(tmp_path):
    """Points of 100 bytes each, of which the page may keep 250."""
    site = Site(tmp_path, workers=1, tree_bytes=250)
    write = READY + "(out / 'points.bin').write_bytes(bytes(100)); say(done=True)"
    jobs = [ended(site, write) for _ in range(4)]
    until(lambda: jobs[1].note)
    assert [(job.folder / "points.bin").exists() for job in jobs] == [False, False, True, True]
    assert [bool(job.note) for job in jobs] == [True, True, False, False]
    assert all(job.folder.exists() for job in jobs)
    large = ended(site, write.replace("100", "1000"))
    until(lambda: jobs[3].note)
    assert (large.folder / "points.bin").exists()  # that of the latest stays
    site.close()


def test_closing_ends_reports_too(site):
    measured = ended(site, READY + "say(done=True)")
    report = started(site, "time.sleep(30)", "report", uses=(measured,))
    site.close()
    assert report.process.returncode == -signal.SIGKILL
    assert report.state == "cancelled"
    assert report.finished.is_set()


def test_reports_wait_in_a_line_of_their_own_which_is_bounded_too(site):
    measured = ended(site, READY + "say(done=True)")
    for _ in range(2):
        started(site, HANG, "report", uses=(measured,))
    started(site, HANG)
    for task, uses in (("report", (measured,)), ("measure", ())):
        for _ in range(2):
            started(site, HANG, task, "waiting", uses=uses)
        with pytest.raises(RefusedError, match="2 jobs are waiting"):
            jobs_of(site).start(task, "car", {}, uses=uses)


def test_what_a_job_reads_is_kept_until_it_ends(site):
    first, second = (ended(site, READY + "say(done=True)") for _ in range(2))
    comparing = started(site, "wait('go'); say(done=True)", "compare", uses=(first, second))
    for _ in range(3):
        ended(site, READY + "say(done=True)")
    assert first.folder.is_dir()
    assert second.folder.is_dir()
    (comparing.folder / "go").touch()
    assert comparing.finished.wait(60)
    ended(site, READY + "say(done=True)")
    until(lambda: len(list((site.allowed.parent / "scratch").glob("job-*"))) == 2)
    assert not first.folder.exists()
    with pytest.raises(RefusedError, match="no longer kept"):
        jobs_of(site).start("report", "late", {}, uses=(first,))


def test_reports_push_no_measurement_out(site):
    kept = [ended(site, READY + "say(done=True)") for _ in range(2)]
    for language in ("en", "pt"):
        for axis in ("rear-axle", "thrust-line"):
            address = f"/api/jobs/{kept[0].id}/report.txt?language={language}&axis={axis}"
            assert site.get(address).status_code == 200
    assert jobs_of(site).measured() == kept[::-1]
    assert all(job.folder.is_dir() for job in kept)


def test_a_report_that_takes_too_long_is_stopped(site, monkeypatch):
    monkeypatch.setattr("wheelplane.web.jobs.saving.REPORT_SECONDS", 0.1)
    measured = ended(site, READY + "say(done=True)")
    made, start = [], jobs_of(site).start

    def start_slow(task, name, given, **rest):
        made.append(start(task, name, given | {"do": HANG}, **rest))
        return made[-1]

    monkeypatch.setattr(jobs_of(site), "start", start_slow)
    answer = site.get(f"/api/jobs/{measured.id}/report.txt")
    assert answer.status_code == 500
    assert "in time" in answer.json["error"]
    assert made[0].finished.wait(60)
    assert made[0].state == "cancelled"


def test_an_upload_that_is_refused_for_now_is_kept(site):
    upload = site.send(figure__txt=PAPER.read_bytes())
    hung = [started(site, HANG), *(started(site, HANG, state="waiting") for _ in range(2))]
    for _ in range(2):
        assert site.post("/api/measure", {"upload": upload}).status_code == 503
    for job in hung:
        jobs_of(site).cancel(job)
    job = site.post("/api/measure", {"upload": upload})
    assert job.status_code == 200
    assert site.ended(job.json["id"])["state"] == "done"
    assert site.post("/api/measure", {"upload": upload}).status_code == 404  # it is taken


FAIL = "say(failure={'text': 'two planes have the outline'})"


def uploaded(site, tmp_path, name, do=FAIL):
    """A measurement of an upload that ended, and the upload's folder."""
    folder = tmp_path / name
    folder.mkdir()
    job = jobs_of(site).start("measure", name, {"do": do, "owned": str(folder)})
    assert job.finished.wait(60)
    return job, folder


def test_a_failed_upload_is_measured_again_without_being_sent_again(site, tmp_path):
    job, folder = uploaded(site, tmp_path, "car")
    assert job.state == "failed"
    assert folder.is_dir()
    looked = jobs_of(site).explain(job, "en")
    assert looked.finished.wait(60)
    assert folder.is_dir()
    assert looked.plan["language"] == "en"
    again = jobs_of(site).again(job, {"hints": {"FL": (1.0, 2.0, 3.0)}})
    assert again.finished.wait(60)
    assert again.plan["options"] == {"hints": {"FL": (1.0, 2.0, 3.0)}}
    assert folder.is_dir()  # it failed as well
    with pytest.raises(RefusedError, match="no longer kept"):
        jobs_of(site).again(job, {})
    again.plan["do"] = "say(done=True)"
    last = jobs_of(site).again(again, {})
    assert last.finished.wait(60)
    assert last.state == "done"
    assert not folder.exists()
    with pytest.raises(RefusedError, match="no longer kept"):
        jobs_of(site).explain(last, "en")


def test_an_upload_that_was_measured_is_removed(site, tmp_path):
    job, folder = uploaded(site, tmp_path, "car", "say(done=True)")
    assert job.state == "done"
    assert not folder.exists()


def test_of_many_failed_uploads_the_latest_are_kept(tmp_path):
    made = Site(tmp_path, workers=1, waiting=2, jobs=50)
    folders = [uploaded(made, tmp_path, f"car {number}")[1] for number in range(5)]
    jobs_of(made).start("measure", "last", {"do": "say(done=True)"})
    assert [folder.is_dir() for folder in folders] == [False, False, False, True, True]
    made.close()


def test_only_a_measurement_is_explained(site):
    job = jobs_of(site).start("report", "car", {}, (ended(site, "say(done=True)"),))
    assert job.finished.wait(60)
    answer = site.post(f"/api/jobs/{job.id}/explain", {})
    assert answer.status_code == 409


@pytest.mark.parametrize(
    "hints", ["FL", {"FL": "1,2"}, {"FL": "1,2,nan"}, {str(n): "1,2,3" for n in range(201)}]
)
def test_hints_that_are_no_points_are_refused(site, hints):
    job = ended(site, FAIL)
    answer = site.post(f"/api/jobs/{job.id}/again", {"options": {"hints": hints}})
    assert answer.status_code == 400


def test_a_measurement_does_not_wait_for_the_points_of_another(site):
    """With one worker: one sorts its points, the next is measured meanwhile, a third one waits."""
    first = started(site, f"{READY}wait('go'); say(done=True)", state="ready")
    second = started(site, f"{READY}wait('go'); say(done=True)", state="ready")
    third = started(site, "say(done=True)", state="waiting")
    for job in (first, second):
        assert job.state == "ready"
        (job.folder / "go").touch()
    for job in (first, second, third):
        assert job.finished.wait(60)
        assert job.state == "done"


def test_a_kept_result_is_removed_with_its_files_and_nothing_else(tmp_path):
    results = tmp_path / "results"
    results.mkdir()
    site = Site(tmp_path, workers=1, results=results)
    done = f"{READY}say(done=True)"
    one, other = ended(site, done), ended(site, done)
    at_work = started(site, f"{READY}wait('go'); say(done=True)", state="ready")
    refused = site.post(f"/api/jobs/{at_work.id}/remove", {})
    assert (refused.status_code, refused.json["error"].count("still at work")) == (409, 1)
    assert site.post(f"/api/jobs/{one.id}/remove", {}).json == {"removed": one.id}
    (at_work.folder / "go").touch()
    assert at_work.finished.wait(60)
    assert {path.name for path in results.iterdir()} == {other.id, at_work.id}
    assert site.post(f"/api/jobs/{one.id}/remove", {}).status_code == 404
    assert one.id not in [job["id"] for job in site.get("/api/jobs").json["jobs"]]
    site.close()


def test_a_result_of_this_session_is_not_removed(site):
    job = ended(site, f"{READY}say(done=True)")
    assert site.post(f"/api/jobs/{job.id}/remove", {}).status_code == 409
    assert (job.folder / "measurement.json").is_file()
