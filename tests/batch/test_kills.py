"""Runners, worker processes and fork servers that are killed lose nothing and spoil nothing."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import Future
from pathlib import Path

import pytest

from tests.support.batches import (
    ROOT,
    descendants,
    kill,
    left,
    run,
    run_process,
    settle,
    start,
    trees,
    zip_of_discs,
)
from wheelplane.batch.plan.discover import FoundCapture
from wheelplane.batch.plan.settings import BatchSettings
from wheelplane.batch.run import work as work_module
from wheelplane.batch.run.measure_one import TransientError
from wheelplane.batch.run.progress import ProgressLines
from wheelplane.batch.run.run import Batch
from wheelplane.batch.run.work import VANISHED, CompletedCapture, RunRequest, Task, work
from wheelplane.batch.storage import scratch
from wheelplane.batch.storage.entry import Entry
from wheelplane.batch.storage.scratch import GONE, LOCK, PREFIX, scratch_folder
from wheelplane.batch.storage.store import open_store
from wheelplane.system import acquire

pytestmark = pytest.mark.slow

OPTIONS = ("--workers", "2")


def archive_of_zips(folder: Path, count: int, spacing_m: float = 0.006) -> Path:
    for k in range(count):
        zip_of_discs(folder / f"car-{k:03d}.zip", k, spacing_m)
    settle(folder)
    return folder


def wait_for(condition) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


# Folders of temporary files


def test_scratch_of_the_killed_is_cleared_and_that_of_the_living_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / f"{PREFIX}killed" / "capture").mkdir(parents=True)
    (tmp_path / f"{PREFIX}killed{LOCK}").touch()
    (tmp_path / f"{GONE}half" / "capture").mkdir(parents=True)  # killed while it removed it
    (tmp_path / f"{PREFIX}half{LOCK}").touch()
    (tmp_path / f"{PREFIX}early{LOCK}").touch()  # killed before it made its folder
    with scratch_folder() as one, scratch_folder() as other:
        assert one.is_dir()
        assert other.is_dir()
        assert len(list(tmp_path.iterdir())) == 4
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no owner here")
def test_scratch_of_another_user_is_left(tmp_path, monkeypatch):
    """Even by who may open its lock, and that is held by nobody."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / f"{PREFIX}other").mkdir()
    (tmp_path / f"{PREFIX}other{LOCK}").touch()
    monkeypatch.setattr(os, "geteuid", lambda: (tmp_path.stat().st_uid) + 1)
    with scratch_folder():
        assert (tmp_path / f"{PREFIX}other").is_dir()
    monkeypatch.undo()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with scratch_folder():
        assert not (tmp_path / f"{PREFIX}other").exists()


def test_a_folder_is_never_seen_without_its_lock(tmp_path, monkeypatch):
    """Whenever another run looks, it leaves the folder: also before and after it is used."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    seen = []

    def look(event: str, _arguments: tuple[object, ...]) -> None:
        if not active or not event.startswith(("os.", "shutil.", "open", "tempfile.")):
            return
        active.clear()  # a look of the look's own
        for folder in tmp_path.glob(f"{PREFIX}*[!k]"):
            handle = os.open(f"{folder}{LOCK}", os.O_RDWR)
            seen.append(acquire(handle, wait=False))
            os.close(handle)
        active.append(True)

    active: list[bool] = []
    sys.addaudithook(look)
    active.append(True)
    with scratch_folder() as folder:
        (folder / "a").write_bytes(b"")
    active.clear()
    assert len(seen) >= 2  # while it is used, and before it is removed
    assert not any(seen)


def test_a_lock_that_another_run_cleared_before_it_was_held_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    late = []

    def acquire_late(handle: int, wait: bool = True) -> bool:
        if not late:
            (lock,) = tmp_path.glob(f"*{LOCK}")
            late.append(lock)
            scratch._clear(lock)
        return acquire(handle, wait)

    monkeypatch.setattr(scratch, "acquire", acquire_late)
    with scratch_folder() as folder:
        assert not late[0].exists()
        assert Path(f"{folder}{LOCK}").exists()


MANY = """
import sys, tempfile
from wheelplane.batch.storage.scratch import scratch_folder
tempfile.tempdir = sys.argv[1]
for _ in range(100):
    with scratch_folder() as folder:
        (folder / "a").write_bytes(b"1")
        assert (folder / "a").read_bytes() == b"1"
"""


def test_runs_that_start_and_stop_at_once_lose_no_folder(tmp_path):
    command = [sys.executable, "-c", MANY, str(tmp_path)]
    both = [subprocess.Popen(command, cwd=ROOT) for _ in range(8)]
    assert [process.wait() for process in both] == [0] * 8
    assert list(tmp_path.iterdir()) == []


# What vanished while it was measured


def task_of(archive: Path, results: Path, name: str) -> Task:
    (entry,) = (e for e in open_store(str(archive)).list() if e.name == name)
    request = RunRequest(str(archive), str(results), BatchSettings())
    return Task(request, (FoundCapture(name, "zip", (entry,)),))


def test_a_capture_that_is_gone_when_its_turn_comes_has_no_row(tmp_path):
    archive = archive_of_zips(tmp_path / "archive", 1, 0.02)
    task = task_of(archive, tmp_path / "results", "car-000.zip")
    (archive / "car-000.zip").unlink()
    (done,) = work(task)
    assert done.outcome == VANISHED
    assert list(tmp_path.rglob("*.json")) == []


def test_an_object_that_is_gone_when_its_turn_comes_has_no_row(remote, tmp_path):
    request = RunRequest("s3://cars/archive", str(tmp_path / "results"), BatchSettings())
    (done,) = work(Task(request, (FoundCapture("a.zip", "zip", (Entry("a.zip", 1, "1"),)),)))
    assert done.outcome == VANISHED
    assert list(tmp_path.rglob("*.json")) == []


def test_a_run_whose_captures_are_removed_goes_on(tmp_path):
    archive, results = archive_of_zips(tmp_path / "archive", 3), tmp_path / "results"

    class Removing(ProgressLines):
        def planned(self, known: int, todo: int, expected_s: float, later: int = 0) -> None:
            super().planned(known, todo, expected_s, later)
            for name in ("car-000.zip", "car-002.zip"):
                (archive / name).unlink()

    class Here:
        slots = 1

        def submit(self, task: Task) -> Future[list[CompletedCapture]]:
            done: Future[list[CompletedCapture]] = Future()
            done.set_result(work(task))
            return done

        def close(self) -> None:
            """Nothing to end."""

    request = RunRequest(str(archive), str(results), BatchSettings())
    with scratch_folder() as scratch_of_run:
        counts = Batch(request, Here(), scratch_of_run, Removing()).run()
    assert counts.done == {"vanished": 2, "ok": 1}
    assert set(trees(results)) == {"car-001.zip"}
    again = run(archive, results, *OPTIONS)
    assert (again.returncode, "1 done before, 0 to do" in again.stderr) == (0, True)


def test_a_result_without_its_temporary_folder_is_never_written(tmp_path, monkeypatch):
    archive = archive_of_zips(tmp_path / "archive", 1, 0.02)
    task = task_of(archive, tmp_path / "results", "car-000.zip")
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    real = work_module.measure_bytes

    def cleared(subject):
        shutil.rmtree(folder)
        return real(subject)

    monkeypatch.setattr(work_module, "measure_bytes", cleared)
    with pytest.raises(TransientError, match="the folder of temporary files was removed"):
        work(task)
    assert list(tmp_path.rglob("*.json")) == []


# Kills


def fork_server(runner: int) -> list[int]:
    """The fork server of a runner, and the worker processes that it started."""
    of_all = [pid for pid in descendants(runner) if b"forkserver" in command_of(pid)]
    workers = {child for pid in of_all for child in descendants(pid)}
    return [pid for pid in of_all if pid not in workers][:1] + sorted(workers & {*of_all})


def command_of(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def is_there(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_worker_processes_end_with_their_runner_even_if_the_fork_server_does_not(tmp_path):
    """It may learn late of the runner's end, and meanwhile the next run clears their folder."""
    archive = archive_of_zips(tmp_path / "archive", 3, 0.0015)
    results = tmp_path / "results"
    temporary = tmp_path / "t"
    temporary.mkdir()
    process = start(archive, tmp_path / "results", *OPTIONS, TMPDIR=str(temporary))
    found: list[int] = []

    def at_work() -> bool:
        found[:] = fork_server(process.pid)
        return len(found) == 3 and any(temporary.rglob("capture/*.xyz"))

    def recorded() -> list[Path]:
        return [*results.glob("measurements/*/*.json")]

    wait_for(at_work)
    server, *workers = found
    os.kill(server, signal.SIGSTOP)
    try:
        kill(process.pid)
        process.wait()
        before = recorded()
        wait_for(lambda: not any(map(is_there, workers)))
        assert recorded() == before
        done = run_process(archive, tmp_path / "results", *OPTIONS, TMPDIR=str(temporary))
    finally:
        kill(server)
        process.communicate(timeout=60)  # whose pipes the fork server holds
    assert done.returncode == 0, done.stdout
    assert {tree["batch"]["status"] for tree in trees(tmp_path / "results").values()} == {"ok"}
    assert [path.name for path in temporary.iterdir() if path.name.startswith(PREFIX)] == []


def test_the_end_of_a_fork_server_is_not_held_against_a_capture(tmp_path):
    archive = archive_of_zips(tmp_path / "archive", 1)
    process = start(archive, tmp_path / "results", "--workers", "1")
    servers: set[int] = set()

    def works_again() -> bool:
        return len(found := fork_server(process.pid)) == 2 and found[0] not in servers

    for _ in range(3):
        wait_for(works_again)
        server = fork_server(process.pid)[0]
        servers.add(server)
        kill(server)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, out + err


def undisturbed(place: Path, count: int) -> tuple[Path, dict[str, bytes]]:
    archive = archive_of_zips(place / "archive", count, 0.01)
    done = run(archive, place / "undisturbed", *OPTIONS)
    assert done.returncode == 0, done.stdout
    return archive, left(place / "undisturbed")


def disturbed(archive: Path, results: Path, kills: int, every_s: float, rng) -> dict[str, int]:
    """Run a batch to its end while this many of its processes are killed; return who was."""
    killed = dict.fromkeys(("runner", "worker", "server", "all"), 0)
    while sum(killed.values()) < kills:
        process = start(archive, results, *OPTIONS)
        while process.poll() is None and sum(killed.values()) < kills:
            time.sleep(rng.uniform(0.2, 2.0) * every_s)
            server, *workers = fork_server(process.pid) or [0]
            who = rng.choice(list(killed))
            victims = {
                "runner": [process.pid],
                "worker": workers[:1],
                "server": [server],
                "all": rng.sample([process.pid, server, *workers], 2 + len(workers)),
            }[who]
            if workers and process.poll() is None:
                for victim in victims:
                    kill(victim)
                killed[who] += 1
        if process.poll() is None and sum(killed.values()) >= kills:
            process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)
        assert "Traceback" not in err
        assert "quarantined" not in err
        if not trees_left(archive, results):
            break
    assert run_process(archive, results, *OPTIONS).returncode == 0
    return killed


def trees_left(archive: Path, results: Path) -> int:
    """Number of captures without a result."""
    return len(list(archive.iterdir())) - len(list(results.glob("measurements/*/*.json")))


def test_kills_of_a_run_leave_the_catalogue_of_an_undisturbed_one(tmp_path):
    archive, expected = undisturbed(tmp_path, 16)
    killed = disturbed(archive, tmp_path / "results", 4, 0.5, random.Random(1))
    assert sum(killed.values()) > 0
    assert left(tmp_path / "results") == expected


@pytest.mark.parametrize("seed", [1])
def test_forty_kills_in_two_hundred_captures(tmp_path, seed):
    archive, expected = undisturbed(tmp_path, 200)
    rng = random.Random(seed)
    print(disturbed(archive, tmp_path / "results", 40, 1.0, rng))
    assert left(tmp_path / "results") == expected
