"""Flange and widest ring on the meridian."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.round_wheels import EDGE_M, GROOVE_M, MERIDIAN, axis_of, wheel_points
from wheelplane.wheel.cells import Grid
from wheelplane.wheel.fit_axis import fit_axis
from wheelplane.wheel.flange import Flange, bulges_inwards, edge_ring, find_flange, widest_ring
from wheelplane.wheel.meridian import Meridian
from wheelplane.wheel.normal_lines import Axis

GRID = Grid(0.1, 0.0015, 150, 72)


def fitted(seed, meridian=MERIDIAN, size=1.0):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction, meridian=size * meridian)
    grid = replace(GRID, low_m=size * GRID.low_m, width_m=size * GRID.width_m)
    return points, fit_axis(points, Axis(centre, direction), grid, (0.15, size * 0.33))


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


def grooved(at_m, depth_m):
    """The meridian with a groove in the tyre's side wall."""
    away = np.array([-0.006, 0.0, 0.006])
    height = np.interp(at_m + away, *MERIDIAN.T) - [0.0, depth_m, 0.0]
    beside = np.abs(MERIDIAN[:, 0] - at_m) > 0.0061
    rows = np.vstack([MERIDIAN[beside], np.column_stack([at_m + away, height])])
    return rows[np.argsort(rows[:, 0])]


def test_a_groove_of_the_tyre_that_is_less_clear_is_not_the_flange_s():
    points, fit = fitted(3, grooved(0.274, 0.0035))
    assert abs(find_flange(points, fit, None).edge_m - EDGE_M) < 0.003


def test_a_groove_farther_out_that_is_only_a_little_clearer_decides_nothing():
    points, fit = fitted(4, grooved(0.274, 0.0085))
    assert find_flange(points, fit, None) is None


def ridged(lift_m):
    """The meridian without its flange's groove, and with a ridge of the rim at 0.2 m."""
    ridge = np.array([(0.196, lift_m - 0.022), (0.2, lift_m - 0.018), (0.204, lift_m - 0.026)])
    outer = MERIDIAN[(MERIDIAN[:, 0] > 0.212) & (np.abs(MERIDIAN[:, 0] - GROOVE_M) > 0.005)]
    return np.vstack([ridge, outer])


def test_a_ridge_of_the_rim_deep_below_the_tyre_is_not_the_flange():
    points, fit = fitted(7, ridged(0.0))
    assert find_flange(points, fit, None) is None
    assert abs(find_flange(points, fit, 15.0).edge_m - 0.2) < 0.003  # a rim that is stated


@pytest.mark.parametrize("size", [1.0, 1.4])
def test_the_larger_a_tyre_the_farther_it_may_bulge_over_its_flange(size):
    found = find_flange(*fitted(7, ridged(0.006), size), None)
    assert abs(found.edge_m - size * 0.2) < 0.003


@pytest.mark.parametrize("at_m", [0.2803, 0.2807, 0.2811])
def test_the_top_of_a_round_wall_is_exact_wherever_it_lies_between_two_rings(at_m):
    _, fit = fitted(9)
    grid, noise = fit.meridian.grid, fit.meridian.noise_m
    wall = Meridian(grid, 0.011 - (grid.radius_m - at_m) ** 2 / 0.16, noise)
    fit = replace(fit, meridian=wall)
    assert np.allclose(widest_ring(fit, 0.25), (at_m, 0.011), rtol=0.0, atol=1e-9)
    assert np.allclose(edge_ring(fit, Flange(at_m, 0.29, 50.0, 0.001)), (at_m, 0.011), atol=1e-9)


def test_a_tyre_s_widest_ring_is_not_the_highest_by_its_noise():
    """Mean error of 12 wheels; the highest of rings about as high is as far off as their noise."""
    radius = np.linspace(0.246, 0.314, 40)
    wall = np.column_stack([radius, 0.011 - (radius - 0.28) ** 2 / 0.16])
    meridian = np.vstack([MERIDIAN[MERIDIAN[:, 0] < 0.246], wall, [[0.316, -0.06]]])
    rng = np.random.default_rng(8)
    away, noise = [], []
    for _ in range(12):
        centre, direction = axis_of(rng)
        points = wheel_points(rng, centre, direction, 20_000, 0.005, meridian=meridian)
        start = Axis(centre, direction)
        fit = fit_axis(points, start, Grid(0.1, 0.003, 75, 48), (0.15, 0.33))
        _, height = widest_ring(fit, 0.25)
        away.append(height + (fit.axis.point_m - centre) @ direction - 0.011)
        noise.append(np.nanmedian(fit.cells.ring_u_m))
    assert abs(np.mean(away)) < 0.5 * np.mean(noise)


def test_a_groove_that_half_the_circle_hides_is_the_flange_s():
    rng = np.random.default_rng(5)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction)
    local = points - centre
    off = local - (local @ direction)[:, None] * direction
    radius = np.linalg.norm(off, axis=1)
    side = np.cross(direction, [0.3, 0.5, 0.8])
    hidden = (np.abs(radius - GROOVE_M) < 0.0022) & (off @ side > 0.0)
    grid = Grid(0.1, 0.004, 56, 48)
    fit = fit_axis(points[~hidden], Axis(centre, direction), grid, (0.15, 0.33))
    assert abs(find_flange(points[~hidden], fit, None).edge_m - EDGE_M) < 0.003


def test_the_side_wall_decides_what_is_outwards_and_the_rim_alone_nothing():
    rng = np.random.default_rng(6)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction)
    radius = np.linalg.norm(np.cross(points - centre, direction), axis=1)
    for sign, seen, inwards in ((1, 1.0, False), (-1, 1.0, True), (1, 0.265, False)):
        start = Axis(centre, sign * direction)
        fit = fit_axis(points[radius < seen], start, GRID, (0.15, 0.33))
        assert bulges_inwards(fit) is inwards
