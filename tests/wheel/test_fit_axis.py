"""Axis of rings, to convergence."""

import numpy as np
import pytest

from tests.support.round_wheels import angle_between, aside, axis_of, wheel_points
from wheelplane.errors import NotMeasuredError
from wheelplane.wheel.cells import Grid
from wheelplane.wheel.fit_axis import fit_axis
from wheelplane.wheel.normal_lines import Axis

GRID = Grid(0.1, 0.0015, 150, 72)
RIM = (0.196, 0.242)


def started(rng, centre, direction):
    tilted = direction + 0.02 * rng.normal(size=3)
    return Axis(centre + rng.normal(0.0, 0.005, 3), tilted / np.linalg.norm(tilted))


@pytest.mark.parametrize("seed", range(4))
def test_the_axis_is_found_from_a_degree_off(seed):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction)
    found = fit_axis(points, started(rng, centre, direction), GRID, RIM)
    V = found.cells.covariance
    assert angle_between(found.axis.direction, direction) < 4.5 * np.sqrt(np.trace(V[:2, :2]))
    assert aside(found.axis.point_m, centre, direction) < 4.5 * np.sqrt(np.trace(V[2:4, 2:4]))
    assert np.sqrt(np.trace(V[:2, :2])) < np.radians(1.0 / 60.0)


@pytest.mark.parametrize("seed", range(4))
def test_from_far_aside_the_same_axis_is_found(seed):
    """The meridian about a start far aside is smeared: its slopes show less of the shift."""
    rng = np.random.default_rng([seed, 60])
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction, count=15_000, noise_m=0.005)
    across = np.cross(direction, rng.normal(size=3))
    aside_m = 0.04 * across / np.linalg.norm(across)
    grid = Grid(0.1, 0.003, 75, 48)
    near, far = (
        fit_axis(points, Axis(centre + off, direction), grid, (0.15, 0.33), 1e-4)
        for off in (np.zeros(3), aside_m)
    )
    V = near.cells.covariance
    u_m, u_rad = np.sqrt(np.trace(V[2:4, 2:4])), np.sqrt(np.trace(V[:2, :2]))
    assert aside(far.axis.point_m, near.axis.point_m, direction) < 0.5 * u_m
    assert angle_between(far.axis.direction, near.axis.direction) < 0.5 * u_rad


def test_a_wave_of_two_periods_moves_nothing():
    rng = np.random.default_rng(7)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction, wave_m=0.0005)
    found = fit_axis(points, started(rng, centre, direction), GRID, RIM)
    assert angle_between(found.axis.direction, direction) < np.radians(1.0 / 60.0)
    assert abs(np.hypot(*found.cells.step[4:6]) - 0.0005) < 5e-5


def test_too_few_rings_are_refused():
    rng = np.random.default_rng(8)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction, count=5_000)
    with pytest.raises(NotMeasuredError) as caught:
        fit_axis(points, Axis(centre, direction), GRID, (0.10, 0.18))
    assert caught.value.status == "wheel-not-found"
