"""What the wheels stand on: pads, patches and waves of a floor, by scans of another make."""

import numpy as np
import pytest

from tests.support.bay_floors import SLOPES, scanned
from wheelplane.uncertainty import coverage_factor
from wheelplane.vehicle.contact import find_contact
from wheelplane.vehicle.vertical import fit_floor

RR, RL, FR, FL = np.eye(4)


def u_of(floor):
    return np.sqrt(np.diag(floor.covariance))


@pytest.mark.parametrize("height", [0.003, 0.01, 0.04, 0.07, 0.1])
@pytest.mark.parametrize("wheel", range(4))
def test_a_wheel_on_a_pad_tilts_the_plane_and_is_in_its_uncertainty(wheel, height):
    """The floor beside the pad, another truth, lies within the twist's uncertainty as well."""
    points, wheels, true = scanned(wheel, height * np.eye(4)[wheel])
    floor = fit_floor(points, wheels)
    assert floor.pads_m[wheel] == pytest.approx(height, abs=6e-4)
    assert not np.delete(floor.pads_m, wheel).any()
    assert floor.twist_m == pytest.approx(abs(height), abs=8e-4)
    np.testing.assert_array_less(np.abs(floor.slopes - true), 4.0 * u_of(floor))
    twist = np.sqrt(np.diag(floor.twist_covariance))
    np.testing.assert_array_less(np.abs(SLOPES - true), 1.3 * twist)
    np.testing.assert_array_less(0.7 * twist, np.abs(SLOPES - true))


@pytest.mark.parametrize(
    "pads",
    [
        (0.08, 0.07, 0.08, 0.07),
        (0.09, 0.07, 0.09, 0.07),
        (0.08, 0.08, 0.07, 0.07),
        (0.09, 0.06, 0.09, 0.06),
        (0.06, 0.06, 0.06, 0.06),
        (0.1, 0.02, 0.05, 0.0),
    ],
)
def test_wheels_on_high_pads_are_seen_to_stand_on_them(pads):
    """All of them too, where none shows by its centre how high the others are raised."""
    for seed in range(3):
        points, wheels, true = scanned(seed, np.array(pads))
        floor = fit_floor(points, wheels)
        np.testing.assert_allclose(floor.pads_m, pads, atol=6e-4)
        np.testing.assert_array_less(np.abs(floor.slopes - true), 4.0 * u_of(floor))


@pytest.mark.parametrize("pads", [(0.0, 0.0, 0.0, 0.0), (0.04, 0.08, 0.0, 0.02)])
def test_wheel_centres_stand_as_high_above_pads_as_above_the_floor(pads):
    points, wheels, _ = scanned(2, np.array(pads))
    floor = fit_floor(points, wheels)
    np.testing.assert_allclose(floor.above_m, floor.above_m.mean(), atol=2e-3)
    assert floor.depth_m == pytest.approx(floor.above_m.mean(), abs=2e-3)


def test_a_block_that_is_not_seen_shows_in_the_heights_of_the_centres():
    """150 mm beneath the front wheels: its top is higher than a pad may be."""
    points, wheels, _ = scanned(2, 0.15 * (FR + FL))
    floor = fit_floor(points, wheels)
    assert not floor.pads_m.any()
    assert np.ptp(floor.above_m) > 0.06


def test_pads_that_lie_in_one_plane_are_no_twist():
    """Plates of 40 mm beneath the front wheels, and beneath all: planes, as a floor is."""
    front, everywhere = 0.04 * (FR + FL), np.full(4, 0.04)
    for pads in (front, everywhere):
        points, wheels, true = scanned(11, pads)
        floor = fit_floor(points, wheels)
        np.testing.assert_allclose(floor.pads_m, pads, atol=6e-4)
        assert floor.twist_m == 0.0
        assert not floor.twist_covariance.any()
        np.testing.assert_array_less(np.abs(floor.slopes - true), 4.0 * u_of(floor))
        assert u_of(floor).max() < 5e-4
    assert np.linalg.norm(scanned(11, front)[2] - SLOPES) > 0.01


@pytest.mark.parametrize("seed", range(8))
def test_a_level_floor_is_the_plane_of_its_cells(seed):
    points, wheels, true = scanned(seed)
    floor = fit_floor(points, wheels)
    assert not floor.pads_m.any()
    assert floor.twist_m == 0.0
    assert u_of(floor).max() < 2.5e-5
    np.testing.assert_allclose(floor.slopes, true, atol=1e-4)


@pytest.mark.parametrize("gap", [0.06, 0.1])
def test_a_board_beside_a_wheel_is_no_pad(gap):
    """20 mm high, with the floor between it and the tyre."""
    points, wheels, true = scanned(5)
    out = wheels[2, 0] + 0.06 - points[:, 0]
    board = (out > gap) & (out < 0.3) & (np.abs(points[:, 1] - wheels[2, 1]) < 0.3)
    board &= points[:, 2] < -0.29
    points[board, 2] += 0.02
    floor = fit_floor(points, wheels)
    assert not floor.pads_m.any()
    np.testing.assert_allclose(floor.slopes, true, atol=2e-4)


def test_without_a_sidewall_or_points_beside_it_no_pad_is_seen():
    points, wheels, _ = scanned(6, 0.01 * FR)
    above = points[:, 2] + 0.3 - points[:, :2] @ SLOPES
    seen = find_contact(points, above, wheels[2], 1e-3)
    assert seen.pad_m == pytest.approx(0.01, abs=6e-4)
    assert seen.middle_m == pytest.approx([-0.58, 2.65], abs=0.01)
    low = above < 0.05
    for kept in (low, ~low, np.zeros(len(low), dtype=bool)):
        none = find_contact(points[kept], above[kept], wheels[2], 1e-3)
        assert (none.pad_m, none.u_m) == (0.0, 0.0)
        assert none.middle_m == pytest.approx([-0.58, 2.65], abs=0.01)


CASES = {
    "level": {},
    "pad": {"pads": 0.01 * FR},
    "narrow pad": {"pads": 0.01 * RL, "size": (0.3, 0.3), "count": 8000},
    "thin pad": {"pads": 0.003 * RR},
    "two pads": {"pads": 0.04 * (FR + FL)},
    "patch": {"patches": 0.003 * FR},
    "waves": {"waves": 1e-3},
    "large waves": {"waves": 3e-3},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_errors_are_as_large_as_stated(case):
    """Slopes of 60 floors: 5 % of 120 outside, at most 13 with one chance in 500.

    Level floors have errors of 0.1', from what tyres hide: twice their u.
    """
    outside, count = 0, 60
    for seed in range(count):
        points, wheels, true = scanned(seed, **CASES[case])
        floor = fit_floor(points, wheels)
        u = np.sqrt(np.diag(floor.covariance + floor.twist_covariance))
        expanded = u * coverage_factor(0.95, np.array([float(floor.dof)]))
        outside += np.count_nonzero(np.abs(floor.slopes - true) > expanded)
    assert outside <= (13 if case != "level" else 40)
