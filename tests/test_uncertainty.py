"""The uncertainty of every angle: against Monte Carlo, and with the right slopes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.angles import vehicle_angles, wheel_angles
from pipeline.locate_centre import TargetFit
from pipeline.reference_frame import REFERENCE_WHEELS, build_reference_frame
from pipeline.uncertainty import propagate
from tests.scenes import rotation

ARCSEC = np.pi / 648_000
WHEELS = [*REFERENCE_WHEELS, "FR", "RL"]
NAMES = ("rear_total_toe_rad", "front_total_toe_rad", "thrust_angle_rad")
SIZES = ("rear_track_m", "front_track_m", "wheelbase_m")
FIELDS = ("toe_rad", "camber_rad", "camber_iso_rad", *NAMES, *SIZES)


def spread(rng, scale):
    """A covariance (3, 3) of unequal axes, about scale^2."""
    R = rotation(rng)
    return (R * (scale * rng.uniform(0.3, 2.0, 3)) ** 2) @ R.T


def car(seed, centre_m=1e-4, normal_rad=20 * ARCSEC):
    """Six targets, the last two trials, on a car turned at random, each with its own covariance."""
    rng = np.random.default_rng(seed)
    R, t = rotation(rng), rng.uniform(-9, 9, 3)
    places = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.74, 0.01], [2.62, 0.76, 0.0]])
    places = np.concatenate([places, places[[2, 1]] + 0.003]) + rng.uniform(-0.01, 0.01, (6, 3))
    fitted = []
    for place, wheel in zip(places, WHEELS, strict=True):
        out = 1.0 if wheel.endswith("L") else -1.0
        normal = np.array([rng.uniform(-0.3, 0.3), out, rng.uniform(-0.06, 0.06)])
        normal = R @ (normal / np.linalg.norm(normal))
        across = np.eye(3) - np.outer(normal, normal)
        fitted.append(
            TargetFit(
                centre_m=R @ place + t,
                normal=normal * rng.choice([-1, 1]),
                centre_covariance_m2=spread(rng, centre_m),
                normal_covariance=across @ spread(rng, normal_rad) @ across,
                plane_rms_m=8e-4,
                points_on_target=1000,
                method="rim",
            )
        )
    return fitted


def values(targets):
    """All quantities (3 W + 6,) in the order of FIELDS."""
    frame = build_reference_frame(np.stack([target.centre_m for target in targets[:4]]))
    angles = [wheel_angles(frame, t.normal, w) for t, w in zip(targets, WHEELS, strict=True)]
    vehicle = vehicle_angles(dict(zip(WHEELS[:4], (a.toe_rad for a in angles), strict=False)))
    rows = [[getattr(a, name) for a in angles] for name in FIELDS[:3]]
    return np.concatenate(
        [*rows, [getattr(vehicle, n) for n in NAMES], [getattr(frame, n) for n in SIZES]]
    )


def stated(targets):
    u = propagate(targets, WHEELS)
    return np.concatenate([np.atleast_1d(getattr(u, name)) for name in FIELDS])


def perturbed(targets, rng):
    moved = []
    for target in targets:
        shift = rng.multivariate_normal(np.zeros(3), target.centre_covariance_m2)
        lean = rng.multivariate_normal(np.zeros(3), target.normal_covariance, check_valid="ignore")
        moved.append(replace(target, centre_m=target.centre_m + shift, normal=target.normal + lean))
    return moved


DRAWS = 1500


def scatter(seed, centre_m, normal_rad):
    """Standard deviations over draws about the truth."""
    targets = car(seed, centre_m, normal_rad)
    rng = np.random.default_rng([seed, 1])
    truth = values(targets)
    errors = np.array([values(perturbed(targets, rng)) - truth for _ in range(DRAWS)])
    return targets, np.sqrt(np.mean(errors**2, axis=0))


# A standard deviation from n draws is known to 1/sqrt(2 n); 4.5 of them: 24 quantities, 3 cases.
LIMIT = 4.5 / np.sqrt(2 * DRAWS)


@pytest.mark.parametrize(
    ("seed", "centre_m", "normal_rad"),
    [(0, 1e-4, 20 * ARCSEC), (1, 5e-4, 1 * ARCSEC), (2, 1e-6, 60 * ARCSEC)],
)
def test_formula_and_monte_carlo_agree(seed, centre_m, normal_rad):
    targets, deviation = scatter(seed, centre_m, normal_rad)
    ratio = stated(targets) / deviation
    np.testing.assert_allclose(ratio, 1.0, rtol=0, atol=LIMIT)
    for factor in (0.5, 2.0):
        wrong = [
            replace(
                target,
                centre_covariance_m2=target.centre_covariance_m2 * factor**2,
                normal_covariance=target.normal_covariance * factor**2,
            )
            for target in targets
        ]
        assert np.all(np.abs(stated(wrong) / deviation - 1.0) > LIMIT)


def test_zero_input_gives_zero_and_each_part_counts():
    targets = car(3)
    none = [
        replace(t, centre_covariance_m2=np.zeros((3, 3)), normal_covariance=np.zeros((3, 3)))
        for t in targets
    ]
    np.testing.assert_array_equal(stated(none), 0.0)
    whole = stated(targets) ** 2
    centres = stated([replace(t, normal_covariance=np.zeros((3, 3))) for t in targets]) ** 2
    normals = stated([replace(t, centre_covariance_m2=np.zeros((3, 3))) for t in targets]) ** 2
    np.testing.assert_allclose(centres + normals, whole, rtol=1e-9)
    assert np.all(normals[-3:] == 0.0)
    assert np.all(normals[:-3] > 0.0)
    assert np.all(centres > 0.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shift", [0.0, 1e7])
def test_turned_and_shifted_it_stays(seed, shift):
    targets = car(seed)
    R = rotation(np.random.default_rng(seed + 50))
    moved = [
        replace(
            t,
            centre_m=R @ t.centre_m + shift,
            normal=R @ t.normal,
            centre_covariance_m2=R @ t.centre_covariance_m2 @ R.T,
            normal_covariance=R @ t.normal_covariance @ R.T,
        )
        for t in targets
    ]
    # The centres' rounding moves the point where the slopes are taken by 2 nm in a metre or two.
    np.testing.assert_allclose(stated(moved), stated(targets), rtol=1e-6)


def test_sign_of_a_normal_does_not_matter():
    targets = car(5)
    turned = [replace(t, normal=-t.normal) for t in targets]
    np.testing.assert_allclose(stated(turned), stated(targets), rtol=1e-9)


def test_centres_alone_by_hand():
    """DOMAIN: yaw and roll of the frame are sqrt(2) s / track; the other axle's do not see it."""
    s, track = 1e-4, 1.5
    places = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.75, 0], [2.6, 0.75, 0]])
    targets = [
        TargetFit(
            p,
            np.array([0.0, np.sign(p[1]), 0.0]),
            s**2 * np.eye(3),
            np.zeros((3, 3)),
            0.0,
            1,
            "rim",
        )
        for p in places
    ]
    u = propagate(targets, list(REFERENCE_WHEELS))
    np.testing.assert_allclose(u.toe_rad, np.sqrt(2) * s / track, rtol=1e-6)
    np.testing.assert_allclose(u.camber_rad, np.sqrt(2) * s / track, rtol=1e-6)
    assert u.rear_total_toe_rad < 1e-6 * s  # left and right see the same yaw with opposite signs
    assert u.front_total_toe_rad < 1e-6 * s
    assert u.thrust_angle_rad == pytest.approx(np.sqrt(2) * s / track, rel=1e-6)
    assert u.rear_track_m == pytest.approx(np.sqrt(2) * s, rel=1e-6)
    assert u.wheelbase_m == pytest.approx(s, rel=1e-6)
