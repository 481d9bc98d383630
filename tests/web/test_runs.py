"""The state of runs on the page, and why a capture failed."""

from __future__ import annotations

import time

from tests.support.batches import archive_of, call, run, settle
from tests.support.web_site import Site
from wheelplane.batch.operation.run_state import AtWork, RunState, write_state
from wheelplane.batch.storage.store import open_store


def test_runs_at_work_are_shown_with_their_failures_and_these_with_their_account(tmp_path):
    """The same facts as `batch --status`, in the language of the page, while a run works."""
    site = Site(tmp_path)
    results = site.allowed / "results"
    store, now_s = open_store(str(results)), time.time()
    hidden = AtWork(("a/\x1b[2J.zip", "b", "c"), now_s - 30.0, "worker 2")
    works = RunState("node1, process 7", "2/4", now_s - 100.0, now_s, 5, 1000, at_work=(hidden,))
    works.done, works.failures = {"ok": 180, "failed": 20}, {"failed, read: no number": 20}
    works.expected_s, works.worked_s = 5.0, 1.0
    write_state(store, "b", works)
    write_state(store, "a", RunState("node2", "1/1", now_s - 900.0, now_s - 600.0, 0, 10))
    write_state(
        store, "c", RunState("node3", "1/1", now_s - 90, now_s - 60, 0, 9, ended="finished")
    )
    assert {i["kind"] for i in site.get("/api/files/0/").json["items"]} == {"results"}
    assert site.get("/api/archive/overview/0/results").json["total"] == 0  # none is done yet
    lost, up, ended = site.get("/api/archive/runs/0/results").json["runs"]
    assert [one["name"] for one in (lost, up, ended)] == [
        "node2", "node1, process 7, shard 2/4", "node3",
    ]  # fmt: skip
    assert [one["up"] for one in (lost, up, ended)] == [False, True, False]
    assert dict(up["facts"]) == {
        "Status": "running",
        "Began": "2 min ago",
        "Done before": "5",
        "Done now": "20 failed, 180 measured",
        "To do": "800",
        "Captures a second": "2",
        "Time left": "7 min",
    }
    assert up["work"]["rows"] == [[r"a/\x1b[2J.zip and 2 small ones", "30 s", "worker 2"]]
    assert (up["failures"]["rows"], up["statuses"]) == (
        [["20", "failed, read: no number"]],
        ["failed"],
    )
    assert dict(lost["facts"])["Status"].startswith("no sign for 10 min")
    assert dict(ended["facts"])["Status"] == "finished, 60 s ago"
    assert (lost["work"], lost["failures"]) == (None, None)
    site.client.set_cookie("wheelplane-language", "pt", domain="127.0.0.1")
    _, up, _ = site.get("/api/archive/runs/0/results").json["runs"]
    assert dict(up["facts"])["Estado"] == "em curso"
    assert dict(up["facts"])["Início"] == "há 2 min"
    (results / "run").rename(tmp_path / "elsewhere")
    (results / "run").symlink_to(tmp_path / "elsewhere")
    assert site.get("/api/archive/runs/0/results").status_code == 403


def test_a_failed_capture_has_its_account_and_no_file_from_elsewhere(tmp_path):
    site = Site(tmp_path)
    archive = archive_of(tmp_path / "archive", 1)
    (archive / "bad.txt").write_text("1 2 3\n4 5\n")
    settle(archive)
    assert run(archive, site.allowed / "results", "--workers", "1").returncode == 1

    def account(status: str) -> str:
        (key,) = site.get(f"/api/archive/captures/0/results?status={status}").json["keys"]
        return site.get(f"/api/archive/capture/0/results?key={key}").json["why"]

    printed = call("batch", "-o", site.allowed / "results", "--why", "bad.txt").stdout
    assert account("failed").strip() == printed.strip()
    assert account("ok") == ""
    (log,) = (site.allowed / "results" / "logs").iterdir()
    log.rename(tmp_path / "outside")
    log.symlink_to(tmp_path / "outside")
    assert account("failed") == ""


def test_a_damaged_result_is_listed_by_its_key_and_says_why(tmp_path):
    site = Site(tmp_path)
    archive = archive_of(tmp_path / "archive", 2)
    assert run(archive, site.allowed / "results", "--workers", "1").returncode == 0
    path = next((site.allowed / "results").glob("measurements/*/*.json"))
    path.unlink()
    path.write_text('{"schema": ')
    rows = site.get("/api/archive/captures/0/results?status=damaged").json["table"]["rows"]
    assert [row[0] for row in rows] == [path.stem]
    (row,) = site.get("/api/archive/failures/0/results").json["table"]["rows"]
    assert row[-1] == path.stem
    shown = site.get(f"/api/archive/capture/0/results?key={path.stem}").json
    assert (shown["name"], shown["tables"], shown["record"]) == (path.stem, [], "")
    printed = call("batch", "-o", site.allowed / "results", "--why", path.stem).stdout
    assert shown["why"].strip() == printed.strip()
    assert printed.startswith(f"{path.stem}: damaged\n")
