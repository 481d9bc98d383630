"""Run-out compensation: the axle of a wheel from scans of it turned about the axle.

The plate need not be square to the axle, nor centred on it: as the wheel turns, its normal goes
round on a cone and its centre on a circle. The axis of both is the axle. The turn of a round plate
shows in neither, save by wobble and eccentricity themselves, so that it is told with each scan, and
refined by them where they tell more. A plate that shows its turn about its own normal tells it.

Signs: a turn is > 0 as the wheel rolls forwards; a clock angle of wobble or eccentricity is counted
from the top, > 0 forwards, where the told turn is 0. Toe and camber as in `angles.py`, of the axle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.errors import NotMeasuredError
from pipeline.first_order import First, atan2, length
from pipeline.kernels import Array
from pipeline.measurement import Measurement
from pipeline.one_axis import OneAxis
from pipeline.reference_frame import REFERENCE_WHEELS
from pipeline.steering import measure_kingpins
from pipeline.turned import DOUBT, Estimate, Turned, turned

LEAST_TURN = 0.25  # |1 - exp(i turn)|, some 14 degrees, of the two places that differ most
MOST_ECCENTRIC_M = 0.02  # no plate is clamped so far off; the wheel itself moved

RunoutStatus = Literal["ok", "too-few-positions", "turn-too-small", "no-axis", "moved"]


@dataclass(frozen=True)
class AxleAngles:
    """Toe, camber and ISO camber of an axle."""

    toe: Estimate
    camber: Estimate
    camber_iso: Estimate


@dataclass(frozen=True)
class Runout:
    """The axle of one wheel; None where the scans say too little.

    scans: names of those that were measured. with_reference: the wheel's reference scan is one of
    them, so that the axle is that of the reference. angles: in the frame of the plates' centres;
    on_axles: in that of the axles' centres, of every wheel whose reference scan is one of its
    run-out's; None where one of those is not ok.
    wobble: between the plate's normal and the axle, and eccentricity of its centre, each with its
    clock angle. turns_rad: as fitted, in the order of the scans. axis: (3,) unit, outward, and
    centre_m: (3,) of the axle, level with the plate's centre, scanner coordinates. chi_square: of
    what one axis leaves, with `freedom` degrees; probability: of as much or more.
    """

    wheel: str
    scans: tuple[str, ...]
    status: RunoutStatus = "ok"
    reason: str = ""
    with_reference: bool = False
    angles: AxleAngles | None = None
    on_axles: AxleAngles | None = None
    wobble: Estimate | None = None
    wobble_clock_rad: float = 0.0
    eccentricity: Estimate | None = None
    eccentricity_clock_rad: float = 0.0
    turns_rad: tuple[float, ...] = ()
    axis: Array | None = None
    centre_m: Array | None = None
    chi_square: float = 0.0
    freedom: int = 0
    probability: float = 1.0

    @property
    def compensated(self) -> AxleAngles | None:
        """The angles to use: in the frame of the axles where it is known."""
        return self.on_axles or self.angles

    @property
    def frame(self) -> Literal["axle centres", "plate centres"]:
        """Through which the frame of the compensated angles stands."""
        return "axle centres" if self.on_axles else "plate centres"


def measure_runouts(measurement: Measurement) -> tuple[Runout, ...]:
    """The run-out of each wheel that was turned, in the order RR, RL, FR, FL."""
    scanned = {w.wheel for w in measurement.wheels if w.observation.role == "runout"}
    scans = turned(measurement, "runout")
    found, fits = [], {}
    for wheel in REFERENCE_WHEELS:
        if wheel in scanned:
            runout, fit = _runout(wheel, scans, measurement)
            found.append(runout)
            if fit is not None and runout.with_reference and runout.status == "ok":
                fits[wheel] = fit
    if not fits or any(runout.with_reference and runout.wheel not in fits for runout in found):
        return tuple(found)
    axles = _on_axles(scans, fits)
    return tuple(
        replace(runout, on_axles=_angles(axles, fits[runout.wheel], runout.wheel))
        if runout.wheel in fits
        else runout
        for runout in found
    )


def all_turned(measurement: Measurement) -> bool:
    """Whether every sweep and run-out gave its axis."""
    swept = all(kingpin.status == "ok" for kingpin in measure_kingpins(measurement))
    return swept and all(runout.status == "ok" for runout in measure_runouts(measurement))


def _runout(wheel: str, scans: Turned, measurement: Measurement) -> tuple[Runout, OneAxis | None]:
    members = scans.of_wheel(wheel)
    names = tuple(scans.scans[i].observation.name for i in members)
    turns = _told(scans, members, wheel)
    if len(members) < 2:
        reason = f"{len(members)} positions were measured, 2 or more are needed"
        return Runout(wheel, names, "too-few-positions", reason), None
    places = np.exp(1j * turns)
    if float(np.abs(places[:, None] - places).max()) < LEAST_TURN:
        reason = "the scans are of nearly the same turn: turn the wheel by 180 degrees"
        return Runout(wheel, names, "turn-too-small", reason), None
    try:
        fit = _fit(scans, members, turns)
    except NotMeasuredError as error:
        if error.status == "not-one-axis":
            return Runout(wheel, names, "moved", f"{error}, or an angle_deg is wrong"), None
        return Runout(wheel, names, "no-axis", str(error)), None
    own = scans.inputs_of(members)
    off, d_off, along = _off_axis(fit, own)
    lean = scans.in_frame(off, d_off)
    aside = scans.in_frame(fit.centre_m - fit.point_m, (fit.d_centre - fit.d_point) @ own)
    eccentricity = scans.estimate(_size(aside))
    status, reason = _judge(scans, members, turns, fit, eccentricity)
    reference = measurement.wheels[REFERENCE_WHEELS.index(wheel)].observation.source
    runout = Runout(
        wheel=wheel,
        scans=names,
        status=status,
        reason=reason,
        with_reference=any(scans.scans[i].observation.source == reference for i in members),
        angles=_angles(scans, fit, wheel),
        wobble=scans.estimate(atan2(_size(lean), along)),
        wobble_clock_rad=math.atan2(lean[1].value, lean[2].value),
        eccentricity=eccentricity,
        eccentricity_clock_rad=math.atan2(aside[1].value, aside[2].value),
        turns_rad=tuple((fit.turns_rad * _sense(wheel)).tolist()),
        axis=fit.axis,
        centre_m=fit.point_m,
        chi_square=fit.chi_square,
        freedom=fit.freedom,
        probability=fit.probability,
    )
    return runout, fit


def _told(scans: Turned, members: list[int], wheel: str) -> Array:
    """Turns about the outward axle, right-handed: on the left, a wheel that rolls forwards."""
    turns = [scans.scans[i].observation.turn for i in members]
    return np.array([t.angle_rad or 0.0 for t in turns if t is not None]) * _sense(wheel)


def _fit(scans: Turned, members: list[int], turns: Array) -> OneAxis:
    normals = [scans.scans[i].normal for i in members]
    middle = np.sum([normal for normal in normals if normal is not None], axis=0)
    return scans.fit(members, turns, scans.u_turns_rad[members], middle)


def _off_axis(fit: OneAxis, own: Array) -> tuple[Array, Array, First]:
    """What of the plate's normal lies across the axle (3,), its slopes (3, K), what lies along."""
    cosine = float(fit.normal @ fit.axis)
    d_cosine = fit.axis @ fit.d_normal + fit.normal @ fit.d_axis
    off = fit.normal - cosine * fit.axis
    d_off = fit.d_normal - np.outer(fit.axis, d_cosine) - cosine * fit.d_axis
    return off, d_off @ own, First(cosine, d_cosine @ own)


def _angles(scans: Turned, fit: OneAxis, wheel: str) -> AxleAngles:
    own = scans.inputs_of(scans.of_wheel(wheel))
    left, forward, up = scans.in_frame(fit.axis, fit.d_axis @ own)
    outward = left * _sense(wheel)
    angles = (
        atan2(forward, outward),
        -atan2(up, length(outward, forward)),
        -atan2(up, outward),
    )
    return AxleAngles(*(scans.estimate(angle) for angle in angles))


def _on_axles(scans: Turned, fits: Mapping[str, OneAxis]) -> Turned:
    """The scans in the frame of the axles' centres, where a reference scan was compensated."""
    centres, moved = scans.reference_centres_m.copy(), scans.d_centres.copy()
    for wheel, fit in fits.items():
        index = REFERENCE_WHEELS.index(wheel)
        members = scans.of_wheel(wheel)
        centres[index] = fit.point_m
        moved[3 * index : 3 * index + 3] = fit.d_point @ scans.inputs_of(members)
    return scans.on_centres(centres, moved)


def _judge(
    scans: Turned, members: list[int], turns: Array, fit: OneAxis, eccentricity: Estimate
) -> tuple[RunoutStatus, str]:
    if fit.probability < DOUBT:
        return "moved", (
            f"the scans do not turn about one axle as told (chi2/nu = "
            f"{fit.chi_square / fit.freedom:.1f}): {_mend(scans, members, turns)}"
        )
    if eccentricity.value > MOST_ECCENTRIC_M:
        return "moved", (
            f"the plate's centre goes round at {eccentricity.value * 1e3:.1f} mm from the axle: "
            "the vehicle moved, or angle_deg is wrong"
        )
    return "ok", ""


def _mend(scans: Turned, members: list[int], turns: Array) -> str:
    """What to look at; the turns told backwards are tried, and said, never taken."""
    try:
        backwards = _fit(scans, members, -turns).probability >= DOUBT
    except NotMeasuredError:
        backwards = False
    if backwards:
        return "they do if angle_deg counts against the rolling forwards: change its signs"
    return "the vehicle moved, the plate slipped, or an angle_deg is wrong"


def _size(parts: tuple[First, First, First]) -> First:
    """Length of a vector; one of no length at all has the slope of its first part."""
    return length(*parts) if any(part.value for part in parts) else parts[0]


def _sense(wheel: str) -> float:
    return 1.0 if wheel.endswith("L") else -1.0
