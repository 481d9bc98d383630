"""Parts of a batch: what is a capture, whose shard it is, who is to blame, what a day is called."""

from __future__ import annotations

import errno
import pickle
import time
from pathlib import PurePosixPath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.batches import archive_of, five_points, run
from tests.support.records import add, result
from tests.test_structure import ROOMS, sources
from wheelplane.batch.catalogue import segments
from wheelplane.batch.catalogue.catalogue import open_catalogue, rebuild, update
from wheelplane.batch.catalogue.load_records import json_name, load_records
from wheelplane.batch.catalogue.rows import read_record
from wheelplane.batch.plan.discover import FoundCapture, discover
from wheelplane.batch.plan.settings import BatchSettings
from wheelplane.batch.plan.shard import Shard, read_shard
from wheelplane.batch.results.listing import capture_table
from wheelplane.batch.results.page import Selection, results_document
from wheelplane.batch.results.query import ALL, captures
from wheelplane.batch.run import result_index
from wheelplane.batch.run import run as batch_run
from wheelplane.batch.run.measure_one import Outcome, Subject, TransientError, measure_bytes
from wheelplane.batch.run.result_index import ResultIndex
from wheelplane.batch.run.stages import STAGES, stage_of, transient_fault
from wheelplane.batch.run.tasks import MOST_TOGETHER, Run, tasks_of
from wheelplane.batch.run.work import ArchiveError, CompletedCapture, RunRequest, Task
from wheelplane.batch.run.worker_process import WorkerError
from wheelplane.batch.storage.entry import Entry
from wheelplane.batch.storage.store import open_store
from wheelplane.capture.open_capture import CaptureOptions, open_capture
from wheelplane.config import Config
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.notes import joined_notes_in
from wheelplane.report.format.view import PAPER
from wheelplane.report.format.writer import Writer
from wheelplane.targets import read_targets

SINGLE = {
    "a.zip": "zip",
    "b.tar.gz": "tar",
    "c.ply": "cloud",
    "d.e57": "cloud",
    "e.xyz.gz": "cloud",
}
SINGLE |= {"f.txt": "five-point", "g.csv": "five-point"}
PASSED_OVER = ["README.txt", "photo.jpg", "truth.json", ".hidden.ply", "target.toml"]
OF_WHEELS = ["rr.ply", "capture.toml", "FL.xyz"]
FOLDERS = ["a", "b", "a b", "a-b", "z"]


def found_in(names: list[str], spool) -> dict[str, tuple[str, set[str]]]:
    entries = [Entry(name, 1, "1-1") for name in sorted(names)]
    captures = list(discover(entries, spool, "archive"))
    assert len({found.name for found in captures}) == len(captures)
    return {f.name: (f.kind, {file.name for file in f.files}) for f in captures}


def by_definition(names: list[str]) -> dict[str, tuple[str, set[str]]]:
    """The same from the definition: the outermost folder with a wheel's file is one capture."""
    paths = [PurePosixPath(name) for name in names]
    marked = {path.parent for path in paths if path.name in OF_WHEELS}
    found: dict[str, tuple[str, set[str]]] = {}
    for path in paths:
        above = [folder for folder in reversed(path.parents) if folder in marked]
        hidden = any(part.startswith(".") for part in path.parts)
        relevant = path.name in SINGLE or path.name in OF_WHEELS or path.suffix in (".toml", ".txt")
        if hidden or not relevant:
            continue
        if above:
            found.setdefault(str(above[0]), ("folder", set()))[1].add(str(path))
        elif path.name in SINGLE:
            found[str(path)] = (SINGLE[path.name], {str(path)})
    for kind, files in found.values():
        if kind == "folder":
            files -= {name for name in files if "README" in name}
    return found


trees = st.lists(
    st.builds(
        lambda folders, file: "/".join([*folders, file]),
        st.lists(st.sampled_from(FOLDERS), min_size=1, max_size=3),
        st.sampled_from([*SINGLE, *PASSED_OVER, *OF_WHEELS]),
    ),
    unique=True,
    max_size=25,
)


@given(names=trees)
def test_captures_are_found_as_they_are_defined(names, tmp_path_factory):
    spool = tmp_path_factory.mktemp("spool") / "captures"
    assert found_in(names, spool) == by_definition(names)


def test_an_archive_that_is_itself_a_capture_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"archive: contains rr\.ply, so it is itself a capture"):
        found_in(["rr.ply", "x/a.zip"], tmp_path / "captures")


@given(n=st.integers(1, 40), names=st.lists(st.text(max_size=8), max_size=20))
def test_each_capture_is_of_one_shard(n, names):
    shards = [read_shard(f"{k}/{n}") for k in range(1, n + 1)]
    assert all(sum(shard.holds(name) for shard in shards) == 1 for name in names)


def test_shards_are_about_equal():
    n, count = 8, 8000
    sizes = [sum(Shard(k, n).holds(f"car {i}") for i in range(count)) for k in range(1, n + 1)]
    assert max(abs(size - count / n) for size in sizes) < 5.0 * (count / n) ** 0.5  # Poisson
    assert min(sizes) > 0


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "1/0", "a/b", "-1/2", "1/2/3"])
def test_what_is_no_shard_is_said(text):
    with pytest.raises(InputError, match="K from 1 to N"):
        read_shard(text)


@pytest.mark.parametrize(
    ("pattern", "name", "day"),
    [
        (r"\d{4}-\d\d-\d\d", "a/2026-11-20 car", "2026-11-20"),
        (r"_(\d{8})_", "a_20261120_b", "2026-11-20"),
        (r"(?P<d>\d\d)\.(?P<m>\d\d)\.(?P<y>\d{4})", "20.11.2026.zip", "2026-11-20"),
        (r"(?P<d>\d+)\.(?P<m>\d+)\.(?P<y>\d{4})", "5.3.2026.zip", "2026-03-05"),
        (r"(?P<y>\d+)_(?P<m>\d+)_(?P<d>\d+)", "26_3_5", None),
        (r"(\d{4}-\d\d-\d\d)", "2026-13-40", None),
        (r"(\d{4}-\d\d-\d\d)", "undated", None),
        (r"(\d{4}-\d\d-\d\d)?", "undated", None),
        (r"car(?P<y> \d{4})?(?P<m>-\d\d)?(?P<d>-\d\d)?", "car 2026", None),
    ],
)
def test_the_day_is_read_from_the_name(pattern, name, day):
    assert BatchSettings(date_in_name=pattern).date_of(name) == day


def test_settings_of_one_kind_do_not_concern_the_other():
    plain, spherical = BatchSettings(), BatchSettings(coordinates="spherical", angle_unit="gon")
    fronted = BatchSettings(options=CaptureOptions(front=(1.0, 0.0, 0.0), of_clouds=True))
    assert plain.digest("folder") == spherical.digest("folder") != fronted.digest("folder")
    assert plain.digest("five-point") == fronted.digest("five-point")
    assert plain.digest("five-point") != spherical.digest("five-point")
    assert len({plain.settings_hash, spherical.settings_hash, fronted.settings_hash}) == 3
    bare = BatchSettings(target=read_targets("disc-250"))
    mixed = BatchSettings(target=read_targets("disc-250,FL=wheel"))
    assert len({one.digest("folder") for one in (plain, bare, mixed)}) == 3
    assert mixed.digest("five-point") == plain.digest("five-point")
    upright = BatchSettings(vertical="gravity")
    assert upright.digest("folder") != plain.digest("folder")
    assert upright.digest("five-point") == plain.digest("five-point")


def test_doubts_stand_in_the_row_of_a_capture(tmp_path):
    """Five points a wheel, left and right exchanged: measured, and nothing to be relied on."""
    file = five_points(tmp_path / "archive" / "car.txt", 1)
    blocks = np.array_split(file.read_text().splitlines(), 4)
    file.write_text("".join(f"{line}\n" for i in (1, 0, 3, 2) for line in blocks[i]))
    five_points(tmp_path / "archive" / "sound.txt", 2)
    done = run(tmp_path / "archive", tmp_path / "results")
    assert done.returncode == 0
    assert "      1 in doubt, left out of statistics: The frame's up points" in done.stdout
    assert "        such as car.txt\n" in done.stdout
    chosen = Selection("", ALL, None, ["list"], 9, 9)
    writer = Writer(load_translations("pt"), PAPER)
    with open_catalogue(str(tmp_path / "results")) as catalogue:
        rows = {row.name: row for row in captures(catalogue)}
        said = "\n".join(capture_table(catalogue))
        page = results_document(catalogue, chosen, writer).results[0]
    note = rows["car.txt"].reason
    assert (rows["car.txt"].status, rows["sound.txt"].reason) == ("ok", "")
    assert note.startswith("The frame's up points against z of the file")
    assert said.count(note) == 1
    translated = joined_notes_in(note, writer.words)
    assert translated != note
    assert f"car.txt: {translated}" in [part for part in page.parts if isinstance(part, str)]


def test_a_full_disk_and_too_little_memory_are_no_facts_of_a_capture(tmp_path, monkeypatch):
    subject = Subject(
        five_points(tmp_path / "car.txt", 1), "car.txt", "five-point", BatchSettings()
    )
    assert measure_bytes(subject).outcome == Outcome("ok")

    def full(_):
        try:
            raise OSError(errno.ENOSPC, "No space left on device", "/tmp/x")
        except OSError as error:
            raise InputError("the archive cannot be unpacked") from error

    def greedy(_):
        try:
            raise MemoryError
        except MemoryError:
            raise InputError("the cloud does not fit into memory") from None

    def wrong(_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("wheelplane.batch.run.measure_one._measure", full)
    with pytest.raises(TransientError, match="No space left"):
        measure_bytes(subject)
    monkeypatch.setattr("wheelplane.batch.run.measure_one._measure", greedy)
    with pytest.raises(MemoryError):
        measure_bytes(subject)
    monkeypatch.setattr("wheelplane.batch.run.measure_one._measure", wrong)
    result = measure_bytes(subject)
    assert result.outcome.status == "failed"
    assert "internal error (ZeroDivisionError" in result.outcome.reason
    assert "Traceback" in result.log


@pytest.mark.parametrize("name", ["car.txt", "n\udceb.txt", "bad.txt", 'é "q".txt'])
def test_the_rows_of_a_result_are_those_of_its_bytes(tmp_path, name):
    file = five_points(tmp_path / name, 1)
    if name == "bad.txt":
        file.write_text("1 2 3\n")
    settings = BatchSettings()
    result = measure_bytes(Subject(file, name, "five-point", settings, "key"))
    assert (result.outcome.status == "failed") == (name == "bad.txt")
    assert (result.tree is None) == (name == "n\udceb.txt")  # its name is written otherwise
    rows = read_record("key", result.data, result.tree)
    assert rows == read_record("key", result.data)
    assert rows.capture.status == result.outcome.status


def test_passing_faults_are_seen_through_their_consequences():
    assert transient_fault(InputError("x")) is None
    assert transient_fault(OSError(errno.EIO, "bad sector")) is None
    assert transient_fault(OSError(errno.ENOSPC, "full")) is not None
    assert stage_of(InputError("never raised")) == "read"


def test_every_room_of_a_stage_is_there_and_only_tools_have_none():
    named = {room for rooms in STAGES.values() for room in rooms.split()}
    modules = {name.partition(".")[2] for name in sources("pipeline")}
    assert named <= modules | {name.rpartition(".")[0] for name in modules}
    tools = {"errors", "vectors", "units", "config", "cloud", "targets", "system"}
    measuring = set(ROOMS[: ROOMS.index("measure") + 1])
    assert measuring - tools <= named
    assert not tools & named


def raised_in(*modules: str) -> BaseException:
    """A fault in the last of these modules, which called one another."""
    call = None
    for module in reversed(modules):
        scope = {"__name__": f"wheelplane.{module}", "inner": call}
        exec("def call(): inner() if inner else 1 / 0", scope)
        call = scope["call"]
    with pytest.raises(ZeroDivisionError) as caught:
        call()
    return caught.value


@pytest.mark.parametrize(
    ("modules", "stage"),
    [
        (("measure", "kinematics.steering_axis", "kinematics.wheel_axis"), "angles"),
        (("measure", "kinematics.toe_out_on_turns"), "angles"),
        (("measure", "measurement.residual_map"), "plane"),
        (("measure", "measurement.observe", "detection.find_target", "cloud.selection"), "segment"),
        (("measure", "measurement.observe", "centre.edge.fit_edge", "cloud.selection"), "centre"),
        (("readers.formats.ply",), "read"),
    ],
)
def test_a_fault_is_of_the_stage_whose_code_or_tool_it_is_in(modules, stage):
    assert stage_of(raised_in(*modules)) == stage


def test_a_front_given_for_many_captures_passes_over_those_with_a_scan_a_wheel(tmp_path):
    folder = tmp_path / "car"
    folder.mkdir()
    for wheel in ("rr", "rl", "fr", "fl"):
        (folder / f"{wheel}.xyz").write_text("0 0 0\n")
    overrides = CaptureOptions(front=(1.0, 0.0, 0.0))
    with (
        pytest.raises(InputError, match="--front is for a cloud"),
        open_capture(folder, "disc-250", overrides),
    ):
        pass
    of_clouds = CaptureOptions(front=(1.0, 0.0, 0.0), of_clouds=True)
    with open_capture(folder, "disc-250", of_clouds) as capture:
        assert capture.front is None
        with pytest.raises(InputError, match=r"rr\.xyz"):
            measure_capture(capture, Config())


class Script:
    """An engine that does what a script says: an outcome, or an error to raise, by name."""

    slots = 1

    def __init__(self, said) -> None:
        self.script, self.tasks = {name: list(each) for name, each in said.items()}, []

    def submit(self, task):
        from concurrent.futures import Future

        future: Future[list[CompletedCapture]] = Future()
        self.tasks.append(task)
        for found in task.captures:
            errors_left = self.script.get(found.name)
            if errors_left and task.outcome is None:
                future.set_exception(errors_left.pop(0))
                return future
        outcome = task.outcome or Outcome("ok")
        future.set_result([CompletedCapture(f.name, "", outcome, None, ()) for f in task.captures])
        return future

    def close(self) -> None:
        """Nothing to end."""


def outcomes(said, count=120, probe=lambda: 0.0):
    request = RunRequest("a", "r", BatchSettings())
    small = [FoundCapture(f"c{k}", "five-point", (Entry(f"c{k}", 10, ""),)) for k in range(count)]
    engine = Script(said)
    run = Run(tasks_of(request, small), engine, probe, lambda _: None)
    found = {done.name: done.outcome for done in run.outcomes()}
    assert len(found) == count
    return found, engine


def died(cause):
    return WorkerError(cause, f"it {cause}")


def test_of_several_together_only_the_guilty_one_is_put_aside():
    found, engine = outcomes({"c7": [died("crashed")] * 9})
    assert {name for name, outcome in found.items() if outcome.status != "ok"} == {"c7"}
    assert found["c7"] == Outcome("quarantined", "child", "it crashed")
    alone = [task for task in engine.tasks if [f.name for f in task.captures] == ["c7"]]
    assert len(alone) == 3  # twice measured, once written down
    assert max(len(task.captures) for task in engine.tasks) == MOST_TOGETHER


def test_who_is_killed_from_outside_is_not_blamed_at_once():
    found, _ = outcomes({"c7": [died("killed")] * 4})
    assert found["c7"].status == "ok"
    found, _ = outcomes({"c7": [died("killed")] * 5})
    assert found["c7"].status == "quarantined"
    found, _ = outcomes({"c7": [died("crashed"), died("too long")]})
    assert found["c7"].status == "ok"  # together, then alone


def test_what_cannot_be_read_is_a_row_and_what_cannot_be_written_ends_the_run(monkeypatch):
    monkeypatch.setattr("wheelplane.batch.run.tasks.FIRST_WAIT_S", 0.0)
    found, _ = outcomes({"c7": [ArchiveError("c7 is gone")] * 9})
    reason = "its files cannot be read from the archive: c7 is gone"
    assert found["c7"] == Outcome("failed", "read", reason)
    assert sum(outcome.status == "ok" for outcome in found.values()) == 119
    with pytest.raises(
        InputError, match=r"disk full \(run stopped; repeat the command to continue"
    ):
        outcomes({f"c{k}": [TransientError("disk full")] * 9 for k in range(120)})


def test_what_fails_while_the_storage_is_away_is_nobody_s_fault():
    """The storage answers again after each task was submitted."""
    away = {f"c{k}": [TransientError("away"), ArchiveError("away")] * 4 for k in range(120)}
    found, _ = outcomes(away, probe=time.monotonic)
    assert {outcome.status for outcome in found.values()} == {"ok"}
    found, _ = outcomes({"c7": [TransientError("disk full")] * 3})
    assert {outcome.status for outcome in found.values()} == {"ok"}


def test_small_captures_go_together_and_large_ones_alone():
    sizes = [10] * 70 + [10**6] * 2 + [10]
    captures = [
        FoundCapture(str(k), "five-point", (Entry(str(k), s, ""),)) for k, s in enumerate(sizes)
    ]
    tasks: list[Task] = list(tasks_of(RunRequest("a", "r", BatchSettings()), captures))
    assert sorted(len(task.captures) for task in tasks) == [1, 1, 21, 50]
    assert sorted(int(f.name) for task in tasks for f in task.captures) == list(range(73))


def test_a_record_is_that_of_a_result_while_its_file_is_the_same(tmp_path):
    store = open_store(str(tmp_path / "results"))
    tree = result("a")
    add(store, tree)
    key = tree["batch"]["key"]
    name = json_name(key)
    data = store.read(name)
    record = read_record(key, data)
    index = ResultIndex(store, "0" * 64, store, tmp_path / "index")
    index.load()
    stamp = store.stat(name).stamp
    pickled = pickle.dumps(record)
    index.add(CompletedCapture("a", key, Outcome("ok"), "f", (), pickled, stamp))
    assert index.record_of(key) == record
    assert index.record_of("0" * 64) is None
    store.write(name, data.replace(b'"car"', b'"bus"'))
    assert index.record_of(key) is None
    index.forget_records()
    index.add(CompletedCapture("a", key, Outcome("ok"), "f", (), pickled, store.stat(name).stamp))
    assert index.record_of(key) == record
    store.remove(name)
    assert index.record_of(key) is None


@pytest.mark.parametrize("most", [0, 5, 1000])
def test_the_catalogue_of_a_run_is_that_of_its_files(tmp_path, monkeypatch, most):
    """With the records of all at once, of some at a time, and of none of the results."""
    monkeypatch.setattr(result_index, "MOST_RECORDS", most)
    archive, results = archive_of(tmp_path / "archive", 12), tmp_path / "results"
    (archive / "bad.txt").write_text("no number\n")
    read, real = [], load_records
    monkeypatch.setattr(
        segments, "load_records", lambda s, keys: real(s, [read.append(k) or k for k in keys])
    )
    written = []  # files read by the end of an update; the list of results reads late ones again

    def counted(store, known):
        update(store, known=known)
        written.append(len(read))

    monkeypatch.setattr(batch_run, "update", counted)
    assert run(archive, results, "--workers", "1").returncode == 1
    # With five at a time: at the first update all 13 of the task are written, and five known; what
    # was written within the grain of time stamps before is read once more by the second.
    assert (len(written), written[0]) == {0: (1, 13), 5: (3, 8), 1000: (1, 0)}[most]
    made = (results / "catalogue.sqlite").read_bytes()
    rebuild(open_store(str(results)))
    assert (results / "catalogue.sqlite").read_bytes() == made
