"""Passes over all points: kernels and fallback, any number of threads, any order of points."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.cloud import moments, selection, threads, voxel_grid
from wheelplane.cloud.moments import slab_moments, sums_by
from wheelplane.cloud.selection import (
    Slab,
    coordinate_hash,
    least_rows,
    nearest_points,
    sample,
    surroundings,
)
from wheelplane.cloud.voxel_grid import (
    box,
    voxel_key,
    voxel_moments,
    voxels_without_strays,
    within_voxels,
)

CENTRE = np.array([10.2, -4.1, 2.3])
NORMAL = np.array([2.0, -1.0, 2.0]) / 3.0
COUNT = 3 * threads.ROWS_PER_CHUNK + 17
EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def cloud():
    """A cube of 2 m full of points, a tenth of them on a disc with noise."""
    rng = np.random.default_rng(5)
    cloud = CENTRE + rng.uniform(-1, 1, (COUNT, 3))
    uv = rng.uniform(-0.3, 0.3, (COUNT // 10, 2))
    disc = np.column_stack([uv, rng.normal(0, 1e-3, len(uv))])
    R = rotation(rng)
    R = np.column_stack([R[:, 0], R[:, 1], NORMAL])
    R[:, 0] -= (R[:, 0] @ NORMAL) * NORMAL
    R[:, 0] /= np.linalg.norm(R[:, 0])
    R[:, 1] = np.cross(NORMAL, R[:, 0])
    cloud[: len(disc)] = disc @ R.T + CENTRE
    return cloud


@pytest.fixture(params=["numpy", "compiled"])
def backend(request, monkeypatch):
    """The kernels, and numpy in their place."""
    if request.param == "numpy":
        without_kernels(monkeypatch)
    return request.param


def without_kernels(monkeypatch):
    for module in (selection, voxel_grid, moments):
        monkeypatch.setattr(module, "kernels", lambda: None)


SIDES = np.array([[1, 0, 0.2], [-1, 0, 0.2], [0, 1, 0.25], [0, -1, 0.25]])


def face_basis():
    first = np.cross([0.0, 0.0, 1.0], NORMAL)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(NORMAL, first), NORMAL])


def everything(cloud):
    """Return the results of all passes over a cloud."""
    near = surroundings(cloud, CENTRE, NORMAL, Slab(0.4, 0.05), Slab(0.4, 0.3, 1.0, 0.6), 5000)
    inner = slab_moments(
        near.face_m,
        face_basis(),
        1e-4,
        (2e-3, 4e-3),
        (0.3, SIDES, np.array([[0.1, 0, 0.05]])),
        7,
    )
    held = voxel_moments(cloud, box(cloud)[0] - 0.01, 0.11)
    rows = within_voxels(cloud, held, held.key[::5])
    return [sample(cloud, 5000), near.face_m, near.around_m, inner.sums, inner.edge, held.key,
            held.sums, rows]  # fmt: skip


def test_threads_change_no_bit(cloud, backend, monkeypatch):
    monkeypatch.setenv("WHEELPLANE_THREADS", "1")
    one = everything(cloud)
    for count in ("2", "3"):
        monkeypatch.setenv("WHEELPLANE_THREADS", count)
        for a, b in zip(one, everything(cloud), strict=True):
            np.testing.assert_array_equal(a, b)


def test_kernels_and_fallback_agree(cloud, monkeypatch):
    compiled = everything(cloud)
    without_kernels(monkeypatch)
    plain = everything(cloud)
    for k in (0, 1, 2, 5, 7):
        np.testing.assert_array_equal(compiled[k], plain[k])
    # Sums of N terms in another order: N eps of the largest.
    np.testing.assert_allclose(compiled[3], plain[3], atol=1e4 * EPS * np.abs(plain[3]).max())
    np.testing.assert_allclose(compiled[4], plain[4], atol=8 * EPS)
    np.testing.assert_allclose(compiled[6], plain[6], atol=1e4 * EPS * np.abs(plain[6]).max())
    assert plain[3].sum() > 100
    assert len(plain[4]) > 10


def test_order_of_the_points_does_not_matter(cloud, backend):
    shuffled = np.random.default_rng(2).permutation(cloud)
    np.testing.assert_array_equal(sample(cloud, 5000), sample(shuffled, 5000))
    before, after = everything(cloud), everything(shuffled)
    for k in (1, 2):
        rows = [part[np.lexsort(part.T)] for part in (before[k], after[k])]
        np.testing.assert_array_equal(*rows)
    np.testing.assert_array_equal(before[5], after[5])
    for k in (3, 6):
        np.testing.assert_allclose(after[k], before[k], atol=1e4 * EPS * np.abs(before[k]).max())


def test_sample_is_a_fair_share(cloud, backend):
    drawn = sample(cloud, 20_000)
    assert abs(len(drawn) - 20_000) < 5 * np.sqrt(20_000)
    rows = {tuple(row) for row in cloud}
    assert all(tuple(row) in rows for row in drawn)
    # Uniform along each axis, and so is any part of it, for the order is that of the hash.
    for part in (drawn, drawn[:2000]):
        inside = np.mean(part[:, 0] < CENTRE[0])
        assert abs(inside - 0.5) < 5 * 0.5 / np.sqrt(len(part))
    drawn[:] = 0.0
    assert cloud.any()


def test_sample_of_few_is_all_of_them(cloud):
    few = cloud[:100]
    drawn = sample(few, 200)
    np.testing.assert_array_equal(drawn[np.lexsort(drawn.T)], few[np.lexsort(few.T)])
    assert len(sample(few[:0], 10)) == 0


def test_hash_depends_on_every_coordinate():
    points = np.array([[1.0, 2.0, 3.0], [2.0, 1.0, 3.0], [1.0, 3.0, 2.0], [1.0, 2.0, 3.000002]])
    assert len(set(coordinate_hash(points).tolist())) == 4
    single = np.random.default_rng(0).random((4000, 3)).astype(np.float32).astype(float)
    share = coordinate_hash(single) / 2.0**64  # their last 29 bits are all zero
    for bits in (1.0, 16.0, 256.0):
        inside = np.mean((share * bits) % 1.0 < 0.5)
        assert abs(inside - 0.5) < 5 * 0.5 / np.sqrt(4000)


def test_rounding_hardly_ever_changes_the_sample(cloud):
    drawn = {tuple(np.round(row, 9)) for row in sample(cloud, 5000)}
    again = {tuple(np.round(row, 9)) for row in sample((cloud * 1e3) / 1e3, 5000)}
    assert len(drawn & again) > 0.999 * len(drawn)


def test_surroundings_are_those_of_a_plain_mask(cloud, backend):
    offset = cloud - CENTRE
    depth = np.abs(offset @ NORMAL)
    aside = np.linalg.norm(np.cross(offset, NORMAL), axis=1)
    on_face = (aside < 0.4) & (depth < 0.05)
    around = (aside < np.minimum(0.4 + depth, 0.6)) & (depth < 0.3) & ~on_face
    intensity = np.arange(len(cloud), dtype=np.float32)
    slabs = (Slab(0.4, 0.05), Slab(0.4, 0.3, 1.0, 0.6))
    near = surroundings(cloud, CENTRE, NORMAL, *slabs, len(cloud), intensity)
    assert near.share == 1.0
    np.testing.assert_array_equal(near.face_m, offset[on_face])
    np.testing.assert_array_equal(near.face_intensity, intensity[on_face])
    np.testing.assert_array_equal(near.around_intensity, intensity[around])
    np.testing.assert_array_equal(near.around_m, offset[around].astype(np.float32))
    some = surroundings(cloud, CENTRE, NORMAL, *slabs, np.count_nonzero(around) // 4)
    assert some.share == pytest.approx(0.25, rel=1e-3)
    np.testing.assert_array_equal(some.face_m, offset[on_face])
    assert some.face_intensity is None
    assert some.around_intensity is None
    expected = np.count_nonzero(around) / 4.0
    assert abs(len(some.around_m) - expected) < 5 * np.sqrt(expected)


def test_slab_moments_are_those_of_a_plain_mask(cloud, backend):
    near = surroundings(cloud, CENTRE, NORMAL, Slab(0.5, 0.05), Slab(0.5, 0.05), 0).face_m
    hole = np.array([[0.1, 0.0, 0.05]])
    held = slab_moments(near, face_basis(), 1e-4, (2e-3, 4e-3), (0.3, SIDES, hole), 7)
    uvw = near @ face_basis().T
    u, v, w = uvw.T
    inside = (np.hypot(u, v) < 0.3) & (np.abs(u) < 0.2) & (np.abs(v) < 0.25)
    inside &= np.hypot(u - 0.1, v) > 0.05
    off = np.abs(w - 1e-4)
    np.testing.assert_allclose(held.edge, uvw[inside & (off >= 2e-3) & (off < 4e-3)], atol=8 * EPS)
    sure = uvw[inside & (off < 2e-3)]
    total = held.sums.sum(axis=0)
    assert total[0] == len(sure)
    expected = [*sure.sum(axis=0), *(sure[:, i] @ sure[:, j] for i, j in
                ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))]  # fmt: skip
    np.testing.assert_allclose(total[1:], expected, atol=1e4 * EPS)
    np.testing.assert_array_equal(np.bincount(held.cells(sure), minlength=49), held.sums[:, 0])
    both = held.with_edge(np.ones(len(held.edge), dtype=bool))
    assert both[:, 0].sum() == len(sure) + len(held.edge)


def test_voxels_hold_every_point_once(cloud, backend):
    held = voxel_moments(cloud, box(cloud)[0] - 0.01, 0.11)
    assert np.all(np.diff(held.key) > 0)
    assert held.sums[:, 0].sum() == len(cloud)
    index = np.floor((cloud - held.low_m) / 0.11).astype(int)
    here = np.nonzero((index == held.index[200]).all(axis=1))[0]
    local = cloud[here] - held.middle_m[200]
    np.testing.assert_allclose(
        held.sums[200], sums_by(np.zeros(len(here), int), local, 1)[0], atol=1e4 * EPS
    )
    np.testing.assert_array_equal(within_voxels(cloud, held, held.key[200:201]), here)
    np.testing.assert_array_equal(voxel_key(held.index), held.key)
    start, stop = held.between(CENTRE[0] - 0.2, CENTRE[0] + 0.2)
    inside = np.abs(held.middle_m[:, 0] - CENTRE[0]) < 0.2
    assert set(np.nonzero(inside)[0]) <= set(range(start, stop)) < set(range(len(held.key)))


@pytest.mark.parametrize("every", [1, 3, 50, 10_000])
def test_points_within_voxels_are_those_by_their_keys_in_any_order(cloud, every, backend):
    """Points in order are known by their runs; in no order, each is looked up."""
    low, edge = box(cloud)[0] - 0.01, 0.11
    key = voxel_key(((cloud - low) * (1.0 / edge)).astype(np.int64))
    for order in (np.argsort(key), np.arange(COUNT)):
        held = voxel_moments(cloud[order], low, edge)
        chosen = held.key[1::every]
        expected = np.nonzero(np.isin(key[order], chosen))[0]
        np.testing.assert_array_equal(within_voxels(cloud[order], held, chosen), expected)
        if backend == "compiled":
            assert (held.runs is None) == (order[0] == 0)


def test_no_runs_are_known_where_points_are_left_out(backend):
    line = np.linspace(0.0, 1.0, 5000)[:, None] * np.ones(3)
    far = np.vstack([line, [[1e6, 0.0, 0.0]]])
    held = voxels_without_strays(far, 0.03)
    assert held.runs is None
    assert len(within_voxels(line, held, held.key)) == len(line)
    assert (voxels_without_strays(line, 0.03).runs is None) == (backend == "numpy")


@pytest.mark.parametrize("stray", [(-1e6, 0, 0), (3e5, -3e5, 9e9), (0, 8e4, -8e4), (9e9, 9e9, 9e9)])
@pytest.mark.parametrize("offset", [0.0, 5e6])
def test_voxels_are_those_without_the_strays(stray, offset, backend):
    """Voxels of 0.03 m, whose keys reach 63 km."""
    points = np.random.default_rng(1).normal(0.0, 3.0, (20_000, 3)) + offset
    far = np.vstack([points[:7000], np.array([stray]) + offset, points[7000:]])
    alone, found = (voxels_without_strays(one, 0.03) for one in (points, far))
    np.testing.assert_array_equal(found.low_m, alone.low_m)
    np.testing.assert_array_equal(found.key, alone.key)
    np.testing.assert_allclose(found.sums, alone.sums, atol=1e4 * EPS)
    apart = voxels_without_strays(np.vstack([points, points + 1e6]), 0.03)
    assert apart.sums[:, 0].sum() == len(points)
    near = np.vstack([points, points[:1] + 3e4])
    assert voxels_without_strays(near, 0.03).sums[:, 0].sum() == len(near)


def test_a_full_table_grows(backend):
    points = np.random.default_rng(1).uniform(0, 100, (40_000, 3))  # nearly a voxel each
    held = voxel_moments(points, np.full(3, -1.0), 0.2)
    assert len(held.key) > 39_000
    assert held.sums[:, 0].sum() == len(points)


@pytest.mark.parametrize("slope", [0.0, 1e-12, 0.7])
@pytest.mark.parametrize("most_m", [0.2, 0.35, np.inf])
def test_a_slab_grows_with_depth_up_to_its_most(slope, most_m):
    rng = np.random.default_rng(4)
    radius_m, depth_m = rng.uniform(0.0, 0.6, 4000), rng.uniform(0.0, 0.2, 4000)
    slab = Slab(0.3, 0.15, slope, most_m)
    reach_m = np.minimum(0.3 + slope * depth_m, most_m)
    expected = (depth_m < 0.15) & (radius_m < reach_m)
    np.testing.assert_array_equal(slab.holds(radius_m**2, depth_m), expected)
    assert 0 < expected.sum() < len(expected)


@pytest.mark.parametrize("count", [1, 3, 63, 64, 65, 1000, COUNT])
def test_a_box_is_that_of_each_column(cloud, backend, count):
    some = cloud[::-1][:count].copy()  # the disc lies last
    found = box(some)
    assert found.shape == (2, 3)
    for k, column in enumerate(some.T):
        assert (found[0, k], found[1, k]) == (min(column), max(column))


@pytest.mark.parametrize("count", [1, 40, 350])
@pytest.mark.parametrize("order", ["random", "falling", "equal"])
def test_the_least_values_of_many_are_found(count, order):
    """Also where every sixteenth value misleads about where they end."""
    values = np.random.default_rng(count).exponential(size=200_000)
    if order == "falling":
        values = np.sort(values)[::-1].copy()
    if order == "equal":
        values[::16] = values.min()
    found = values[least_rows(values, count)]
    np.testing.assert_array_equal(np.sort(found), np.sort(values)[:count])


def test_the_nearest_points_are_those_of_the_whole_cloud():
    points = np.random.default_rng(0).normal(size=(150_000, 3))
    place = np.array([0.3, -0.2, 0.1])
    away = np.linalg.norm(nearest_points(points, place, 50) - place, axis=1)
    np.testing.assert_allclose(
        np.sort(away), np.sort(np.linalg.norm(points - place, axis=1))[:50], rtol=1e-12
    )
