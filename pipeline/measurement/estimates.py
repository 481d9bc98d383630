"""Estimates by their slopes, and sums of them with what they share."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..uncertainty import Effect, effective_dof
from ..vectors import Array
from .records import Estimate


def estimate(value: float, slope: Array, effects: Sequence[Effect], u_own: float = 0.0) -> Estimate:
    """Return a value with its uncertainty by all effects on its inputs.

    slope: (K,) by the inputs on which the effects act. u_own: a part of u that no input causes.
    Source: JCGM 100, 5.2 and G.4.
    """
    shares = [np.atleast_1d(np.sum((slope @ effect.factor) ** 2)) for effect in effects]
    total = np.sum(np.stack(shares), axis=0) + u_own**2
    dof = effective_dof(effects, shares, total)
    known = tuple(effects)
    return Estimate(value, math.sqrt(float(total[0])), float(dof[0]), slope, known, u_own)


def weighted_sum(terms: Sequence[tuple[float, Estimate]]) -> Estimate:
    """Return the sum of weight times estimate, all of one vehicle, with their covariance."""
    effects = terms[0][1].effects
    return estimate(
        math.fsum(weight * term.value for weight, term in terms),
        np.sum([weight * term.slope for weight, term in terms], axis=0),
        effects,
        math.hypot(*(weight * term.u_own for weight, term in terms)),
    )
