"""Meridian of a surface of revolution."""

import numpy as np

from wheelplane.wheel.cells import CellPoints, Grid
from wheelplane.wheel.meridian import Meridian
from wheelplane.wheel.normal_lines import Axis

GRID = Grid(0.2, 0.002, 30, 36)
AXIS = Axis(np.zeros(3), np.array([0.0, 0.0, 1.0]))


def cone(rng, slope, noise_m, count=60_000):
    radius, angle = rng.uniform(0.2, 0.26, count), rng.uniform(-np.pi, np.pi, count)
    height = slope * (radius - 0.23) + rng.normal(0.0, noise_m, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])


def test_a_cone_has_its_slope_and_its_noise():
    points = CellPoints.of(cone(np.random.default_rng(0), 0.5, 0.001), AXIS, np.eye(3), GRID)
    found = Meridian.of(points)
    u = 1.25 * 0.001 / np.sqrt(2000 / 36)  # of the median of the cells of a ring
    assert np.abs(found.height_m - 0.5 * (GRID.radius_m - 0.23)).max() < 4.0 * u
    assert np.abs(found.slope[2:-2] - 0.5).max() < 4.0 * u / 0.002
    assert 0.9e-3 < np.median(found.noise_m) < 1.25e-3
    assert np.all(found.usable)


def test_heights_over_the_meridian_are_nothing_but_noise():
    points = CellPoints.of(cone(np.random.default_rng(1), 0.5, 0.001), AXIS, np.eye(3), GRID)
    heights = Meridian.of(points).heights(points)
    assert heights.count.sum() > 0.9 * len(points.cell)
    assert abs(np.average(heights.mean_m, weights=heights.count)) < 1e-4


def test_steep_and_empty_rings_are_not_used():
    rng = np.random.default_rng(2)
    points = CellPoints.of(cone(rng, 4.0, 0.0005), AXIS, np.eye(3), GRID)
    assert not np.any(Meridian.of(points).usable[2:-2])
    inner = cone(rng, 0.5, 0.0005)
    inner = inner[np.hypot(*inner[:, :2].T) < 0.23]
    found = Meridian.of(CellPoints.of(inner, AXIS, np.eye(3), GRID))
    assert not np.any(found.usable[GRID.radius_m > 0.232])
