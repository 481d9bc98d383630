"""Sweep scans with their slopes: the frame by central differences, u by the dense covariance."""

import numpy as np
import pytest

from tests.support.turning import WHEELS, Scene, rolled, side, swept
from wheelplane.kinematics.runout import runouts_of
from wheelplane.kinematics.steering_axis import STEERED, fit_steering_axes, toe_and_camber
from wheelplane.kinematics.sweep import sweep_scans
from wheelplane.kinematics.toe_out_on_turns import INNER_RAD, toe_out_of
from wheelplane.kinematics.wheel_axis import fit_axles, on_axles, size
from wheelplane.vehicle.autodiff import Dual

STEERS = np.radians([-21.0, -10.0, 0.0, 10.0, 21.0])
HALF = np.array([0.0, np.pi])


@pytest.fixture(scope="module")
def measurement():
    scene = Scene(4).references()
    for wheel in STEERED:
        swept(scene, wheel, 0.07, 0.2, STEERS, positions=[f"p{i}" for i in range(len(STEERS))])
    return rolled(scene, "RL", HALF, u_turn=1e-3, with_reference=True).measure()


def test_the_frame_s_slopes_are_its_central_differences(measurement):
    scans = sweep_scans(measurement.plates or measurement)
    vector, still = np.array([0.3, -0.5, 0.8]), np.zeros((3, scans.count))
    slopes = [part.slope for part in scans.in_frame(vector, still)]
    for wheel in range(len(WHEELS)):
        for way in range(3):
            step = np.zeros((4, 3))
            step[wheel, way] = 1e-6
            plus, minus = (
                scans.on_centres(scans.reference_centres_m + sign * step, scans.d_centres)
                for sign in (1, -1)
            )
            expected = [
                (high.value - low.value) / 2e-6
                for high, low in zip(
                    plus.in_frame(vector, still), minus.in_frame(vector, still), strict=True
                )
            ]
            column = 6 * wheel + 3 + way
            np.testing.assert_allclose([s[column] for s in slopes], expected, atol=1e-7)


def test_u_is_that_of_the_dense_covariance(measurement):
    scans = sweep_scans(measurement.plates or measurement)
    covariance = sum(effect.factor @ effect.factor.T for effect in scans.effects)
    slope = np.random.default_rng(1).normal(size=scans.count)
    assert scans.estimate(Dual(0.0, slope)).u == pytest.approx(np.sqrt(slope @ covariance @ slope))


def test_toe_and_camber_of_a_scan_are_those_of_the_wheel(measurement):
    scans = sweep_scans(measurement.plates or measurement)
    assert len(scans.scans) == 2 * len(STEERS) + len(HALF)
    for i, scan in enumerate(scans.scans):
        toe, camber = toe_and_camber(scans, scan.wheel, scan.normal, scans.columns(i)[0])
        assert toe.value == pytest.approx(scan.angles.toe_rad, abs=1e-12)
        assert camber.value == pytest.approx(scan.angles.camber_rad, abs=1e-12)


def test_the_length_of_a_vector_that_is_zero_has_a_slope():
    zero, slope = Dual(0.0, np.zeros(2)), np.array([1.0, 2.0])
    np.testing.assert_array_equal(size((Dual(0.0, slope), zero, zero)).slope, slope)
    assert size((Dual(3.0, slope), Dual(4.0, slope), zero)).value == pytest.approx(5.0)


def test_one_axle_that_is_not_ok_leaves_its_target_in_the_frame():
    scene = Scene(5).references()
    for wheel, turns in (("RR", HALF), ("RL", np.array([0.0, 0.05]))):
        rolled(scene, wheel, turns, u_turn=1e-3, with_reference=True)
    measurement = scene.measure()
    scans = sweep_scans(measurement.plates or measurement)
    axles = fit_axles(scans, measurement)
    assert [axle.status for axle in axles] == ["ok", "turn-too-small"]
    best = on_axles(scans, axles)
    assert best.through == "axle and plate centres"
    np.testing.assert_array_equal(best.scans.reference_centres_m[0], axles[0].fit.point_m)
    np.testing.assert_array_equal(best.scans.reference_centres_m[1:], scans.reference_centres_m[1:])
    assert on_axles(scans, axles[1:]).through == "plate centres"
    found = runouts_of(on_axles(scans, axles))
    assert [runout.wheel for runout in found] == ["RR", "RL"]
    assert [runout.compensates for runout in found] == [True, False]


def test_toe_out_of_a_symmetric_car_is_alike_on_both_turns():
    scene = Scene(6, noise=0.0).references()
    for wheel in STEERED:
        steers = STEERS + 0.2 * STEERS**2 * side(wheel)  # the inner wheel steers further
        swept(scene, wheel, 0.07, 0.2, steers, positions=[f"p{i}" for i in range(len(STEERS))])
    measurement = scene.measure()
    scans = sweep_scans(measurement.plates or measurement)
    best = on_axles(scans, fit_axles(scans, measurement))
    assert [axis.wheel for axis in fit_steering_axes(best, measurement)] == list(STEERED)
    left, right = toe_out_of(best, ())
    assert [(turn.status, turn.of) for turn in (left, right)] == [("ok", "plates")] * 2
    assert left.difference.value == pytest.approx(right.difference.value, abs=1e-9)
    assert abs(left.difference.value) > 0.1 * INNER_RAD**2
