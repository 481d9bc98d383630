"""Cells of radius and angle, and means in them."""

import numpy as np

from wheelplane.wheel.cells import CellPoints, Grid, clipped_means, medians
from wheelplane.wheel.normal_lines import Axis

GRID = Grid(0.1, 0.05, 4, 8)


def test_medians_are_those_of_each_group():
    rng = np.random.default_rng(0)
    group, value = rng.integers(0, 20, 5001), rng.normal(size=5001)
    middle, count = medians(group, value, 21)
    for k in range(20):
        own = np.sort(value[group == k])
        assert abs(middle[k] - own[len(own) // 2]) < 2e-5
        assert count[k] == len(own)
    assert np.isnan(middle[20])


def test_a_point_lies_in_the_cell_of_its_radius_and_angle():
    axis, basis = Axis(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 1.0])), np.eye(3)
    ring, sector = np.divmod(np.arange(GRID.cells), GRID.sectors)
    radius, angle = GRID.radius_m[ring], GRID.angle[sector]
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * ring])
    found = CellPoints.of(points + axis.point_m, axis, basis, GRID)
    assert np.array_equal(found.cell, np.arange(GRID.cells))
    assert np.allclose(found.height_m, 0.01 * ring)
    outside = CellPoints.of(
        np.add(axis.point_m, [[0.05, 0.0, 0.0], [0.0, 0.31, 0.0]]), axis, basis, GRID
    )
    assert len(outside.cell) == 0


def test_means_leave_out_what_is_far_from_the_middle():
    cell, value = np.zeros(5, dtype=np.int64), np.array([1.0, 1.1, 0.9, 9.0, -7.0])
    points = CellPoints(GRID, cell, np.full(5, 0.12), value)
    found = clipped_means(points, value, np.ones(GRID.cells), np.full(GRID.cells, 0.5))
    assert found.count[0, 0] == 3
    assert abs(found.mean_m[0, 0] - 1.0) < 1e-12
