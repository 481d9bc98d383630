"""Toe-out on turns: how much more the inner front wheel steers than the outer one.

With the inner wheel at 20 degrees of toe-out against the frame's forward axis, toe-out on turns is
the inner wheel's angle less the outer wheel's, interpolated between positions of the steering.
A plate leans against its axle, by the same lean wherever the wheel is steered while the brake holds
it; where a run-out shows the lean, the angles are the axles'.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ..measurement import SteeringAxis, ToeOut, toe_out_at
from ..system import frozen
from ..vectors import Array
from ..vehicle import Dual
from .plate_pose import turn_about
from .steering_axis import STEERED, toe_and_camber
from .sweep import SweepScans
from .wheel_axis import Framed

INNER_RAD = math.radians(20.0)
MOST_APART = 4.5  # u, between a target and the prediction from its reference


def toe_out_of(best: Framed, steering_axes: Sequence[SteeringAxis]) -> tuple[ToeOut, ...]:
    """Return toe-out on the left turn, then on the right; none where both wheels share no position.

    steering_axes: of the same scans. Where these do not turn about one axis, it has no value.
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
    of: Literal["axles", "plates"] = "axles" if tilts else "plates"
    known = best.scans.estimate
    less = [known(-(right + left)) for right, left in pairs]  # inner less outer, on either turn
    left = tuple(zip((known(-toe) for _, toe in pairs), less, strict=True))
    right = tuple(zip((known(-toe) for toe, _ in pairs), less, strict=True))
    turns = [ToeOut("left", curve=left, of=of), ToeOut("right", curve=right, of=of)]
    moved = [axis.wheel for axis in steering_axes if axis.status == "not-one-axis"]
    if moved:
        reason = (
            f"the scans of {' and '.join(moved)} do not turn about one axis, so that they show "
            "more than the steering"
        )
        turns = [replace(turn, status="not-one-axis", reason=reason) for turn in turns]
    return tuple(toe_out_at(turn, INNER_RAD) for turn in turns)


@frozen
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
