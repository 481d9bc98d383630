"""Damaged files by the hundred, files of any structure, and a fuzzer that sees what it should.

The long run is a command: tests/bench/fuzz.py.
"""

from __future__ import annotations

import importlib.util
import logging
import os
import sys
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzzing import judge, worker
from tests.fuzzing.e57 import seal_pages
from tests.fuzzing.headers import STRATEGIES
from tests.fuzzing.mutations import MUTATIONS, Mutant, mutant
from tests.fuzzing.samples import GIVEN, ROWS, samples, scans
from tests.fuzzing.supervise import fuzz
from tests.support.paths import FORMATS
from wheelplane.errors import InputError
from wheelplane.readers import READERS, ReadOptions, Scan, read_scan

pytestmark = pytest.mark.slow

POOL = samples()
MUTANTS = 500


def test_short_run():
    """Each mutant ends in a reading or in one clear line; see tests/fuzzing/judge.py."""
    outcomes = list(fuzz(0, MUTANTS, seed=20))
    assert [outcome for outcome in outcomes if outcome.failed] == []
    assert [outcome.index for outcome in outcomes] == list(range(MUTANTS))
    read = sum(outcome.verdict == "read" for outcome in outcomes)
    assert 0.05 * MUTANTS < read < 0.5 * MUTANTS  # damage that is seen, and some that is none


def test_every_sample_is_read_as_it_stands_unless_it_is_broken(tmp_path):
    broken = {"ZeroPoints.e57", "bad-crc.e57", "bunny_8.pts"}  # the last has 9 rows, says 8
    broken |= set() if importlib.util.find_spec("lxml") else {"model.3mf"}
    for sample in POOL:
        data = sample.seal(sample.data)
        expected = "refused" if sample.file in broken else "read"
        assert judge.judge(Mutant(sample, data, "none"), tmp_path) == expected, sample.name


def test_samples_cover_every_format_of_the_table():
    suffixes = {"." + sample.file.rpartition(".")[2] for sample in POOL}
    assert set(READERS) <= suffixes


STLS = {"binary.stl", "ascii.stl", "solids.stl"}
OTHER_PLACES = {"posed.ptx", "posed.e57", "raster-columns.npy"}
MISSING = {"holes.xyz": 5, "empty.csv": 5, "posed.ptx": 8}


@pytest.mark.parametrize("name", sorted(set(scans()) - STLS))
def test_all_formats_hold_the_same_points(name, tmp_path):
    if name == "model.3mf":
        pytest.importorskip("lxml")
    path, given = tmp_path / name, dict(GIVEN.get(name, {}))
    path.write_bytes(scans()[name])
    scan = read_scan(path, given.pop("length_unit", "m"), options=ReadOptions(**given))
    assert scan.invalid_points == MISSING.get(name, 0)
    assert len(scan.points_m) + scan.invalid_points == ROWS
    reference = tmp_path / "blanks.xyz"
    reference.write_bytes(scans()["blanks.xyz"])
    points = read_scan(reference).points_m
    if name in MISSING:
        points = points[np.arange(ROWS) % 9 != 0]
    if name not in OTHER_PLACES:
        single = name in ("faces.ply", "single.npy", "mesh.glb")
        np.testing.assert_allclose(scan.points_m, points, rtol=0, atol=1e-6 if single else 1e-12)
    elif name.endswith("npy"):
        assert sorted(scan.points_m.tolist()) == sorted(points.tolist())


def test_mutants_are_decided_by_their_seed():
    again = samples()
    for index in range(0, 400, 7):
        assert mutant(POOL, index, 3).data == mutant(again, index, 3).data
    assert len({mutant(POOL, index, 3).data for index in range(200)}) > 180
    changed = [mutant(POOL, k, 4).data != mutant(POOL, k, 5).data for k in range(200)]
    assert np.mean(changed) > 0.9


def test_every_mutation_happens_and_changes_files():
    found = [mutant(POOL, index, 1) for index in range(600)]
    for name in MUTATIONS:
        alone = [m for m in found if m.how == name]
        assert alone, name
        assert any(m.data != m.sample.seal(m.sample.data) for m in alone), name


def test_sealed_pages_are_those_of_other_programs():
    for path in FORMATS.glob("*Cube*.e57"):
        data = path.read_bytes()
        assert seal_pages(data) == data
        assert seal_pages(data[:100] + b"?" + data[101:]) != data


XYZ = next(sample for sample in POOL if sample.file == "count.pts")
GOOD = Scan(np.ones((ROWS, 3)), None, "x", 0)


def speak():
    print("a word")
    return GOOD


def leave_a_file():
    import tempfile

    tempfile.mkstemp()
    return GOOD


class RawError(InputError):
    """Whose text nothing has made plain."""

    def __init__(self, text):
        Exception.__init__(self, text)


def refuse(text):
    raise RawError(text)


class Panic(BaseException):
    """As the Rust libraries raise it."""


def panic():
    raise Panic("index out of bounds")


FAULTS = {
    "silent loss": lambda: replace(GOOD, points_m=GOOD.points_m[1:]),
    "points invented": lambda: replace(GOOD, invalid_points=1),
    "not finite": lambda: replace(GOOD, points_m=GOOD.points_m * np.nan),
    "single precision": lambda: replace(GOOD, points_m=GOOD.points_m.astype(np.float32)),
    "no points": lambda: replace(GOOD, points_m=np.empty((0, 3))),
    "intensity": lambda: replace(GOOD, intensity=np.zeros(3, np.float32)),
    "exception": lambda: [][1],
    "panic": panic,
    "warning": lambda: warnings.warn("odd", stacklevel=1) or GOOD,
    "word": speak,
    "log": lambda: logging.getLogger("some.library").warning("odd") or GOOD,
    "native word": lambda: os.write(2, b"bad file\n") and GOOD,
    "left behind": leave_a_file,
    "two lines": lambda: refuse("count.pts: bad:\nmend it"),
    "control codes": lambda: refuse("count.pts: bad \x1b[31m: mend it"),
    "no name": lambda: refuse("bad file: mend it"),
    "endless": lambda: refuse("count.pts: " + "9" * 1000),
    "room for a lie": lambda: refuse("count.pts: the cloud does not fit into memory: thin it"),
}


@pytest.fixture
def look(tmp_path, monkeypatch):
    """Verdict of the worker on a given reader, in a process with streams of its own."""
    (tmp_path / "files").mkdir()
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    # The peak of this process is that of all tests before.
    monkeypatch.setattr(worker, "PEAK_MB", float("inf"))

    def run(reader, sample=XYZ):
        monkeypatch.setattr(judge, "read_scan", lambda *path, **options: reader())
        monkeypatch.setattr(judge, "_inspect", lambda *seen: None)
        handlers = logging.getLogger().handlers[:]
        saved = os.dup(1), os.dup(2), sys.stdout, sys.stderr
        with (tmp_path / "spoken").open("w+") as spoken, warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                logging.getLogger().handlers[:] = []
                os.dup2(spoken.fileno(), 1)
                os.dup2(spoken.fileno(), 2)
                sys.stdout = sys.stderr = spoken
                mutated = Mutant(sample, sample.data, "none")
                return worker.look(mutated, tmp_path / "files", tmp_path / "temporary")["verdict"]
            finally:
                os.dup2(saved[0], 1)
                os.dup2(saved[1], 2)
                os.close(saved[0])
                os.close(saved[1])
                sys.stdout, sys.stderr = saved[2:]
                logging.getLogger().handlers[:] = handlers

    return run


@pytest.mark.parametrize("fault", FAULTS)
def test_the_fuzzer_sees(fault, look):
    assert look(FAULTS[fault]) not in ("read", "refused")


def test_the_fuzzer_lets_pass_what_is_right(look, monkeypatch):
    assert look(lambda: GOOD) == "read"
    assert look(lambda: refuse("count.pts: it holds 0 points: export it again")) == "refused"
    monkeypatch.setattr(worker, "SECONDS", 0.01)
    assert look(lambda: time.sleep(0.02) or GOOD).startswith("slow: ")


SABOTAGE = """
import os, sys, time
from pathlib import Path
from tests.fuzzing import judge, worker
def door(path, mutant):
    number = len(list(Path({mark!r}).iterdir()))
    (Path({mark!r}) / str(number)).touch()
    if number == 1:
        os.abort()
    if number == 3:
        time.sleep(60)
judge.DOORS = dict.fromkeys(judge.DOORS, door)
worker.main()
"""


def test_a_crash_and_a_hang_are_reported_and_the_run_goes_on(tmp_path, monkeypatch):
    from tests.fuzzing import supervise

    (tmp_path / "mark").mkdir()
    code = SABOTAGE.format(mark=str(tmp_path / "mark"))
    monkeypatch.setattr(supervise, "SECONDS", 1.0)
    monkeypatch.setattr(supervise, "WORKER", ["-c", code])
    outcomes = list(fuzz(0, 6, seed=0))
    assert [outcome.index for outcome in outcomes] == list(range(6))
    verdicts = [outcome.verdict.partition(":")[0] for outcome in outcomes]
    assert verdicts == ["read", "crash", "read", "hang", "read", "read"]


VERTEX = b"element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
RASTER = b"1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n"
MANY = {
    "properties.ply": b"ply\nformat ascii 1.0\n"
    + VERTEX
    + b"".join(b"property float a%d\n" % k for k in range(5000))
    + b"end_header\n"
    + b"1 " * 5003
    + b"\n",
    "elements.ply": b"ply\nformat ascii 1.0\n"
    + b"".join(b"element e%d 0\nproperty int a\n" % k for k in range(2500))
    + VERTEX
    + b"end_header\n1 2 3\n",
    "blocks.pts": b"1\n1 2 3\n" * 10_001,
    "scans.ptx": RASTER * 10_001,
    "blank.xyz": b"\n" * 100_001 + b"1 2 3\n",
}


@pytest.mark.parametrize("name", MANY)
def test_small_parts_beyond_number_are_refused(name, tmp_path):
    """Each would cost time of its own: a file of a few megabytes took half a minute."""
    path = tmp_path / name
    path.write_bytes(MANY[name])
    with pytest.raises(InputError, match=rf"{name}: it has more than \d+ .*: split it"):
        read_scan(path)


@pytest.mark.parametrize("name", ["digits.xyz", "digits.csv", "digits.pts"])
def test_a_million_digits_are_refused_at_once(name, tmp_path):
    """A pattern of numbers that tries every split of the digits never came back from this."""
    path = tmp_path / name
    row = ",".join if name.endswith("csv") else " ".join
    path.write_text(f"{row('123')}\n{row(['1', '2', '9' * 1_000_000 + 'x'])}\n")
    with pytest.raises(InputError, match=f"{name}: line 2 holds .*not a number"):
        read_scan(path)


LONG = {
    "a name of blanks": "x_" + "_" * 200_000 + "(,y,z\n1,2,3\n",
    "a name of words": "x " * 100_000 + ",y,z\n1,2,3\n",
    "a key of words": "x " * 100_000 + "\n" + ",".join("1" * 20) + "\n",
    "a line of cells": "1," * 300_000 + "\n",
    "lines of prose": "Export of a wheel scan\n" * 90_000 + "1 2 3\n",
    "comments": "# x y z of a wheel scan\n" * 90_000 + "1 2 3\n",
    "a long quoted cell": '"' + "1" * 200_000 + 'x",2,3\n',
    "quotes": '"' * 200_001 + "\n1 2 3\n",
    "blanks in a row": "1,2,3\n1," + " " * 200_000 + "x,3\n",
}


@pytest.mark.parametrize("name", LONG)
def test_long_headings_come_to_an_end(name, tmp_path):
    """A pattern of names that tries every split of a line would never come back."""
    path = tmp_path / "a.csv"
    path.write_text(LONG[name])
    if name in ("lines of prose", "comments", "quotes"):
        assert read_scan(path).points_m.tolist() == [[1, 2, 3]]
    else:
        with pytest.raises(InputError):
            read_scan(path)


@pytest.mark.parametrize(
    ("name", "data", "points"),
    [("blocks.pts", b"1\n1 2 3\n" * 100, 100), ("scans.ptx", RASTER * 100, 100)],
)
def test_many_small_parts_are_read(name, data, points, tmp_path):
    path = tmp_path / name
    path.write_bytes(data)
    scan = read_scan(path)
    assert len(scan.points_m) == len(scan.parts) == points


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("structure")


@pytest.mark.parametrize("suffix", sorted(STRATEGIES))
@settings(
    derandomize=True,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.differing_executors],
)
@given(data=st.data())
def test_any_structure_is_read_exactly_and_any_lie_refused(suffix, folder, data):
    written = data.draw(STRATEGIES[suffix]())
    path = folder / f"scan.{suffix}"
    path.write_bytes(written.data)
    scan = read_scan(path)
    np.testing.assert_array_equal(scan.points_m, written.points)
    assert scan.invalid_points == written.missing
    for lie in written.lies:
        path.write_bytes(lie)
        with pytest.raises(InputError) as caught:
            read_scan(path)
        judge._check_line(str(caught.value), path.name)
