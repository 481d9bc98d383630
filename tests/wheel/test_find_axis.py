"""Rough axis of a wheel in a scan."""

import numpy as np
import pytest

from tests.support.round_wheels import angle_between, aside, axis_of, door_points, wheel_points
from wheelplane.errors import NotMeasuredError
from wheelplane.wheel.find_axis import RoughAxis, _about, find_axis
from wheelplane.wheel.normal_lines import Axis


@pytest.mark.parametrize("seed", range(4))
def test_the_axis_is_found_beside_a_door_that_is_not_square_to_it(seed):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    wheel = wheel_points(rng, centre, direction)
    found = find_axis(np.concatenate([wheel, door_points(rng, centre, direction)]))
    assert angle_between(found.axis.direction, direction) < np.radians(1.5)
    assert aside(found.axis.point_m, centre, direction) < 0.01
    assert 0.28 < found.radius_m < 0.42


def test_two_wheels_in_one_scan_are_refused():
    rng = np.random.default_rng(5)
    centre, direction = axis_of(rng)
    across = np.cross(direction, [0.2, 0.3, 0.9])
    other = centre + 0.9 * across / np.linalg.norm(across)
    both = [wheel_points(rng, place, direction, count=40_000) for place in (centre, other)]
    with pytest.raises(NotMeasuredError, match=r"two wheels are in the scan, 0\.9") as caught:
        find_axis(np.concatenate(both))
    assert caught.value.status == "ambiguous-target"


def test_a_stray_point_however_far_hides_no_wheel():
    rng = np.random.default_rng(0)
    centre, direction = axis_of(rng)
    wheel = wheel_points(rng, centre, direction)
    for stray in (-1e6, 1e5, 1e9):
        found = find_axis(np.vstack([wheel, centre + stray]))
        assert angle_between(found.axis.direction, direction) < np.radians(1.5)
        assert aside(found.axis.point_m, centre, direction) < 0.01


def test_two_planes_are_no_wheel():
    rng = np.random.default_rng(2)
    floor = np.column_stack([rng.uniform(-1, 1, (30_000, 2)), rng.normal(0.0, 0.001, 30_000)])
    wall = np.column_stack([rng.uniform(-1, 1, 30_000), rng.normal(1.0, 0.001, 30_000),
                            rng.uniform(0, 2, 30_000)])  # fmt: skip
    with pytest.raises(NotMeasuredError) as caught:
        find_axis(np.concatenate([floor, wall]))
    assert caught.value.status in ("wheel-not-found", "too-few-points")


@pytest.mark.parametrize("noise_m", [0.03, 0.1])
def test_many_points_that_are_no_surface_are_not_too_few(noise_m):
    """More of them, as the status of too few asks for, would show no wheel either."""
    rng = np.random.default_rng(6)
    points = wheel_points(rng, np.zeros(3), np.array([0.0, 1.0, 0.0]), 150_000, noise_m)
    with pytest.raises(NotMeasuredError, match="lie on no smooth surface") as caught:
        find_axis(points)
    assert caught.value.status == "wheel-not-found"


def test_few_points_are_too_few():
    with pytest.raises(NotMeasuredError) as caught:
        find_axis(np.random.default_rng(0).normal(size=(50, 3)))
    assert caught.value.status == "too-few-points"


@pytest.mark.parametrize("places", [1, 3])
@pytest.mark.parametrize("seed", range(4))
def test_many_points_at_few_places_are_too_few(places, seed):
    """A sample by coordinates holds all points of a place, or none."""
    points = np.tile(np.random.default_rng(seed).normal(size=(places, 3)), (300_000 // places, 1))
    with pytest.raises(NotMeasuredError) as caught:
        find_axis(points)
    assert caught.value.status == "too-few-points"


def test_of_several_axes_of_the_chosen_wheel_the_best_counts():
    """Another start may lead to a poorer axis of the same wheel, nearer to the point by chance."""
    level = np.array([0.0, 1.0, 0.0])
    best, poor, other = (
        RoughAxis(Axis(np.array([x, 0.0, 0.3]), level), score, 0.32, 1.0)
        for x, score in ((0.0, 80.0), (0.02, 50.0), (0.7, 90.0))
    )
    near = np.array([0.04, 0.1, 0.3])
    assert _about(near, [poor, other, best]) == [best]
