"""Run-out compensation: toe and camber of a wheel's axle, from scans in several rotations about it.

The target need not be square to the axle, nor centred on it: as the wheel rotates, its normal moves
on a cone and its centre on a circle. The axis of both is the axle. A disc shows its rotation only
by its axial and radial run-out, so that the rotation is stated with each scan, and refined where
these determine it better. A target with edges or print shows its in-plane rotation itself.

Signs: a rotation is > 0 as the wheel rolls forwards; clock angles of the run-outs are measured from
the top, > 0 forwards, at the stated rotation 0, in the frame that is named with the angles. Toe and
camber as in `vehicle/angles.py`.
"""

from __future__ import annotations

from ..measurement import AxleAngles, Estimate, Runout
from ..vectors import Array
from ..vehicle import Dual, atan2, cos, sin
from .axis_fit import OneAxis
from .steering_axis import toe_and_camber
from .sweep import SweepScans
from .wheel_axis import Axle, Framed, outward_sense, size


def runouts_of(best: Framed) -> tuple[Runout, ...]:
    """Return the run-out of each wheel that was turned about its axle, in the order of the axles.

    All values are in the frame of the axles.
    """
    return tuple(_runout(axle, best) for axle in best.axles)


def _runout(axle: Axle, best: Framed) -> Runout:
    scans = best.scans
    names = tuple(scans.scans[i].observation.name for i in axle.members)
    fit = axle.fit
    if fit is None:
        return Runout(axle.wheel, names, axle.status, axle.reason)
    own = scans.inputs_of(axle.members)
    off, d_off, along = _off_axis(fit, own)
    tilt = scans.in_frame(off, d_off)
    aside = scans.in_frame(fit.centre_m - fit.point_m, (fit.d_centre - fit.d_point) @ own)
    return Runout(
        wheel=axle.wheel,
        scans=names,
        status=axle.status,
        reason=axle.reason,
        compensates=axle.serves,
        angles=_angles(scans, fit, axle),
        frame=best.through,
        axial_runout=scans.estimate(atan2(size(tilt), along)),
        axial_clock=_clock(tilt, scans),
        radial_runout=axle.eccentricity,
        radial_clock=_clock(aside, scans),
        turns_rad=tuple((fit.turns_rad * outward_sense(axle.wheel)).tolist()),
        axis=fit.axis,
        centre_m=fit.point_m,
        chi_square=fit.chi_square,
        dof=fit.dof,
        probability=fit.probability,
    )


def _off_axis(fit: OneAxis, own: Array) -> tuple[Array, Array, Dual]:
    """Return the normal's part across the axle (3,), its slopes (3, K), and the part along."""
    cosine = float(fit.normal @ fit.axis)
    d_cosine = fit.axis @ fit.d_normal + fit.normal @ fit.d_axis
    off = fit.normal - cosine * fit.axis
    d_off = fit.d_normal - fit.axis[:, None] * d_cosine - cosine * fit.d_axis
    return off, d_off @ own, Dual(cosine, d_cosine @ own)


def _clock(off: tuple[Dual, Dual, Dual], scans: SweepScans) -> Estimate | None:
    """Return the direction of a run-out from the top, > 0 forwards; None where there is none."""
    _, forward, up = off
    return scans.estimate(atan2(forward, up)) if forward.value or up.value else None


def _angles(scans: SweepScans, fit: OneAxis, axle: Axle) -> AxleAngles:
    own = scans.inputs_of(axle.members)
    toe, camber = toe_and_camber(scans, axle.wheel, fit.axis, fit.d_axis @ own)
    iso = atan2(sin(camber), cos(camber) * cos(toe))
    return AxleAngles(*(scans.estimate(angle) for angle in (toe, camber, iso)))
