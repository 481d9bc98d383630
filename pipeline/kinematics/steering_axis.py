"""The steering axis of each front wheel, from a steering sweep.

The body stands still, the brake holds the wheel on its axle, and the target rotates about the
steering axis. A disc shows only its normal and centre, so that the inclination depends on the
sagitta of the normals' arc, 1 - cos t; a target that also shows its in-plane rotation shows the
whole rotation, and the inclination depends on its sine.

Signs, alike on both sides: caster > 0 where the top leans backwards, projected on the side plane,
atan2(-a.forward, a.up); steering axis inclination (SAI, kingpin inclination) > 0 where the top
leans inwards, projected on the plane across, atan2(-a.outward, a.up); a is the axis' unit vector
that points up. Both are measured from the vertical in use, the normal to the plane of the wheel
centres by default.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..errors import NotMeasuredError
from ..measurement import Estimate, Measurement, SteeringAxis, SweepStatus, weighted_sum
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS, Dual, atan2, length, over, sin
from .axis_fit import OneAxis
from .sweep import DOUBT, SweepScans
from .wheel_axis import Framed, outward_sense

STEERED = ("FR", "FL")
LEAST_POSITIONS = 3  # two normals lie on a cone about any axis between them
LEAST_SWEEP_RAD = math.radians(2.0)
MOST_U_RAD = math.radians(1.0)  # an angle less certain is not given


def fit_steering_axes(best: Framed, measurement: Measurement) -> tuple[SteeringAxis, ...]:
    """Fit the steering axis of each wheel that was swept, FR before FL."""
    swept = {w.wheel for w in measurement.wheels if w.observation.role == "sweep"}
    return tuple(_steering_axis(wheel, best, measurement) for wheel in STEERED if wheel in swept)


def toe_and_camber(scans: SweepScans, wheel: str, way: Array, moved: Array) -> tuple[Dual, Dual]:
    """Return toe and camber of an outward direction (3,) with slopes (3, K), radians."""
    left, forward, _ = scans.in_frame(way, moved)
    outward = left * outward_sense(wheel)
    aside, ahead, rise = scans.upright(way, moved)
    return atan2(forward, outward), -atan2(rise, length(aside, ahead))


def _steering_axis(wheel: str, best: Framed, measurement: Measurement) -> SteeringAxis:
    scans = best.scans
    members = scans.of_wheel(wheel, "sweep")
    names = tuple(scans.scans[i].observation.name for i in members)
    toe = [_of_plate(scans, i)[0].value for i in members]
    sweep_rad = max(toe) - min(toe) if toe else 0.0
    swept = f"{math.degrees(sweep_rad):.1f}°"
    none = SteeringAxis(wheel, names, sweep_rad, best.through)
    if len(members) < LEAST_POSITIONS:
        reason = f"{len(members)} positions were measured, {LEAST_POSITIONS} or more are needed"
        return replace(none, status="too-few-positions", reason=reason)
    if sweep_rad < LEAST_SWEEP_RAD:
        reason = f"the wheel was steered through {swept} only; steer to 20° on either side"
        return replace(none, status="range-too-small", reason=reason)
    try:
        fit = _fit(scans, members)
    except NotMeasuredError as error:
        two = error.status == "not-one-axis"
        why: SweepStatus = "not-one-axis" if two else "no-axis"
        return replace(none, status=why, reason=str(error))
    caster, inclination = _tilts(scans, fit, wheel)
    point, inwards, ahead = _beside_the_centre(scans, fit, wheel)
    status, reason = _assess(fit, caster, inclination, swept)
    faces = scans.faces_of(members)
    none = replace(
        none,
        status=status,
        reason=reason,
        chi_square=fit.chi_square,
        dof=fit.dof,
        probability=fit.probability,
        with_rotation=len(faces),
        mark=scans.mark_of(faces),
    )
    if status == "not-one-axis":
        return replace(none, reason=reason + _slipped(scans, members))
    included = _included(inclination, wheel, best, measurement)
    return replace(
        none,
        caster=_if_known(caster),
        inclination=_if_known(inclination),
        caster_by_camber=_by_camber(scans, members),
        lateral_offset=inwards,
        longitudinal_offset=ahead,
        included_angle=_if_known(included),
        axis=fit.axis,
        point_m=point,
    )


def _of_plate(scans: SweepScans, index: int) -> tuple[Dual, Dual]:
    """Return toe and camber of one scan's target."""
    scan = scans.scans[index]
    assert scan.normal is not None
    return toe_and_camber(scans, str(scan.wheel), scan.normal, scans.columns(index)[0])


def _fit(scans: SweepScans, members: list[int]) -> OneAxis:
    """Fit the axis, starting from the direction in which normals and centres differ least."""
    fitted = [scans.scans[i].observation.fitted for i in members]
    normals = np.stack([scans.scans[i].normal for i in members])  # type: ignore[misc]
    centres = np.stack([fit.centre_m for fit in fitted])
    scatter = np.zeros((3, 3))
    for vectors, blocks in ((normals, [f.normal_covariance for f in fitted]),
                            (centres, [f.centre_covariance_m2 for f in fitted])):  # fmt: skip
        about = vectors - vectors.mean(axis=0)
        scatter += about.T @ about / max(float(np.mean([np.trace(b) for b in blocks])), 1e-20)
    axis = np.linalg.eigh(scatter)[1][:, 0]
    axis = axis if axis @ scans.frame.up > 0.0 else -axis
    flat = normals - np.outer(normals @ axis, axis)
    turns = np.arctan2(np.cross(flat[0], flat) @ axis, flat @ flat[0])
    unknown = np.full(len(members), math.inf)
    unknown[0] = 1.0  # the turns are counted from the first scan's, whatever it is
    return scans.fit(members, turns, unknown, axis)


def _tilts(scans: SweepScans, fit: OneAxis, wheel: str) -> tuple[Estimate, Estimate]:
    own = scans.inputs_of(scans.of_wheel(wheel, "sweep"))
    left, forward, up = scans.upright(fit.axis, fit.d_axis @ own)
    outward = left * outward_sense(wheel)
    return scans.estimate(-atan2(forward, up)), scans.estimate(-atan2(outward, up))


def _beside_the_centre(
    scans: SweepScans, fit: OneAxis, wheel: str
) -> tuple[Array, Estimate, Estimate]:
    """Return the axis' point at the reference centre's height, its offset inwards, forwards."""
    index = REFERENCE_WHEELS.index(wheel)
    centre = scans.reference_centres_m[index]
    own = scans.inputs_of(scans.of_wheel(wheel, "sweep"))
    axis = scans.in_frame(fit.axis, fit.d_axis @ own)
    moved = fit.d_point @ own - scans.d_centres[3 * index : 3 * index + 3]
    beside = scans.in_frame(fit.point_m - centre, moved)
    rise = over(-beside[2], axis[2])
    left, ahead = beside[0] + axis[0] * rise, beside[1] + axis[1] * rise
    point = fit.point_m + rise.value * fit.axis
    return point, scans.estimate(left * -outward_sense(wheel)), scans.estimate(ahead)


def _included(
    inclination: Estimate, wheel: str, best: Framed, measurement: Measurement
) -> Estimate:
    """Return inclination plus camber straight ahead.

    Camber of the axle where a run-out shows it, else of the target.
    """
    index, axle = REFERENCE_WHEELS.index(wheel), best.axle_of(wheel)
    scans, reference = best.scans, measurement.wheels[index]
    if axle is not None and axle.fit is not None:
        way, moved = axle.fit.axis, axle.fit.d_axis @ scans.inputs_of(axle.members)
    else:
        assert reference.normal is not None
        way, moved = reference.normal, scans.columns_of_target(index)[0]
    camber = scans.estimate(toe_and_camber(scans, wheel, way, moved)[1])
    return weighted_sum([(1.0, inclination), (1.0, camber)])


def _by_camber(scans: SweepScans, members: list[int]) -> Estimate:
    """Return caster by camber change over the difference of sines: camber = c - caster sin(toe).

    Source: the workshop formula, which neglects the inclination at unequal angles.
    """
    seen = sorted((_of_plate(scans, i) for i in members), key=lambda pair: pair[0].value)
    (toe_out, camber_out), (toe_in, camber_in) = seen[0], seen[-1]
    return scans.estimate(over(camber_out - camber_in, sin(toe_in) - sin(toe_out)))


def _assess(
    fit: OneAxis, caster: Estimate, inclination: Estimate, swept: str
) -> tuple[SweepStatus, str]:
    if fit.probability < DOUBT:
        return "not-one-axis", (
            f"the scans do not turn about one axis (chi2/nu = {fit.chi_square / fit.dof:.1f}): "
            "the wheel rolled, the body moved, or the target slipped"
        )
    for name, angle in (("caster", caster), ("steering axis inclination", inclination)):
        if not angle.u <= MOST_U_RAD:
            return "range-too-small", (
                f"steered through {swept}, the {name} is known to {math.degrees(angle.u):.1f}° "
                "(k = 1) only: steer further, or scan more positions"
            )
    return "ok", ""


def _slipped(scans: SweepScans, members: list[int]) -> str:
    """Return a hint where the normals and centres alone do rotate about one axis."""
    if not scans.faces_of(members):
        return ""
    try:
        alone = _fit(scans.without_faces(), members).probability
    except NotMeasuredError:
        return ""
    return "; only the target's in-plane rotation shows it: hold the brake" * (alone >= DOUBT)


def _if_known(angle: Estimate) -> Estimate | None:
    return angle if angle.u <= MOST_U_RAD else None
