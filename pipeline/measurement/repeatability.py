"""Repeatability: scans of a wheel with nothing moved, pooled; their scatter and drift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ..system import frozen
from ..uncertainty import UncertaintyComponent, chi_square_beyond, least_squares, scatter_beyond
from ..vectors import Array
from .doubts import are_copies
from .records import Measurement, Observation

OF_PLATE = (
    "flatness",
    "clamp",
    "stand-off",
)  # components constant for a target, which no scatter shows
TYRE_RUNOUT = "tyre run-out"  # constant, too, while the wheel is not rotated
DOUBT = 0.01  # probability below which scatter counts as larger, or smaller, than predicted


@frozen
class PooledAngle:
    """Angle from repeat scans, radians, values in the order of the scans.

    pooled: generalised least squares estimate; u: its standard uncertainty. chi_square: of the
    scatter about that without `scatter`, with `dof` degrees of freedom; probability: of exceeding
    it by chance. status: 'as-predicted', 'larger' or 'smaller' scatter than predicted. scatter:
    standard deviation of a scan beyond its u, 0 unless larger; it is in both u, whose degrees of
    freedom are then `dof`. drift: per scan, and its u; None for two scans.
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
    scatter: float


@frozen
class Repeats:
    """Names of the scans that repeat one wheel or trial, and their pooled angles."""

    of: str
    scans: tuple[str, ...]
    angles: tuple[PooledAngle, ...]


def share_components(observations: Sequence[Observation]) -> list[Observation]:
    """Share the components of a target among its repeat scans, so that they cancel between them."""
    named = {o.name: o for o in observations}
    repeated = {o.repeats for o in observations if o.repeats is not None}
    return [
        _share(observation, named[observation.repeats or observation.name])
        if observation.repeats is not None or observation.name in repeated
        else observation
        for observation in observations
    ]


def _share(observation: Observation, first: Observation) -> Observation:
    """Return a scan of the target of `first` with components that it shares with this.

    The run-out of a tyre, as large as other waves of it in each scan, is that of the first.
    """
    if observation.evidence is None:
        return observation
    target = observation.evidence.target
    of_first = first.evidence.target.components if first.evidence else ()
    runout = next((one for one in of_first if one.name == TYRE_RUNOUT), None)
    plate = f"plate of {first.name}"

    def shared(component: UncertaintyComponent) -> UncertaintyComponent:
        if component.name == TYRE_RUNOUT and runout is not None:
            return replace(runout, shared=plate)
        if component.name in OF_PLATE and math.isinf(component.dof):
            return replace(component, shared=plate)
        return component

    components = tuple(map(shared, target.components))
    evidence = replace(observation.evidence, target=replace(target, components=components))
    return replace(observation, evidence=evidence)


def pool_repeats(measurement: Measurement) -> tuple[Repeats, ...]:
    """Pool every group of two or more measured scans of one wheel or trial, in result order.

    Without those that are copies of one before: these show nothing of their own.
    """
    measured = [wheel for wheel in measurement.wheels if wheel.evaluated is not None]
    groups: dict[str, list[int]] = {}
    for index, wheel in enumerate(measured):
        seen = wheel.observation
        group = groups.setdefault(seen.repeats or seen.name, [])
        if not any(are_copies(measured[one].observation, seen) for one in group):
            group.append(index)
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

    Chi-square test as in JCGM 100, 4.2.3 and F.1, with the covariance in place of a single sigma.
    Scatter as of a series over time (batch/results/trends.py).
    """
    count = len(values)
    start, ones = values[0], np.ones((len(values), 1))
    mean, u_mean, chi_square = least_squares(ones, values - start, covariance)
    dof = count - 1
    probability = chi_square_beyond(chi_square, dof)
    scatter = 0.0
    if probability < DOUBT:
        scatter = scatter_beyond(ones, values - start, covariance, float(np.ptp(values - start)))
    covariance = covariance + scatter**2 * np.eye(count)
    mean, u_mean, _ = least_squares(ones, values - start, covariance)
    drift = u_drift = None
    if count > 2:
        order = np.arange(count) - (count - 1) / 2.0
        slopes, u_slopes, _ = least_squares(
            np.column_stack([np.ones(count), order]), values - start, covariance
        )
        drift, u_drift = float(slopes[1]), float(u_slopes[1])
    status: Literal["as-predicted", "larger", "smaller"] = "as-predicted"
    if probability < DOUBT:
        status = "larger"
    elif probability > 1.0 - DOUBT:
        status = "smaller"
    return PooledAngle(
        kind=kind,
        values=values,
        pooled=float(start + mean[0]),
        u=float(u_mean[0]),
        chi_square=chi_square,
        dof=dof,
        probability=probability,
        drift=drift,
        u_drift=u_drift,
        status=status,
        scatter=scatter,
    )
