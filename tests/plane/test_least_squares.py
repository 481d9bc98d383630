"""The plane of least squares, and the passes over all points, against independent answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import linalg, optimize

from tests.support.scenes import rotation
from wheelplane.cloud.selection import gather_ball, random_rows, within_slab
from wheelplane.plane.least_squares import _tilted, total_least_squares
from wheelplane.vectors import CHUNK_ROWS, plane_basis

EPS = np.finfo(float).eps
CERTIFIED = Path(__file__).parents[2] / "pipeline" / "diagnostics" / "certified"
PLANES = sorted((CERTIFIED / "nist" / "plane").glob("*.ds"))


def tilt(a, b):
    """Angle between two directions without sign, radians."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b)))


def slab_of_noise(seed, count=400, sigma=0.01):
    rng = np.random.default_rng(seed)
    local = np.column_stack(
        [rng.uniform(-1, 1, (count, 2)) * [1.0, 0.6], rng.normal(0, sigma, count)]
    )
    R = rotation(rng)
    return local @ R.T + rng.uniform(-5, 5, 3), R[:, 2]


@pytest.mark.parametrize("path", PLANES, ids=lambda path: path.stem)
def test_certified_planes(path):
    points = np.loadtxt(path, skiprows=1)
    certified = np.loadtxt(path.with_suffix(".fit"))
    point, normal = certified[:3], certified[3:]
    plane = total_least_squares(points)
    size = np.abs(points).max()
    flat = np.sqrt(plane.scatter_m2[1] / plane.count)
    # DOMAIN: double precision reproduces all of them to 1e-8 seconds of arc and 1e-12 in offset.
    assert tilt(plane.normal, normal) < np.radians(1e-8 / 3600) + 64 * EPS * size / flat
    assert abs((plane.centroid_m - point) @ normal) < 1e-12 + 64 * EPS * size
    start = np.linalg.svd(points[:3] - points[:3].mean(axis=0))[2][2]
    assert tilt(start, normal) > 1e-9  # the plane of the first three points is another one


@pytest.mark.parametrize("seed", range(12))
def test_agrees_with_the_singular_value_decomposition(seed):
    points, truth = slab_of_noise(seed)
    plane = total_least_squares(points)
    _, singular, rows = linalg.svd(points - points.mean(axis=0), full_matrices=False)
    assert tilt(plane.normal, rows[2]) < 1e-12
    np.testing.assert_allclose(plane.scatter_m2, singular**2, rtol=1e-10)
    assert tilt(plane.normal, truth) < 5 * 0.01 / np.sqrt(len(points)) / (0.6 / np.sqrt(3))


@pytest.mark.parametrize("seed", range(4))
def test_agrees_with_a_minimiser_of_the_distances(seed):
    points, _ = slab_of_noise(seed)

    def distances(state):
        normal = np.array(
            [
                np.cos(state[0]) * np.sin(state[1]),
                np.sin(state[0]) * np.sin(state[1]),
                np.cos(state[1]),
            ]
        )
        return points @ normal - state[2]

    plane = total_least_squares(points)
    start = [np.arctan2(*plane.normal[1::-1]) + 0.1, np.arccos(plane.normal[2]) + 0.1, 0.0]
    best = optimize.least_squares(distances, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert 2 * best.cost == pytest.approx(plane.scatter_m2[2], rel=1e-9)
    a, b, _ = best.x
    found = np.array([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)])
    assert tilt(plane.normal, found) < 1e-6
    assert np.sum(distances(start) ** 2) > 1.5 * plane.scatter_m2[2]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("shift", [0.0, 1e3, 1e7])
def test_rotation_and_shift(seed, shift):
    points, _ = slab_of_noise(seed)
    rng = np.random.default_rng(seed)
    R, t = rotation(rng), shift * np.array([1.0, -1.0, 0.5])
    before, after = total_least_squares(points), total_least_squares(points @ R.T + t)
    resolution = EPS * (shift + 10.0)
    flat = 0.6 / np.sqrt(3)
    assert tilt(R @ before.normal, after.normal) < 8 * resolution / flat
    np.testing.assert_allclose(R @ before.centroid_m + t, after.centroid_m, atol=8 * resolution)


@pytest.mark.parametrize("seed", range(3))
def test_permute_mirror_and_scale(seed):
    points, _ = slab_of_noise(seed)
    plane = total_least_squares(points)
    shuffled = total_least_squares(np.random.default_rng(seed).permutation(points))
    assert tilt(plane.normal, shuffled.normal) < 1e-13
    mirror = np.array([1.0, 1.0, -1.0])
    assert tilt(plane.normal * mirror, total_least_squares(points * mirror).normal) < 1e-13
    for scale in (1e3, 1e-4):
        scaled = total_least_squares(points * scale)
        assert tilt(plane.normal, scaled.normal) < 1e-13
        np.testing.assert_allclose(scaled.scatter_m2, plane.scatter_m2 * scale**2, rtol=1e-10)


def test_basis_is_right_handed_and_its_normal_points_up():
    for seed in range(20):
        points, _ = slab_of_noise(seed)
        plane = total_least_squares(points)
        np.testing.assert_allclose(plane.basis @ plane.basis.T, np.eye(3), atol=8 * EPS)
        assert np.linalg.det(plane.basis) == pytest.approx(1.0, abs=8 * EPS)
        assert plane.normal[np.argmax(np.abs(plane.normal))] > 0
        assert np.all(np.diff(plane.scatter_m2) < 0)
        other = plane_basis(plane.normal)
        np.testing.assert_allclose(other @ other.T, np.eye(3), atol=8 * EPS)
        assert np.linalg.det(other) == pytest.approx(1.0, abs=8 * EPS)
        np.testing.assert_allclose(other[2], plane.normal, atol=2 * EPS)


def test_exact_plane_leaves_no_more_than_rounding():
    rng = np.random.default_rng(0)
    R = rotation(rng)
    points = np.column_stack([rng.uniform(-1, 1, (1000, 2)), np.zeros(1000)]) @ R.T
    plane = total_least_squares(points)
    assert tilt(plane.normal, R[:, 2]) < 4 * EPS
    assert np.sqrt(plane.scatter_m2[2] / plane.count) < 4 * EPS  # eigh alone: sqrt(eps) = 1e-8


@pytest.fixture(scope="module")
def cloud():
    rng = np.random.default_rng(5)
    return np.array([10.0, -4.0, 2.0]) + rng.uniform(-1, 1, (2 * CHUNK_ROWS + 17, 3))


CENTRE = np.array([10.2, -4.1, 2.3])
NORMAL = np.array([2.0, -1.0, 2.0]) / 3.0


def test_ball_is_its_one_line_definition(cloud):
    inside = np.linalg.norm(cloud - CENTRE, axis=1) < 0.5
    np.testing.assert_array_equal(gather_ball(cloud, CENTRE, 0.5), cloud[inside] - CENTRE)
    assert 0 < inside.sum() < len(cloud)
    assert gather_ball(np.zeros((0, 3)), CENTRE, 0.5).shape == (0, 3)


def test_slab_is_its_one_line_definition(cloud):
    expected = np.abs((cloud - CENTRE) @ NORMAL) < 0.1
    np.testing.assert_array_equal(within_slab(cloud, CENTRE, NORMAL, 0.1), expected)
    assert 0 < expected.sum() < len(cloud)


@pytest.mark.parametrize(("total", "count"), [(10, 10), (9, 10), (1000, 10), (1003, 250)])
def test_random_rows_take_one_from_each_stretch(total, count):
    points = np.arange(total)[:, None] * np.ones(3)
    rows = random_rows(points, count, np.random.default_rng(1))[:, 0]
    if total <= count:
        np.testing.assert_array_equal(rows, np.arange(total))
        return
    assert len(rows) == count
    stretch = np.floor(rows * count / total)
    assert np.abs(stretch - np.arange(count)).max() <= 1
    assert np.all(np.diff(rows) >= 0)


def test_random_rows_are_a_copy_and_follow_the_seed():
    points = np.random.default_rng(0).random((50, 3))
    drawn = random_rows(points, 100, np.random.default_rng(0))
    drawn += 1.0
    assert points.max() < 1.0
    first, again, other = (random_rows(points, 9, np.random.default_rng(s)) for s in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("tilts", [(2e-4, -1e-4), (0.0, 3e-4), (-3e-4, 0.0)])
def test_the_scatter_in_axes_near_the_plane_gives_the_plane(tilts):
    """Axes a little off an exact plane: the tilt and what is across it, to the third order."""
    uv = np.random.default_rng(1).uniform(-1.0, 1.0, (1000, 2)) * [1.0, 0.6]
    uv = (uv - uv.mean(axis=0)) @ linalg.eigh(np.cov(uv.T))[1]  # along the axes
    points = np.column_stack([uv, uv @ tilts])
    basis, across = _tilted(np.eye(3), points.T @ points)
    truth = np.array([*np.negative(tilts), 1.0]) / np.linalg.norm([*tilts, 1.0])
    first_order = np.linalg.norm(tilts)
    assert tilt(basis[2], truth) < 10.0 * first_order**3
    assert across < 10.0 * first_order**4 * np.sum(uv**2)
    assert np.linalg.det(basis) == pytest.approx(1.0, abs=8 * EPS)


def test_a_scatter_that_is_not_wider_than_thick_is_left():
    basis, across = _tilted(np.eye(3), np.diag([2.0, 1.0, 1.0]))
    np.testing.assert_array_equal(basis, np.eye(3))
    assert across == 1.0


@pytest.mark.parametrize("scale", [1.0, 1e-8])
def test_the_scatter_of_a_thick_cloud_in_axes_near_its_own_gives_its_own(scale):
    """Eigenvectors, to the second order of what the axes are off."""
    off = linalg.expm(1e-5 * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -2.0], [-1.0, 2.0, 0.0]]))
    along = off @ np.diag([3.0, 2.0, 0.5]) @ off.T * scale
    basis, across = _tilted(np.eye(3), along)
    values, vectors = linalg.eigh(along)
    assert tilt(basis[2], vectors[:, 0]) < 100.0 * 1e-10
    assert across == pytest.approx(values[0], rel=1e-9)


def test_a_point_that_is_left_out_costs_no_digit():
    rng = np.random.default_rng(2)
    points = rng.uniform(-1.0, 1.0, (CHUNK_ROWS + 9, 3)) * [1.0, 1.0, 0.0]
    points[0] = 1e12
    keep = np.arange(len(points)) > 0
    plane = total_least_squares(points, keep)
    assert tilt(plane.normal, np.array([0.0, 0.0, 1.0])) < 4 * EPS
    np.testing.assert_allclose(plane.centroid_m, points[1:].mean(axis=0), atol=1e-14)
