"""Compiled kernels: each against its definition in a few lines of numpy, and at its limits."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.cloud import compiled
from wheelplane.cloud.moments import SUMS, sums_by
from wheelplane.cloud.selection import coordinate_hash
from wheelplane.cloud.voxel_grid import VOXEL_BITS, voxel_key

COUNT = 3000
LOW, EDGE = np.full(3, -1.01), 0.25
EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(3).uniform(-1.0, 1.0, (COUNT, 3))


def test_hash_is_that_of_the_fallback_for_either_sign(points):
    far = np.vstack([points, 1e4 * points, [[0.0, -0.0, 2.0**-21], [-1e-7, 1e-7, 3e5]]])
    rows, hashes = np.empty(len(far), np.int64), np.empty(len(far), np.uint64)
    everything = np.uint64(0xFFFFFFFFFFFFFFFF)
    assert compiled.hash_rows(far, everything, rows, hashes) == len(far)
    np.testing.assert_array_equal(rows, np.arange(len(far)))
    np.testing.assert_array_equal(hashes, coordinate_hash(far))


def test_rows_are_those_with_hashes_up_to_the_limit(points):
    rows, hashes = np.empty(COUNT, np.int64), np.empty(COUNT, np.uint64)
    limit = np.sort(coordinate_hash(points))[COUNT // 3]  # itself included
    found = compiled.hash_rows(points, limit, rows, hashes)
    assert found == COUNT // 3 + 1
    np.testing.assert_array_equal(rows[:found], np.nonzero(coordinate_hash(points) <= limit)[0])


@pytest.mark.parametrize("every", [1, 7, 2000])
def test_rows_kept_are_those_with_hashes_up_to_the_limit(points, every):
    rows, limit = np.arange(1, COUNT, every, np.int32), np.uint64(1 << 62)
    kept = np.empty_like(rows)
    found = compiled.thin_rows(points, limit, rows, kept)
    np.testing.assert_array_equal(kept[:found], rows[coordinate_hash(points[rows]) <= limit])


@pytest.mark.parametrize("start", [0, 5, COUNT - compiled.PIECE, COUNT - 1, COUNT])
def test_a_piece_ends_with_the_points(points, start):
    piece = np.zeros((compiled.PIECE, 3))
    count = compiled.read_piece(points, start, piece)
    assert count == min(compiled.PIECE, COUNT - start)
    np.testing.assert_array_equal(piece[:count], points[start : start + count])
    assert not piece[count:].any()


def test_rows_near_a_plane_are_those_of_two_masks(points):
    """A cone that widens with depth up to a limit; what is on the face is not beside it."""
    centre, normal = np.array([0.1, -0.2, 0.05]), np.array([2.0, -1.0, 2.0]) / 3.0
    face, around = np.array([0.5, 0.1, 0.0, 9.0]), np.array([0.4, 0.6, 0.8, 0.7])
    on_face, beside = np.empty((2, COUNT), np.int32)
    counts = compiled.near_plane(points, centre, normal, face, around, on_face, beside)
    offset = points - centre
    depth = np.abs(offset @ normal)
    radius = np.linalg.norm(np.cross(offset, normal), axis=1)
    first = (depth < 0.1) & (radius < 0.5)
    second = (depth < 0.6) & (radius < np.minimum(0.4 + 0.8 * depth, 0.7)) & ~first
    np.testing.assert_array_equal(on_face[: counts[0]], np.nonzero(first)[0])
    np.testing.assert_array_equal(beside[: counts[1]], np.nonzero(second)[0])
    assert min(counts) > 50


def test_taken_rows_are_relative_to_the_centre(points):
    rows, centre, out = np.array([7, 0, 7, COUNT - 1]), np.array([3.0, -2.0, 1.0]), np.empty((4, 3))
    compiled.take(points, centre, rows, out)
    np.testing.assert_array_equal(out, points[rows] - centre)


def test_slab_moments_are_those_of_the_points_inside(points):
    """Region, hole and both limits; cells outside the grid are clipped to its border."""
    sides = np.array([[1.0, 0.0, 0.6], [-1.0, 0.0, 0.6]])  # |u| < 0.6
    hole = np.array([[0.2, 0.1, 0.3]])
    sums, edge = np.zeros((25, SUMS)), np.empty((COUNT, 3))
    limits, grid = np.array([0.1, 0.3]), np.array([5, 0.3])
    found = compiled.slab_moments(
        points, np.eye(3), 0.2, limits, 0.9, sides, hole, grid, sums, edge
    )
    off = np.abs(points[:, 2] - 0.2)
    inside = (np.hypot(points[:, 0], points[:, 1]) < 0.9) & (np.abs(points[:, 0]) < 0.6)
    inside &= np.hypot(points[:, 0] - 0.2, points[:, 1] - 0.1) > 0.3
    sure = points[inside & (off < 0.1)]
    np.testing.assert_array_equal(edge[:found], points[inside & (off >= 0.1) & (off < 0.3)])
    column, row = np.clip((sure[:, :2] / 0.3 + 2.5).astype(int), 0, 4).T
    wanted = sums_by(row * 5 + column, sure, 25)
    np.testing.assert_allclose(sums, wanted, rtol=0, atol=COUNT * EPS)
    assert np.abs(sure[:, 1]).max() > 0.75  # so that clipping counts
    assert found > 100


@pytest.mark.parametrize("order", ["as drawn", "sorted"])
def test_voxel_moments_are_those_of_each_voxel(points, order):
    """Also where neighbours in the file share a voxel, whose slot is kept."""
    cloud = points if order == "as drawn" else points[np.argsort(points[:, 0])]
    keys, sums = np.full(4096, -1, np.int64), np.zeros((4096, SUMS))
    used = compiled.voxel_moments(cloud, LOW, EDGE, keys, sums)
    index = np.floor((cloud - LOW) / EDGE).astype(np.int64)
    present, group = np.unique(voxel_key(index), return_inverse=True)
    assert used == len(present)
    filled = np.nonzero(keys >= 0)[0]
    rows = filled[np.argsort(keys[filled])]
    np.testing.assert_array_equal(keys[rows], present)
    local = cloud - (LOW + (index + 0.5) * EDGE)
    wanted = sums_by(group, local, len(present))
    np.testing.assert_allclose(sums[rows], wanted, rtol=0, atol=100 * EPS)


def test_a_full_table_is_reported():
    points = np.random.default_rng(0).uniform(0.0, 50.0, (200, 3))  # nearly a voxel each
    for capacity, full in ((128, True), (512, False)):
        keys, sums = np.full(capacity, -1, np.int64), np.zeros((capacity, SUMS))
        used = compiled.voxel_moments(points, LOW, EDGE, keys, sums)
        assert (used == -1) == full


def test_marked_points_are_those_of_the_voxels_asked_for(points):
    index = np.floor((points - LOW) / EDGE).astype(np.int64)
    keys = voxel_key(index)
    asked = np.unique(keys)[::3]
    table = np.full(1024, -1, np.int64)
    compiled.voxel_moments(  # its own table, so that kernels that write and read agree
        points[np.isin(keys, asked)], LOW, EDGE, table, np.zeros((1024, SUMS))
    )
    marked = np.empty(COUNT, np.bool_)
    found = compiled.in_voxels(points, LOW, EDGE, table, marked)
    np.testing.assert_array_equal(marked, np.isin(keys, asked))
    assert found == marked.sum()
    assert 0 < found < COUNT
    assert keys.max() < 1 << (3 * VOXEL_BITS)
