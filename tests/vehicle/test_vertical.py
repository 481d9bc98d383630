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
