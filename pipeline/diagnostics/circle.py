"""The circle of least squared distances, with weights and a known radius where there is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, NotMeasuredError
from ..vectors import Array

MAX_STEPS = 200
STILL = 1e-15  # of the circle's size: a step that ends the fit
FLAT = 1e-12  # spread across a line, over the spread along it, that is none


@dataclass(frozen=True)
class Circle:
    """A circle in a plane: centre_m (2,), radius_m; covariance_m2 (2, 2) of the centre.

    The covariance is for weights that are one over the variance. steps: until the fit stood still.
    """

    centre_m: Array
    radius_m: float
    covariance_m2: Array
    steps: int


def fit_circle(
    points_m: Array,
    weigh: Callable[[Array], Array] = np.ones_like,
    known_m: tuple[float, float] | None = None,
) -> Circle:
    """Circle of least weighted squared distances to points_m (N, 2), by Gauss-Newton.

    |p - c| - r = excess, d excess = -rho . dc - dr, rho the unit vector from the centre to p.
    weigh: weights (N,) of the excesses (N,); called anew at each step. known_m: the radius and its
    standard uncertainty. Raises InputError for fewer than 3 points, NotMeasuredError 'no-circle'
    for points on a line.
    Source: Gander, Golub, Strebel, BIT 34 (1994) 558, section 3.
    """
    if len(points_m) < 3:
        raise InputError(f"a circle needs at least 3 points, got {len(points_m)}")
    origin = points_m.mean(axis=0)
    local = points_m - origin
    state = _first_circle(local)
    prior = np.zeros(3) if known_m is None else np.array([0.0, 0.0, known_m[1] ** -2])
    mean = 0.0 if known_m is None else known_m[0]
    steps, moved = 0, np.inf
    while moved > STILL * state[2] and steps < MAX_STEPS:
        offset = local - state[:2]
        reach = np.hypot(offset[:, 0], offset[:, 1])
        excess = reach - state[2]
        slopes = np.column_stack([offset / np.maximum(reach, 1e-300)[:, None], np.ones(len(local))])
        weight = weigh(excess)
        information = (slopes.T * weight) @ slopes + np.diag(prior)
        step = np.linalg.solve(
            information, slopes.T @ (weight * excess) - prior * (state[2] - mean)
        )
        state, steps, moved = state + step, steps + 1, np.abs(step).max()
    covariance: Array = np.linalg.inv(information).astype(np.float64)
    return Circle(origin + state[:2], float(state[2]), covariance[:2, :2], steps)


def _first_circle(local: Array) -> Array:
    """Centre and radius (3,) of least squared |p|^2 - 2 c . p - (r^2 - c^2), which is linear."""
    spread = np.linalg.svd(local, compute_uv=False)
    if spread[1] <= FLAT * spread[0]:
        raise NotMeasuredError("no-circle", "the points of a circle lie on a line")
    slopes = np.column_stack([2.0 * local, np.ones(len(local))])
    u, v, rest = np.linalg.lstsq(slopes, np.sum(local**2, axis=1), rcond=None)[0]
    return np.array([u, v, np.sqrt(rest + u * u + v * v)])
