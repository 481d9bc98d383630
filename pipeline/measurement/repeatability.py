"""Repeat scans of a wheel with nothing moved: pooled result, observed scatter, drift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..uncertainty import chi_square_beyond
from ..vectors import Array
from .records import Measurement, Observation

OF_PLATE = ("flatness", "clamp")  # causes that repeat with the plate, so that no scatter shows them
DOUBT = 0.01  # chance below which the scatter is called larger, or smaller, than predicted


@dataclass(frozen=True)
class PooledAngle:
    """One angle over the repeats, radians, in the order of the scans.

    pooled: generalised least squares, which weighs by the covariance; u: of it. chi_square: of the
    scatter about it, with `freedom` degrees; probability: of as much or more. drift: per scan, and
    its u; None for two scans. status: 'as-predicted', 'larger' or 'smaller' than predicted.
    """

    kind: str
    values: Array
    pooled: float
    u: float
    chi_square: float
    dof: int
    probability: float
    drift: float | None
    u_drift: float | None
    status: Literal["as-predicted", "larger", "smaller"]


@dataclass(frozen=True)
class Repeats:
    """The scans, by name, that repeat one wheel or trial, and what they say together."""

    of: str
    scans: tuple[str, ...]
    angles: tuple[PooledAngle, ...]


def share_plates(observations: Sequence[Observation]) -> list[Observation]:
    """Make what comes with the plate one effect in all scans of it, so that it cancels between."""
    repeated = {seen.repeats for seen in observations if seen.repeats is not None}
    return [
        _share(seen, seen.repeats or seen.name)
        if seen.repeats is not None or seen.name in repeated
        else seen
        for seen in observations
    ]


def _share(seen: Observation, plate: str) -> Observation:
    if seen.evidence is None:
        return seen
    target = seen.evidence.target
    components = tuple(
        replace(component, shared=f"plate of {plate}")
        if component.name in OF_PLATE and math.isinf(component.dof)
        else component
        for component in target.components
    )
    return replace(
        seen, evidence=replace(seen.evidence, target=replace(target, components=components))
    )


def pool_repeats(measurement: Measurement) -> tuple[Repeats, ...]:
    """Every group of two or more measured scans of the same thing, in the order of the result."""
    measured = [wheel for wheel in measurement.wheels if wheel.angles is not None]
    groups: dict[str, list[int]] = {}
    for index, wheel in enumerate(measured):
        groups.setdefault(wheel.observation.repeats or wheel.observation.name, []).append(index)
    count = len(measured)
    found = []
    for of, members in groups.items():
        if len(members) < 2:
            continue
        rows = np.array(members)
        pooled = []
        for offset, kind in ((0, "toe"), (count, "camber")):
            values = np.array([getattr(measured[i].angles, f"{kind}_rad") for i in members])
            block = measurement.uncertainty.covariance[np.ix_(rows + offset, rows + offset)]
            pooled.append(pool(kind, values, block))
        names = tuple(measured[i].observation.name for i in members)
        found.append(Repeats(of, names, tuple(pooled)))
    return tuple(found)


def pool(kind: str, values: Array, covariance: Array) -> PooledAngle:
    """Pool values (n,) with their covariance (n, n), radians.

    Source: generalised least squares, Aitken (1935); the chi-square test of JCGM 100, 4.2.3 and
    F.1, with the covariance in the place of one sigma.
    """
    count = len(values)
    start = values[0]
    mean, u_mean, left = _fit(np.ones((count, 1)), values - start, covariance)
    dof = count - 1
    above = chi_square_beyond(left, dof)
    drift = u_drift = None
    if count > 2:
        order = np.arange(count) - (count - 1) / 2.0
        slopes, u_slopes, _ = _fit(
            np.column_stack([np.ones(count), order]), values - start, covariance
        )
        drift, u_drift = float(slopes[1]), float(u_slopes[1])
    status: Literal["as-predicted", "larger", "smaller"] = "as-predicted"
    if above < DOUBT:
        status = "larger"
    elif above > 1.0 - DOUBT:
        status = "smaller"
    return PooledAngle(
        kind=kind,
        values=values,
        pooled=float(start + mean[0]),
        u=float(u_mean[0]),
        chi_square=left,
        dof=dof,
        probability=above,
        drift=drift,
        u_drift=u_drift,
        status=status,
    )


def _fit(slopes: Array, values: Array, covariance: Array) -> tuple[Array, Array, float]:
    """Coefficients, their standard uncertainties, and the chi-square left over."""
    scale = float(np.trace(covariance)) / len(covariance)
    if not scale > 0.0:
        raise ValueError("repeats without any uncertainty cannot be compared")
    # What all share adds to the pooled value and nothing to the differences; a trace of rounding
    # keeps the matrix regular where nothing else distinguishes the scans.
    V = covariance / scale + 1e-12 * np.eye(len(values))
    weighted = np.linalg.solve(V, slopes)
    inverse = np.linalg.inv(slopes.T @ weighted)
    found = inverse @ (weighted.T @ values)
    residual = values - slopes @ found
    left = float(residual @ np.linalg.solve(V, residual)) / scale
    return found, np.sqrt(np.diag(inverse) * scale), left
