"""The whole way in memory: four scans of plates on a car to its angles."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from tests.support.given import components
from tests.support.scenes import Setup, make, rotation
from tests.support.single_scan import measure_scan
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.config import Config
from wheelplane.errors import InputError
from wheelplane.measurement.evaluate import align
from wheelplane.measurement.records import Evidence, Observation, Provenance
from wheelplane.readers.scan import Scan
from wheelplane.targets.plates import DiscTarget

ARCSEC = np.pi / 648_000
DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
NAMES = ("RR", "RL", "FR", "FL")
NOWHERE = Provenance("memory", None, "0", {}, {}, 0)
SETUP = Setup(spacing_m=0.003, half_width_m=0.19, pairs=12)


@dataclass(frozen=True)
class Car:
    """Centres (W, 3) and outward normals (W, 3) as (left, forward, up), and the angles set."""

    centres: np.ndarray
    normals: np.ndarray
    toe: np.ndarray
    camber: np.ndarray


def car(seed):
    """A car that stands square in its own frame, so that the angles set are the angles."""
    rng = np.random.default_rng(seed)
    rear, front, base = rng.uniform([1.4, 1.4, 2.5], [1.6, 1.6, 2.8])
    centres = np.array(
        [[-rear / 2, 0, 0], [rear / 2, 0, 0], [-front / 2, base, 0.0], [front / 2, base, 0.0]]
    )
    toe = np.radians(rng.uniform(-0.6, 0.6, 4))
    camber = np.radians(rng.uniform(-2.5, 1.5, 4))
    side = np.array([-1.0, 1.0, -1.0, 1.0])
    # Sphere: elevation minus camber, azimuth toe from the outward side.
    normals = np.column_stack(
        [side * np.cos(camber) * np.cos(toe), np.cos(camber) * np.sin(toe), -np.sin(camber)]
    )
    return Car(centres, normals, toe, camber)


def placed(vectors, seed, shift=0.0):
    """(left, forward, up) to a scanner's right-handed frame: forward, left, up; then turned."""
    rng = np.random.default_rng([seed, 77])
    R, t = rotation(rng), rng.uniform(-5, 5, 3)
    return vectors[:, [1, 0, 2]] @ R.T, t + shift


def onto(points_m, cloud, centre, normal):
    """The cloud's points with its target moved to `centre`, its normal to `normal`."""
    axis = np.cross(cloud.normal, normal)
    cosine = float(cloud.normal @ normal)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    R = np.eye(3) + K + K @ K / (1.0 + cosine)
    return (points_m - cloud.centre_m) @ R.T + centre


def scans(seed, setup=SETUP, shift=0.0):
    """Four scans of a car, in the order of NAMES, and the car."""
    truth = car(seed)
    centres, t = placed(truth.centres, seed, shift)
    normals, _ = placed(truth.normals, seed)
    clouds = []
    for index, (centre, normal) in enumerate(zip(centres + t, normals, strict=True)):
        rng = np.random.default_rng([seed, index])
        stand = setup.but(
            incidence_deg=rng.uniform(5, 25), azimuth_deg=rng.uniform(0, 360), shift_m=(0, 0, 0)
        )
        cloud = make(stand, 10 * seed + index)
        clouds.append(onto(cloud.points_m, cloud, centre, normal))
    return truth, clouds


def observation(name, target=None, wheel="own", status="ok"):
    return Observation(
        name=name,
        role="reference" if name in NAMES else "trial",
        wheel=name if wheel == "own" else wheel,
        source=f"{name}.ply",
        sha256="",
        points_total=1,
        invalid_points=0,
        evidence=None if target is None else Evidence(target),
        status=status,
    )


def fitted(points):
    return measure_scan(Scan(points, None, "memory", 0), DISC, Config()).target


@functools.cache
def measured(seed):
    truth, clouds = scans(seed)
    return truth, align(
        [observation(n, fitted(p)) for n, p in zip(NAMES, clouds, strict=True)], NOWHERE
    )


def angles(measurement):
    """Toe and camber (W, 2)."""
    return np.array([[w.angles.toe_rad, w.angles.camber_rad] for w in measurement.wheels])


def exact(truth, seed, shift=0.0):
    centres, t = placed(truth.centres, seed, shift)
    normals, _ = placed(truth.normals, seed)
    return [
        TargetFit(c + t, n, components(1e-10 * np.eye(3), 1e-12 * np.eye(3)), 0.0, 1, "rim")
        for c, n in zip(centres, normals, strict=True)
    ]


@pytest.mark.parametrize("seed", range(10))
def test_exact_planes_and_centres_give_the_angles_to_rounding(seed):
    truth = car(seed)
    result = align(
        [observation(n, t) for n, t in zip(NAMES, exact(truth, seed), strict=True)], NOWHERE
    )
    np.testing.assert_allclose(
        angles(result), np.column_stack([truth.toe, truth.camber]), atol=1e-12
    )
    assert np.abs(truth.toe).max() > 1e-4
    assert result.vehicle["rear_total_toe"] == pytest.approx(truth.toe[:2].sum(), abs=1e-12)
    assert result.vehicle["front_total_toe"] == pytest.approx(truth.toe[2:].sum(), abs=1e-12)
    assert result.vehicle["thrust_angle"] == pytest.approx(
        (truth.toe[1] - truth.toe[0]) / 2, abs=1e-12
    )
    assert result.frame.wheelbase_m == pytest.approx(truth.centres[2, 1], abs=1e-12)
    iso = [w.angles.camber_iso_rad for w in result.wheels]
    np.testing.assert_allclose(np.tan(iso), np.tan(truth.camber) / np.cos(truth.toe), atol=1e-12)


@pytest.mark.parametrize("shift", [1e4, 1e7])
def test_far_away_the_angles_lose_no_more_than_the_coordinates_resolution(shift):
    truth = car(3)
    targets = exact(truth, 3, shift)
    result = align([observation(n, t) for n, t in zip(NAMES, targets, strict=True)], NOWHERE)
    limit = 4 * np.finfo(float).eps * 1.8 * shift / 1.4
    expected = np.column_stack([truth.toe, truth.camber])
    np.testing.assert_allclose(angles(result), expected, atol=limit)


@pytest.mark.parametrize("seed", range(3))
def test_scans_to_angles(seed):
    truth, result = measured(seed)
    error = angles(result) - np.column_stack([truth.toe, truth.camber])
    u = np.array([[w.u_toe_rad, w.u_camber_rad] for w in result.wheels])
    assert np.abs(error / u).max() < 4.5
    assert np.abs(error).max() < 120 * ARCSEC
    assert u.max() < 60 * ARCSEC
    assert result.complete
    for wheel in result.wheels:
        assert wheel.normal @ (wheel.observation.fitted.centre_m - result.frame.origin_m) > 0
        assert wheel.observation.fitted.method == "rim"


def test_centres_by_the_mean_of_the_points_would_not_do():
    truth, clouds = scans(1, SETUP.but(keep=lambda u, v: v > -0.05))
    worst = {}
    for kind in ("rim", "mean"):
        targets = []
        for points in clouds:
            evidence = measure_scan(Scan(points, None, "memory", 0), DISC, Config())
            target = evidence.target
            if kind == "mean":
                target = TargetFit(
                    evidence.plane.centroid_m,
                    target.normal,
                    target.components,
                    target.plane_rms_m,
                    target.points_on_target,
                    target.method,
                )
            targets.append(target)
        result = align([observation(n, t) for n, t in zip(NAMES, targets, strict=True)], NOWHERE)
        error = angles(result) - np.column_stack([truth.toe, truth.camber])
        worst[kind] = np.abs(error).max() / max(w.u_toe_rad for w in result.wheels)
    assert worst["rim"] < 4.5
    assert worst["mean"] > 5 * 4.5


def test_normalised_errors_of_total_toe_and_camber_sum():
    """The invariants of the frame: they show the normals' covariance alone."""
    values = []
    for seed in range(8):
        truth, result = measured(seed)
        error = angles(result) - np.column_stack([truth.toe, truth.camber])
        u = result.uncertainty.vehicle_standard
        values.append((error[0, 0] + error[1, 0]) / u["rear_total_toe"])
        values.append((error[2, 0] + error[3, 0]) / u["front_total_toe"])
    total = float(np.sum(np.square(values)))
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(values))  # 99.9 % two-sided
    assert low < total < high
    assert not low < total * 4 < high
    assert not low < total / 4 < high


def test_turned_shifted_permuted_wheel_by_wheel():
    truth, clouds = scans(2)
    before = angles(measured(2)[1])
    rng = np.random.default_rng(0)
    R = rotation(rng)
    moved = [rng.permutation(points) @ R.T + [1e5, -2e5, 3e3] for points in clouds]
    after = align([observation(n, fitted(p)) for n, p in zip(NAMES, moved, strict=True)], NOWHERE)
    u = np.array([[w.u_toe_rad, w.u_camber_rad] for w in after.wheels])
    assert np.abs((angles(after) - before) / u).max() < 0.5
    assert np.abs(np.column_stack([truth.toe, truth.camber])).min() > 2 * u.max()


def test_mirrored_car_has_left_and_right_exchanged():
    _, clouds = scans(2)
    mirror = np.array([1.0, 1.0, -1.0])
    order = (1, 0, 3, 2)
    result = align(
        [observation(n, fitted(clouds[k] * mirror)) for n, k in zip(NAMES, order, strict=True)],
        NOWHERE,
    )
    u = np.array([[w.u_toe_rad, w.u_camber_rad] for w in result.wheels])
    assert np.abs((angles(result) - angles(measured(2)[1])[list(order)]) / u).max() < 0.5


def test_trial_goes_to_its_nearest_wheel_and_a_failed_one_stays():
    truth = car(4)
    targets = exact(truth, 4)
    near = targets[3]
    trial = TargetFit(near.centre_m + 0.003, -near.normal, *list(vars(near).values())[2:])
    seen = [observation(n, t) for n, t in zip(NAMES, targets, strict=True)]
    seen += [observation("1", None, None, "no-target"), observation("2", trial, None)]
    result = align(seen, NOWHERE)
    assert [w.observation.name for w in result.wheels] == [*NAMES, "1", "2"]
    assert result.wheels[5].wheel == "FL"
    assert result.wheels[5].angles.toe_rad == pytest.approx(truth.toe[3], abs=1e-12)
    assert result.wheels[4].angles is None
    assert result.wheels[4].u_toe_rad is None
    assert not result.complete
    assert len(result.uncertainty.toe_rad) == 5


def test_wheels_in_a_line_are_no_car():
    truth = car(5)
    targets = exact(truth, 5)
    line = [
        TargetFit(targets[0].centre_m + k * np.array([1.0, 0, 0]), *list(vars(t).values())[1:])
        for k, t in enumerate(targets)
    ]
    with pytest.raises(InputError, match=r"lie on one line|apart"):
        align([observation(n, t) for n, t in zip(NAMES, line, strict=True)], NOWHERE)


@pytest.mark.parametrize(
    ("shift", "noted"),
    [
        (0.0, ()),
        (0.1, ()),
        (0.5, ("tracks of 1.5", "wheelbases of")),
        (-0.6, ("tracks of 1.5",)),
    ],
)
def test_centres_that_are_not_those_of_two_axles_are_noted(shift, noted):
    """The front left wheel is moved sideways, or sideways and forward, by metres."""
    targets = exact(car(6), 6)
    across = targets[1].centre_m - targets[0].centre_m
    along = targets[3].centre_m - targets[1].centre_m
    step = shift * (across + along * (shift > 0)) / np.linalg.norm(across)
    moved = TargetFit(targets[3].centre_m + step, *list(vars(targets[3]).values())[1:])
    seen = [observation(n, t) for n, t in zip(NAMES, [*targets[:3], moved], strict=True)]
    notes = align(seen, NOWHERE).notes
    assert len(notes) == len(noted)
    assert all("not placed as on two axles" in note for note in notes)
