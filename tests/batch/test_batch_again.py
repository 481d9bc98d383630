"""The same batch once more: failures retried, changes, shards, what left the archive, odd names."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Future

import pytest

from tests.support.batches import (
    ROOT,
    archive_of,
    call,
    five_points,
    kill,
    poisoned,
    run,
    run_process,
    settle,
    start,
    trees,
)
from wheelplane.batch.plan.discover import FoundCapture
from wheelplane.batch.plan.settings import BatchSettings
from wheelplane.batch.plan.shard import Shard
from wheelplane.batch.run import run as run_module
from wheelplane.batch.run.progress import ProgressLines
from wheelplane.batch.run.result_index import ResultIndex
from wheelplane.batch.run.run import Batch
from wheelplane.batch.run.work import RunRequest, work
from wheelplane.batch.storage.entry import MOST_LEVELS, Entry
from wheelplane.batch.storage.store import open_store
from wheelplane.errors import InputError

BAD = ("a/crash.txt", "b/crash.txt", "c/crash.txt", "d/crash.txt")


def statuses(results) -> dict[str, str]:
    return {name: tree["batch"]["status"] for name, tree in trees(results).items()}


def ask(results, *options: str) -> subprocess.CompletedProcess[str]:
    """Run `wheelplane results`."""
    return call("results", results, *options)


@pytest.fixture
def put_aside(tmp_path):
    """An archive, and its results with four quarantined captures, in both of two shards."""
    archive = archive_of(tmp_path / "archive", 2)
    for seed, name in enumerate(BAD):
        five_points(archive / name, seed)
    settle(archive)
    assert {Shard(1, 2).holds(name) for name in BAD} == {True, False}
    assert run_process(archive, tmp_path / "results", **poisoned(tmp_path)).returncode == 1
    found = statuses(tmp_path / "results")
    assert {name for name, status in found.items() if status == "quarantined"} == set(BAD)
    assert len(found) == 6
    return archive, tmp_path / "results"


def test_retrying_a_part_leaves_the_other_results_where_they_are(put_aside):
    archive, results = put_aside
    limited = run(archive, results, "--retry", "--limit", "1")
    said = "6 captures: 2 done before, 1 to do, 3 when the command is repeated"
    assert said in limited.stderr
    assert sorted(statuses(results).values()) == ["ok"] * 3 + ["quarantined"] * 3
    assert run(archive, results, "--retry", "--shard", "1/2").returncode == 0
    left = {name for name, status in statuses(results).items() if status != "ok"}
    assert left == {name for name in BAD if Shard(2, 2).holds(name)} & left != set()
    assert len(list((results / "logs").iterdir())) == len(left)
    assert run(archive, results, "--retry", "--shard", "2/2").returncode == 0
    assert set(statuses(results).values()) == {"ok"}
    assert len(statuses(results)) == 6
    again = run(archive, results, "--retry")
    assert (again.returncode, "6 done before, 0 to do" in again.stderr) == (0, True)


def test_a_shard_ends_as_often_as_it_is_repeated_by_what_its_captures_are(tmp_path):
    archive, results = archive_of(tmp_path / "archive", 4), tmp_path / "results"
    (archive / "bad.txt").write_text("1 2 3\n4 5\n")
    settle(archive)
    for _ in range(2):
        codes = [run(archive, results, "--shard", f"{k}/2").returncode for k in (1, 2)]
        assert codes == [int(Shard(k, 2).holds("bad.txt")) for k in (1, 2)]
    assert run(archive, results).returncode == max(codes)


@pytest.mark.parametrize("is_changed", [False, True])
def test_a_capture_has_one_result_also_after_a_kill(tmp_path, monkeypatch, is_changed):
    """An earlier result, by another capture or other settings, goes as the new one comes."""
    archive, results = archive_of(tmp_path / "archive", 4), tmp_path / "results"
    assert run(archive, results, "--workers", "1").returncode == 0
    before = {tree["batch"]["key"] for tree in trees(results).values()}
    options = () if is_changed else ("--date-in-name", "car-(.*)", "--resume")
    if is_changed:
        for path in archive.rglob("*.txt"):
            path.write_text(path.read_text() + "\n")
        settle(archive)
    monkeypatch.setattr(Batch, "update_catalogue", lambda *_, **__: None)  # it does not come so far
    run(archive, results, "--workers", "1", "--limit", "2", *options)
    monkeypatch.undo()
    found = json.loads(ask(results, "--json").stdout)["captures"]
    assert [one["name"] for one in found] == [f"00/car-000{k}.txt" for k in range(4)]
    keys = [one["key"] in before for one in found]
    assert sum(keys) == 2
    assert len(list((results / "superseded").iterdir())) == 2


def test_a_failure_that_was_mended_is_replaced_also_when_retried(tmp_path):
    (tmp_path / "archive").mkdir()
    (tmp_path / "archive" / "car.txt").write_text("1 2 3\n4 5\n")
    assert run(tmp_path / "archive", tmp_path / "results").returncode == 1
    five_points(tmp_path / "archive" / "car.txt", 1)
    assert run(tmp_path / "archive", tmp_path / "results", "--retry").returncode == 0
    assert statuses(tmp_path / "results") == {"car.txt": "ok"}
    assert len(list((tmp_path / "results" / "superseded").iterdir())) == 1


def test_a_damaged_result_is_measured_anew_when_asked_for(tmp_path):
    archive = archive_of(tmp_path / "archive", 3)
    assert run(archive, tmp_path / "results").returncode == 0
    path = next((tmp_path / "results" / "measurements").rglob("*.json"))
    whole = path.read_bytes()
    path.unlink()
    path.write_bytes(whole[:100])
    assert run(archive, tmp_path / "results").returncode == 1
    assert path.read_bytes() != whole
    assert run(archive, tmp_path / "results", "--retry").returncode == 0
    assert path.read_bytes() == whole


def test_results_that_are_removed_in_mid_run_are_missed_and_measured_again(tmp_path, monkeypatch):
    archive, results = archive_of(tmp_path / "archive", 5), tmp_path / "results"
    update = Batch.update_catalogue

    def removing(batch, at_end=False):
        for path in sorted((results / "measurements").rglob("*.json"))[: 2 * at_end]:
            path.unlink()
        update(batch, at_end)

    monkeypatch.setattr(Batch, "update_catalogue", removing)
    done = run(archive, results, "--workers", "1")
    assert (done.returncode, "2 were removed while it ran" in done.stdout) == (1, True)
    monkeypatch.undo()
    done = run(archive, results, "--workers", "1")
    assert (done.returncode, "removed while" in done.stdout) == (0, False)
    assert "3 done before; now: 2 ok" in done.stdout


def test_a_folder_without_permission_is_a_row_and_the_rest_is_measured(tmp_path, monkeypatch):
    archive = archive_of(tmp_path / "archive", 21)
    closed, access = archive / "01", os.access
    five_points(archive / "lost+found" / "inode-7.txt", 7)
    monkeypatch.setattr(os, "access", lambda path, mode: path != closed and access(path, mode))
    done = run(archive, tmp_path / "results", "--workers", "1")
    assert done.returncode == 1, done.stderr
    found = {name: tree["batch"] for name, tree in trees(tmp_path / "results").items()}
    row = found.pop("01")
    assert (row["status"], row["stage"]) == ("failed", "discover")
    assert row["reason"].startswith("01: no permission to list the folder")
    assert [batch["status"] for batch in found.values()] == ["ok"] * 11
    monkeypatch.undo()
    again = run(archive, tmp_path / "results", "--workers", "1")
    assert "now: 10 ok" in again.stdout
    assert "no longer in the archive" not in again.stdout
    assert {tree["batch"]["status"] for tree in trees(tmp_path / "results").values()} == {"ok"}


def test_what_lies_in_a_folder_that_cannot_be_listed_is_not_reported_as_gone(tmp_path, monkeypatch):
    archive, results = archive_of(tmp_path / "archive", 25), tmp_path / "results"
    assert run(archive, results, "--workers", "1").returncode == 0
    (archive / "02" / "car-0020.txt").unlink()
    closed, access = archive / "01", os.access
    monkeypatch.setattr(os, "access", lambda path, mode: path != closed and access(path, mode))
    done = run(archive, results, "--workers", "1")
    assert "now: 1 failed" in done.stdout
    assert "1 no longer in the archive" in done.stdout
    assert ask(results, "--gone").stdout.splitlines()[1].split()[0] == "02/car-0020.txt"
    monkeypatch.undo()
    closed.rename(archive / "011")
    done = run(archive, results, "--workers", "1")
    assert "12 no longer in the archive" in done.stdout  # ten, the folder's own row, and the one


def test_a_capture_whose_folder_becomes_one_of_captures_keeps_its_result(tmp_path):
    archive, results = tmp_path / "archive", tmp_path / "results"
    five_points(archive / "car.txt", 1)
    settle(archive)
    assert run(archive, results, "--workers", "1").returncode == 0
    (archive / "car.txt").unlink()
    five_points(archive / "car.txt" / "1.txt", 2)
    settle(archive)
    done = run(archive, results, "--workers", "1")
    assert "1 no longer in the archive" in done.stdout
    assert statuses(results) == {"car.txt": "ok", "car.txt/1.txt": "ok"}


def test_what_lies_too_deep_is_a_row_that_says_so_and_the_rest_is_measured(tmp_path):
    archive = archive_of(tmp_path / "archive", 2)
    five_points(archive.joinpath(*["d"] * (MOST_LEVELS + 3)) / "car.txt", 1)
    settle(archive)
    done = run(archive, tmp_path / "results", "--workers", "1")
    assert done.returncode == 1, done.stderr
    found = [tree["batch"] for tree in trees(tmp_path / "results").values()]
    assert sorted(batch["status"] for batch in found) == ["failed", "ok", "ok"]
    (reason,) = [batch["reason"] for batch in found if batch["reason"]]
    assert f"more than {MOST_LEVELS} folders deep" in reason
    again = run(archive, tmp_path / "results", "--workers", "1")
    assert "3 done before, 0 to do" in again.stderr


@pytest.mark.parametrize("forgotten", [False, True])
def test_shards_replace_what_changed_in_their_part(tmp_path, forgotten):
    archive = archive_of(tmp_path / "archive", 6)
    results = tmp_path / "results"

    def both() -> None:
        for k in (1, 2):
            assert run(archive, results, "--shard", f"{k}/2").returncode == 0

    both()
    first = trees(results)
    changed = "00/car-0003.txt"
    five_points(archive / changed, 99)
    if forgotten:
        shutil.rmtree(results / "run" / "seen")
    both()
    after = trees(results)  # which asserts one result a capture
    assert {name for name in first if first[name] != after[name]} == {changed}
    assert [path.stem for path in (results / "superseded").iterdir()] == [
        first[changed]["batch"]["key"]
    ]


@pytest.mark.parametrize("shard", ["1/1", "1/2"])
def test_a_failure_that_left_the_archive_is_none_of_its_captures(tmp_path, shard):
    """Its row stays, as any; the exit code is of what the archive holds."""
    archive, results = archive_of(tmp_path / "archive", 2), tmp_path / "results"
    bad = next(f"bad-{n}.txt" for n in range(9) if Shard(1, 2).holds(f"bad-{n}.txt"))
    (archive / bad).write_text("1 2 3\n")
    settle(archive)
    options = ("--workers", "1", "--shard", shard)
    assert run(archive, results, *options).returncode == 1
    (archive / bad).unlink()
    done = run(archive, results, *options)
    assert "1 no longer in the archive" in done.stdout
    assert statuses(results)[bad] == "failed"
    assert done.returncode == 0, done.stdout
    (archive / bad).write_text("1 2 3\n")
    settle(archive)
    assert run(archive, results, *options).returncode == 1


@pytest.mark.parametrize("forgotten", [False, True])
def test_results_of_captures_that_left_the_archive_stay_and_are_reported(tmp_path, forgotten):
    archive = archive_of(tmp_path / "archive", 5)
    results = tmp_path / "results"
    assert "no longer" not in run(archive, results).stdout
    assert ask(results, "--gone").stdout.endswith("\n0 captures.\n")
    (archive / "00" / "car-0000.txt").unlink()
    (archive / "00" / "car-0001.txt").rename(archive / "00" / "renamed.txt")
    if forgotten:
        shutil.rmtree(results / "run" / "seen")
    done = run(archive, results, "--shard", "1/1")
    assert "2 no longer in the archive" in done.stdout
    assert len(trees(results)) == 6
    gone = [line.split()[0] for line in ask(results, "--gone").stdout.splitlines()[1:3]]
    assert gone == ["00/car-0000.txt", "00/car-0001.txt"]
    assert "6 captures: 6 ok, 2 no longer in the archive." in ask(results).stdout
    there = ask(results, "--no-gone").stdout
    assert "4 captures: 4 ok." in there
    assert "renamed.txt" in there
    for k in range(2):
        five_points(archive / "00" / f"car-000{k}.txt", k)
    assert "no longer" not in run(archive, results).stdout
    assert ask(results, "--gone").stdout.endswith("\n0 captures.\n")


def test_a_name_that_is_no_utf_8_is_measured_and_known_again(tmp_path):
    archive = archive_of(tmp_path / "archive", 1)
    name, shown = os.fsdecode(b"Citro\xebn.txt"), r"Citro\xebn.txt"
    five_points(archive / name, 1)
    settle(archive)
    results = tmp_path / "results"
    done = run(archive, results)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    assert statuses(results) == {"00/car-0000.txt": "ok", shown: "ok"}
    assert "2 done before, 0 to do" in run(archive, results).stderr
    assert ask(results, "--csv", str(tmp_path / "all.csv")).returncode == 0
    rows = csv.DictReader(io.StringIO((tmp_path / "all.csv").read_text()))
    assert [row["name"] for row in rows] == ["00/car-0000.txt", shown]
    assert shown in ask(results).stdout
    (archive / name).write_text("1 2 3\n4 5\n")
    assert run(archive, results).returncode == 1
    assert statuses(results)[shown] == "failed"
    assert trees(results)[shown]["batch"]["reason"].startswith(f"{shown}: line 2")
    for path in results.rglob("*.json"):
        assert "\\ud" not in path.read_bytes().decode()
    assert len(list((results / "superseded").iterdir())) == 1


class Direct:
    """An engine that does the work here, or fails."""

    slots = 1

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error

    def submit(self, task):
        future = Future()
        if self.error is None:
            future.set_result(work(task))
        else:
            future.set_exception(self.error)
        return future

    def close(self) -> None:
        """Nothing to end."""


def batch_of(archive, results, scratch, error=None, settings=None) -> Batch:
    scratch.mkdir()
    request = RunRequest(str(archive), str(results), settings or BatchSettings())
    return Batch(request, Direct(error), scratch, ProgressLines())


@pytest.mark.parametrize("error", [InputError("the disk is full"), KeyboardInterrupt("x")])
@pytest.mark.parametrize("spoilt", [False, True])
def test_what_ended_a_run_is_what_is_reported(tmp_path, monkeypatch, capsys, error, spoilt):
    archive = archive_of(tmp_path / "archive", 1)

    def spoil(*_, **__):
        raise InputError("the catalogue cannot be made")

    if spoilt:
        monkeypatch.setattr(run_module, "update", spoil)
    with pytest.raises(type(error), match=str(error)):
        batch_of(archive, tmp_path / "results", tmp_path / "scratch", error).run()
    assert ("the catalogue cannot be made" in capsys.readouterr().err) == spoilt


def test_a_fault_of_the_catalogue_alone_is_reported(tmp_path, monkeypatch):
    def spoil(*_, **__):
        raise InputError("the catalogue cannot be made")

    monkeypatch.setattr(run_module, "update", spoil)
    archive = archive_of(tmp_path / "archive", 1)
    with pytest.raises(InputError, match="cannot be made"):
        batch_of(archive, tmp_path / "results", tmp_path / "scratch").run()


def test_a_watch_that_saw_nothing_ends_with_ctrl_c(tmp_path):
    (tmp_path / "archive").mkdir()
    process = start(tmp_path / "archive", tmp_path / "results", "--watch")
    try:
        wait_for(lambda: (tmp_path / "results" / "run" / "begun.json").exists())
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    finally:
        kill(process.pid)
    assert (process.returncode, err) == (0, "")
    assert "nothing new" in out


@pytest.mark.parametrize("first", ["a", "b"])
def test_a_change_elsewhere_is_learnt_once(tmp_path, first):
    """Whichever of two runs' files is read first."""
    results, archive = open_store(str(tmp_path / "results")), open_store(str(tmp_path / "archive"))
    archive.write("ours.toml", b"")
    now = archive.stat("ours.toml")
    found = FoundCapture("car", "folder", (Entry("car/rr.ply", 1, "1-1"),))
    old, new = "0" * 64, "1" * 64
    for key in (old, new):
        results.write(f"measurements/{key[:2]}/{key}.json", b"{}")
    entries = {
        first: (old, [["ours.toml", 7, "before"]]),
        "ab".replace(first, ""): (new, [["ours.toml", now.size, now.stamp]]),
    }
    for file, (key, elsewhere) in entries.items():
        line = json.dumps(["car", found.fingerprint, key, json.dumps(elsewhere)])
        results.write(f"run/seen/{'f' * 16}/{file}.jsonl", f"{line}\n".encode())
    index = ResultIndex(results, "f" * 64, archive, tmp_path / "index")
    index.load()
    index.compare([found.listed], lambda _: True)
    assert not index.is_todo(found)
    assert index.outdated() == [old]


def test_a_watched_folder_sees_a_change_of_a_file_that_is_named_elsewhere(tmp_path):
    archive, results = tmp_path / "archive", tmp_path / "results"
    (archive / "car").mkdir(parents=True)
    names = ("RR", "RL", "FR", "FL")
    for wheel in names:
        (archive / "car" / f"{wheel.lower()}.xyz").write_text("0 0 0\n")
    (archive / "car" / "capture.toml").write_text(
        'target = "../ours.toml"\n[reference]\n'
        + "".join(f'{wheel} = "{wheel.lower()}.xyz"\n' for wheel in names)
    )
    ours = 'shape = "disc"\ndiameter = 0.25\n'
    (archive / "ours.toml").write_text(ours)
    settle(archive)
    process = start(archive, results, "--watch", "--settle", "0.4", "--workers", "1")
    try:
        wait_for(lambda: (results / "catalogue.sqlite").exists())
        time.sleep(1.0)  # in which the folder is looked at again, ten times a second
        (archive / "ours.toml").write_text(ours.replace("0.25", "0.24"))
        wait_for(lambda: list(results.glob("superseded/*.json")))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    finally:
        kill(process.pid)
    assert len(trees(results)) == 1


def wait_for(condition) -> None:
    end = time.monotonic() + 40.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_help_loads_nothing_that_measures():
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "wheelplane", "batch", "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "wheelplane.commands.shared.batch_options" in loaded
    heavy = {"wheelplane.measure", "wheelplane.batch.run.work", "wheelplane.batch.run.run"}
    assert loaded & heavy == set()
