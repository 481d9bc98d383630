"""Flange and widest ring on the meridian."""

import numpy as np

from tests.support.round_wheels import EDGE_M, GROOVE_M, MERIDIAN, axis_of, wheel_points
from wheelplane.wheel.cells import Grid
from wheelplane.wheel.fit_axis import fit_axis
from wheelplane.wheel.flange import edge_ring, find_flange, widest_ring
from wheelplane.wheel.normal_lines import Axis

GRID = Grid(0.1, 0.0015, 150, 72)


def fitted(seed, meridian=MERIDIAN):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction, meridian=meridian)
    return points, fit_axis(points, Axis(centre, direction), GRID, (0.15, 0.33), 4)


def test_edge_and_groove_are_found_and_the_edge_has_its_height():
    points, fit = fitted(0)
    found = find_flange(points, fit, None)
    assert abs(found.edge_m - EDGE_M) < 0.003
    assert abs(found.groove_m - GROOVE_M) < 0.002
    radius, height = edge_ring(fit, found)
    assert abs(radius - EDGE_M) < 0.002
    assert abs(height) < 0.0003
    assert abs(widest_ring(fit, 0.24)[0] - 0.28) < 0.01


def test_a_stated_rim_decides_what_may_be_its_flange():
    points, fit = fitted(1)
    assert find_flange(points, fit, 17.0) is not None
    assert find_flange(points, fit, 14.0) is None


def test_a_wall_without_a_groove_has_no_flange():
    smooth = MERIDIAN[(MERIDIAN[:, 0] < 0.228) | (MERIDIAN[:, 0] > 0.252)]
    points, fit = fitted(2, smooth)
    assert find_flange(points, fit, None) is None
