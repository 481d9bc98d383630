"""Plane of rounded coordinates, by the likelihood of the steps on which the points came to lie.

Of a point that was rounded to a step s across the plane, only that step is known. With its middle
at the distance d from the plane, and noise sigma of distribution Phi, the point lay in it with the
probability P(d) = Phi((d + s/2)/sigma) - Phi((d - s/2)/sigma). Least squares take the middle of the
step for the point, and where sigma is less than half a step they are pulled towards the steps; the
maximum of the likelihood is not, and its information shows how much the rounding hides. Points on
a third step tell the slope from the noise: where few points reach one, the angle is hidden.
Source: Burridge, J. R. Statist. Soc. B 43 (1981) 41: this likelihood has one maximum.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..errors import NotMeasuredError
from ..system import frozen
from ..vectors import Array, Mask, Rows
from .correlated_noise import Cells, filled

KEPT = 4.0  # sigma beyond its step, within which a point is kept
FEW = 20  # points beyond the two steps that most are on, below which the steps hide the angle
HIDDEN = 0.25  # standard uncertainty of ln sigma above which they do as well
FIRST_POINTS = 20_000  # enough to find where all points are then fitted
LEAST_SIGMA = 1e-3  # of a step
LARGEST_MOVE = 0.7  # of ln sigma, in one iteration
MAX_ITERATIONS, MAX_HALVINGS, MAX_SETS = 60, 8, 10
SETTLED = 1e-4  # expected gain in log-likelihood: a hundredth of the uncertainty, squared
FARTHEST = 300.0  # sigma, beyond which a logistic tail below 1e-236 counts as there: exp is finite
TAIL, PER_STEP, PER_SIGMA = 9.0, 200, 25  # reach of the tables in sigma, nodes a step and a sigma

Tail = Callable[[Array], tuple[Array, Array]]


@frozen(eq=False)
class RoundedFit:
    """Plane w = height_m + slopes . (u, v) of rounded points.

    sigma_m: noise across the plane before rounding. covariance: (3, 3) of the height and the two
    slopes, by this noise and by rounding. kept: (N,) points used. rms_m: of their distances.
    cells: mean distances of the points from the plane, as far as their steps show them.
    """

    height_m: float
    slopes: Array
    sigma_m: float
    covariance: Array
    kept: Mask
    rms_m: float
    cells: Cells | None


def fit_rounded(
    uvw_m: Array, level: Rows, step_m: float, sigma_m: float, across: int, side_m: float
) -> RoundedFit:
    """Fit the plane of points uvw_m (N, 3) near w = 0 that were rounded to steps step_m along w.

    level: (N,) number of the step on which each lies. sigma_m: where the search for the noise
    starts. across, side_m: number and side of the cells.
    The noise is taken for normal; how far the plane of logistic noise, with its longer tails, lies
    from that plane is a standard uncertainty. Raises NotMeasuredError 'steps-too-coarse'.
    """
    radius_m = float(np.abs(uvw_m[:, :2]).max())
    uvw = uvw_m / np.array([radius_m, radius_m, step_m])
    state = np.array([0.0, 0.0, 0.0, math.log(max(sigma_m / step_m, 0.5))])
    for stride in sorted({1, 1 + len(uvw) // FIRST_POINTS}, reverse=True):
        state, kept = _fit_kept(uvw[::stride], state)
    found = _evaluate(uvw[kept], state, normal_tail)
    covariance = np.linalg.pinv(found.information, hermitian=True)
    count = np.sort(np.unique(level[kept], return_counts=True)[1])
    if count[:-2].sum() < FEW or covariance[3, 3] > HIDDEN**2:
        raise NotMeasuredError(
            "steps-too-coarse",
            f"its coordinates lie in steps of {step_m * 1e3:.3g} mm across the target, and only "
            f"{count[:-2].sum()} of its {count.sum()} points beyond two of these steps",
        )
    other = _maximise(uvw[kept], state, logistic_tail)
    shape = (other - state)[:3]
    to_m = step_m / np.array([1.0, radius_m, radius_m])
    distance = _distance(uvw[kept], state)
    return RoundedFit(
        height_m=float(state[0] * step_m),
        slopes=state[1:3] * step_m / radius_m,
        sigma_m=math.exp(state[3]) * step_m,
        covariance=(covariance[:3, :3] + np.outer(shape, shape)) * np.outer(to_m, to_m),
        kept=kept,
        rms_m=float(np.sqrt(np.mean(distance**2))) * step_m,
        cells=_cells(uvw_m[kept, :2], found, math.exp(state[3]), step_m, across, side_m),
    )


def normal_tail(x: Array) -> tuple[Array, Array]:
    """Return the probability that a standard normal variable exceeds x (N,), and its density."""
    beyond = [0.5 * math.erfc(value) for value in (x / math.sqrt(2.0)).tolist()]
    return np.array(beyond), np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)


def logistic_tail(x: Array) -> tuple[Array, Array]:
    """Return the same of a logistic variable of unit variance, (N,) each."""
    rate, x = math.pi / math.sqrt(3.0), x.clip(-FARTHEST, FARTHEST)
    beyond = 1.0 / (1.0 + np.exp(rate * x))
    return beyond, rate * beyond / (1.0 + np.exp(-rate * x))


@frozen(eq=False)
class _Likelihood:
    """Log-likelihood of points at a state, its slope (4,) and expected information (4, 4).

    state: height, slopes and ln sigma; lengths across the plane in steps, along it in radii.
    by_height, weight: (N,) each point's part of the slope and the information of the height.
    """

    value: float
    slope: Array
    information: Array
    by_height: Array
    weight: Array


def _fit_kept(uvw: Array, state: Array) -> tuple[Array, Mask]:
    """Maximise the likelihood, drop points beyond their step, until the same ones are kept."""
    kept = np.ones(len(uvw), dtype=bool)
    for _ in range(MAX_SETS):
        state = _maximise(uvw[kept], state, normal_tail)
        before = kept
        kept = np.abs(_distance(uvw, state)) < 0.5 + KEPT * math.exp(state[3])
        if np.array_equal(before, kept):
            return state, kept
    return state, kept


def _maximise(uvw: Array, state: Array, tail: Tail) -> Array:
    """Return the state of the greatest likelihood, by Fisher's scoring."""
    here = _evaluate(uvw, state, tail)
    for _ in range(MAX_ITERATIONS):
        least = 1e-9 * len(uvw) * np.eye(4)  # one step only shows nothing of a slope
        move = np.linalg.solve(here.information + least, here.slope)
        if float(here.slope @ move) < SETTLED:
            return state
        move *= min(1.0, LARGEST_MOVE / max(abs(float(move[3])), 1e-300))
        for _ in range(MAX_HALVINGS):
            ahead = state + move
            ahead[3] = max(ahead[3], math.log(LEAST_SIGMA))
            there = _evaluate(uvw, ahead, tail)
            if there.value > here.value:
                break
            move /= 2.0
        else:
            return state
        state, here = ahead, there
    return state


def _distance(uvw: Array, state: Array) -> Array:
    return np.asarray(uvw[:, 2] - state[0] - uvw[:, :2] @ state[1:3])


def _evaluate(uvw: Array, state: Array, tail: Tail) -> _Likelihood:
    """Return the likelihood of points uvw (N, 3) at a state (4,)."""
    distance, table = _distance(uvw, state), _Table.of(math.exp(state[3]), tail)
    log, by_height, by_noise = (np.interp(distance, table.at, y) for y in table.point)
    phase = distance - np.rint(distance)
    height, mixed, noise = (np.interp(phase, table.phase, y) for y in table.expected)
    terms = np.column_stack([np.ones(len(uvw)), uvw[:, :2]])
    information = np.empty((4, 4))
    information[:3, :3] = (terms.T * height) @ terms
    information[3, :3] = information[:3, 3] = mixed @ terms
    information[3, 3] = float(noise.sum())
    slope = np.append(by_height @ terms, by_noise.sum())
    return _Likelihood(float(log.sum()), slope, information, by_height, height)


@frozen(eq=False)
class _Table:
    """Likelihood of one point and what it is expected to tell, in steps, at one sigma.

    point: ln P and its derivatives by the plane's height and by ln sigma, at the distances `at`.
    expected: information on the height, on both, on ln sigma, of a point whose nearest step lies
    `phase` from the plane: their sums over all the steps it may come to lie on.
    """

    at: Array
    point: tuple[Array, ...]
    phase: Array
    expected: tuple[Array, ...]

    @classmethod
    def of(cls, sigma: float, tail: Tail) -> _Table:
        """Return the table for noise sigma, in steps, with that tail."""
        edge = 0.5 + sigma * np.linspace(-TAIL, TAIL, round(2.0 * TAIL * PER_SIGMA) + 1)
        edge = np.concatenate([np.linspace(0.0, 0.5, PER_STEP // 2 + 1), edge[edge > 0.0]])
        half = np.unique(edge)
        near, far = (half - 0.5) / sigma, (half + 0.5) / sigma
        (beyond, density), (farther, less) = tail(near), tail(far)
        p = np.maximum(beyond - farther, 1e-300)
        by_height, by_noise = (density - less) / (sigma * p), (near * density - far * less) / p
        at = np.concatenate([-half[:0:-1], half])
        point = tuple(
            np.concatenate([sign * y[:0:-1], y])
            for sign, y in ((1.0, np.log(p)), (-1.0, by_height), (1.0, by_noise))
        )
        phase = at[np.abs(at) <= 0.5]
        others = np.arange(-math.ceil(TAIL * sigma), math.ceil(TAIL * sigma) + 1)
        log, height, noise = (np.interp(phase[:, None] + others, at, y) for y in point)
        pairs = (height * height, height * noise, noise * noise)
        return cls(at, point, phase, tuple(np.sum(np.exp(log) * y, axis=1) for y in pairs))


def _cells(
    uv_m: Array, found: _Likelihood, sigma: float, step_m: float, across: int, side_m: float
) -> Cells | None:
    """Return how far the points of each cell are off the plane, with what they tell for a count.

    sum(slope) / sum(information) is a step of the likelihood's maximum for the height of a cell
    alone; its variance is 1 / sum(information), that of sigma^2 times as many exact points.
    """
    column, row = (uv_m.T / side_m + 0.5 * across).astype(np.int64).clip(0, across - 1)
    cell = row * across + column
    weight, slope, *moments = (
        np.bincount(cell, y, minlength=across * across)
        for y in (found.weight, found.by_height, *(found.weight * uv_m.T))
    )
    count = np.asarray(weight * sigma**2, dtype=np.float64)
    full = filled(count)
    if full is None:
        return None
    index = np.stack([np.flatnonzero(full) % across, np.flatnonzero(full) // across], axis=1)
    return Cells(
        uv_m=np.stack([moment[full] / weight[full] for moment in moments], axis=1),
        mean_m=slope[full] / weight[full] * step_m,
        count=count[full],
        index=index,
        side_m=side_m,
        white_variance=(sigma * step_m) ** 2,
    )
