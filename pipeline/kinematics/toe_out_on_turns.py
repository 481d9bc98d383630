"""Toe-out on turns: how much more the inner front wheel steers than the outer one.

With the inner wheel at 20 degrees of toe-out against the frame's forward axis, toe-out on turns is
the inner wheel's angle less the outer wheel's, interpolated between positions of the steering.
A plate leans against its axle, by the same lean wherever the wheel is steered while the brake holds
it; where a run-out shows the lean, the angles are the axles'.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..measurement import SteeringAxis, ToeOut, estimate
from ..vectors import Array
from ..vehicle import Dual
from .plate_pose import turn_about
from .steering_axis import STEERED, toe_and_camber
from .sweep import SweepScans
from .wheel_axis import Framed

INNER_RAD = math.radians(20.0)
BEYOND_RAD = math.radians(1.0)  # of extrapolation beyond the positions
LEAST_PAIRS = 3
TOGETHER_RAD = math.radians(2.0)  # positions that count as one

MOST_APART = 4.5  # u, between a target and the prediction from its reference


def toe_out_of(best: Framed, steering_axes: Sequence[SteeringAxis]) -> tuple[ToeOut, ...]:
    """Return toe-out on the left turn, then on the right; none where both wheels share no position.

    steering_axes: of the same scans.
    """
    tilts = {}
    for steering in steering_axes:
        tilt = None if steering.axis is None else _tilt(best, steering.wheel, steering.axis)
        if tilt is not None:
            tilts[steering.wheel] = tilt
    if len(tilts) < len(STEERED):
        tilts = {}  # half of the difference compensated would be worse than neither
    pairs = _pairs(best.scans, tilts)
    if not pairs:
        return ()
    left = [(-toe_left, -(toe_left + toe_right)) for toe_right, toe_left in pairs]
    right = [(-toe_right, -(toe_left + toe_right)) for toe_right, toe_left in pairs]
    turns = _of_turn(best.scans, "left", left), _of_turn(best.scans, "right", right)
    return tuple(replace(turn, of="axles" if tilts else "plates") for turn in turns)


@dataclass(frozen=True)
class _Tilt:
    """Offset of the axle from a target's normal (3,), at the reference's normal, with slopes."""

    steering: Array
    at: Array
    off: Array
    moved: Array

    def axle(self, normal: Array, moved: Array) -> tuple[Array, Array]:
        """Return the axle where the target's normal is `normal`, rotated about the steering axis.

        The rotation's own error times the tilt, some 0.01, is neglected.
        """
        T = turn_about(self.steering, _turn(self.steering, self.at, normal))
        return normal + T @ self.off, moved + T @ self.moved


def _tilt(best: Framed, wheel: str, steering: Array) -> _Tilt | None:
    """Return the tilt; None where no run-out shows it, or the target was mounted otherwise."""
    axle, scans = best.axle_of(wheel), best.scans
    if axle is None or axle.fit is None or axle.reference is None:
        return None
    at, by_at = scans.scans[axle.reference].normal, scans.columns(axle.reference)[0]
    assert at is not None
    for i in scans.of_wheel(wheel, "sweep"):
        normal = scans.scans[i].normal
        assert normal is not None
        apart = scans.estimate(
            Dual(float(steering @ (normal - at)), steering @ (scans.columns(i)[0] - by_at))
        )
        if abs(apart.value) > MOST_APART * apart.u:
            return None
    moved = axle.fit.d_axis @ scans.inputs_of(axle.members) - by_at
    return _Tilt(steering, at, axle.fit.axis - at, moved)


def _turn(axis: Array, start: Array, end: Array) -> float:
    """Return the rotation about a unit axis from one vector to another, radians."""
    across = start - axis * (axis @ start)
    return float(np.arctan2(axis @ np.cross(across, end), across @ end))


def _pairs(scans: SweepScans, tilts: Mapping[str, _Tilt]) -> list[tuple[Dual, Dual]]:
    """Return toe of FR and of FL at every position that both have."""
    toes: dict[str, dict[str, Dual]] = {wheel: {} for wheel in STEERED}
    for wheel in STEERED:
        for i in scans.of_wheel(wheel, "sweep"):
            turn, normal = scans.scans[i].observation.turn, scans.scans[i].normal
            if turn is None or turn.position is None or normal is None:
                continue
            way, moved = normal, scans.columns(i)[0]
            if wheel in tilts:
                way, moved = tilts[wheel].axle(way, moved)
            toes[wheel][turn.position] = toe_and_camber(scans, wheel, way, moved)[0]
    return [(toe, toes["FL"][place]) for place, toe in toes["FR"].items() if place in toes["FL"]]


def _of_turn(
    scans: SweepScans, turn: Literal["left", "right"], curve: list[tuple[Dual, Dual]]
) -> ToeOut:
    """Return toe-out from the inner wheel's angle and the difference at every position."""
    if len(curve) < LEAST_PAIRS:
        reason = f"both wheels share {len(curve)} positions, {LEAST_PAIRS} or more are needed"
        return ToeOut(turn, "too-few-pairs", reason)
    farthest = max(inner.value for inner, _ in curve)
    if farthest < INNER_RAD - BEYOND_RAD:
        reason = f"the inner wheel was steered to {math.degrees(farthest):.1f}°, 20° are needed"
        return ToeOut(turn, "not-reached", reason)
    curve = _merged(curve)
    if len(curve) < LEAST_PAIRS:
        reason = f"only {len(curve)} of the positions differ, {LEAST_PAIRS} or more are needed"
        return ToeOut(turn, "too-few-pairs", reason)
    nearest = sorted(curve, key=lambda pair: abs(pair[0].value - INNER_RAD))[:LEAST_PAIRS]
    curved, straight = _at_inner(nearest), _at_inner(nearest[:2])
    u_curve = abs(curved.value - straight.value) / 2.0
    difference = estimate(curved.value, curved.slope, scans.effects, u_curve)
    return ToeOut(turn, "ok", "", difference, u_curve)


def _merged(curve: list[tuple[Dual, Dual]]) -> list[tuple[Dual, Dual]]:
    """Return means of positions that lie together: a curve through noise must not be steep."""
    groups: list[list[tuple[Dual, Dual]]] = []
    for pair in sorted(curve, key=lambda pair: pair[0].value):
        if groups and pair[0].value - groups[-1][0][0].value < TOGETHER_RAD:
            groups[-1].append(pair)
        else:
            groups.append([pair])
    return [(_mean([x for x, _ in group]), _mean([y for _, y in group])) for group in groups]


def _mean(numbers: list[Dual]) -> Dual:
    whole = numbers[0]
    for number in numbers[1:]:
        whole = whole + number
    return whole / len(numbers)


def _at_inner(pairs: list[tuple[Dual, Dual]]) -> Dual:
    """Return the polynomial through all pairs at 20 degrees, with its slopes by all pairs.

    Source: Lagrange's form; an error of an abscissa acts by the polynomial's own slope there.
    """
    x = np.array([inner.value for inner, _ in pairs])
    y = np.array([difference.value for _, difference in pairs])
    powers = np.arange(len(x))
    at = (INNER_RAD**powers) @ np.linalg.inv(x[:, None] ** powers)
    coefficients = np.linalg.solve(x[:, None] ** powers, y)
    rises = (x[:, None] ** (powers[1:] - 1) * powers[1:]) @ coefficients[1:]
    slope = sum(
        (w * (d.slope - rise * inner.slope)
         for w, rise, (inner, d) in zip(at, rises, pairs, strict=True)),
        np.zeros_like(pairs[0][0].slope),
    )  # fmt: skip
    return Dual(float(at @ y), slope)
