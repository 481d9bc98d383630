"""Clouds larger than the memory are refused before it is taken; others are read within a bound."""

from __future__ import annotations

import resource
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tests.readers.test_readers import WRITERS
from tests.support.paths import ROOT
from wheelplane.diagnostics.scan_summary import summarise_scan
from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.memory import available_bytes

pytestmark = pytest.mark.slow

PIECE = 1 << 20  # bytes that a reader holds besides: a chunk, or a piece of text and its numbers
WHOLE = {"compressed.pcd", "alone.zip"}  # PCD's compressed block is unpacked as a whole
ROWS = np.random.default_rng(0).normal(size=(150_000, 4)).round(6)
HEAD = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n" + "".join(
    f"property double {axis}\n" for axis in "xyz"
)


@pytest.mark.parametrize("name", sorted(set(WRITERS) - WHOLE))
def test_reading_takes_little_more_than_its_result(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(WRITERS[name](ROWS.tolist()))
    read_scan(path)
    tracemalloc.start()
    scan = read_scan(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    arrays = scan.points_m.nbytes + scan.intensity.nbytes
    arrays += 0 if scan.grid is None else scan.grid.nbytes
    assert arrays <= peak < arrays + 8 * PIECE
    assert 2 * ROWS.nbytes > 8 * PIECE  # reading all first would take more


def test_looking_at_a_cloud_keeps_a_sample_only(tmp_path):
    path = tmp_path / "a.ply"
    rows = np.random.default_rng(1).normal(size=(1_000_000, 3))
    path.write_bytes((HEAD.format(len(rows)) + "end_header\n").encode() + rows.tobytes())
    tracemalloc.start()
    summarise_scan(path, "m")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.75 * rows.nbytes


def test_a_cloud_that_does_not_fit_is_refused_with_both_numbers(tmp_path, monkeypatch):
    path = tmp_path / "a.ply"
    path.write_bytes((HEAD.format(9_000_000) + "end_header\n").encode())
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size + 9_000_000 * 24)  # a hole: no disk is taken
    for free, refused in ((100 << 20, True), (1 << 30, False)):
        monkeypatch.setattr("wheelplane.readers.memory.available_bytes", lambda free=free: free)
        if not refused:
            assert len(read_scan(path).points_m) == 9_000_000
            continue
        tracemalloc.start()
        with pytest.raises(InputError) as caught:
            read_scan(path, name="a.ply")
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 4 * PIECE
        assert str(caught.value) == (
            "a.ply: its 9000000 points need 0.201 GiB of memory, 0.0352 GiB are free: "
            "thin the cloud, or use a larger machine"
        )


def test_the_limit_of_the_process_counts(tmp_path):
    path = tmp_path / "a.ply"
    count = 40_000_000
    path.write_bytes((HEAD.format(count) + "end_header\n").encode())
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size + count * 24)
    code = (
        "import resource, sys\n"
        "resource.setrlimit(resource.RLIMIT_AS, (900 << 20, 900 << 20))\n"
        "sys.argv[:] = ['wheelplane', 'plane', sys.argv[1]]\n"
        "from wheelplane.cli import main\nmain()\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith(f"wheelplane: {path}: its {count} points need 0.894 GiB of memory")
    assert run.stderr.count("\n") == 1


def test_available_is_less_than_all_and_more_than_nothing():
    total = resource.getpagesize() * int(
        Path("/proc/meminfo").read_text().split("MemTotal:")[1].split()[0]
    ) * 1024 // resource.getpagesize()  # fmt: skip
    assert 0 < available_bytes() <= total
