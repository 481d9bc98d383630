"""Wheels in the cloud of a whole vehicle."""

import numpy as np
import pytest

from tests.support.round_wheels import angle_between, vehicle_points, wheel_points
from wheelplane.errors import NotMeasuredError
from wheelplane.wheel.find_axis import find_axis
from wheelplane.wheel.find_wheels import _find_floor, find_wheels

CENTRES = [(x, y, 0.32) for x in (0.0, 2.6) for y in (-0.75, 0.75)]
LEVEL = [np.array([0.0, np.sign(y), 0.0]) for _, y, _ in CENTRES]


def placed(found, centres=CENTRES):
    """For each patch, the number of the nearest centre; nothing farther than 30 mm."""
    away = [np.linalg.norm(patch.origin_m - np.array(centres), axis=1) for patch in found]
    assert max(one.min() for one in away) < 0.05
    return sorted(int(np.argmin(one)) for one in away)


def test_the_four_wheels_of_a_car_are_found_whatever_their_steering():
    rng = np.random.default_rng(0)
    steer = np.radians(25.0)
    turned = np.array([[np.cos(steer), -np.sin(steer), 0], [np.sin(steer), np.cos(steer), 0],
                       [0, 0, 1.0]])  # fmt: skip
    axes = [*LEVEL[:2], *(turned @ one for one in LEVEL[2:])]
    found = find_wheels(vehicle_points(rng, CENTRES, axes), None)
    assert placed(found) == [0, 1, 2, 3]
    for patch in found:
        nearest = int(np.argmin(np.linalg.norm(patch.origin_m - np.array(CENTRES), axis=1)))
        assert patch.basis[2] @ axes[nearest] > 0.0
        assert angle_between(patch.basis[2], axes[nearest]) < np.radians(1.5)


def test_the_wheels_are_found_in_coordinates_of_a_country_with_a_point_at_0_0_0():
    offset = np.array([5e5, 5e6, 100.0])
    points = vehicle_points(np.random.default_rng(0), CENTRES, LEVEL) + offset
    found = find_wheels(np.vstack([points, np.zeros(3)]), None)
    assert placed(found, CENTRES + offset) == [0, 1, 2, 3]


@pytest.mark.slow
def test_a_wheel_that_lies_leans_or_hangs_is_none_of_the_car_s():
    rng = np.random.default_rng(1)
    lean = np.radians(25.0)
    spares = [
        ((-2.5, 0.0, 0.9), np.array([-1.0, 0.0, 0.0])),
        ((1.3, 2.5, 0.10), np.array([0.0, 0.0, 1.0])),
        ((1.3, -2.5, 0.30), np.array([0.0, -np.cos(lean), np.sin(lean)])),
    ]
    more = [wheel_points(rng, np.array(c), axis, count=30_000) for c, axis in spares]
    points = np.concatenate([vehicle_points(rng, CENTRES, LEVEL), *more])
    assert placed(find_wheels(points, None)) == [0, 1, 2, 3]


@pytest.mark.slow
def test_the_outer_one_of_twin_wheels_counts():
    rng = np.random.default_rng(7)
    inner = [(x, 0.58 * y, z) for x, y, z in CENTRES[:2]]
    points = vehicle_points(rng, [*CENTRES, *inner], [*LEVEL, *LEVEL[:2]])
    assert placed(find_wheels(points, None)) == [0, 1, 2, 3]


@pytest.mark.slow
def test_wheels_with_another_rim_than_the_stated_one_are_wheels():
    rng = np.random.default_rng(9)
    assert placed(find_wheels(vehicle_points(rng, CENTRES, LEVEL), 13.0)) == [0, 1, 2, 3]


def test_all_wheels_that_stand_are_found_for_the_choice_of_four():
    rng = np.random.default_rng(2)
    six = [*CENTRES, (-1.1, -0.75, 0.32), (-1.1, 0.75, 0.32)]
    axes = [*LEVEL, *LEVEL[:2]]
    assert placed(find_wheels(vehicle_points(rng, six, axes), None), six) == [0, 1, 2, 3, 4, 5]


def test_a_chosen_point_decides_which_wheel():
    rng = np.random.default_rng(3)
    points = vehicle_points(rng, CENTRES, LEVEL)
    near = [np.array(CENTRES[k]) + 0.1 for k in (2, 0)]
    found = find_wheels(points, None, near_m=near)
    away = [np.linalg.norm(p.origin_m - np.array(c)) for p, c in zip(found, near, strict=True)]
    assert max(away) < 0.25


def test_a_chosen_point_decides_between_wheels_of_a_tandem():
    rng = np.random.default_rng(8)
    pair = [np.array([x, 0.75, 0.32]) for x in (0.0, -0.7)]
    points = np.concatenate([wheel_points(rng, one, LEVEL[1]) for one in pair])
    with pytest.raises(NotMeasuredError, match=r"two wheels are in the scan, 0\.70 m apart"):
        find_axis(points)
    for centre in pair:
        for off in rng.uniform(-0.15, 0.15, (3, 3)):
            (found,) = find_wheels(points, None, near_m=[centre + off])
            assert np.linalg.norm(found.origin_m - centre) < 0.03


@pytest.mark.slow
def test_each_wheel_is_taken_from_the_scan_that_shows_it_best():
    rng = np.random.default_rng(4)
    points = vehicle_points(rng, CENTRES, LEVEL)
    left = points[:, 1] > 0.0
    parts = [points[left], points[~left]]
    bounds = [(0, len(parts[0])), (len(parts[0]), len(points))]
    stations = [np.array([1.3, 4.0, 1.0]), np.array([1.3, -4.0, 1.0])]
    found = find_wheels(np.concatenate(parts), None, bounds, stations)
    assert [patch.part for patch in found] == [int(p.origin_m[1] < 0.0) for p in found]
    assert all(patch.station is not None for patch in found)


@pytest.mark.parametrize("raised_mm", range(60, 160, 5))
def test_the_floor_is_the_lowest_surface_although_a_platform_stands_on_it(raised_mm):
    """Whatever the platform's height, and that of the cloud's origin."""
    rng = np.random.default_rng(10)
    place = rng.uniform((-4.0, -3.0), (4.0, 3.0), (10_000, 2))
    above = np.all(np.abs(place) < (3.0, 2.0), axis=1)
    pieces = np.column_stack(
        [place, raised_mm * 1e-3 * above + rng.normal(0.0, 0.0005, len(place))]
    )
    normals = np.array([0.0, 0.0, 1.0]) + rng.normal(0.0, 0.03, pieces.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for origin_m in (0.0, 0.01, 0.024, 0.037):
        floor = _find_floor(pieces + np.array([0.0, 0.0, origin_m]), normals)
        height_m = floor.height_m(np.array([[x, y, origin_m] for x in (-4, 4) for y in (-3, 3)]))
        np.testing.assert_allclose(height_m, 0.0, atol=1e-3)


def test_a_cloud_without_a_floor_is_refused():
    rng = np.random.default_rng(5)
    wall = rng.random((50_000, 3)) * [3.0, 0.001, 2.0]
    with pytest.raises(NotMeasuredError, match="no floor"):
        find_wheels(wall, None)


def test_wheels_on_a_lift_are_not_said_to_be_missing():
    """They are measured where a point on each is chosen."""
    rng = np.random.default_rng(11)
    points = vehicle_points(rng, CENTRES, LEVEL)
    lift = np.all(np.abs(points[:, :2] - [1.3, 0.0]) < (2.0, 1.2), axis=1)
    points[~lift, 2] -= 0.3
    with pytest.raises(NotMeasuredError, match=r"stand about 0\.3 m above its floor.*--hint"):
        find_wheels(points, None)
    found = find_wheels(points, None, near_m=[np.array(one) + 0.05 for one in CENTRES])
    assert placed(found) == [0, 1, 2, 3]


def test_a_floor_alone_has_no_wheels():
    rng = np.random.default_rng(6)
    floor = rng.random((200_000, 3)) * [4.0, 3.0, 0.001]
    assert find_wheels(floor, None) == ()
