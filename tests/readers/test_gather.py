"""From blocks to a scan: independent of how the blocks are cut; poses are applied exactly once."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.support.leases import are_given
from tests.support.sources import opened
from wheelplane.errors import InputError
from wheelplane.readers import memory
from wheelplane.readers.gather import PointRows, apply_pose, checked_pose, gather
from wheelplane.readers.memory import check_memory
from wheelplane.readers.scan import Part, Scan
from wheelplane.readers.source import Block, RawCloud, RawPart
from wheelplane.units import LENGTH_UNITS, in_metres

COUNT = 23
RNG = np.random.default_rng(4)
POINTS = RNG.normal(0.0, 5.0, (COUNT, 3))
POINTS[[3, 11, 12], RNG.integers(0, 3, 3)] = np.nan
SHADE = RNG.uniform(0.0, 1.0, COUNT)
INVALID = RNG.random(COUNT) < 0.2
SPLIT = 9  # rows of the first part


def pose(seed, shift=(1e6, -2e6, 30.0)):
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = shift
    return T


def cloud(cuts, parts):
    rows = np.arange(COUNT)
    edges = sorted({0, SPLIT, COUNT, *cuts})
    blocks = [
        Block(
            tuple(POINTS[a:b].T), SHADE[a:b], (rows[a:b], -rows[a:b]), INVALID[a:b], int(a >= SPLIT)
        )
        for a, b in pairwise(edges)
    ]
    return RawCloud(COUNT, True, iter(blocks), has_grid=True, parts=parts)


def plain(table):
    """Records of x, y, z and an intensity between others' fields, as a cloud and as its bytes."""
    xyz, shade = (np.ascontiguousarray(table[name]) for name in ("xyz", "intensity"))
    blocks = iter([Block(tuple(xyz.T), shade)])
    return RawCloud(len(table), True, blocks, record=table.dtype), table.tobytes()


def records(shade="<f4"):
    kind = np.dtype(
        {
            "names": ["xyz", "intensity"],
            "formats": [("<f8", 3), shade],
            "offsets": [2, 27],
            "itemsize": 37,
        }
    )
    table = np.zeros(COUNT, kind)
    table["xyz"], table["intensity"] = RNG.normal(0.0, 5.0, (COUNT, 3)), 100.0 * SHADE
    return table


@pytest.mark.parametrize("shade", ["<f4", "<f8", "u1"])
def test_points_in_their_file_are_those_that_are_read(tmp_path, shade):
    cloud, content = plain(records(shade))
    with opened(tmp_path, content) as source:
        placed = gather(cloud, source, "m", in_place=True)
        read = gather(cloud, source, "m")
    if are_given():
        assert placed.points_m.strides == (37, 8)
        assert not placed.points_m.flags.writeable
    assert placed.intensity.dtype == np.float32
    for name in ("points_m", "intensity"):
        np.testing.assert_array_equal(getattr(placed, name), getattr(read, name))
    assert (placed.invalid_points, placed.source) == (0, read.source)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30, -9999.0])
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_points_that_need_any_work_are_read(tmp_path, value, unit):
    """Invalid ones are dropped, marks of missing returns as well; other units are converted."""
    table = records()
    table["xyz"][:12] = value
    for in_place in (True, False):
        cloud, content = plain(table)
        with opened(tmp_path, content) as source:
            scan = gather(cloud, source, unit, in_place=in_place)
        assert scan.invalid_points == 12
        expected = table["xyz"][12:] * (1.0 if unit == "m" else 1e-3)
        np.testing.assert_allclose(scan.points_m, expected, rtol=1e-15)
        assert scan.points_m.flags.c_contiguous


def scan_of(folder, cuts, parts, unit="m"):
    with opened(folder, b"?") as source:
        return gather(cloud(cuts, parts), source, unit)


@pytest.mark.parametrize("unit", LENGTH_UNITS)
@settings(max_examples=25)
@given(cuts=st.sets(st.integers(1, COUNT - 1)))
def test_a_scan_does_not_depend_on_how_its_blocks_are_cut(tmp_path_factory, unit, cuts):
    parts = (RawPart("a", pose(1)), RawPart("b"))
    folder = tmp_path_factory.mktemp("cloud")
    one, other = scan_of(folder, (), parts, unit), scan_of(folder, cuts, parts, unit)
    np.testing.assert_allclose(other.points_m, one.points_m, rtol=4e-16, atol=0)
    for name in ("intensity", "grid"):
        assert getattr(one, name).tolist() == getattr(other, name).tolist()
    assert one.invalid_points == other.invalid_points
    assert [(p.start, p.stop) for p in one.parts] == [(p.start, p.stop) for p in other.parts]


def test_what_is_kept_is_what_is_valid_and_each_part_has_its_pose(tmp_path):
    parts = (RawPart("a", pose(1)), RawPart("b", pose(2)))
    scan = scan_of(tmp_path, (5, 17), parts, "mm")
    valid = ~INVALID & ~np.isnan(POINTS).any(axis=1)
    assert scan.invalid_points == COUNT - valid.sum()
    assert scan.grid[:, 0].tolist() == np.flatnonzero(valid).tolist()
    assert scan.intensity.tolist() == SHADE[valid].astype(np.float32).tolist()
    rows = np.arange(COUNT)
    for part, raw, mine in zip(scan.parts, parts, (rows < SPLIT, rows >= SPLIT), strict=True):
        own = POINTS[valid & mine] @ raw.T_file_scan[:3, :3].T + raw.T_file_scan[:3, 3]
        np.testing.assert_allclose(scan.points_m[part.start : part.stop], own / 1000, rtol=1e-15)
        np.testing.assert_allclose(part.station_m, raw.T_file_scan[:3, 3] / 1000, rtol=1e-15)
    assert scan.parts[-1].stop == len(scan.points_m)


def test_a_pose_that_leads_back_to_the_origin_loses_no_digits_of_large_coordinates():
    """R c + t cancels from 1e7 m to 10 m: what is left is the rounding of long double."""
    points = RNG.normal((1e7, -1e7, 50.0), 3.0, (40, 3))
    T = pose(6, (0.0, 0.0, 0.0))
    T[:3, 3] = [8.0, -5.0, 2.0] - T[:3, :3] @ points[0]
    exact = exactly(T, points)
    moved = points.copy()
    apply_pose(moved, T)
    bound = 8 * np.finfo(np.longdouble).eps * np.abs(points).max() + np.spacing(32.0)
    assert np.abs(exact).max() < 32.0
    assert np.abs(moved - exact).max() <= bound
    assert np.abs(points @ T[:3, :3].T + T[:3, 3] - exact).max() > 100 * bound


def exactly(T, points):
    return [
        [
            float(sum(Fraction(T[i, j]) * Fraction(p[j]) for j in range(3)) + Fraction(T[i, 3]))
            for i in range(3)
        ]
        for p in points.tolist()
    ]


def test_a_pose_is_exact_to_two_roundings_far_from_the_origin():
    T = pose(5, (4e6, -7e6, 120.0))
    points = RNG.normal((2e6, 1e6, 50.0), 3.0, (40, 3))
    exact = exactly(T, points)
    moved = points.copy()
    apply_pose(moved, T)
    step = np.spacing(np.abs(exact).max())
    # Half a step for the rounding of the shift, half for the sum; the rotation of 10 m adds none.
    assert np.abs(moved - exact).max() <= 1.01 * step
    apply_pose(moved[:0], T)


@pytest.mark.parametrize(
    "change",
    [
        lambda T: T @ np.diag([1.0, 1.0, -1.0, 1.0]),
        lambda T: T @ np.diag([1.0, 1.0, 0.0, 1.0]),
        lambda T: np.where(np.eye(4) == 1, np.nan, T),
        lambda T: T + np.eye(4)[[3, 2, 1, 0]],
        lambda T: np.where(np.arange(4) == 3, T * [[np.nan], [1], [1], [1]], T),
    ],
    ids=["mirrored", "singular", "nan", "projective", "nowhere"],
)
def test_what_is_no_pose_is_refused(tmp_path, change):
    with opened(tmp_path, b"?") as source:
        assert checked_pose(RawPart("a", pose(3)), source) is not None
        assert checked_pose(RawPart("a", np.eye(4)), source) is None
        half = pose(3) @ np.diag([0.5, 0.5, 0.5, 1.0])  # read; a finding says that it scales
        assert checked_pose(RawPart("a", half), source) is not None
        with pytest.raises(InputError, match=r"^rr\.dat: the pose of its scan a "):
            checked_pose(RawPart("a", change(pose(3))), source)


def test_the_station_is_the_image_of_the_scanner_s_origin():
    T = pose(7)
    assert Part("a", 0, 1, T).station_m.tolist() == (T @ [0.0, 0.0, 0.0, 1.0])[:3].tolist()
    assert Part("a", 0, 1, None).station_m is None
    assert Scan(POINTS, None, "rr.ply", 0).parts == ()


@pytest.mark.parametrize("declared", [0, COUNT - 1])
def test_more_rows_than_declared_and_none_at_all_are_refused(tmp_path, declared):
    raw = cloud((), (RawPart("a"), RawPart("b")))
    with opened(tmp_path, b"?") as source, pytest.raises(InputError, match=r"declares"):
        gather(RawCloud(declared, True, raw.blocks, True, raw.parts), source, "m")


@pytest.mark.parametrize("unit", LENGTH_UNITS)
def test_the_pose_that_was_applied_stands_in_the_scan_in_metres(tmp_path, unit):
    T = pose(3)
    scan = scan_of(tmp_path, (), (RawPart("a", T), RawPart("b")), unit)
    metres = in_metres(1.0, unit)
    np.testing.assert_allclose(scan.parts[0].station_m, metres * T[:3, 3], rtol=1e-15)
    assert scan.parts[0].T_file_scan[3].tolist() == [0.0, 0.0, 0.0, 1.0]
    assert scan.parts[0].axes.tolist() == T[:3, :3].T.tolist()


@pytest.mark.parametrize("beyond", [1.2e10, -1.2e10, 7e11])
@pytest.mark.parametrize("shift", [None, 1e3], ids=["as it is", "posed"])
@pytest.mark.parametrize("axis", range(3))
def test_one_coordinate_beyond_any_site_is_refused(tmp_path, beyond, shift, axis):
    points = np.random.default_rng(5).normal(size=(9, 3))
    points[4, axis] = beyond
    T = None if shift is None else np.eye(4) + shift * np.eye(4)[[0]].T * np.eye(4)[3]
    raw = RawCloud(9, False, iter([Block(tuple(points.T))]), parts=(RawPart("a", T),))
    with opened(tmp_path, b"?") as source, pytest.raises(InputError, match="beyond any site"):
        gather(raw, source, "m")


def test_a_block_without_points_adds_none(tmp_path):
    points = np.random.default_rng(5).normal(size=(9, 3))
    blocks = iter([Block(tuple(part.T)) for part in (points[:4], points[:0], points[4:])])
    with opened(tmp_path, b"?") as source:
        scan = gather(RawCloud(9, False, blocks), source, "m")
    assert scan.points_m.tobytes() == points.tobytes()
    assert scan.grid is None
    assert scan.intensity is None


@pytest.mark.parametrize("has_intensity", [False, True])
@pytest.mark.parametrize("has_grid", [False, True])
def test_the_memory_of_a_row_is_that_of_its_columns(has_intensity, has_grid):
    raw = RawCloud(0, has_intensity, iter(()), has_grid=has_grid)
    room = PointRows.room(1000, raw)
    held = [column for column in (room.points, room.intensity, room.grid) if column is not None]
    assert sum(column.nbytes for column in held) == 1000 * PointRows.row_bytes(raw)


@pytest.mark.parametrize("limits", [(3 << 30, 1 << 30), (1 << 30, 3 << 30)])
def test_a_cloud_needs_what_is_free_but_for_the_rest_of_the_program(tmp_path, monkeypatch, limits):
    """The smaller of what the machine has and what the process may take."""
    monkeypatch.setattr(memory, "free_bytes", lambda: limits[0])
    monkeypatch.setattr(memory, "unlimited_bytes", lambda: limits[1])
    most = ((1 << 30) - (64 << 20)) // 32
    with opened(tmp_path, b"?") as source:
        check_memory(most, 32, source)
        with pytest.raises(InputError, match=r"need 0\.938 GiB of memory, 0\.938 GiB are free"):
            check_memory(most + 1, 32, source)
