"""RANSAC without geometry: propose, score, refine the best, stop at the stated confidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..system import frozen
from ..vectors import Array

M = TypeVar("M")


class Problem(Protocol[M]):
    """Contract of a problem with models of type M."""

    def propose(self, count: int, rng: np.random.Generator) -> Sequence[M]:
        """Return models through minimal random samples."""

    def score(self, models: Sequence[M]) -> Array:
        """Return the support of each model: (len(models),), larger is better."""

    def refine(self, model: M) -> M:
        """Return the model refitted to its own support."""

    def success_rate(self, model: M) -> float:
        """Return the probability that one proposal is as good as this model."""


@frozen
class RansacOptions:
    """Stopping rule: this confidence that a good proposal was drawn, or the maximum."""

    confidence: float = 0.999
    max_proposals: int = 3000
    batch: int = 50


@frozen
class RansacResult(Generic[M]):
    """Best model, its score, and the number of proposals up to it."""

    model: M
    score: float
    proposals: int


def ransac(
    problem: Problem[M], options: RansacOptions, rng: np.random.Generator
) -> RansacResult[M] | None:
    """Find the best model of `problem`; None when no proposal had any support.

    Locally optimised: each new best is refined and kept if that raised its score.
    Source: Fischler and Bolles, CACM 24 (1981) 381; Chum, Matas, Kittler, DAGM 2003.
    """
    best: RansacResult[M] | None = None
    proposals, needed = 0, float(options.max_proposals)
    while proposals < needed:
        models = problem.propose(options.batch, rng)
        scores = problem.score(models)
        proposals += options.batch
        leader = int(np.argmax(scores))
        if scores[leader] > (best.score if best else 0.0):
            best = _refined(problem, models[leader], float(scores[leader]), proposals)
            needed = min(needed, _proposals_needed(problem.success_rate(best.model), options))
    return best


def _refined(problem: Problem[M], model: M, score: float, proposals: int) -> RansacResult[M]:
    refined = problem.refine(model)
    refined_score = float(problem.score([refined])[0])
    if refined_score >= score:
        return RansacResult(refined, refined_score, proposals)
    return RansacResult(model, score, proposals)


def _proposals_needed(success_rate: float, options: RansacOptions) -> float:
    if success_rate >= 1.0:
        return 0.0
    return math.log(1.0 - options.confidence) / math.log1p(-max(success_rate, 1e-12))
