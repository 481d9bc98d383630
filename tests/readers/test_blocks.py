"""Scans read block by block: the points of the whole scan, of every format."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

from tests.fuzzing.samples import samples
from tests.readers.test_missing import MARKED, mixed
from wheelplane.errors import InputError
from wheelplane.readers import AS_THE_FILE_SAYS, ReadOptions, read_scan
from wheelplane.readers import blocks as read_by_blocks
from wheelplane.readers.blocks import read_blocks

SCANS = [sample for sample in samples() if sample.door == "scan" and sample.name == sample.file]


def joined(path, unit="m", options=AS_THE_FILE_SAYS, **more):
    """Blocks of a file, and all their points."""
    blocks = list(read_blocks(path, unit, path.name, options, **more))
    return blocks, np.concatenate([np.zeros((0, 3)), *(block.points_m for block in blocks)])


@pytest.mark.parametrize("sample", SCANS, ids=[sample.name for sample in SCANS])
def test_blocks_hold_the_points_of_the_scan(tmp_path, sample):
    path = tmp_path / sample.file
    path.write_bytes(sample.seal(sample.data))
    given = dict(sample.given)
    unit = given.pop("length_unit", "m")
    options = given.pop("options", ReadOptions(**given))
    try:
        scan = read_scan(path, unit, path.name, options)
    except InputError:  # damaged, or without points
        with suppress(InputError):
            assert len(joined(path, unit, options)[1]) == 0
        return
    blocks, points = joined(path, unit, options)
    assert np.array_equal(points, scan.points_m)
    assert all((block.intensity is None) == (scan.intensity is None) for block in blocks)
    if scan.intensity is not None:
        each = np.concatenate([block.intensity for block in blocks])
        assert np.array_equal(each, scan.intensity, equal_nan=True)
    assert blocks[0].parts == tuple(part.name for part in scan.parts)
    counts = np.zeros(max(1, len(scan.parts)), int)
    for block in blocks:
        counts[block.part] += len(block.points_m)
    assert counts.tolist() == [part.stop - part.start for part in scan.parts] or not scan.parts


@pytest.mark.parametrize("name", MARKED)
def test_missing_returns_are_dropped(tmp_path, name):
    path = tmp_path / "a.npy"
    np.save(path, mixed(MARKED[name]))
    _, points = joined(path)
    assert np.array_equal(points, read_scan(path).points_m)
    _, every = joined(path, has_missing=False)
    assert len(every) == len(points) + len(MARKED[name])


def test_few_missing_returns_of_a_small_file_are_dropped(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, mixed(np.zeros((12, 3)), np.random.default_rng(4).normal(size=(500, 3))))
    assert read_scan(path).invalid_points == 12
    assert len(joined(path)[1]) == 500


def test_the_sample_is_every_nth_point_wherever_blocks_end(tmp_path, monkeypatch):
    rows = np.random.default_rng(7).normal(size=(100_000, 3))
    np.save(tmp_path / "a.npy", rows)
    samples = []
    monkeypatch.setattr(read_by_blocks, "SAMPLE", 1000)
    monkeypatch.setattr(read_by_blocks, "find_markers", samples.append)
    blocks, points = joined(tmp_path / "a.npy")
    assert len(blocks) > 2
    assert np.array_equal(points, rows)
    assert np.array_equal(samples[0], rows[::100])
