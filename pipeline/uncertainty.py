"""Covariances of planes and centres, carried through the frame to every angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.angles import vehicle_angles, wheel_angles
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.reference_frame import REFERENCE_WHEELS, build_reference_frame

STEP_M = 1e-5  # central differences: the frame is smooth over metres, rounding is at 1e-9 m


@dataclass(frozen=True)
class AngleUncertainty:
    """Standard uncertainties (k = 1), radians and metres.

    toe_rad, camber_rad, camber_iso_rad: (W,) one a wheel. The rest: of the vehicle.
    """

    toe_rad: Array
    camber_rad: Array
    camber_iso_rad: Array
    rear_total_toe_rad: float
    front_total_toe_rad: float
    thrust_angle_rad: float
    rear_track_m: float
    front_track_m: float
    wheelbase_m: float


def propagate(targets: Sequence[TargetFit], wheels: Sequence[str]) -> AngleUncertainty:
    """Uncertainty of all angles of W targets, of which the first four are RR, RL, FR, FL.

    J Sigma J^T over the four reference centres, shared by all angles, and each wheel's own normal.
    Source: JCGM 100 (GUM), 5.2; Jacobians by central differences.
    """
    centres = np.stack([target.centre_m for target in targets[:4]])
    centres = centres - centres.mean(axis=0)
    by_centres = np.stack(
        [_slope(targets, wheels, centres, index, axis) for index in range(4) for axis in range(3)],
        axis=1,
    )
    shared = np.zeros((12, 12))
    for index, target in enumerate(targets[:4]):
        rows = slice(3 * index, 3 * index + 3)
        shared[rows, rows] = target.centre_covariance_m2
    covariance = by_centres @ shared @ by_centres.T
    _add_normals(covariance, targets, wheels, centres)
    deviation = np.sqrt(np.diag(covariance).clip(min=0.0))
    count = len(targets)
    return AngleUncertainty(
        deviation[:count],
        deviation[count : 2 * count],
        deviation[2 * count : 3 * count],
        *(float(value) for value in deviation[3 * count :]),
    )


def _values(targets: Sequence[TargetFit], wheels: Sequence[str], centres: Array) -> Array:
    """Toes (W), cambers (W), ISO cambers (W), then the vehicle's six quantities."""
    frame = build_reference_frame(centres)
    angles = [wheel_angles(frame, t.normal, w) for t, w in zip(targets, wheels, strict=True)]
    vehicle = vehicle_angles({w: angles[i].toe_rad for i, w in enumerate(REFERENCE_WHEELS)})
    return np.array(
        [a.toe_rad for a in angles]
        + [a.camber_rad for a in angles]
        + [a.camber_iso_rad for a in angles]
        + [vehicle.rear_total_toe_rad, vehicle.front_total_toe_rad, vehicle.thrust_angle_rad]
        + [frame.rear_track_m, frame.front_track_m, frame.wheelbase_m]
    )


def _slope(
    targets: Sequence[TargetFit], wheels: Sequence[str], centres: Array, index: int, axis: int
) -> Array:
    ends = []
    for sign in (1.0, -1.0):
        moved = centres.copy()
        moved[index, axis] += sign * STEP_M
        ends.append(_values(targets, wheels, moved))
    return np.asarray((ends[0] - ends[1]) / (2.0 * STEP_M))


def _add_normals(
    covariance: Array, targets: Sequence[TargetFit], wheels: Sequence[str], centres: Array
) -> None:
    """Add each wheel's own normal: to its three angles, and through its toe to the vehicle's."""
    frame, count = build_reference_frame(centres), len(targets)
    for i, (target, wheel) in enumerate(zip(targets, wheels, strict=True)):
        slopes = np.zeros((len(covariance), 3))
        for axis in range(3):
            tilt = np.zeros(3)
            tilt[axis] = STEP_M
            ends = [wheel_angles(frame, target.normal + sign * tilt, wheel) for sign in (1, -1)]
            for k, name in enumerate(("toe_rad", "camber_rad", "camber_iso_rad")):
                change = getattr(ends[0], name) - getattr(ends[1], name)
                slopes[k * count + i, axis] = math.remainder(change, 2 * math.pi) / (2 * STEP_M)
        if i < 4:
            _to_vehicle(slopes, slopes[i], wheel, count)
        covariance += slopes @ target.normal_covariance @ slopes.T


def _to_vehicle(slopes: Array, toe: Array, wheel: str, count: int) -> None:
    """Total toe = left + right; thrust angle = (RL - RR) / 2."""
    slopes[3 * count + (0 if wheel.startswith("R") else 1)] = toe
    if wheel.startswith("R"):
        slopes[3 * count + 2] = toe / 2.0 if wheel == "RL" else -toe / 2.0
