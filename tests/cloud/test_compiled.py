"""Compiled kernels: each against its definition in a few lines of numpy, and at its limits."""

from __future__ import annotations

import ctypes.util
import shutil
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import ROOT
from wheelplane.cloud import all_within, compiled, moments, raster_sums, selection, voxel_grid
from wheelplane.cloud.compiled import SHORTEST_RUN, kernels
from wheelplane.cloud.moments import sums_by
from wheelplane.cloud.selection import coordinate_hash
from wheelplane.cloud.voxel_grid import VOXEL_BITS, _hash_table, voxel_key

COUNT, PIECE = 3000, 1024  # points in a test, and in a piece that a kernel copies
LOW, EDGE = np.full(3, -1.01), 0.25
EPS = np.finfo(float).eps
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="kernels need a C compiler")


@pytest.fixture(scope="module", params=["one after the other", "in records of 28 bytes"])
def points(request):
    own = np.random.default_rng(3).uniform(-1.0, 1.0, (COUNT, 3))
    if request.param == "one after the other":
        return own
    records = np.zeros(COUNT, np.dtype([("shade", "f4"), ("xyz", "f8", 3)]))
    records["xyz"] = own
    return records["xyz"]


def hashes_in_numpy(points, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(selection, "kernels", lambda: None)
        return coordinate_hash(points)


def test_hash_is_that_of_the_fallback_for_either_sign(points, monkeypatch):
    far = np.vstack([points, 1e4 * points, [[0.0, -0.0, 2.0**-21], [-1e-7, 1e-7, 3e5]]])
    wanted = hashes_in_numpy(far, monkeypatch)
    np.testing.assert_array_equal(kernels().hashes(far), wanted)
    np.testing.assert_array_equal(coordinate_hash(far), wanted)
    rows, hashes = kernels().hash_rows(far, np.uint64(0xFFFFFFFFFFFFFFFF))
    np.testing.assert_array_equal(rows, np.arange(len(far)))
    np.testing.assert_array_equal(hashes, wanted)


def test_rows_are_those_with_hashes_up_to_the_limit(points):
    limit = np.sort(coordinate_hash(points))[COUNT // 3]  # itself included
    rows, hashes = kernels().hash_rows(points, limit)
    assert len(rows) == COUNT // 3 + 1
    np.testing.assert_array_equal(rows, np.nonzero(coordinate_hash(points) <= limit)[0])
    np.testing.assert_array_equal(hashes, coordinate_hash(points)[rows])


@pytest.mark.parametrize("every", [1, 7, 2000])
def test_rows_kept_are_those_with_hashes_up_to_the_limit(points, every):
    rows, limit = np.arange(1, COUNT, every, np.int32), np.uint64(1 << 62)
    kept = kernels().thin_rows(points, limit, rows)
    np.testing.assert_array_equal(kept, rows[coordinate_hash(points[rows]) <= limit])


@pytest.mark.parametrize("count", [1, PIECE - 1, PIECE, PIECE + 1, COUNT])
def test_a_box_holds_all_points_of_the_last_piece_too(points, count):
    few = points[:count] + np.array([7.0, -3.0, 0.0])
    np.testing.assert_array_equal(kernels().box(few), [few.min(axis=0), few.max(axis=0)])


@pytest.mark.parametrize("count", [0, 1, PIECE, PIECE + 1, COUNT])
def test_points_within_a_limit_are_finite_and_smaller(points, count, monkeypatch):
    few = points[:count]
    wrong = [np.nan, np.inf, -np.inf, 2.0, -2.0]
    outside = [few.copy() for _ in wrong]
    for k, cloud in enumerate(outside):
        cloud[count - 1 :, k % 3] = wrong[k]
    for compiled_here in (True, False):
        if not compiled_here:
            monkeypatch.setattr(voxel_grid, "kernels", lambda: None)
        assert all_within(few, 2.0)
        assert [all_within(cloud, 2.0) for cloud in outside] == [count == 0] * len(wrong)


@pytest.mark.parametrize("lay", [np.asfortranarray, lambda p: np.repeat(p, 2, axis=0)[::2]])
def test_points_that_are_not_contiguous_are_read_in_their_order(points, lay):
    np.testing.assert_array_equal(kernels().hashes(lay(points)), coordinate_hash(points))
    np.testing.assert_array_equal(kernels().box(lay(points)), kernels().box(points))


def test_rows_near_a_plane_are_those_of_two_masks(points):
    """A cone that widens with depth up to a limit; what is on the face is not beside it."""
    centre, normal = np.array([0.1, -0.2, 0.05]), np.array([2.0, -1.0, 2.0]) / 3.0
    face, around = np.array([0.5, 0.1, 0.0, 9.0]), np.array([0.4, 0.6, 0.8, 0.7])
    on_face, beside = kernels().near_plane(points, centre, normal, face, around)
    offset = points - centre
    depth = np.abs(offset @ normal)
    radius = np.linalg.norm(np.cross(offset, normal), axis=1)
    first = (depth < 0.1) & (radius < 0.5)
    second = (depth < 0.6) & (radius < np.minimum(0.4 + 0.8 * depth, 0.7)) & ~first
    np.testing.assert_array_equal(on_face, np.nonzero(first)[0])
    np.testing.assert_array_equal(beside, np.nonzero(second)[0])
    assert min(len(on_face), len(beside)) > 50


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_taken_rows_are_relative_to_the_centre(points, kind):
    rows, centre = np.array([7, 0, 7, COUNT - 1], np.int32), np.array([3.0, -2.0, 1.0])
    out = np.empty((4, 3), kind)
    kernels().take(points, centre, rows, out)
    np.testing.assert_array_equal(out, (points[rows] - centre).astype(kind))


def test_slab_moments_are_those_of_the_points_inside(points):
    """Region, hole and both limits; cells outside the grid are clipped to its border."""
    sides = np.array([[1.0, 0.0, 0.6], [-1.0, 0.0, 0.6]])  # |u| < 0.6
    hole = np.array([[0.2, 0.1, 0.3]])
    sums, edge = kernels().slab_moments(
        points, np.eye(3), 0.2, (0.1, 0.3), (0.9, sides, hole), (5, 0.3)
    )
    off = np.abs(points[:, 2] - 0.2)
    inside = (np.hypot(points[:, 0], points[:, 1]) < 0.9) & (np.abs(points[:, 0]) < 0.6)
    inside &= np.hypot(points[:, 0] - 0.2, points[:, 1] - 0.1) > 0.3
    sure = points[inside & (off < 0.1)]
    np.testing.assert_array_equal(edge, points[inside & (off >= 0.1) & (off < 0.3)])
    column, row = np.clip((sure[:, :2] / 0.3 + 2.5).astype(int), 0, 4).T
    wanted = sums_by(row * 5 + column, sure, 25)
    np.testing.assert_allclose(sums, wanted, rtol=0, atol=COUNT * EPS)
    assert np.abs(sure[:, 1]).max() > 0.75  # so that clipping counts
    assert len(edge) > 100


@pytest.mark.parametrize("extra", [None, np.arange(COUNT) / 7.0])
def test_raster_sums_are_those_of_the_fallback_and_count_points_beyond(points, extra, monkeypatch):
    uvw, along = points * [1.0, 1.0, 0.01], np.ascontiguousarray(points.T[:2] * 1.3)
    given = (uvw, extra, along, (40, 5), np.array([0.05, 0.4]))
    sums = raster_sums(*given)
    monkeypatch.setattr(moments, "kernels", lambda: None)
    np.testing.assert_array_equal(sums, raster_sums(*given))
    assert sums[:, 0].sum() == COUNT
    assert sums.shape == (200, 5 if extra is None else 6)


@pytest.mark.parametrize("order", ["as drawn", "sorted"])
def test_voxel_moments_are_those_of_each_voxel(points, order):
    """Also where neighbours in the file share a voxel, whose sums are kept."""
    by_voxel = np.argsort(voxel_key(np.floor((points - LOW) / EDGE).astype(np.int64)))
    cloud = points if order == "as drawn" else points[by_voxel]
    keys, sums, runs = kernels().voxel_moments(cloud, LOW, EDGE, 4096)
    index = np.floor((cloud - LOW) / EDGE).astype(np.int64)
    present, group = np.unique(voxel_key(index), return_inverse=True)
    rows = np.argsort(keys)
    np.testing.assert_array_equal(keys[rows], present)
    local = cloud - (LOW + (index + 0.5) * EDGE)
    wanted = sums_by(group, local, len(present))
    np.testing.assert_allclose(sums[rows], wanted, rtol=0, atol=100 * EPS)
    of_points = voxel_key(index)
    changes = np.append(0, np.flatnonzero(np.diff(of_points)) + 1)
    assert (runs is None) == (len(changes) > COUNT // SHORTEST_RUN) == (order == "as drawn")
    if runs is not None:
        np.testing.assert_array_equal(runs[0], changes)
        np.testing.assert_array_equal(keys[runs[1]], of_points[changes])


def test_a_full_table_is_reported():
    points = np.random.default_rng(0).uniform(0.0, 50.0, (200, 3))  # nearly a voxel each
    for capacity, full in ((128, True), (512, False)):
        found = kernels().voxel_moments(points, LOW, EDGE, capacity)
        assert (found is None) == full


def test_marked_points_are_those_of_the_voxels_asked_for(points):
    index = np.floor((points - LOW) / EDGE).astype(np.int64)
    keys = voxel_key(index)
    asked = np.unique(keys)[::3]
    marked = kernels().in_voxels(points, LOW, EDGE, _hash_table(asked))
    np.testing.assert_array_equal(marked, np.isin(keys, asked))
    assert 0 < marked.sum() < COUNT
    assert keys.max() < 1 << (3 * VOXEL_BITS)


@pytest.mark.parametrize("library", ["missing", "text", "of another source", "of libc"])
def test_a_library_that_is_not_of_this_source_is_not_used(tmp_path, monkeypatch, library):
    """As left by an older version, or where no compiler was found: numpy does the work."""
    path, source = tmp_path / "kernels.so", compiled.SOURCE
    if library == "text":
        path.write_text("no library")
    elif library == "of another source":
        path.write_bytes(compiled.LIBRARY.read_bytes())
        source = tmp_path / "kernels.c"
        source.write_bytes(compiled.SOURCE.read_bytes() + b"/* changed */")
    elif library == "of libc":
        path = Path(ctypes.util.find_library("c"))
    monkeypatch.setattr(compiled, "LIBRARY", path)
    monkeypatch.setattr(compiled, "SOURCE", source)
    assert kernels.__wrapped__() is None
    monkeypatch.undo()
    assert kernels.__wrapped__() is not None


@pytest.mark.parametrize("compiler", ["no-such-compiler", "false"])
def test_without_a_compiler_none_are_built_and_none_of_old_are_left(
    tmp_path, monkeypatch, compiler
):
    spec = spec_from_file_location("build_kernels", ROOT / ".ci" / "build_kernels.py")
    build = module_from_spec(spec)
    spec.loader.exec_module(build)
    library = tmp_path / "kernels.so"
    monkeypatch.setattr(build, "LIBRARY", library)
    assert build.compile_kernels() is None
    assert library.read_bytes() == compiled.LIBRARY.read_bytes()
    monkeypatch.setenv("CC", compiler)
    assert build.compile_kernels()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wrong", [np.float32, np.int64])
def test_arrays_of_another_type_are_refused_not_read(points, wrong):
    with pytest.raises(ctypes.ArgumentError):
        kernels()._library.hash(points.astype(wrong), COUNT, np.empty(COUNT, np.uint64))
