"""Poses of all wheels with their run-out compensated: those of the axles where these are known.

A wheel without a run-out keeps its target's pose. How far targets are mounted off their axles is
then known from the other wheels' run-outs, and is part of its uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..measurement import Observation, Vertical, WheelPose, WheelResult, estimate
from ..system import frozen
from ..uncertainty import Effect, UncertaintyComponent, mounting_component
from ..vectors import Array
from ..vehicle import REFERENCE_WHEELS
from .sweep import SweepScans
from .wheel_axis import Axle, Framed


@frozen
class MountingScatter:
    """Standard deviations per axis of targets as mounted, with their degrees of freedom."""

    tilt_rad: float
    shift_m: float
    dof: float


def compensated(best: Framed) -> dict[str, Axle]:
    """Return the axle of every compensated wheel and of its repeat scans, by their names."""
    found = {}
    for result in best.scans.measured:
        axle = best.axle_of(str(result.wheel))
        if axle is not None and result.observation.role != "runout":
            reference = result.observation.repeats or result.observation.name
            if reference == axle.wheel:
                found[result.observation.name] = axle
    return found


def wheel_poses(best: Framed) -> list[WheelPose]:
    """Return the pose of every measured target, or of its axle, with what they share.

    The normal and the centre of every pose are functions of the same inputs, whose errors act on
    all of them through their slopes: one component for each effect, shared by all poses.
    """
    axles, measured = compensated(best), best.scans.measured
    posed = [
        _pose(best, row, axles.get(result.observation.name)) for row, result in enumerate(measured)
    ]
    return [
        WheelPose(
            centre,
            normal,
            tuple(
                UncertaintyComponent(
                    effect.name, slopes @ effect.factor, effect.dof, f"effect {i}", effect.pooled
                )
                for i, effect in enumerate(best.scans.effects)
            ),
        )
        for normal, centre, slopes in posed
    ]


def with_mounting(best: Framed) -> Framed:
    """Return the scans with the mounting of reference targets whose axle is not known as effects.

    They act on the target, its repeat scans, and through its centre on the frame, by the scatter of
    the known ones beyond what the target file states.
    """
    if best.through != "axle and plate centres":
        return best
    scans, scatter = best.scans, mounting_scatter(best)
    effects = []
    for wheel in (wheel for wheel in REFERENCE_WHEELS if best.axle_of(wheel) is None):
        factor = np.zeros((scans.count, 6))
        for row, result in enumerate(scans.measured):
            seen = result.observation
            if wheel in (seen.name, seen.repeats):
                rest, (normal, _) = beyond_stated(scatter, seen), _seen(result)
                component = mounting_component(rest.tilt_rad, rest.shift_m, normal)
                factor[6 * row : 6 * row + 6] = component.factor
        effects.append(Effect("clamp", factor, scatter.dof, pooled=True))
    scans = replace(scans, effects=(*effects, *scans.effects))
    return replace(best, scans=scans, axles=tuple(_by(axle, scans) for axle in best.axles))


def _by(axle: Axle, scans: SweepScans) -> Axle:
    """Return the axle with its estimate by the effects of these scans, as all others are."""
    known = axle.eccentricity
    if known is None:
        return axle
    return replace(axle, eccentricity=estimate(known.value, known.slope, scans.effects))


def vertical_as_effect(best: Framed) -> Vertical | None:
    """Return the vertical in use with its components named as the effects that they are."""
    vertical, count = best.scans.vertical, len(best.scans.effects)
    if vertical is None:
        return None
    first = count - len(vertical.components)
    components = (
        replace(component, shared=f"effect {first + i}")
        for i, component in enumerate(vertical.components)
    )
    return replace(vertical, components=tuple(components))


def mounting_scatter(best: Framed) -> MountingScatter:
    """Return the scatter of targets about their axles, as the known run-outs show it."""
    fits = [axle.fit for axle in best.axles if axle.serves and axle.fit is not None]
    tilts = [np.linalg.norm(np.cross(fit.normal, fit.axis)) for fit in fits]
    shifts = [np.linalg.norm(fit.centre_m - fit.point_m) for fit in fits]
    tilt_rad, shift_m = (math.sqrt(np.mean(np.square(x)) / 2.0) for x in (tilts, shifts))
    return MountingScatter(tilt_rad, shift_m, 2.0 * len(fits))


def beyond_stated(scatter: MountingScatter, seen: Observation) -> MountingScatter:
    """Return the scatter beyond the mounting repeatability that the target file states."""
    stated = [part for part in seen.fitted.components if part.name == "clamp"]
    covariance = sum((part.covariance for part in stated), np.zeros((6, 6)))
    tilt2, shift2 = (np.trace(covariance[i : i + 3, i : i + 3]) / 2.0 for i in (0, 3))
    return MountingScatter(
        math.sqrt(max(scatter.tilt_rad**2 - tilt2, 0.0)),
        math.sqrt(max(scatter.shift_m**2 - shift2, 0.0)),
        scatter.dof,
    )


def _pose(best: Framed, row: int, axle: Axle | None) -> tuple[Array, Array, Array]:
    """Return normal (3,), centre (3,) and their slopes (6, K).

    A repeat scan, with nothing moved, shows the axle as far from the reference's as its target.
    """
    scans = best.scans
    normal, centre = _seen(scans.measured[row])
    slopes = np.vstack(scans.columns_of_target(row))
    if axle is None or axle.fit is None:
        return normal, centre, slopes
    fit, own = axle.fit, scans.inputs_of(axle.members)
    by_axle = np.vstack([fit.d_axis, fit.d_point]) @ own
    first = next(i for i, r in enumerate(scans.measured) if r.observation.name == axle.wheel)
    if row == first:
        return fit.axis, fit.point_m, by_axle
    at, start = _seen(scans.measured[first])
    by_repeat = by_axle + slopes - np.vstack(scans.columns_of_target(first))
    turned = fit.axis + normal - at
    return turned / np.linalg.norm(turned), fit.point_m + centre - start, by_repeat


def _seen(result: WheelResult) -> tuple[Array, Array]:
    """Return the outward normal and the centre of a target."""
    assert result.normal is not None
    return result.normal, result.observation.fitted.centre_m
