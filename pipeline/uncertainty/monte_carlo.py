"""Propagation of distributions (JCGM 101): normals and centres drawn at random.

The quantities are computed by an independent model, so that the comparison checks the measurement's
formulas as well as their derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..system import frozen
from ..vectors import Array
from .components import UncertainTarget
from .monte_carlo_model import independent_quantities
from .propagation import LEVEL, AngleUncertainty, Effect, effects_of, estimates_of

BLOCK = 10_000  # draws; JCGM 101, 7.9.4 asks for at least that many in a block
# Relative to u: strictest tolerance for one significant digit of u (0.5 in 9; JCGM 101, 7.9.2).
TOLERANCE = 0.05


Status = Literal["agree", "disagree", "not-converged"]


@frozen
class MonteCarlo:
    """Results of the draws beside the formula; all arrays (Q,) in the order of the covariance.

    low, high: ends of the probabilistically symmetric 95 % interval. formula: standard
    uncertainties by J Sigma J^T; expanded: U by the effective degrees of freedom, which that
    interval checks. tolerance: within which the ends of both intervals have to agree (JCGM 101,
    7.9.2). end_difference: the larger difference of the two ends (clause 8.1). status: 'agree',
    'disagree', or 'not-converged' where the draws allowed did not decide.
    """

    draws: int
    mean: Array
    standard: Array
    low: Array
    high: Array
    formula: Array
    expanded: Array
    tolerance: Array
    end_difference: Array
    status: Status

    @property
    def half(self) -> Array:
        """Half the width of the 95 % interval (Q,)."""
        return (self.high - self.low) / 2.0


def monte_carlo(
    targets: Sequence[UncertainTarget],
    wheels: Sequence[str],
    known: AngleUncertainty,
    max_draws: int,
    seed: int,
    vertical: UncertainTarget | None = None,
) -> MonteCarlo:
    """Propagate the same components by random draws, block by block, until the results converge.

    max_draws: at least two blocks are drawn. vertical: see `propagate`. Components are drawn from
    normal distributions, from Student's t where their size was estimated with finite degrees of
    freedom.
    Source: JCGM 101, 6.4.9 (Student's t), 7.9 (adaptive procedure), 8 (comparison with the
    formula); JCGM 102, 5.3.2, for what was estimated together.
    """
    inputs = targets if vertical is None else [*targets, vertical]
    base = independent_quantities(*_inputs(inputs), wheels)[0]
    effects = effects_of(inputs)
    rng = np.random.default_rng(seed)
    tolerance = TOLERANCE * known.standard
    half = known.coverage_factor * known.standard
    blocks: list[Array] = []
    results: list[Array] = []  # both ends of each block
    status: Status = "not-converged"
    while len(blocks) < 2 or (status == "not-converged" and (len(blocks) + 1) * BLOCK <= max_draws):
        moved = _moved(effects, 6 * len(inputs), rng).reshape(BLOCK, -1, 6)
        block = independent_quantities(*_inputs(inputs, moved), wheels) - base
        blocks.append(block)
        results.append(_ends(block))
        if len(blocks) > 2:
            status = _status(np.stack(results), half, tolerance)
    drawn = np.concatenate(blocks)
    low, high = _ends(drawn)
    return MonteCarlo(
        draws=len(drawn),
        mean=base + drawn.mean(axis=0),
        standard=drawn.std(axis=0, ddof=1),
        low=base + low,
        high=base + high,
        formula=known.standard,
        expanded=half,
        tolerance=tolerance,
        end_difference=np.maximum(np.abs(low + half), np.abs(high - half)),
        status=status,
    )


def _moved(effects: Sequence[Effect], size: int, rng: np.random.Generator) -> Array:
    """Return a block of draws (BLOCK, size) of all inputs.

    Of one estimate with nu degrees of freedom: normal draws over sqrt(chi-square(nu)/nu).
    """
    scales: dict[object, Array] = {}
    total = np.zeros((BLOCK, size))
    for key, effect in zip(estimates_of(effects), effects, strict=True):
        drawn = rng.standard_normal((BLOCK, effect.factor.shape[1]))
        if math.isfinite(effect.dof):
            if key not in scales:
                scales[key] = np.sqrt(effect.dof / rng.chisquare(effect.dof, (BLOCK, 1)))
            drawn *= scales[key]
        total += drawn @ effect.factor.T
    return total


def _ends(values: Array) -> Array:
    """Return the ends y_(r), y_(r + q) (2, Q) of the symmetric 95 % interval of values (M, Q).

    q = 0.95 M, r = (M - q)/2. Source: JCGM 101, 7.7.2.
    """
    ordered = np.sort(np.ascontiguousarray(values.T), axis=1)
    q = round(LEVEL * len(values))
    r = (len(values) - q) // 2
    return np.asarray(ordered[:, [r - 1, r + q - 1]].T)


def _status(results: Array, half: Array, tolerance: Array) -> Status:
    """Return the status from the blocks' ends (B, 2, Q).

    Disagree: ends differ by more than the tolerance beyond doubt. Converged: two standard
    deviations of the means of all ends over the blocks are at most a fifth of the tolerance; then
    so are those of mean and standard deviation, where Student's t has one.
    """
    doubt = 2.0 * results.std(axis=0, ddof=1) / math.sqrt(len(results))
    low, high = results.mean(axis=0)
    difference = np.maximum(np.abs(low + half), np.abs(high - half))
    if bool(np.any(difference - doubt.max(axis=0) > tolerance)):
        return "disagree"
    if bool(np.all(doubt <= tolerance / 5.0)):
        return "agree" if bool(np.all(difference <= tolerance)) else "not-converged"
    return "not-converged"


def _inputs(targets: Sequence[UncertainTarget], moved: Array | None = None) -> tuple[Array, Array]:
    """Return normals and centres (T, W, 3), centres relative to the mean of the first four."""
    normals = np.stack([target.normal for target in targets])
    centres = np.stack([target.centre_m for target in targets])
    centres = centres - centres[:4].mean(axis=0)
    if moved is None:
        return normals[None], centres[None]
    return normals + moved[:, :, :3], centres + moved[:, :, 3:]
