"""Scans read block by block: the points of the whole scan, of every format."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise

import numpy as np
import pytest

from tests.fuzzing.samples import samples
from tests.readers.test_missing import MARKED, mixed
from wheelplane.diagnostics import scan_summary
from wheelplane.errors import InputError
from wheelplane.readers import AS_THE_FILE_SAYS, ReadOptions, gather, missing, read_scan
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


def test_all_ways_to_read_look_at_the_same_points(tmp_path, monkeypatch):
    """So that they find the same marks, wherever blocks end and whatever no point is."""
    points = np.random.default_rng(7).normal(size=(200_000, 3))
    points[1::7] = np.nan
    np.save(tmp_path / "a.npy", points)
    looked_at = []
    for module in (read_by_blocks, gather, scan_summary):
        monkeypatch.setattr(module, "find_markers", looked_at.append)
    blocks, every = joined(tmp_path / "a.npy")
    assert len(blocks) > 2
    read_scan(tmp_path / "a.npy")
    scan_summary.summarise_scan(tmp_path / "a.npy", "m")
    assert len(looked_at) == 3
    assert 5_000 < len(looked_at[0]) <= missing.ROWS
    assert all(np.array_equal(one, looked_at[0]) for one in looked_at)
    assert np.isin(looked_at[0][:, 0], every[:, 0]).all()


@pytest.mark.parametrize("ends", [(0, 200_000), (0, 1, 2, 3, 70_000, 70_007, 200_000)])
def test_one_of_each_run_is_looked_at_wherever_blocks_end(ends):
    points, looked_at = np.random.default_rng(8).normal(size=(200_000, 3)), missing.LookedAt()
    for start, stop in pairwise(ends):
        looked_at.add(points[start:stop])
    rows = missing.rows_looked_at(0, 200_000, 200_000)
    assert np.array_equal(looked_at.points_m(), points[rows])
    assert np.array_equal(rows // 16, np.arange(12_500))
    counts = np.bincount(rows % 16)
    assert len(counts) == 16
    assert counts.min() > 0.5 * counts.max()


@pytest.mark.parametrize("count", [1, 1000, 16_384, 16_385, 32_768, 32_769, 1_000_000])
def test_a_large_scan_is_looked_at_as_a_small_one_is(count):
    rows = missing.rows_looked_at(0, count, count)
    assert min(count, missing.ROWS // 2) <= len(rows) <= missing.ROWS
    assert rows.min() >= 0
    assert rows.max() < count
    assert len(np.unique(rows)) == len(rows)
