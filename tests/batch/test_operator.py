"""Questions of an operator: what failed and why, what is at work, what takes long."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import time
import zipfile

import pytest

from tests.support.batches import (
    archive_of,
    call,
    five_points,
    poisoned,
    run,
    settle,
    start,
    trees,
    zip_of_discs,
)
from wheelplane.batch.operation.run_state import AtWork, RunState, ordered, states_text, write_state
from wheelplane.batch.operation.times import CaptureTime, Times, slow_text, slowest
from wheelplane.batch.plan.discover import FoundCapture
from wheelplane.batch.results.query import brief, general
from wheelplane.batch.run.tasks import SMALL_BYTES
from wheelplane.batch.run.work import _Stopwatch
from wheelplane.batch.storage.entry import IMPROPER, TOO_DEEP, Entry, legible
from wheelplane.batch.storage.store import open_store
from wheelplane.system import STAGES


@pytest.fixture
def finished(tmp_path):
    """An archive of two good captures and two bad ones, and its results."""
    archive = archive_of(tmp_path / "archive", 2)
    (archive / "bad.txt").write_text("1 2 3\n4 5\n")
    (archive / "odd.txt").write_text("no number\n")
    settle(archive)
    assert run(archive, tmp_path / "results", "--workers", "1").returncode == 1
    return archive, tmp_path / "results"


def recent(results) -> dict[str, int]:
    paths = {path.stem: path for path in results.glob("measurements/*/*.json")}
    return {
        name: paths[tree["batch"]["key"]].stat().st_mtime_ns
        for name, tree in trees(results).items()
    }


@pytest.mark.parametrize(
    ("retry", "again"),
    [
        (("--retry",), {"bad.txt", "odd.txt"}),
        (("--retry", "failed"), {"bad.txt", "odd.txt"}),
        (("--retry", "ok"), {"00/car-0000.txt", "00/car-0001.txt"}),
        (("--retry", "odd.txt"), {"odd.txt"}),
        (("--retry", "00/car-0001.txt"), {"00/car-0001.txt"}),
        (("--retry", "quarantined"), set()),
    ],
)
def test_a_retry_measures_what_it_names_and_nothing_else(finished, retry, again):
    archive, results = finished
    before, content = recent(results), trees(results)
    done = run(archive, results, *retry, "--workers", "1")
    assert done.returncode == 1
    assert f"{4 - len(again)} done before, {len(again)} to do" in done.stderr
    after = recent(results)
    assert {name for name in before if before[name] != after[name]} == again
    assert trees(results) == content


def test_a_retry_of_an_unknown_name_is_one_line(finished):
    archive, results = finished
    done = run(archive, results, "--retry", "nowhere.txt")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "nowhere.txt" in done.stderr


def test_the_archive_may_follow_retry_as_before(finished):
    archive, results = finished
    done = call("batch", "--retry", archive, "-o", results)
    assert "2 done before, 2 to do" in done.stderr


def test_why_shows_reason_inputs_and_log(finished):
    archive, results = finished
    done = call("batch", "-o", results, "--why", "bad.txt")
    assert done.returncode == 0
    tree = trees(results)["bad.txt"]
    for text in ("bad.txt: failed at read", tree["batch"]["reason"], "line 2: 2 numbers"):
        assert text in done.stdout
    assert tree["provenance"]["inputs"]["bad.txt"] in done.stdout
    assert "Traceback" in done.stdout  # of the log
    assert f"wheelplane five-point {archive}/bad.txt --plot DIR" in done.stdout
    assert "00/car-0000.txt: ok" in call("batch", "-o", results, "--why", "00/car-0000.txt").stdout


def test_a_damaged_result_goes_by_its_key_until_it_is_measured_again(finished):
    archive, results = finished
    before = trees(results)
    key = before["00/car-0000.txt"]["batch"]["key"]
    (path,) = results.glob(f"measurements/*/{key}.json")
    path.unlink()  # a file changed in place is not noticed
    path.write_text('{"schema": ')
    assert key in call("results", results).stdout
    assert f"\n{'':9}{key}\n" in call("results", results, "--failures").stdout
    done = call("batch", "-o", results, "--why", key)
    assert done.returncode == 0
    assert done.stdout.startswith(f"{key}: damaged\n  not JSON, or incomplete (11 bytes)\n")
    assert f"wheelplane batch {archive} -o {results} --retry damaged" in done.stdout
    damaged = path.read_bytes()
    for retry in ("damaged", key):
        path.unlink()
        path.write_bytes(damaged)
        assert "3 done before, 1 to do" in run(archive, results, "--retry", retry).stderr
        assert trees(results) == before


NAMES = [
    "it's/car 1.txt",
    "a\x1b[2J\n'\\b.txt",
    os.fsdecode(b"Citro\xeb1.txt"),
    r"Citro\xeb2.txt",
    "-x.txt",
]


def test_what_why_prints_finds_the_file_when_it_is_pasted_into_a_shell(tmp_path):
    archive, results = tmp_path / "my archive", tmp_path / "results"
    for name in NAMES:
        five_points(archive / name, 1)
    with zipfile.ZipFile(archive / "many.zip", "w") as packed:
        for name in NAMES[:1]:
            packed.write(archive / name, f"a/{name}")
            packed.write(archive / name, f"b/{name}")
    settle(archive)
    assert run(archive, results, "--workers", "1").returncode == 0
    names = list(trees(results))
    assert len(names) == len(NAMES) + 2
    for name in names:
        shown = call("batch", "-o", results, "--why", name).stdout
        assert shown.replace("\n", "").isprintable()
        pasted = shown.split("see its targets: ")[1].splitlines()[0]
        repeated = shown.split("measure it again: ")[1].splitlines()[0]
        # the file that `wheelplane` would be given, read by the shell's own means
        called = f'wheelplane() {{ cat -- "$2"; }}; {pasted}'
        done = subprocess.run(["bash", "-c", called], cwd=tmp_path, capture_output=True, check=True)
        assert done.stdout == (archive / NAMES[0]).read_bytes()
        called = f'wheelplane() {{ printf %s "$6"; }}; {repeated}'
        done = subprocess.run(["bash", "-c", called], capture_output=True, check=True)
        assert legible(os.fsdecode(done.stdout)) == name


def test_why_of_an_unknown_name_is_one_line(finished):
    done = call("batch", "-o", finished[1], "--why", "nowhere")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "has no result of this name" in done.stderr


@pytest.mark.parametrize("arguments", [(), ("-o", "results"), ("archive",)])
def test_what_is_missing_is_said(arguments):
    done = call("batch", *arguments)
    assert (done.returncode, "Missing" in done.stderr) == (2, True)


def test_a_long_name_hides_no_reason(tmp_path):
    archive = tmp_path / "archive"
    for letter in "mn":
        path = archive / (letter * 240) / "bad.txt"
        path.parent.mkdir(parents=True)
        path.write_text("1 2 3\n4 5\n")
    settle(archive)
    done = run(archive, tmp_path / "results", "--workers", "1")
    why = f"failed, read: {'m' * 57}...: line 2: 2 numbers where 3 are needed"
    assert f"      2 {why}" in done.stdout
    assert why.replace(", read", f": {'m' * 240}/bad.txt: read") in done.stderr
    listed = call("results", tmp_path / "results", "--failures").stdout.splitlines()
    assert (
        listed[0].removesuffix(" (x y z): complete the row")
        == f"      2  {why.replace(', read', '  read')}"
    )
    assert [line.strip() for line in listed[1:]] == [f"{c * 240}/bad.txt" for c in "mn"]


@pytest.mark.parametrize("stamp", [IMPROPER, TOO_DEEP])
@pytest.mark.parametrize("name", ["n" * 300, "a//" + "b" * 250, "a  b\n/../c", "\x1b" + "d" * 999])
def test_what_cannot_be_copied_is_one_reason_whatever_its_name(name, stamp):
    reasons = set()
    for more in ("", "-2"):
        found = FoundCapture(name + more, "five-point", (Entry(name + more, 1, stamp),))
        collapsed = " ".join(found.refusal.split())  # as in the results
        reasons.add(general(collapsed, found.name))
        assert len(brief(collapsed, found.name)) < 140
    (reason,) = reasons
    assert len(reason) < 100


NAMED = ["bad.txt", "00/car-7.txt", "2", "4711", "a", "line", "number", "#"]


@pytest.mark.parametrize("name", NAMED)
def test_a_reason_is_the_same_whatever_the_captures_name(name):
    fact = "line 2: 2 numbers where 3 are needed"
    assert general(f"{name}: {fact}", name) == "line #: # numbers where # are needed"
    fact = "a target of 0.5 mm: a scan of 12 points"
    assert general(f"{name}/rr.ply: {fact}", name) == "rr.ply: a target of # mm: a scan of # points"
    assert general(f"it has the scans of {name}", name) == "it has the scans of #"


# Runs at work


def test_the_status_of_a_run_is_read_from_its_results_while_it_works(tmp_path):
    archive = archive_of(tmp_path / "archive", 3)
    with five_points(archive / "hang.txt", 1).open("a") as file:
        file.write("\n" * SMALL_BYTES)  # so that it is a task of its own
    (archive / "bad.txt").write_text("1 2 3\n4 5\n")
    settle(archive)
    results = tmp_path / "results"
    options = ("--workers", "2", "--timeout", "600")
    process = start(archive, results, *options, **poisoned(tmp_path))
    try:
        end, failure = (
            time.monotonic() + 60.0,
            "1 failed, read: line #: # numbers where # are needed",
        )
        while failure not in (text := status(results)):
            assert time.monotonic() < end, text
            time.sleep(0.2)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert f"process {process.pid}: running for" in text
    assert "0 done before; now 1 failed, 3 ok; 1 to do" in text
    assert "at work: hang.txt, for" in text
    after = status(results)
    assert f"process {process.pid}: interrupted after" in after
    assert "0 done before; now at least 1 failed, 3 ok; at most 1 to do" in after
    assert "at work" not in after


def status(results) -> str:
    done = call("batch", "--status", results)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_a_run_that_ended_is_forgotten_by_the_next(finished):
    archive, results = finished
    assert "finished after" in status(results)
    run(archive, results)
    text = status(results)
    assert text.count("finished after") == 1
    assert "4 done before; now none; 0 to do" in text
    assert [path.parent.name for path in results.glob("run/state/*")] == ["state"]


def test_a_run_without_a_sign_and_one_that_works(tmp_path):
    results = open_store(str(tmp_path))
    assert "no run has begun" in states_text(results)
    now_s = time.time()
    task = AtWork(("a/\x1b[2J.zip", "b", "c"), now_s - 30.0, "worker 2")
    works = RunState("node1, process 7", "2/4", now_s - 100.0, now_s, 5, 1000, at_work=(task,))
    works.done, works.failures = {"ok": 180, "failed": 20}, {"failed, read: no number": 20}
    works.expected_s, works.worked_s = 5.0, 1.0
    write_state(results, "b", works)
    lost = RunState("node2, process 8", "1/1", now_s - 900.0, now_s - 600.0, 0, 10)
    write_state(results, "a", lost)
    results.write("run/state/c.json", b"{}")
    assert states_text(results).split("\n") == [
        "node2, process 8: no sign for 10 min: killed, or its machine is not reached",
        "  0 done before; now at least 0; at most 10 to do",  # workers may have written more
        "node1, process 7, shard 2/4: running for 2 min, 2/s, 7 min left",
        "  5 done before; now 20 failed, 180 ok; 800 to do",
        r"  at work: a/\x1b[2J.zip and 2 small ones, for 30 s, worker 2",
        "     20 failed, read: no number",
    ]


def test_the_time_left_is_that_of_what_is_left_also_where_small_captures_come_first():
    """By the number alone, 1,000 five-point files before ten scans leave a hundredth."""
    small = FoundCapture("a.txt", "five-point", (Entry("a.txt", 1000, ""),))
    scans = FoundCapture("b.zip", "zip", (Entry("b.zip", 100_000_000, ""),))
    assert 100.0 * small.expected_s < scans.expected_s
    expected_s = 1000 * small.expected_s + 10 * scans.expected_s
    for slow in (0.5, 1.0, 8.0):  # as many workers, or a slow machine
        for done_small, done_scans in ((100, 0), (1000, 0), (1000, 7)):
            worked_s = done_small * small.expected_s + done_scans * scans.expected_s
            state = RunState("node1", "1/1", 0.0, slow * worked_s, 0, 1010)
            state.expected_s, state.worked_s = expected_s, worked_s
            state.done = {"ok": done_small + done_scans}
            assert state.left_s == pytest.approx(slow * (expected_s - worked_s))
    assert RunState("earlier version", "1/1", 0.0, 9.0, 0, 9, done={"ok": 3}).left_s is None


@pytest.mark.parametrize("limit", [None, 2, 4])
def test_a_run_counts_the_work_that_it_plans(tmp_path, limit):
    archive = archive_of(tmp_path / "archive", 3)
    zip_of_discs(archive / "car.zip", 1, 0.02)
    settle(archive)
    options = () if limit is None else ("--limit", str(limit))
    assert run(archive, tmp_path / "results", "--workers", "1", *options).returncode == 0
    (state,) = ordered(open_store(str(tmp_path / "results")))
    expected_s = [0.008, 0.008, 0.008, 0.3 + (archive / "car.zip").stat().st_size / 1e8][:limit]
    assert state.expected_s == pytest.approx(sum(expected_s))
    assert state.worked_s == pytest.approx(sum(expected_s))
    assert (state.left, state.left_s) == (0, None)


def test_the_log_holds_an_event_a_line(tmp_path):
    archive = archive_of(tmp_path / "archive", 1)
    (archive / "bad.txt").write_text("1 2 3\n4 5\n")
    settle(archive)
    log = tmp_path / "log.jsonl"
    for _ in range(2):
        run(archive, tmp_path / "results", "--log", str(log))
    events = [json.loads(line) for line in log.read_text().splitlines()]
    names = [event["event"] for event in events]
    assert names == ["planned", "finished", "finished", "ended", "planned", "ended"]
    of_bad = next(event for event in events if event.get("capture") == "bad.txt")
    batch = trees(tmp_path / "results")["bad.txt"]["batch"]
    assert {key: of_bad[key] for key in ("key", "status", "stage", "reason")} == {
        key: batch[key] for key in ("key", "status", "stage", "reason")
    }
    assert set(of_bad["seconds"]) == {"copy", "identify", "read", "other"}  # it ends at reading
    assert all(0.0 <= seconds < 600.0 for seconds in of_bad["seconds"].values())
    assert of_bad["memory_bytes"] > 10_000_000
    assert events[-1]["time"] > events[0]["time"]


def test_a_log_that_cannot_be_written_is_one_line(tmp_path):
    archive = archive_of(tmp_path / "archive", 1)
    done = run(archive, tmp_path / "results", "--log", str(tmp_path / "none" / "log"))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--log" in done.stderr


# What takes long


def test_the_slowest_captures_are_listed_with_their_stages(finished):
    _, results = finished
    done = call("results", results, "--slow", "9")
    assert (done.returncode, done.stderr) == (0, "")
    head, *lines = done.stdout.splitlines()
    of_five_points = ["read", "plane", "angles", "report", "other"]
    assert head.split() == ["capture", "s", "copy", "identify", *of_five_points, "MB"]
    assert {line.split()[0] for line in lines} == set(trees(results))
    totals = [float(line.split()[1]) for line in lines]
    assert totals == sorted(totals, reverse=True)
    for line in lines:
        _, total, *stages, _ = line.split()
        assert abs(float(total) - sum(map(float, stages))) < 0.005 * len(stages) + 0.005 + 1e-9
    tree = json.loads(call("results", results, "--slow", "2", "--json").stdout)
    assert [one["name"] for one in tree["slow"]] == [line.split()[0] for line in lines[:2]]


def test_a_capture_of_scans_has_every_stage_of_its_measurement(tmp_path):
    zip_of_discs(tmp_path / "archive" / "car.zip", 1, 0.02)
    settle(tmp_path / "archive")
    assert run(tmp_path / "archive", tmp_path / "results", "--workers", "1").returncode == 0
    (one,) = slowest(open_store(str(tmp_path / "results")), 1)
    assert set(one.seconds) == {"copy", "identify", *STAGES, "other"}
    assert all(seconds > 0.0 for name, seconds in one.seconds.items() if name in STAGES)


def test_stages_of_several_threads_are_scaled_to_the_time_of_the_measurement():
    watch = _Stopwatch()
    watch.lap_by_stage({"read": 1e6, "plane": 3e6})  # of threads: more than has passed
    laps = dict(watch.laps)
    assert laps["other"] == 0.0
    assert laps["plane"] == pytest.approx(3.0 * laps["read"])
    assert 0.0 < laps["read"] + laps["plane"] < 1e6


def test_times_of_earlier_versions_are_listed(tmp_path):
    store = open_store(str(tmp_path))
    times = Times(store)
    times.add(CaptureTime("a", "k" * 64, {"copy": 1.0, "identify": 0.0, "measure": 2.0}, 1))
    times.flush()
    head, line = slow_text(slowest(store, 5)).splitlines()
    assert head.split() == ["capture", "s", "copy", "identify", "measure", "MB"]
    assert line.split() == ["a", "3.00", "1.00", "0.00", "2.00", "0"]


def test_times_of_a_repeated_measurement_count_once(tmp_path):
    store = open_store(str(tmp_path))
    for seconds in (3.0, 5.0):
        times = Times(store)
        times.add(CaptureTime("a", "k" * 64, {"measure": seconds}, 1))
        times.add(CaptureTime("b", "l" * 64, {"copy": 1.0, "measure": 1.0}, 1))
        times.flush()
    assert [(one.name, one.total_s) for one in slowest(store, 5)] == [("a", 5.0), ("b", 2.0)]
    assert "No times" in slow_text(slowest(open_store(str(tmp_path / "none")), 5))


@pytest.mark.parametrize("count", [1, 3, 10, 500])
def test_the_slowest_are_the_first_of_all_sorted(tmp_path, monkeypatch, count):
    """Over files of this version and of earlier ones, of which only some have to be read."""
    store = open_store(str(tmp_path))
    seconds = random.Random(2).sample(range(1, 10_000), 200)
    every = [CaptureTime(f"c{s}", f"k{s}", {"copy": s / 1e3}, 5) for s in seconds]
    for at in range(0, 200, 20):
        times = Times(store)
        for one in every[at : at + 20]:
            times.add(one)
        times.flush()
    expected = sorted(every, key=lambda one: -one.total_s)
    read, real = [], type(store).read
    monkeypatch.setattr(type(store), "read", lambda self, n: read.append(n) or real(self, n))
    assert slowest(store, count) == expected[:count]
    assert len(read) < 10 or count > 3
    (first, *_) = store.names("run/times/")
    lines = store.read(first).splitlines(keepends=True)
    store.write("run/times/0123456789abcdef.jsonl", b"".join(lines[::-1]))  # as earlier versions
    store.remove(first)
    assert slowest(store, count) == expected[:count]


@pytest.mark.parametrize("content", ['{"a', "[1]", "\udcff"])
def test_damaged_files_of_runs_cost_no_result_and_no_answer(tmp_path, content):
    """The index, the times, the options: what they held is found out again, or not said."""
    archive, results = archive_of(tmp_path / "archive", 2), tmp_path / "results"
    settle(archive)
    assert run(archive, results, "--workers", "1").returncode == 0
    before, content = recent(results), content.encode(errors="surrogateescape")
    times = next(results.glob("run/times/*"))
    (results / "run" / "times" / f"9{times.name[1:]}").write_bytes(content + b"\n")
    (results / "run" / "options.json").write_bytes(content)
    for index in results.glob("run/seen/*/*"):
        index.write_bytes(content)
    slow = call("results", results, "--slow", "5")
    assert slow.returncode == 0
    assert "00/car-0001.txt" in slow.stdout
    why = call("batch", "-o", results, "--why", "00/car-0001.txt")
    assert f"measure it again: wheelplane batch {archive}" in why.stdout
    done = run(archive, results, "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert "2 recognised" in done.stdout
    assert recent(results) == before
    assert "2 done before; now: nothing new" in run(archive, results, "--workers", "1").stdout
    (results / "run" / "begun.json").write_bytes(content)
    assert "measure it again: " in call("batch", "-o", results, "--why", "00/car-0001.txt").stdout
    refused = run(archive, results)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "run/begun.json: damaged: remove it" in refused.stderr
