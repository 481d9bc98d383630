"""Run-out compensation of a vehicle that has rolled: the mean of its wheels over the positions.

In the frame of its own four centres, each position shows the normal of every wheel on a cone about
its axle. Where centres are off the axles, the frame itself is skewed by them, to first order by a
first harmonic of the rotation too. With weights w_i of sum 1 and sum w_i exp(i t_i) = 0, such as
halves at 0 and 180 degrees, the weighted means of normals and centres are free of both. How the
vehicle stands in each scan does not matter: it moves all of a position's wheels alike, which no
angle in the frame of the means depends on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..centre import TargetFit
from ..errors import InputError
from ..measurement import Measurement, Observation, WheelPose, WheelResult, evaluate
from ..uncertainty import UncertaintyComponent
from ..vectors import Array, plane_basis
from ..vehicle import REFERENCE_WHEELS, VehicleFrame, build_reference_frame
from .sweep import turns_with_wheel

MOST_LEFT = 0.3  # of a first harmonic, in the mean: two positions 35 degrees from half a turn
RIDGE = 0.01  # of the sum of squares of the weights, against a squared first harmonic
MOST_TILT_RAD, MOST_SHIFT_M = (
    math.radians(3.0),
    0.04,
)  # between positions: no mounting is as far off


def carried(observations: Sequence[Observation], source: str) -> list[Observation]:
    """Return the observations with those of a rolled vehicle where they were before it rolled.

    By the frames of the four centres. The same where none rolled. Raises InputError where one of
    the four was not measured, or where a position is not that of the same vehicle.
    """
    positions = _positions(observations)
    moved: dict[str, Observation] = {}
    home = _frame(observations[:4], source) if positions else None
    for position, four in positions.items():
        assert home is not None
        for one in four:
            if one.evidence is None:
                raise InputError(
                    f"{source}: {one.name} was not measured ({one.status}): {one.reason}: a "
                    f"position of a rolled vehicle needs all four wheels: scan {position} again, "
                    "or leave it out"
                )
        frame = _frame(four, source)
        moved |= {one.name: _moved(one, frame, home) for one in four}
        for one, first in zip(four, observations[:4], strict=True):
            _check_same(moved[one.name].fitted, first.fitted, f"{source}: {one.name}")
    return [moved.get(one.name, one) for one in observations]


def over_positions(measurement: Measurement) -> Measurement:
    """Return the measurement with the means of each wheel over the positions of a rolled vehicle.

    Raises InputError where the positions do not show half a turn, and for a vertical other than the
    wheels', which one position alone shows.
    """
    wheels = {wheel.observation.name: wheel for wheel in measurement.wheels}
    positions = _positions([wheel.observation for wheel in measurement.wheels])
    source = measurement.provenance.source
    if measurement.vertical is not None:
        raise InputError(
            f"{source}: --vertical {measurement.vertical.kind} with positions of a rolled vehicle, "
            "which are evaluated from the plane of the wheel centres: leave it out"
        )
    turns = [one.turn for four in positions.values() for one in four[:1] if one.turn is not None]
    angles = np.array([0.0, *(turn.angle_rad or 0.0 for turn in turns)])
    weights = _weights(angles)
    left = float(abs(weights @ np.exp(1j * angles)))
    if left > MOST_LEFT:
        shown = ", ".join(f"{math.degrees(angle):.0f}°" for angle in angles)
        raise InputError(
            f"{source}: the vehicle rolled to {shown}, from which run-out cannot be removed: roll "
            "it by half a turn of its wheels, or scan positions all round"
        )
    poses: dict[str, WheelPose] = {}
    for index, wheel in enumerate(REFERENCE_WHEELS):
        results = [wheels[wheel], *(wheels[four[index].name] for four in positions.values())]
        poses[wheel] = _mean(results, weights, left)
    measured = [wheel for wheel in measurement.wheels if wheel.observation.evidence is not None]
    found = evaluate(
        [wheel.observation for wheel in measurement.wheels],
        [poses.get(w.observation.name, w.observation.fitted) for w in measured],
        measurement.provenance,
        (*measurement.notes, _note(angles)),
    )
    as_axles = (
        replace(wheel, compensated=wheel.observation.name in poses, plate=plate)
        for wheel, plate in zip(found.wheels, measurement.wheels, strict=True)
    )
    return replace(
        found, wheels=tuple(as_axles), plates=measurement, verticals=measurement.verticals
    )


def is_rolled(result: WheelResult) -> bool:
    """Return whether a scan is of a vehicle that has rolled since the reference scans."""
    return result.observation.rolled is not None


def _positions(observations: Sequence[Observation]) -> dict[str, list[Observation]]:
    """Return the scans of each position of a rolled vehicle, in the order RR, RL, FR, FL."""
    found: dict[str, list[Observation]] = {}
    for one in observations:
        if one.rolled is not None:
            found.setdefault(one.rolled, []).append(one)
    return {
        position: sorted(four, key=lambda one: REFERENCE_WHEELS.index(str(one.wheel)))
        for position, four in found.items()
    }


def _frame(four: Sequence[Observation], source: str) -> VehicleFrame:
    try:
        return build_reference_frame(np.stack([one.fitted.centre_m for one in four]))
    except InputError as error:
        raise InputError(f"{source}: {error}") from error


def _moved(one: Observation, frame: VehicleFrame, home: VehicleFrame) -> Observation:
    """Return an observation carried from one frame to another."""
    assert one.evidence is not None
    rotation = home.R_vehicle_scanner.T @ frame.R_vehicle_scanner
    fit, both = one.evidence.target, np.kron(np.eye(2), rotation)
    turn = fit.turn and replace(fit.turn, axis=rotation @ fit.turn.axis)
    target = replace(
        fit,
        centre_m=home.origin_m + rotation @ (fit.centre_m - frame.origin_m),
        normal=rotation @ fit.normal,
        components=tuple(replace(c, factor=both @ c.factor) for c in fit.components),
        turn=turn,
    )
    cloud = one.cloud and replace(
        one.cloud,
        origin_m=home.origin_m + rotation @ (one.cloud.origin_m - frame.origin_m),
        offsets_m=(one.cloud.offsets_m @ rotation.T).astype(np.float32),
    )
    return replace(one, evidence=replace(one.evidence, target=target), cloud=cloud)


def _check_same(fit: TargetFit, first: TargetFit, name: str) -> None:
    """Raise InputError where a wheel stands otherwise than before the vehicle rolled."""
    away_m = float(np.linalg.norm(fit.centre_m - first.centre_m))
    across = float(np.linalg.norm(np.cross(fit.normal, first.normal)))
    tilt = math.atan2(across, abs(float(fit.normal @ first.normal)))
    facts = (
        (away_m > MOST_SHIFT_M, f"its centre lies {away_m * 1e3:.0f} mm from where it was"),
        (tilt > MOST_TILT_RAD, f"it stands {math.degrees(tilt):.1f}° otherwise than before"),
    )
    for failed, fact in facts:
        if failed:
            raise InputError(
                f"{name}: {fact} on the vehicle: hold the steering straight as it rolls, and check "
                "that its position names the right scans"
            )


def _weights(angles: Array) -> Array:
    """Return weights (K,) of sum 1 with the least first harmonic, and the least squares of those.

    angles: (K,) rotations of the wheels.
    """
    alike = np.cos(angles[:, None] - angles) + RIDGE * np.eye(len(angles))
    raw = np.linalg.solve(alike, np.ones(len(angles)))
    return np.asarray(raw / raw.sum())


def _mean(results: Sequence[WheelResult], weights: Array, left: float) -> WheelPose:
    """Return the mean pose of one wheel; left: share of a first harmonic that stays in it.

    That, and errors of the rotations, leave as much of the largest deviation from the mean, in any
    direction: the frame's own skew follows no circle.
    """
    fits = [result.observation.fitted for result in results]
    normals = np.stack([result.normal for result in results if result.normal is not None])
    centres_m = np.stack([fit.centre_m for fit in fits])
    normal, centre_m = weights @ normals, weights @ centres_m
    normal = normal / np.linalg.norm(normal)
    components = [
        _weighted(component, weight, fit, result)
        for result, fit, weight in zip(results, fits, weights, strict=True)
        for component in fit.components
        if not turns_with_wheel(component)
    ]
    turns = [result.observation.turn for result in results]
    u_turns = np.array([0.0 if turn is None else turn.u_rad or 0.0 for turn in turns])
    u_left = math.hypot(left, float(np.linalg.norm(weights * u_turns))) * math.sqrt(0.5)
    tilt, shift = (
        float(np.linalg.norm(off, axis=1).max()) for off in (normals - normal, centres_m - centre_m)
    )
    across = plane_basis(normal)[:2].T
    factor: Array = u_left * np.kron(np.diag([tilt, shift]), across).astype(np.float64)
    components.append(UncertaintyComponent("turn", factor))
    return WheelPose(centre_m, normal, tuple(components))


def _weighted(
    component: UncertaintyComponent, weight: float, fit: TargetFit, result: WheelResult
) -> UncertaintyComponent:
    """Return a component of one position as it acts on the mean."""
    assert result.normal is not None
    facing = math.copysign(1.0, float(result.normal @ fit.normal))
    factor = weight * component.factor
    factor[:3] *= facing
    of_plate = component.name == "stand-off"  # the same plate on the same wheel in all positions
    of = f"plate of {result.wheel}" if of_plate else f"scan {result.observation.name}"
    shared = component.shared or of
    return replace(component, factor=factor, shared=shared)


def _note(angles: Array) -> str:
    shown = ", ".join(f"{math.degrees(angle):.0f}°" for angle in angles)
    return (
        f"The wheels are means over {len(angles)} positions of the rolled vehicle ({shown} of "
        "rotation): run-out of rims and targets is not in them."
    )
