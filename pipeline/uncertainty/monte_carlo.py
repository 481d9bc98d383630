"""The same uncertainties by drawing: planes and centres at random, every angle worked out anew.

The quantities are computed by other formulas than the measurement's, so that the comparison checks
those as well as their slopes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..vectors import Array
from .components import UncertainTarget
from .distributions import coverage_factor
from .monte_carlo_model import independent_quantities
from .propagation import LEVEL, AngleUncertainty, effects_of

BLOCK = 10_000  # trials; JCGM 101 asks for at least that many at a time
# Of u: the strictest that one meaningful digit of u asks for (half a unit in 9, JCGM 101, 7.9.2).
TOLERANCE = 0.05


Status = Literal["agree", "disagree", "not-converged"]


@dataclass(frozen=True)
class MonteCarlo:
    """What the trials gave, beside the formula; all arrays (Q,) in the order of the covariance.

    low, high: ends of the 95 % interval, as much beyond either. formula: standard uncertainties by
    J Sigma J^T. tolerance: to which the ends of the intervals have to agree (JCGM 101, 7.9.2).
    apart: the larger distance of the two ends (clause 8.1). status: 'agree', 'disagree', or
    'not-converged' where the trials allowed did not settle which.
    """

    trials: int
    mean: Array
    standard: Array
    low: Array
    high: Array
    formula: Array
    tolerance: Array
    apart: Array
    status: Status


def monte_carlo(
    targets: Sequence[UncertainTarget],
    wheels: Sequence[str],
    known: AngleUncertainty,
    max_trials: int,
    seed: int,
) -> MonteCarlo:
    """Propagate the same causes by random draws, block by block, until the results stand still.

    max_trials: at least two blocks are drawn. Source: JCGM 101, 7.9 (adaptive procedure), 8
    (comparison with the formula); causes are drawn normal, as the formula takes them.
    """
    base = independent_quantities(*_inputs(targets), wheels)[0]
    effects = effects_of(targets)
    rng = np.random.default_rng(seed)
    tolerance = TOLERANCE * known.standard
    half = coverage_factor(LEVEL, np.array(math.inf)) * known.standard
    blocks: list[Array] = []
    results: list[Array] = []  # of each block: mean, standard deviation, both ends
    status: Status = "not-converged"
    while len(blocks) < 2 or (
        status == "not-converged" and (len(blocks) + 1) * BLOCK <= max_trials
    ):
        moved = sum(rng.standard_normal((BLOCK, e.factor.shape[1])) @ e.factor.T for e in effects)
        moved = np.reshape(moved, (BLOCK, len(targets), 6))
        block = independent_quantities(*_inputs(targets, moved), wheels) - base
        blocks.append(block)
        results.append(np.stack([block.mean(axis=0), block.std(axis=0, ddof=1), *_ends(block)]))
        if len(blocks) > 2:
            status = _status(np.stack(results), half, tolerance)
    drawn = np.concatenate(blocks)
    low, high = _ends(drawn)
    return MonteCarlo(
        trials=len(drawn),
        mean=base + drawn.mean(axis=0),
        standard=drawn.std(axis=0, ddof=1),
        low=base + low,
        high=base + high,
        formula=known.standard,
        tolerance=tolerance,
        apart=np.maximum(np.abs(low + half), np.abs(high - half)),
        status=status,
    )


def _ends(values: Array) -> Array:
    """Ends (2, Q) of the 95 % interval of values (M, Q), as many beyond either: y_(r), y_(r + q).

    q = 0.95 M, r = (M - q)/2. Source: JCGM 101, 7.7.2.
    """
    ordered = np.sort(np.ascontiguousarray(values.T), axis=1)
    q = round(LEVEL * len(values))
    r = (len(values) - q) // 2
    return np.asarray(ordered[:, [r - 1, r + q - 1]].T)


def _status(results: Array, half: Array, tolerance: Array) -> Status:
    """What the blocks' results (B, 4, Q) say by now: ends beyond doubt apart, or settled and near.

    A mean over the blocks is settled when two of its standard deviations are a fifth of the
    tolerance.
    """
    doubt = 2.0 * results.std(axis=0, ddof=1) / math.sqrt(len(results))
    _, _, low, high = results.mean(axis=0)
    apart = np.maximum(np.abs(low + half), np.abs(high - half))
    if bool(np.any(apart - doubt[2:].max(axis=0) > tolerance)):
        return "disagree"
    if bool(np.all(doubt <= tolerance / 5.0)):
        return "agree" if bool(np.all(apart <= tolerance)) else "not-converged"
    return "not-converged"


def _inputs(targets: Sequence[UncertainTarget], moved: Array | None = None) -> tuple[Array, Array]:
    """Normals and centres (T, W, 3), centres from the mean of the first four."""
    normals = np.stack([target.normal for target in targets])
    centres = np.stack([target.centre_m for target in targets])
    centres = centres - centres[:4].mean(axis=0)
    if moved is None:
        return normals[None], centres[None]
    return normals + moved[:, :, :3], centres + moved[:, :, 3:]
