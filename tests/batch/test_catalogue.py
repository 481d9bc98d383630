"""The catalogue: an index of the results' JSONs, and of nothing else."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
import time
import zlib
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.support.records import add, key_of, place, result, text
from wheelplane.batch.catalogue import catalogue as catalogue_module
from wheelplane.batch.catalogue import segments, sqlite_file
from wheelplane.batch.catalogue.calibration_row import CalibrationRow, calibration_row
from wheelplane.batch.catalogue.catalogue import FILE, open_catalogue, rebuild, update
from wheelplane.batch.catalogue.changes import (
    GRAIN_NS,
    ObjectComparison,
    in_folder,
    in_storage,
)
from wheelplane.batch.catalogue.columns import captures_of, column_of, renew_columns
from wheelplane.batch.catalogue.history import (
    REMOVED,
    is_retried,
    read_removed,
    retried,
    write_removed,
)
from wheelplane.batch.catalogue.rows import (
    CaptureRow,
    QuantityRow,
    Record,
    WheelRow,
    read_record,
)
from wheelplane.batch.catalogue.schema import TABLES, create, number_of, put
from wheelplane.batch.catalogue.segments import Segments
from wheelplane.batch.catalogue.sqlite_file import (
    mark_verified,
    open_sqlite_file,
    write_sqlite_file,
)
from wheelplane.batch.results.query import capture_of, captures, count, quantities_of, wheels_of
from wheelplane.batch.storage.entry import PARTIAL, Entry
from wheelplane.batch.storage.store import open_store
from wheelplane.errors import InputError
from wheelplane.system import acquire

ROOT = Path(__file__).resolve().parents[2]


def some(n: int, start: int = 0) -> list[dict]:
    """Results that differ in all that a catalogue holds."""
    made = []
    for i in range(start, start + n):
        status = ("ok", "ok", "ok", "part", "failed")[i % 5]
        expected = {"date": f"2026-0{1 + i % 9}-11", "status": status, "vehicle": f"car {i % 3}"}
        values = {} if status == "failed" else {"RR_toe": 0.01 * i, "rear_total_toe_deg": 0.1 * i}
        why = {"stage": "plane", "reason": f"only {i} points"} if status == "failed" else {}
        made.append(result(f"day {i % 4}/capture {i}", **expected, **values, **why))
    return made


def shown(results: Path | str) -> list:
    with open_catalogue(str(results)) as catalogue:
        return list(captures(catalogue))


def digest(folder: Path) -> str:
    return hashlib.sha256((folder / FILE).read_bytes()).hexdigest()


@pytest.fixture
def store(tmp_path):
    """A local store with forty results and no catalogue."""
    store = open_store(str(tmp_path / "results"))
    add(store, *some(40))
    return store


def test_every_field_of_a_json_is_found_again(tmp_path):
    store = open_store(str(tmp_path))
    tree = result(
        "a/b", date="2026-11-20T12:00:00+02:00", RR_toe=(0.25, 0.004), wheelbase_left_m=(2.5, 1e-5)
    )
    add(store, tree)
    with open_catalogue(str(tmp_path)) as catalogue:
        (row,) = captures(catalogue)
        assert (row.key, row.name, row.kind, row.vehicle) == (
            key_of("a/b"),
            "a/b",
            "five-point",
            "car",
        )
        assert (row.status, row.stage, row.reason) == ("ok", "", "")
        assert row.date == "2026-11-20T12:00:00+02:00"
        assert row.day == pytest.approx(20777 + 10 / 24, abs=1e-9)
        assert row.wheels == row.wheels_ok == len(tree["wheels"]) > 4
        assert row.points_total == sum(w["points_total"] for w in tree["wheels"])
        assert row.version == tree["provenance"]["version"]
        assert row == capture_of(catalogue, row.key)
        assert capture_of(catalogue, "f" * 64) is capture_of(catalogue, "no key") is None
        for wheel, expected in zip(wheels_of(catalogue, row.key), tree["wheels"], strict=True):
            for name in ("name", "role", "wheel", "status", "toe_deg", "camber_deg", "u_toe_deg"):
                assert getattr(wheel, name) == expected[name]
            assert (wheel.u_camber_deg, wheel.plane_rms_m) == (
                expected["u_camber_deg"],
                expected["plane_rms_m"],
            )
            assert wheel.points_on_target == expected["points_on_target"]
        quantities = {q.kind: q for q in quantities_of(catalogue, row.key)}
        assert (quantities["wheelbase_left"].value, quantities["wheelbase_left"].u) == (2.5, 1e-5)
        assert quantities["wheelbase_left"].unit == "m"
        assert quantities["wheelbase"].value == tree["frame"]["wheelbase_m"]
        names = {key.rpartition("_")[0] for key in tree["vehicle"] if not key.startswith("u_")}
        assert set(quantities) >= {n for n in names if f"u_{n}_deg" in tree["vehicle"]}


def test_the_same_jsons_give_the_same_bytes_whatever_the_way_there(store, tmp_path):
    rebuild(store)
    expected = digest(store.local)
    trees = some(40)
    for seed in range(3):
        folder = tmp_path / f"other {seed}"
        other = open_store(str(folder))
        order = random.Random(seed).sample(trees, len(trees))
        strangers = [tree | {"vehicle": {"oddity_m": 1.0}} for tree in some(7, start=100)]
        add(other, *order[:11], *strangers)
        update(other)
        add(other, *order[11:12])
        update(other)
        add(other, {**order[12], "vehicle_name": "mistaken"}, *order[13:])
        update(other)
        assert digest(folder) != expected
        for tree in strangers:
            other.remove(place(tree["batch"]["key"]))
        add(other, order[12])
        assert update(other) == len(strangers) + 1
        assert digest(folder) == expected
        rebuild(other)
        assert digest(folder) == expected


def test_an_update_reads_only_what_changed(store, monkeypatch):
    rebuild(store)
    read = []
    real = catalogue_module.load_changed_records
    monkeypatch.setattr(
        catalogue_module,
        "load_changed_records",
        lambda s, c, p, k: read.extend(c.read) or real(s, c, p, k),
    )
    time.sleep(2 * GRAIN_NS * 1e-9)  # what was written just before is looked at once more
    update(store)
    read.clear()
    assert (update(store), read) == (0, [])
    new, changed = some(1, start=50)[0], some(40)[3] | {"vehicle_name": "another"}
    add(store, new, changed)
    gone = some(40)[8]["batch"]["key"]
    store.remove(place(gone))
    assert update(store) == 3
    assert sorted(read) == sorted(tree["batch"]["key"] for tree in (new, changed))
    rows = {row.key: row for row in shown(store.local)}
    assert rows[changed["batch"]["key"]].vehicle == "another"
    assert gone not in rows
    assert len(rows) == 40


def test_results_moved_in_with_their_old_dates_are_found(store, tmp_path):
    rebuild(store)
    other = open_store(str(tmp_path / "other"))
    add(other, *some(30, start=200))
    long_ago = time.time() - 1e6
    for path in sorted((tmp_path / "other").rglob("*"), reverse=True):
        os.utime(path, (long_ago, long_ago))
    shutil.copytree(
        tmp_path / "other" / "measurements", store.local / "measurements", dirs_exist_ok=True
    )
    assert len(shown(store.local)) == 70


def calibrated(kind: str, state: str, error: object, *mpes: float | None) -> dict:
    """Calibration of a quantity whose points have one error and these permissible ones."""
    points = [
        {"point": at, "error": {"value_deg": error}, "mpe_deg": mpe} for at, mpe in enumerate(mpes)
    ]
    return {"quantity": kind, "state": state, "points": points}


LONG, DEEP = b"9" * 400, b"[" * 990 + b"]" * 990


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda data: data[: len(data) // 2], "not JSON, or incomplete"),
        (lambda data: b"", "not JSON, or incomplete"),
        (lambda data: data[:-200] + b"\0" * 200, "zero byte"),
        (lambda data: data.replace(b"five-point", b"five-\xff\xfeint", 1), "not UTF-8"),
        (lambda data: data.replace(b'"toe_deg": ', b'"toe_deg": "high", "x": ', 1), "not a number"),
        (
            lambda data: data.replace(b'"toe_deg": ', b'"toe_deg": ' + LONG + b', "x": ', 1),
            "not a number",
        ),
        (
            lambda data: data.replace(b'"wheels": [', b'"wheels": [{"points_total": 1e30}, '),
            "1e+30",
        ),
        (lambda data: data.replace(b'"wheels": [', b'"wheels": [' + DEEP + b", "), "not JSON"),
        (lambda data: data.replace(b"measurement/1", b"measurement/9"), "schema"),
        (lambda data: b"[1, 2]\n", "schema None"),
        (lambda data: b'{"schema": "wheelplane/measurement/1"}', "`wheels` or `batch` is missing"),
        (lambda data: data.replace(b'"key": "', b'"key": "0'), "contains the result"),
        (lambda data: data.replace(b'"date": null', b'"date": "tomorrow"'), "not ISO 8601"),
        (lambda data: data.replace(b'"wheels": [', b'"wheels": [7, '), "wheel is not an object"),
        (lambda data: data.replace(b'"capture": "', b'"capture": "\\udceb'), "not Unicode"),
        (
            lambda data: data.replace(b'"vehicle": {', b'"vehicle": {"\\ud800_m": 1.0, ', 1),
            "quantity is '\\ud800', not Unicode",
        ),
    ],
)
def test_a_damaged_json_is_reported_and_the_rest_is_there(store, spoil, reason):
    key = key_of("bad")
    store.write(place(key), spoil(text(result("bad"))))
    assert rebuild(store) == 41
    rows = shown(store.local)
    (bad,) = [row for row in rows if row.status == "damaged"]
    assert (bad.key, bad.stage) == (key, "catalogue")
    assert reason in bad.reason
    assert sum(row.status == "ok" for row in rows) == 24
    store.write(place(key), text(result("bad")))
    assert "damaged" not in {row.status for row in shown(store.local)}


@pytest.mark.parametrize(
    "spoilt",
    [
        {"item": {"serial": "\ud800", "maker": "", "model": ""}},
        {"item": {"serial": "7", "maker": "\ud800", "model": ""}},
        {"item": {"serial": "7", "maker": "", "model": "\ud800"}},
        {"error": "\ud800"},
        {"decision": "\ud800"},
        {"decision": ["conform"]},
        {"quantities": [calibrated("toe", "as found", 10**400, 1.0)]},
        {"quantities": [calibrated("toe", "as found", 1.0, 0.0)]},
        {"quantities": [calibrated("toe", "as found", "1.0", 1.0)]},
        {"quantities": [calibrated("\ud800", "as found", 1.0, 1.0)]},
        {"quantities": None},
    ],
)
def test_a_damaged_calibration_is_reported_and_the_rest_is_there(store, spoilt):
    whole = {"item": {"serial": "7", "maker": "a", "model": "b"}, "decision": None}
    tree = result("bad") | {"calibration": whole | {"quantities": []} | spoilt}
    store.write(place(key_of("bad")), json.dumps(tree).encode())
    assert rebuild(store) == 41
    with open_catalogue(str(store.local)) as catalogue:
        ((name, error),) = catalogue.connection.execute("SELECT name, error FROM calibrations")
        assert (name, error[:30]) == ("bad", "no calibration of this program")
        assert count(catalogue) == 41


def test_a_calibration_counts_as_it_was_left():
    found, left = "as found", "as left"
    quantities = [
        calibrated("toe", found, -9.0, 2.0),
        calibrated("camber", found, -3.0, 2.0, 0.5),
        calibrated("toe", left, 1.0, 2.0, None),
    ]
    item = {"serial": 7, "maker": "a", "model": "b"}
    row = calibration_row({"item": item, "decision": "undecided", "quantities": quantities})
    assert row == CalibrationRow("7", "a", "b", "undecided", 4, 6.0, "camber 1")
    failed = calibration_row({"item": None, "error": "no readings"})
    assert failed == CalibrationRow(error="no readings")
    assert (failed.points, failed.worst) == (0, None)
    assert calibration_row(None) is None


def test_what_is_no_result_is_left_alone(store):
    before = len(shown(store.local))
    for name in ("measurements/ab/notes.txt", f"measurements/00/{'f' * 64}.json", "measurements/x"):
        store.write(name, b"{}")
    assert len(shown(store.local)) == before


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.write_bytes(path.read_bytes()[:-4096]),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(b"SQLite format 3\0" + b"junk" * 2000),
        lambda path: path.write_bytes(flipped(path.read_bytes())),
        lambda path: foreign(path),
        lambda path: path.unlink(),
        lambda path: kept_time(path, path.read_bytes()[:-4096]),
        lambda path: kept_time(path, path.read_bytes() + bytes(4096)),
        lambda path: kept_time(path, flipped(path.read_bytes()), 10**9),
    ],
)
def test_a_damaged_or_foreign_catalogue_is_rebuilt(store, spoil):
    rebuild(store)
    expected = digest(store.local)
    spoil(store.local / FILE)
    assert len(shown(store.local)) == 40
    assert digest(store.local) == expected


def flipped(data: bytes) -> bytes:
    """One bit of one name changed, which SQLite itself would not notice."""
    at = data.index(b"capture 7")
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def kept_time(path: Path, data: bytes, whole_ns: int = 1) -> None:
    """Replace the content, as a copy of a damaged file with its time, in units of whole_ns."""
    time_ns = path.stat().st_mtime_ns // whole_ns * whole_ns
    path.write_bytes(data)
    os.utime(path, ns=(time_ns, time_ns))


def test_a_catalogue_to_which_nothing_was_written_is_not_read_whole(store, monkeypatch):
    rebuild(store)
    with monkeypatch.context() as patch:
        patch.setattr(sqlite_file, "_checksums", lambda path: pytest.fail("read whole"))
        for _ in range(2):
            assert len(shown(store.local)) == 40
    (store.local / FILE).touch()
    read = []
    real = sqlite_file._checksums
    monkeypatch.setattr(sqlite_file, "_checksums", lambda path: read.append(path) or real(path))
    for _ in range(3):
        assert len(shown(store.local)) == 40
    assert len(read) == 1


@pytest.mark.parametrize("page", [512, 4096, 65536])  # the header states the largest as 1
def test_a_catalogue_of_any_size_of_page_bears_its_mark_while_it_is_whole(tmp_path, page):
    path, connection = tmp_path / FILE, sqlite3.connect(":memory:", isolation_level=None)
    connection.executescript(f"PRAGMA page_size = {page}; {TABLES}")
    sqlite_file.write_sqlite_file(connection, path)
    data = path.read_bytes()
    assert len(data) % page == 0
    sqlite_file.mark_verified(path, time.time_ns())
    assert sqlite_file._bears_mark(path)
    for spoilt in (data[:-page], data + bytes(page), data[:-1]):
        kept_time(path, spoilt)
        assert not sqlite_file._bears_mark(path)


def test_a_mark_is_of_its_checksum_and_never_the_time_of_a_whole_millisecond():
    marks = {sqlite_file._mark(checksum) for checksum in range(0, 2**32, 99_991)}
    assert marks == set(range(1, sqlite_file.MARKS))


def foreign(path: Path) -> None:
    path.unlink()
    other = sqlite3.connect(path)
    other.execute("CREATE TABLE captures(key)")
    other.commit()
    other.close()


KILLED = """
import os, signal, sys
from pathlib import Path
from wheelplane.batch.catalogue import catalogue
from wheelplane.batch.storage.store import open_store
name = sys.argv[2]
real = getattr(catalogue, name)
def killed(*arguments):
    if name == "put":
        real(*arguments)
    os.kill(os.getpid(), signal.SIGKILL)
setattr(catalogue, name, killed)
catalogue.update(open_store(sys.argv[1]))
"""


@pytest.mark.parametrize("moment", ["put", "write_sqlite_file", "_publish"])
def test_a_catalogue_outlives_a_writer_killed_at_any_moment(store, moment):
    rebuild(store)
    expected = digest(store.local)
    add(store, *some(5, start=60))
    run = subprocess.run(
        [sys.executable, "-c", KILLED, str(store.local), moment], cwd=ROOT, check=False
    )
    assert run.returncode == -signal.SIGKILL
    assert digest(store.local) == expected
    assert len(list((store.local / PARTIAL).iterdir())) > 1  # so it was at work
    assert len(shown(store.local)) == 45
    assert [e.name for e in store.list() if not e.name.startswith("measurements/")] == [FILE]


WRITER = """
import sys
from wheelplane.batch.catalogue.catalogue import update
from wheelplane.batch.storage.store import open_store
from tests.batch.test_catalogue import some
from tests.support.records import add
store = open_store(sys.argv[1])
for i in range(30):
    add(store, *some(2, start=1000 + 2 * i))
    update(store)
"""


@pytest.mark.slow
def test_readers_see_whole_catalogues_while_a_runner_writes(store):
    rebuild(store)
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(store.local)], cwd=ROOT)
    seen = set()
    while writer.poll() is None:
        rows = shown(store.local)
        assert len({row.key for row in rows}) == len(rows)
        seen.add(len(rows))
    assert writer.returncode == 0
    assert len(shown(store.local)) == 100
    assert min(seen) >= 40
    assert len(seen) > 3  # so there was something to be seen


def test_an_open_catalogue_stays_as_it_was(store):
    with open_catalogue(str(store.local)) as catalogue:
        add(store, *some(3, start=70))
        update(store)
        assert count(catalogue) == 40
    assert len(shown(store.local)) == 43


def test_a_folder_without_results_is_reported_in_one_line(tmp_path):
    with pytest.raises(InputError, match="no results found: give the folder"):
        open_catalogue(str(tmp_path))
    with pytest.raises(InputError, match="no results found: give the folder"):
        rebuild(open_store(str(tmp_path / "mistyped")))
    assert list(tmp_path.iterdir()) == []


def test_names_of_captures_that_left_the_archive_are_kept_as_they_are_written(tmp_path):
    store, names = open_store(str(tmp_path)), ["São Paulo/März 1.zip", 'a "b".txt', "back\\slash"]
    write_removed(store, names)
    assert read_removed(store) == names
    assert names[0] in store.read(REMOVED).decode()


def test_results_that_cannot_be_written_to_can_be_read(store, monkeypatch):
    """As on a read-only disk; permissions do not stop root, who may run the tests."""
    monkeypatch.setattr(catalogue_module, "_lock_file", lambda _: None)
    assert len(shown(store.local)) == 40
    assert not (store.local / FILE).exists()
    with pytest.raises(InputError, match="not writable"):
        update(store)


def test_a_full_disk_is_reported_and_leaves_no_drafts(store, monkeypatch):
    rebuild(store)
    expected = digest(store.local)
    add(store, *some(1, start=40))

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    for owner, name in ((Path, "touch"), (shutil, "copyfile"), (os, "fsync")):
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, full)
            with pytest.raises(InputError, match=r"cannot be written \(No space left"):
                update(store)
        assert digest(store.local) == expected
        assert [path.name for path in (store.local / PARTIAL).iterdir()] == [catalogue_module.LOCK]
    assert update(store) == 1


def test_only_a_rebuild_reads_what_was_changed_in_place(store):
    time.sleep(2 * GRAIN_NS * 1e-9)
    rebuild(store)
    tree = some(40)[0]
    path = store.local / place(tree["batch"]["key"])
    path.write_bytes(text(tree | {"vehicle_name": "changed in place"}))
    assert update(store) == 0
    assert rebuild(store) == 40
    assert "changed in place" in {row.vehicle for row in shown(store.local)}


ANGLES = ("toe_deg", "camber_deg", "u_toe_deg", "u_camber_deg")
NO_PATCH = {"points_on_target": None, "plane_rms_m": None}


def test_captures_at_the_bounds_of_parts_are_in_one_each(tmp_path):
    keys = [head + 62 * digit for head in ("00", "01", "02", "fe", "ff") for digit in "0f"]
    keys += [f"01{'0' * 12}{digit}{'0' * 49}" for digit in "12"]
    angles = [dict(zip(ANGLES, (i, 5.0 + i, 0.1 * i, 0.2 * i), strict=True)) for i in range(99)]
    records = [
        Record(
            CaptureRow(key, day=float(i)),
            (WheelRow("RR", "reference", "RR", "ok", **angles[i], **NO_PATCH),),
            (QuantityRow("span", 2.0 * i, i, "m"),),
        )
        for i, key in enumerate(keys)
    ]
    with closing(create(tmp_path / FILE)) as connection:
        assert put(connection, records) == len(keys)
        assert put(connection, records) == 0
        renew_columns(connection, map(number_of, keys))
        ids, days = captures_of(connection)
        column = column_of(connection, "span", "m", ids)
        toe, camber = (
            column_of(connection, f"RR {kind}", "deg", ids) for kind in ("toe", "camber")
        )
    order = sorted(range(len(keys)), key=keys.__getitem__)
    assert ids.tolist() == [int(keys[i][:15], 16) for i in order]
    assert days.tolist() == order
    assert column.tolist() == [[2.0 * i for i in order], order]
    assert toe.tolist() == [order, [0.1 * i for i in order]]
    assert camber.tolist() == [[5.0 + i for i in order], [0.2 * i for i in order]]


@pytest.mark.parametrize("having", [("01",), ("00", "fe"), ("02", "ff"), ("00",), ()])
def test_captures_of_parts_without_a_quantity_are_without_it(tmp_path, monkeypatch, having):
    keys = [head + 62 * digit for head in ("00", "01", "02", "fe", "ff") for digit in "0f"]
    span = {key: float(i) for i, key in enumerate(keys) if key[:2] in having}
    records = [
        Record(
            CaptureRow(key),
            (),
            tuple(QuantityRow("span", span[key], 0.1, "m") for _ in range(key in span)),
        )
        for key in keys
    ]
    with closing(create(tmp_path / FILE)) as connection:
        put(connection, records)
        renew_columns(connection, map(number_of, keys))
        ids, _ = captures_of(connection)
        monkeypatch.setattr(np, "empty", lambda shape: np.full(shape, 7.0))  # as it may be
        values, u = column_of(connection, "span", "m", ids)
    np.testing.assert_array_equal(values, [span.get(key, np.nan) for key in keys])
    np.testing.assert_array_equal(u, [0.1 if key in span else np.nan for key in keys])


def test_keys_that_collide_are_refused_and_one_alone_is_replaced(tmp_path):
    one, other = "a" * 64, "a" * 15 + "b" * 49
    with closing(create(tmp_path / FILE)) as connection:
        assert put(connection, [Record(CaptureRow(one, md5="1"))]) == 1
        assert put(connection, [Record(CaptureRow(one, "again", md5="2"))]) == 1
        with pytest.raises(InputError, match=f"keys {one} and {other} collide"):
            put(connection, [Record(CaptureRow(other, md5="2"))])
        assert connection.execute("SELECT key, name FROM captures").fetchall() == [(one, "again")]


def read_changed(**changes: object) -> Record:
    """Record of a result some of whose sections are others."""
    tree = result("one") | changes
    return read_record(key_of("one"), text(tree))


@pytest.mark.parametrize(
    ("kind", "files", "points", "total"),
    [
        ("cloud", "aaa", [5, 9, 7], 9),
        ("cloud", ["a: 1", "a: 2", "b"], [5, 5, 7], 12),
        ("folder", "abc", [5, 9, 7], 21),
        ("folder", ["a", "b", "a"], [5, 9, 5], 14),
        ("folder", ["a: 1", "a: 2"], [5, 9], 14),
        ("five-point", "aaa", [5, 5, 5], 15),
        ("cloud", "aa", [None, 3], 3),
        ("folder", "ab", [None, 3], 3),
        ("folder", "ab", [0, 1], 1),
        ("cloud", "", [], 0),
        ("folder", "", [], 0),
        ("folder", "ab", [2**53 - 1, 1], 2**53),
    ],
)
def test_points_of_a_scan_count_once(kind, files, points, total):
    """Those of a cloud of all wheels, and those of a scan of a wheel and of its run-out."""
    batch = result("one")["batch"] | {"kind": kind}
    wheels = [
        {"name": f"{k}", "file": file, "points_total": count}
        for k, (file, count) in enumerate(zip(files, points, strict=True))
    ]
    record = read_changed(wheels=wheels, batch=batch)
    assert (record.capture.points_total, record.capture.status) == (total, "ok")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"frame": [1]}, "`frame` or `vehicle` is not an object"),
        ({"vehicle": [1]}, "`frame` or `vehicle` is not an object"),
        ({"wheels": {}}, "`wheels` or `batch` is missing"),
        ({"batch": []}, "`wheels` or `batch` is missing"),
        ({"wheels": [{"toe_deg": True}]}, "`toe_deg` is True, not a number"),
        ({"wheels": [{"points_total": -1}]}, "`points_total` is -1, no number of points"),
        ({"wheels": [{"points_total": 2**53}]}, "no number of points"),
        (
            {"wheels": [{"name": name, "points_total": 2**53 - 1} for name in "ab"]},
            f"hold {2**54 - 2} points",
        ),
        ({"capture": 7}, "`capture` is 7, not text"),
        ({"provenance": {"inputs": [1]}}, "`inputs` is not an object of texts"),
        ({"provenance": {"inputs": {"a": 1}}}, "`inputs` is not an object of texts"),
        ({"doubts": 5}, "`doubts` is not a list of objects"),
        ({"doubts": {"trial": None}}, "`doubts` is not a list of objects"),
        ({"doubts": ["mirrored"]}, "`doubts` is not a list of objects"),
    ],
)
def test_a_section_of_another_kind_is_damage(changes, reason):
    record = read_changed(**changes)
    row = record.capture
    assert (row.status, record.wheels, record.quantities) == ("damaged", (), ())
    assert (row.wheels, row.wheels_ok, row.points_total, row.doubted) == (0, 0, 0, 0)
    assert reason in row.reason


def test_rows_are_those_of_the_json_whether_its_tree_is_known_or_not():
    doubts = [{"trial": "1", "reason": "far"}, {"trial": None, "reason": "mirrored"}]
    calibration = {"item": None, "error": "no readings"}
    changed = {"doubts": doubts, "calibration": calibration, "vertical_in_use": "gravity"}
    for tree in (*some(5), result("in doubt") | changed, result("trial") | {"doubts": doubts[:1]}):
        key, data = tree["batch"]["key"], text(tree)
        record = read_record(key, data)
        assert record == read_record(key, data, tree)
        assert record.capture.version
        assert record.capture.doubted == (tree["capture"] == "in doubt")


def test_quantities_are_those_with_a_name_and_a_unit():
    vehicle = {"toe_deg": 1.0, "u_toe_deg": 0.1, "_deg": 2.0, "roll_rad": 3.0, "note": "x"}
    record = read_changed(frame=None, vehicle=vehicle)
    assert record.quantities == (QuantityRow("toe", 1.0, 0.1, "deg"),)
    frame = {"wheelbase_m": 2.5, "u_wheelbase_m": 0.001}
    of_frame = {q.kind: (q.value, q.u) for q in read_changed(frame=frame, vehicle={}).quantities}
    assert of_frame["wheelbase"] == (2.5, 0.001)
    assert read_changed(frame={}, vehicle={}).quantities == ()


def test_a_vertical_is_that_of_the_wheels():
    assert read_changed(vertical_in_use="gravity").capture.vertical == "gravity"
    assert read_changed(vertical_in_use=None).capture.vertical == "wheels"
    assert read_changed(vertical_in_use="gravity", wheels=[]).capture.vertical == ""


def test_each_byte_of_the_header_is_under_the_checksum(tmp_path):
    path = tmp_path / FILE
    connection = create(tmp_path / "draft")
    put(connection, [Record(CaptureRow("a" * 64))])
    write_sqlite_file(connection, path)
    whole = path.read_bytes()
    assert int.from_bytes(whole[60:64], "big") == zlib.crc32(whole[:60] + whole[64:])
    of_history = [int.from_bytes(whole[at : at + 4], "big") for at in (24, 40, 92, 96)]
    assert of_history == [1, 1, 1, 3_040_000]
    for at in range(sqlite_file.HEADER):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert open_sqlite_file(path) is None
    path.write_bytes(whole)
    catalogue = open_sqlite_file(path)
    assert catalogue is not None
    with closing(catalogue), ThreadPoolExecutor(1) as other_thread:
        rows = other_thread.submit(lambda: catalogue.execute("SELECT key FROM captures").fetchall())
        assert rows.result() == [("a" * 64,)]
    for time_ns in (10**18, 10**18 + 1, 10**18 + 999_999):
        mark_verified(path, time_ns)
        assert time_ns - 2_000_000 < path.stat().st_mtime_ns < time_ns


@pytest.mark.parametrize(
    ("retry", "statuses"),
    [
        ("failed", {"failed", "quarantined", "damaged"}),
        ("quarantined", {"quarantined"}),
        ("part", {"part"}),
        ("ok", {"ok"}),
        ("day 2/capture 2", set()),
    ],
)
def test_a_retry_measures_what_has_the_status_or_the_name(store, retry, statuses):
    trees = [*some(40), result("suspect", status="quarantined")]
    add(store, trees[-1])
    store.write(place(key_of("bad")), b"{}")
    batches = [(tree["batch"]["key"], tree["batch"]["status"], tree["capture"]) for tree in trees]
    batches.append((key_of("bad"), "damaged", ""))
    expected = {key for key, status, name in batches if status in statuses or name == retry}
    assert expected
    assert set(retried(store, retry)) == expected
    assert {row.key for row in shown(store.local) if is_retried(row, retry)} == expected


def test_a_retry_of_nothing_is_refused_unless_it_is_a_status(tmp_path, store):
    assert retried(store, "quarantined") == []
    with pytest.raises(InputError, match=r"--retry capture 2: .* has no result of this name"):
        retried(store, "capture 2")
    assert retried(open_store(str(tmp_path / "none")), "capture 2") == []


def test_the_catalogue_of_a_run_without_results_yet_is_empty(tmp_path):
    store = open_store(str(tmp_path / "new" / "results"))
    assert update(store) == 0
    add(store, *some(2))
    assert update(store) == 2


def test_changes_in_a_folder_are_those_since_the_update(store):
    keys = sorted(add_some(store, 60))
    update(store)
    pairs = [two for two in pairwise(keys) if two[0][:2] == two[1][:2]]
    (replaced, beside), root = pairs[0], store.local / "measurements"
    time.sleep(0.1)
    since_ns = time.time_ns()
    updated_ns = since_ns + GRAIN_NS
    with closing(open_sqlite_file(store.local / FILE)) as current:
        assert not in_folder(store.local, current, updated_ns)
        store.write(place(replaced), b"{}")
        assert root.stat().st_ctime_ns < since_ns
        at_ns = (store.local / place(replaced)).stat().st_ctime_ns
        for known_ns in (updated_ns, at_ns + 1, at_ns + GRAIN_NS):
            found = in_folder(store.local, current, known_ns)
            assert (found.read, found.removed) == ([replaced], [])
        (store.local / place(beside)).unlink()
        assert in_folder(store.local, current, updated_ns).removed == [beside]
        shutil.rmtree(root)
        assert in_folder(store.local, current, updated_ns).removed == keys


def add_some(store, n: int) -> list[str]:
    trees = some(n)
    add(store, *trees)
    return [tree["batch"]["key"] for tree in trees]


def test_only_keys_in_their_places_are_read(store, remote):
    trees = some(3)
    add(remote, *trees)
    for name in ("ab/notes.txt", "ab/abnotes", f"00/{'f' * 64}.json", f"00/{'0' * 63}.json"):
        store.write(f"measurements/{name}", b"{}")
        remote.write(f"measurements/{name}", b"{}")
    expected = sorted(tree["batch"]["key"] for tree in some(40))
    assert in_folder(store.local, None, 0).read == expected
    assert in_storage(remote, None).read == sorted(tree["batch"]["key"] for tree in trees)


def test_progress_is_reported(store):
    expected = []
    rebuild(store, lambda done, total: expected.append((done, total)))
    assert expected == [(i, 40) for i in range(1, 41)]


@pytest.mark.slow
def test_a_catalogue_in_object_storage(remote, tmp_path, monkeypatch):
    trees = some(20)
    with pytest.raises(InputError, match="no results found"):
        open_catalogue(remote.url)
    add(remote, *trees)
    assert len(shown(remote.url)) == 20
    assert not remote.exists(FILE)  # a reader writes nothing
    assert update(remote) == 20
    read = []
    monkeypatch.setattr(type(remote), "read", spied(type(remote).read, read))
    assert (update(remote), read) == (0, [])
    changed = trees[3] | {"vehicle_name": "another"}
    add(remote, changed, *some(1, start=50))
    remote.remove(place(trees[8]["batch"]["key"]))
    assert update(remote) == 3
    assert len(read) == 2
    local = open_store(str(tmp_path / "copy"))
    for entry in remote.list("measurements/"):
        local.write(entry.name, remote.read(entry.name))
    rebuild(local)
    assert remote.read(FILE) == (tmp_path / "copy" / FILE).read_bytes()


def test_a_reader_of_object_storage_sees_what_is_there_and_writes_nothing(remote):
    for stop in (2, 3):  # without a catalogue, and with an older one
        add(remote, *some(stop))
        before = {entry.name for entry in remote.list()}
        assert len(shown(remote.url)) == stop
        assert {entry.name for entry in remote.list()} == before
        update(remote)


class Objects:
    """Store of one content, which counts how often it is read."""

    def __init__(self, data: bytes) -> None:
        self.data, self.reads = data, 0

    def read(self, _: str) -> bytes:
        self.reads += 1
        return self.data


@pytest.mark.parametrize("etags_are_md5", [True, False])
def test_an_object_is_unchanged_by_its_size_and_by_its_sum_where_that_is_one(etags_are_md5):
    data, other = b"content", b"CONTENT"
    of = {each: hashlib.md5(each).hexdigest() for each in (data, other)}
    objects = Objects(other)
    compare = ObjectComparison(objects)
    entry = Entry("a", len(other), of[other] if etags_are_md5 else "0" * 32)
    assert compare(entry, len(other), of[other])
    assert compare(entry, len(data), of[data]) != etags_are_md5
    assert compare(entry, len(data), "") != etags_are_md5
    for size in (None, len(data) + 1):
        assert not compare(entry, size, of[data])
        assert not compare(entry, size, of[other])
        assert not compare(entry, size, entry.stamp)
    assert objects.reads == 1


@pytest.mark.parametrize("first", [True, False])
def test_of_writers_to_object_storage_none_undoes_the_work_of_another(remote, monkeypatch, first):
    """Another process publishes a result while this one makes its catalogue, and again."""
    add(remote, *some(2))
    if not first:
        update(remote)
    add(remote, *some(1, start=20))
    real, others = catalogue_module._draft, [30, 31]

    def overtaken(*arguments):
        differing = real(*arguments)
        if others:
            number = others.pop()
            with monkeypatch.context() as patch:
                patch.setattr(catalogue_module, "_draft", real)
                add(remote, *some(1, start=number))
                assert update(remote) > 0
        return differing

    monkeypatch.setattr(catalogue_module, "_draft", overtaken)
    update(remote)
    published = remote.read(FILE)
    monkeypatch.setattr(catalogue_module, "_draft", real)
    rebuild(remote)
    assert published == remote.read(FILE)
    assert len(shown(remote.url)) == 5
    assert not [path for path in remote._fs.find("cars/results") if "lock" in path]


def test_a_catalogue_whose_answer_was_lost_is_published_once(remote):
    add(remote, *some(2))
    update(remote)
    add(remote, *some(1, start=20))
    real, lost = remote._fs, []

    class Losing:
        def __getattr__(self, name):
            return getattr(real, name)

        def call_s3(self, method, **options):
            done = real.call_s3(method, **options)
            if method == "put_object" and not lost:
                lost.append(method)
                raise TimeoutError("late")
            return done

    remote._opened = os.getpid(), Losing()
    update(remote)
    published = remote.read(FILE)
    assert lost
    assert update(remote) == 0
    rebuild(remote)
    assert remote.read(FILE) == published


def test_storage_without_conditions_takes_the_last_catalogue(remote, tmp_path, monkeypatch):
    monkeypatch.setattr(remote, "_exclusive", False)
    add(remote, *some(2))
    assert update(remote) == 2
    remote._fs.pipe_file("cars/results/other", b"1")
    (tmp_path / "file").write_bytes(b"2")
    assert remote.send("other", tmp_path / "file", "of an older one")
    assert remote.read("other") == b"2"


def spied(real, names: list[str]):
    def read(self, name: str) -> bytes:
        names.append(name)
        return real(self, name)

    return read


def test_where_an_etag_is_no_md5_the_size_decides(remote, monkeypatch):
    trees = some(6)
    add(remote, *trees)
    real = type(remote).list

    def sealed(self, prefix=""):
        for e in real(self, prefix):
            yield Entry(e.name, e.size, hashlib.sha256(e.stamp.encode()).hexdigest()[:32])

    monkeypatch.setattr(type(remote), "list", sealed)
    assert update(remote) == 6
    read = []
    monkeypatch.setattr(type(remote), "read", spied(type(remote).read, read))
    assert update(remote) == 0
    assert len(read) == 1
    add(remote, trees[0] | {"vehicle_name": "a longer name"})
    assert update(remote) == 1


def test_segments_spare_the_reading_and_change_nothing(remote, monkeypatch):
    monkeypatch.setattr(segments, "WORTH", 5)
    monkeypatch.setattr(segments, "RESULTS", 4)
    trees = some(14)
    add(remote, *trees)
    rebuild(remote)
    expected = remote.read(FILE)
    collected = Segments(remote)
    for tree in trees[:11]:
        collected.add(read_record(tree["batch"]["key"], text(tree)))
    was_another = text(trees[12] | {"vehicle_name": "was another"})
    collected.add(read_record(trees[12]["batch"]["key"], was_another))
    collected.add(read_record(key_of("gone"), text(result("gone"))))
    collected.flush()
    assert len(list(remote.list("segments/"))) == 4
    remote.write("segments/damaged.json.gz", b"junk")
    remote.remove(FILE)
    read = []
    monkeypatch.setattr(type(remote), "read", spied(type(remote).read, read))
    assert rebuild(remote) == 14
    jsons = {name for name in read if name.startswith("measurements/")}
    assert jsons == {place(trees[i]["batch"]["key"]) for i in (11, 12, 13)}
    assert remote.read(FILE) == expected
    read.clear()
    add(remote, *some(2, start=30))
    assert update(remote) == 2
    assert not [name for name in read if name.startswith("segments/")]


@pytest.fixture
def locked(store):
    """Results whose catalogue another process holds, as while it updates it."""
    update(store)
    with (store.local / PARTIAL / catalogue_module.LOCK).open("w") as file:
        acquire(file.fileno())
        yield store


def test_a_reader_does_not_wait_for_a_writer(locked):
    add(locked, *some(1, start=40))  # which the writer, who holds the lock, will find
    found: list = []
    reader = threading.Thread(target=lambda: found.extend(shown(locked.url)), daemon=True)
    reader.start()
    reader.join(20.0)
    assert len(found) == 40


def test_a_writer_waits_for_another(store):
    update(store)
    add(store, *some(1, start=40))
    file = (store.local / PARTIAL / catalogue_module.LOCK).open("w")
    acquire(file.fileno())
    found: list[int] = []
    writer = threading.Thread(target=lambda: found.append(update(store)))
    writer.start()
    writer.join(0.5)
    assert (writer.is_alive(), found) == (True, [])
    file.close()
    writer.join()
    assert found == [1]


def test_a_reader_of_a_damaged_catalogue_says_that_it_is_at_work(locked):
    path = locked.local / FILE
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="damaged, and being rebuilt"):
        shown(locked.url)


def test_a_reader_waits_for_the_first_catalogue(store):
    (store.local / PARTIAL).mkdir(exist_ok=True)
    file = (store.local / PARTIAL / catalogue_module.LOCK).open("w")
    acquire(file.fileno())
    writer = threading.Timer(0.3, file.close)
    writer.start()
    assert len(shown(store.url)) == 40
    writer.join()


def test_the_time_of_a_catalogue_is_that_at_which_it_was_begun(store, monkeypatch):
    """A result that is written while it is made is newer, and found by the next update."""
    real = catalogue_module.in_folder

    def slow(*arguments):
        changes = real(*arguments)
        time.sleep(5.0 * GRAIN_NS / 1e9)
        begun.append(time.time_ns())
        return changes

    begun: list[int] = []
    monkeypatch.setattr(catalogue_module, "in_folder", slow)
    update(store)
    path = store.local / FILE
    assert path.stat().st_mtime_ns < begun[-1] - 2 * GRAIN_NS
    update(store)  # of which nothing is written
    assert begun[-2] < path.stat().st_mtime_ns < begun[-1] - 2 * GRAIN_NS
