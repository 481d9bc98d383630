"""Toe and camber: signs from plain geometry, values from rotated wheels, text of angles."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wheelplane.errors import InputError
from wheelplane.vehicle.angles import deg_min_sec, nearest_wheel, outward_normal, wheel_angles
from wheelplane.vehicle.frame import REFERENCE_WHEELS, build_reference_frame

LEFT, FORWARD, UP = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1.0]])
SIDE = {"RR": -1, "FR": -1, "RL": 1, "FL": 1}
CENTRES = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.7, 0], [2.6, 0.7, 0]])
SECOND = math.radians(1 / 3600)


def rotated_wheel(wheel: str, toe_rad: float, camber_rad: float) -> np.ndarray:
    """Outward normal of a wheel: tilted about the forward axis, then steered about the up axis."""
    side = SIDE[wheel]
    tilt = Rotation.from_rotvec(-side * camber_rad * FORWARD)  # positive turns left to up
    steer = Rotation.from_rotvec(-side * toe_rad * UP)  # positive turns forward to left
    return (steer * tilt).apply(side * LEFT)


@pytest.mark.parametrize("wheel", REFERENCE_WHEELS)
def test_signs_from_points_of_the_wheel(wheel):
    """Top edge 1 mm further out: camber > 0; front edge 2 mm further in: toe > 0; in 500 mm."""
    out = SIDE[wheel] * LEFT
    top, bottom = 0.25 * UP + 0.0005 * out, -0.25 * UP - 0.0005 * out
    front, back = 0.25 * FORWARD - 0.001 * out, -0.25 * FORWARD + 0.001 * out
    normal = np.cross(top - bottom, front - back)
    angles = wheel_angles(build_reference_frame(CENTRES), normal, wheel)
    assert angles.toe_rad == pytest.approx(math.atan(0.002 / 0.5), abs=1e-12)
    assert angles.camber_iso_rad == pytest.approx(math.atan(0.001 / 0.5), abs=1e-12)
    assert angles.camber_rad == pytest.approx(angles.camber_iso_rad, rel=1e-5)


@pytest.mark.parametrize("wheel", REFERENCE_WHEELS)
@pytest.mark.parametrize("toe_deg", [-40, -1, 0, 1e-7, 0.33, 20])
@pytest.mark.parametrize("camber_deg", [-5, -1.2, 0, 1e-7, 3])
def test_the_angles_of_a_rotated_wheel_are_recovered(wheel, toe_deg, camber_deg):
    toe, camber = math.radians(toe_deg), math.radians(camber_deg)
    seed = REFERENCE_WHEELS.index(wheel)
    pose = Rotation.random(rng=np.random.default_rng(seed))
    frame = build_reference_frame(pose.apply(CENTRES) + np.array([3, -2, 9]))
    normal = pose.apply(rotated_wheel(wheel, toe, camber))
    for sense in (1, -1, 7.5, -1e-200):
        angles = wheel_angles(frame, sense * normal, wheel)
        assert angles.toe_rad == pytest.approx(toe, abs=1e-12)
        assert angles.camber_rad == pytest.approx(camber, abs=1e-12)
        assert math.tan(angles.camber_iso_rad) == pytest.approx(
            math.tan(camber) / math.cos(toe), abs=1e-12
        )
        np.testing.assert_allclose(outward_normal(frame, sense * normal, wheel), normal, atol=1e-12)


@pytest.mark.parametrize("wheel", REFERENCE_WHEELS)
def test_angles_from_a_vertical_are_those_of_a_frame_whose_up_it_is(wheel):
    """As it is, and of a frame rolled about the car's forward axis: toe stays, camber follows."""
    frame, n = build_reference_frame(CENTRES), rotated_wheel(wheel, -0.6, 0.05)
    one, two = (astuple(wheel_angles(frame, n, wheel, up)) for up in (None, frame.up))
    assert two == pytest.approx(one, abs=1e-14)
    roll = Rotation.from_rotvec(0.03 * FORWARD)
    rolled = wheel_angles(build_reference_frame(roll.apply(CENTRES)), n, wheel)
    found = wheel_angles(frame, n, wheel, roll.apply(UP))
    assert found.camber_rad == pytest.approx(rolled.camber_rad, abs=1e-14)
    assert abs(found.camber_rad - 0.05) > 0.02


def test_two_cambers_differ_by_a_second_at_toe_1_camber_2():
    frame = build_reference_frame(CENTRES)
    normal = rotated_wheel("RL", math.radians(1), math.radians(2))
    angles = wheel_angles(frame, normal, "RL")
    assert angles.camber_iso_rad - angles.camber_rad == pytest.approx(1.1 * SECOND, abs=SECOND / 20)


def test_mirrored_car_has_the_same_angles():
    rng = np.random.default_rng(3)
    centres = CENTRES + rng.uniform(-0.1, 0.1, (4, 3))
    pose = Rotation.random(rng=rng)
    mirror = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1.0]])
    other = {"RR": "RL", "RL": "RR", "FR": "FL", "FL": "FR"}
    frame = build_reference_frame(pose.apply(centres))
    mirrored = build_reference_frame(pose.apply(centres @ mirror)[[1, 0, 3, 2]])
    for wheel in REFERENCE_WHEELS:
        normal = rotated_wheel(wheel, 0.02, -0.03)
        one = wheel_angles(frame, pose.apply(normal), wheel)
        two = wheel_angles(mirrored, pose.apply(mirror @ normal), other[wheel])
        assert two.toe_rad == pytest.approx(one.toe_rad, abs=1e-12)
        assert two.camber_rad == pytest.approx(one.camber_rad, abs=1e-12)
        assert two.camber_iso_rad == pytest.approx(one.camber_iso_rad, abs=1e-12)
        assert abs(one.toe_rad) > 1e-3
        unswapped = wheel_angles(mirrored, pose.apply(mirror @ normal), wheel)
        assert abs(unswapped.toe_rad - one.toe_rad) > 1e-3


@pytest.mark.parametrize("axis", [FORWARD, UP])
def test_normal_along_the_car_has_no_outer_side(axis):
    with pytest.raises(InputError, match=r"wheel FL: .* is at 90\.0° to the rear axle"):
        wheel_angles(build_reference_frame(CENTRES), axis, "FL")


@pytest.mark.parametrize("normal", [[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0]])
def test_no_normal_is_an_error(normal):
    with pytest.raises(InputError, match="wheel RR: its plane has the normal"):
        wheel_angles(build_reference_frame(CENTRES), normal, "RR")


def test_unknown_wheel_is_an_error():
    with pytest.raises(InputError, match="unknown wheel 'XX': name one of RR, RL, FR, FL"):
        wheel_angles(build_reference_frame(CENTRES), LEFT, "XX")


def test_nearest_wheel_names_each_and_refuses_a_tie():
    shift = np.array([1e7, -1e7, 5])
    for wheel, centre in zip(REFERENCE_WHEELS, CENTRES, strict=True):
        assert nearest_wheel(CENTRES + shift, centre + shift + [0.1, -0.2, 0.05]) == wheel
    with pytest.raises(InputError, match=r"0\.750 m from wheel RR and 0\.750 m from RL"):
        nearest_wheel(CENTRES, [0, 0, 0])


@pytest.mark.parametrize(
    ("seconds", "decimals", "text"),
    [
        (1180.7, 1, "+00°19'40.7\""),
        (-1180.7, 1, "-00°19'40.7\""),
        (-0.4, 1, "-00°00'00.4\""),
        (0.0, 1, "+00°00'00.0\""),
        (-0.0, 1, "+00°00'00.0\""),
        (-0.04, 1, "+00°00'00.0\""),
        (59.96, 1, "+00°01'00.0\""),
        (-3599.96, 1, "-01°00'00.0\""),
        (3599.94, 1, "+00°59'59.9\""),
        (59.96, 2, "+00°00'59.96\""),
        (59.6, 0, "+00°01'00\""),
        (9.4, 0, "+00°00'09\""),
        (125 * 3600 + 61, 1, "+125°01'01.0\""),
        (math.nan, 1, "undefined"),
    ],
)
def test_degrees_minutes_seconds(seconds, decimals, text):
    assert deg_min_sec(seconds * SECOND, decimals) == text


def test_text_of_an_angle_reads_back():
    rng = np.random.default_rng(11)
    for seconds in rng.uniform(-20000, 20000, 500):
        text = deg_min_sec(seconds * SECOND)
        degrees, rest = text[1:].split("°")
        minutes, rest = rest.split("'")
        back = 3600 * int(degrees) + 60 * int(minutes) + float(rest.rstrip('"'))
        assert int(minutes) < 60
        assert float(rest.rstrip('"')) < 60
        assert (back if text[0] == "+" else -back) == pytest.approx(seconds, abs=0.05 + 1e-9)


def test_a_normal_is_outward_within_84_degrees_of_the_axle():
    """The bound is a cosine of 0.1: beyond it, the side is a matter of noise."""
    frame = build_reference_frame(CENTRES)
    for cosine in (0.101, 0.5, 1.0):
        sine = np.sqrt(1.0 - cosine**2)
        inward = -cosine * frame.left + sine * frame.forward
        np.testing.assert_allclose(outward_normal(frame, inward, "RL"), -inward, atol=1e-12)
    for cosine in (0.099, 0.06, 0.0):
        sine = np.sqrt(1.0 - cosine**2)
        with pytest.raises(InputError, match="its outer side is undefined"):
            outward_normal(frame, cosine * frame.left + sine * frame.forward, "RL")


@pytest.mark.parametrize("ratio", [0.89, 0.91, 0.94])
def test_a_trial_is_nearest_if_it_is_a_tenth_nearer(ratio):
    rear_right, rear_left = CENTRES[0], CENTRES[1]
    trial = rear_right + (rear_left - rear_right) * ratio / (1.0 + ratio)
    if ratio < 0.9:
        assert nearest_wheel(CENTRES, trial) == "RR"
        return
    with pytest.raises(InputError, match="name its wheel"):
        nearest_wheel(CENTRES, trial)
