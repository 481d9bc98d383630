"""Estimates by their slopes, and sums of them with what they share."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..uncertainty import Effect, effective_dof, effects_of
from ..vectors import Array
from ..vehicle import Dual, atan2, frame_slopes, linearise
from .records import Estimate, Measurement, Vertical


def estimate(value: float, slope: Array, effects: Sequence[Effect], u_own: float = 0.0) -> Estimate:
    """Return a value with its uncertainty by all effects on its inputs; exact where there are none.

    slope: (K,) by the inputs on which the effects act. u_own: a part of u that no input causes.
    Source: JCGM 100, 5.2 and G.4.
    """
    shares = [np.atleast_1d(np.sum((slope @ effect.factor) ** 2)) for effect in effects]
    total = (np.sum(np.stack(shares), axis=0) if shares else np.zeros(1)) + u_own**2
    dof = effective_dof(effects, shares, total)
    known, u = tuple(effects), math.sqrt(float(total[0]))
    rectangles = [float(np.max(np.abs(slope @ e.factor))) for e in effects if e.uniform]
    return Estimate(value, u, float(dof[0]), slope, known, u_own, max(rectangles, default=0.0))


def weighted_sum(terms: Sequence[tuple[float, Estimate]]) -> Estimate:
    """Return the sum of weight times estimate, all of one vehicle, with their covariance."""
    effects = terms[0][1].effects
    return estimate(
        math.fsum(weight * term.value for weight, term in terms),
        np.sum([weight * term.slope for weight, term in terms], axis=0),
        effects,
        math.hypot(*(weight * term.u_own for weight, term in terms)),
    )


def joint_covariance(measurement: Measurement, sources: Sequence[int | Estimate]) -> Array:
    """Return the covariance (n, n) of rows of the measurement's covariance and of estimates.

    Between the two by all effects on the inputs; `u_own` is shared by none.
    """
    rows = [i for i, source in enumerate(sources) if isinstance(source, int)]
    chosen = [source for source in sources if isinstance(source, int)]
    found = [(i, source) for i, source in enumerate(sources) if isinstance(source, Estimate)]
    V = np.zeros((len(sources), len(sources)))
    if found:
        effects = found[0][1].effects
        slopes, factors = _by_poses(measurement, effects)
        for effect, factor in zip(effects, factors, strict=True):
            moved = np.zeros((len(sources), factor.shape[1]))
            moved[rows] = slopes[chosen] @ factor
            for i, known in found:
                moved[i] = known.slope @ effect.factor
            V += moved @ moved.T
        for i, known in found:
            V[i, i] += known.u_own**2
    V[np.ix_(rows, rows)] = measurement.uncertainty.covariance[np.ix_(chosen, chosen)]
    return V


def vertical_tilts(measurement: Measurement, vertical: Vertical) -> tuple[Estimate, Estimate]:
    """Return by how much a vertical leans to the left and forward of the frame's up, radians.

    From it, against the plane of the wheel centres, camber of a left wheel is less and SAI more by
    the first, of a right wheel the other way; caster is more by the second.
    """
    frame = measurement.frame
    poses = [wheel.pose for wheel in measurement.wheels[:4] if wheel.pose is not None]
    centres = np.stack([pose.centre_m for pose in poses])
    slopes = frame_slopes(frame, centres - centres[0])
    effects = effects_of([*poses, vertical])

    def along(axis: Array, d_axis: Array) -> Dual:
        by_inputs = np.zeros((len(poses) + 1, 2, 3))
        by_inputs[:-1, 1] = (vertical.normal @ d_axis).reshape(-1, 3)
        by_inputs[-1, 0] = axis
        return Dual(float(vertical.normal @ axis), by_inputs.reshape(-1))

    left, forward, up = (
        along(frame.left, slopes.left),
        along(frame.forward, slopes.forward),
        along(frame.up, slopes.up),
    )
    tilts = (atan2(left, up), atan2(forward, up))
    to_left, ahead = (estimate(tilt.value, tilt.slope, effects) for tilt in tilts)
    return to_left, ahead


def _by_poses(measurement: Measurement, effects: Sequence[Effect]) -> tuple[Array, list[Array]]:
    """Return the derivatives (Q, 6 W) of all quantities, and how each effect moves the W poses.

    The poses of compensated wheels begin with these effects; others are the first inputs.
    """
    wheels = [wheel for wheel in measurement.wheels if wheel.evaluated is not None]
    poses = [wheel.pose for wheel in wheels if wheel.pose is not None]
    centres, normals = (
        np.stack([getattr(p, name) for p in poses]) for name in ("centre_m", "normal")
    )
    vertical, names = measurement.vertical, [str(wheel.wheel) for wheel in wheels]
    above = None if vertical is None else vertical.normal
    slopes = linearise(centres[:4], normals, names, above).slopes
    inputs = poses if vertical is None else [*poses, vertical]
    if measurement.plates is not None:
        return slopes, [effect.factor for effect in effects_of(inputs)[: len(effects)]]
    size = 6 * len(poses)
    last = [effect.factor[len(effect.factor) - slopes.shape[1] + size :] for effect in effects]
    return slopes, [
        np.vstack([effect.factor[:size], end]) for effect, end in zip(effects, last, strict=True)
    ]
