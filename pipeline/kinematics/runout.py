"""Run-out compensation: toe and camber of a wheel's axle, from scans of it turned about the axle.

The plate need not be square to the axle, nor centred on it: as the wheel turns, its normal goes
round on a cone and its centre on a circle. The axis of both is the axle. The turn of a round plate
shows in neither, save by wobble and eccentricity themselves, so that it is told with each scan, and
refined by them where they tell more. A plate that shows its turn about its own normal tells it.

Signs: a turn is > 0 as the wheel rolls forwards; a clock angle of wobble or eccentricity is counted
from the top, > 0 forwards, where the told turn is 0. Toe and camber as in `angles.py`, of the axle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..measurement import Measurement
from ..vectors import Array
from ..vehicle import Dual, atan2, length
from .axis_fit import OneAxis
from .steering_axis import measure_steering_axes
from .sweep import Estimate, SweepScans, turned
from .wheel_axis import (
    Axle,
    AxleStatus,
    Framed,
    FrameThrough,
    fit_axles,
    on_axles,
    outward_sense,
    size,
)


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
    run-out's; None where one of those is not ok. frame: on which the compensated angles stand.
    wobble: between the plate's normal and the axle, and eccentricity of its centre, each with its
    clock angle. turns_rad: as fitted, in the order of the scans. axis: (3,) unit, outward, and
    centre_m: (3,) of the axle, level with the plate's centre, scanner coordinates. chi_square: of
    what one axis leaves, with `freedom` degrees; probability: of as much or more.
    """

    wheel: str
    scans: tuple[str, ...]
    status: AxleStatus = "ok"
    reason: str = ""
    with_reference: bool = False
    angles: AxleAngles | None = None
    on_axles: AxleAngles | None = None
    frame: FrameThrough = "plate centres"
    wobble: Estimate | None = None
    wobble_clock_rad: float = 0.0
    eccentricity: Estimate | None = None
    eccentricity_clock_rad: float = 0.0
    turns_rad: tuple[float, ...] = ()
    axis: Array | None = None
    centre_m: Array | None = None
    chi_square: float = 0.0
    dof: int = 0
    probability: float = 1.0

    @property
    def compensated(self) -> AxleAngles | None:
        """The angles to use: in the frame of the axles where it is known."""
        return self.on_axles or self.angles


def measure_runouts(measurement: Measurement) -> tuple[Runout, ...]:
    """The run-out of each wheel that was turned, in the order RR, RL, FR, FL."""
    scans = turned(measurement)
    best = on_axles(scans, fit_axles(scans, measurement))
    return tuple(_runout(axle, scans, best) for axle in best.axles)


def all_turned(measurement: Measurement) -> bool:
    """Whether every sweep and run-out gave its axis."""
    if not measurement.has_turned:
        return True
    swept = all(kingpin.status == "ok" for kingpin in measure_steering_axes(measurement))
    return swept and all(runout.status == "ok" for runout in measure_runouts(measurement))


def _runout(axle: Axle, scans: SweepScans, best: Framed) -> Runout:
    names = tuple(scans.scans[i].observation.name for i in axle.members)
    fit = axle.fit
    if fit is None:
        return Runout(axle.wheel, names, axle.status, axle.reason)
    through: FrameThrough = best.through if axle.serves else "plate centres"
    compensated = through != "plate centres"
    own = scans.inputs_of(axle.members)
    off, d_off, along = _off_axis(fit, own)
    tilt = scans.in_frame(off, d_off)
    aside = scans.in_frame(fit.centre_m - fit.point_m, (fit.d_centre - fit.d_point) @ own)
    return Runout(
        wheel=axle.wheel,
        scans=names,
        status=axle.status,
        reason=axle.reason,
        with_reference=axle.reference is not None,
        angles=_angles(scans, fit, axle),
        on_axles=_angles(best.scans, fit, axle) if compensated else None,
        frame=through,
        wobble=scans.estimate(atan2(size(tilt), along)),
        wobble_clock_rad=math.atan2(tilt[1].value, tilt[2].value),
        eccentricity=axle.eccentricity,
        eccentricity_clock_rad=math.atan2(aside[1].value, aside[2].value),
        turns_rad=tuple((fit.turns_rad * outward_sense(axle.wheel)).tolist()),
        axis=fit.axis,
        centre_m=fit.point_m,
        chi_square=fit.chi_square,
        dof=fit.dof,
        probability=fit.probability,
    )


def _off_axis(fit: OneAxis, own: Array) -> tuple[Array, Array, Dual]:
    """What of the plate's normal lies across the axle (3,), its slopes (3, K), what lies along."""
    cosine = float(fit.normal @ fit.axis)
    d_cosine = fit.axis @ fit.d_normal + fit.normal @ fit.d_axis
    off = fit.normal - cosine * fit.axis
    d_off = fit.d_normal - fit.axis[:, None] * d_cosine - cosine * fit.d_axis
    return off, d_off @ own, Dual(cosine, d_cosine @ own)


def _angles(scans: SweepScans, fit: OneAxis, axle: Axle) -> AxleAngles:
    own = scans.inputs_of(axle.members)
    left, forward, up = scans.in_frame(fit.axis, fit.d_axis @ own)
    outward = left * outward_sense(axle.wheel)
    angles = (
        atan2(forward, outward),
        -atan2(up, length(outward, forward)),
        -atan2(up, outward),
    )
    return AxleAngles(*(scans.estimate(angle) for angle in angles))
