"""The floor by points beside the wheels: truth, u as large as the errors, and no floor."""

import numpy as np
import pytest
from scipy import stats

from wheelplane.vehicle.vertical import fit_floor

WHEELS = np.array([[-0.75, 0.0, 0.0], [0.75, 0.0, 0.0], [-0.74, 2.65, 0.0], [0.76, 2.64, 0.0]])
LEVEL, SLOPES = -0.31, np.array([0.002, -0.0035])


def points(seed, noise=1e-3, count=20_000, waves=0.0):
    """A floor around the car under its body, with stray points beyond it, as mirrors make."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform((-2.0, -1.5), (2.0, 4.5), (count, 2))
    floor = np.column_stack([xy, LEVEL + xy @ SLOPES + noise * rng.normal(size=count)])
    floor[:, 2] += waves * np.sin(xy[:, 0] * 40.0)
    body = rng.uniform((-0.8, -0.8, -0.12), (0.8, 3.5, 1.0), (count, 3))
    stray = floor[: count // 50] - [0.0, 0.0, 0.4]
    return np.concatenate([floor, body, stray])


def test_the_floors_slopes_are_found():
    floor = fit_floor(points(1, noise=0.0), WHEELS)
    np.testing.assert_allclose(floor.slopes, SLOPES, atol=1e-9)
    assert floor.depth_m == pytest.approx(0.31 - np.mean(WHEELS[:, :2] @ SLOPES), abs=1e-6)


def test_errors_are_as_large_as_stated():
    found = [fit_floor(points(seed), WHEELS) for seed in range(60)]
    squares = [
        (f.slopes - SLOPES) @ np.linalg.solve(f.covariance, f.slopes - SLOPES) for f in found
    ]
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * len(found)) / len(found)
    assert low < np.mean(squares) < high * 1.02  # F of 2 and some 100 degrees of freedom
    assert np.sqrt(np.trace(found[0].covariance)) < 1e-4


def test_degrees_of_freedom_are_the_cells_without_those_of_a_plane():
    """Points in the middles of so many cells beside each wheel, as many in each."""
    middles = np.array([[x, y] for x in (0.1, 0.3, 0.5) for y in (0.1, 0.3)])
    wheels = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 3.0, 0.0], [1.0, 3.0, 0.0]])
    xy = np.concatenate([wheel[:2] + middles for wheel in wheels]).repeat(8, axis=0)
    rng = np.random.default_rng(1)
    xy = xy + rng.uniform(-0.05, 0.05, xy.shape)
    floor = fit_floor(np.column_stack([xy, LEVEL + 1e-3 * rng.normal(size=len(xy))]), wheels)
    assert floor.dof == len(wheels) * len(middles) - 3


def test_a_floor_that_is_not_flat_is_known_less_well():
    even, uneven = (fit_floor(points(3, waves=waves), WHEELS) for waves in (0.0, 3e-3))
    assert np.trace(uneven.covariance) > 4.0 * np.trace(even.covariance)


def test_without_floor_beside_every_wheel_there_is_none():
    everywhere = points(4)
    assert fit_floor(everywhere[20_000:40_000], WHEELS) is None
    away = everywhere[np.linalg.norm(everywhere[:, :2] - WHEELS[0, :2], axis=1) > 1.0]
    assert fit_floor(away, WHEELS) is None
    assert fit_floor(np.zeros((0, 3)), WHEELS) is None


def beside(wheels, cells, each, height=LEVEL):
    """Points of a level floor: as many in as many cells of 0.2 m beside each wheel."""
    middles = np.array([[x, y] for x in (0.1, 0.3) for y in (0.1, 0.3, 0.5)])
    spots = [np.asarray(wheel[:2]) + middles[:n] for wheel, n in zip(wheels, cells, strict=True)]
    xy = np.concatenate(spots).repeat(each, axis=0)
    xy = xy + np.random.default_rng(2).uniform(-0.05, 0.05, xy.shape)
    return np.column_stack([xy, np.full(len(xy), height)])


APART = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 3.0, 0.0], [1.0, 9.0, 0.0]])


def test_a_floor_needs_four_cells_of_four_points_beside_each_wheel():
    assert fit_floor(beside(APART, [4, 4, 4, 4], 4), APART).dof == 16 - 3
    assert fit_floor(beside(APART, [6, 6, 6, 6], 3), APART) is None
    for few in range(4):
        cells = [3 if i == few else 6 for i in range(4)]
        assert fit_floor(beside(APART, cells, 8), APART) is None


@pytest.mark.parametrize("wheel", range(4))
def test_each_wheel_has_the_cells_that_are_nearest_to_it(wheel):
    """The same cells in any order of the wheels, also where one is far from the others."""
    order = np.roll(np.arange(4), wheel)
    floor = fit_floor(beside(APART, [4, 5, 6, 4], 8), APART[order])
    assert floor.dof == 19 - 3
    assert floor.depth_m == pytest.approx(-LEVEL, abs=1e-12)


@pytest.mark.parametrize("depth", [0.06, 0.1, 0.95, 1.05])
def test_a_floor_lies_8_to_100_cm_below_the_wheel_centres(depth):
    floor = fit_floor(beside(APART, [6, 6, 6, 6], 8, -depth), APART)
    if 0.08 < depth < 1.0:
        assert floor.depth_m == pytest.approx(depth, abs=1e-12)
    else:
        assert floor is None


def test_what_lies_elsewhere_changes_nothing():
    """A pit, the body, and heaps further than 0.8 m from every wheel; nearer they would count."""
    alone, rng = points(5), np.random.default_rng(6)
    pit = rng.uniform((-2.0, -1.5, -1.6), (2.0, 4.5, -1.05), (20_000, 3))
    body = rng.uniform((-2.0, -1.5, -0.07), (2.0, 4.5, 1.0), (20_000, 3))
    heaps = rng.uniform((-2.0, -1.5, LEVEL - 0.02), (2.0, 4.5, LEVEL), (20_000, 3))
    apart = np.linalg.norm(heaps[:, None, :2] - WHEELS[:, :2], axis=2).min(axis=1)
    one = fit_floor(alone, WHEELS)
    two = fit_floor(np.concatenate([alone, pit, body, heaps[apart > 0.81]]), WHEELS)
    np.testing.assert_array_equal(two.slopes, one.slopes)
    np.testing.assert_array_equal(two.covariance, one.covariance)
    near = fit_floor(np.concatenate([alone, heaps[(apart > 0.7) & (apart < 0.79)]]), WHEELS)
    assert np.abs(near.slopes - one.slopes).max() > 1e-6


@pytest.mark.parametrize("below", [None, 0.03, 0.1])
def test_what_has_points_at_every_height_is_no_floor(below):
    """Tyres alone, or over a floor that too few points show: no plane through them is one."""
    rng = np.random.default_rng(8)
    found = beside(APART, [6, 6, 6, 6], 60)
    found[:, 2] += rng.uniform(0.0, 0.25, len(found))
    if below is not None:
        sparse = beside(APART, [6, 6, 6, 6], 6, LEVEL - below)
        found = np.concatenate([found, sparse[rng.random(len(sparse)) < 0.6]])
    floor = fit_floor(found, APART)
    if floor is not None:  # then it is the true one
        np.testing.assert_allclose(floor.slopes, 0.0, atol=2e-3)
        assert floor.depth_m == pytest.approx(-LEVEL + (below or 0.0), abs=0.005)
    assert floor is None or below is not None


def test_the_floor_is_found_under_what_lies_on_it_and_over_its_mirror_image():
    """100 points lie beside a wheel: each cell has 60 on a mat of 3 to 5 cm, 4 mirrored below."""
    rng = np.random.default_rng(7)
    found = beside(APART, [6, 6, 6, 6], 100)
    part = np.tile(np.arange(100), len(found) // 100)
    on_mat = part < 60
    found[on_mat, 2] += rng.uniform(0.03, 0.049, np.count_nonzero(on_mat))
    found[part >= 96, 2] -= 0.3
    found[:, 2] += found[:, :2] @ SLOPES
    floor = fit_floor(found, APART)
    np.testing.assert_allclose(floor.slopes, SLOPES, atol=1e-12)
    assert floor.depth_m == pytest.approx(-LEVEL - np.mean(APART[:, :2] @ SLOPES), abs=1e-12)
