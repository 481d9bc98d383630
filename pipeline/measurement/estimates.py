"""Estimates by their slopes, and sums of them with what they share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

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


def with_part(known: Estimate, u: float, dof: float) -> Estimate:
    """Return the estimate with an error of its own, independent of all inputs.

    Source: Welch and Satterthwaite, JCGM 100, G.4.
    """
    if u == 0.0:
        return known
    total = math.hypot(known.u, u)
    dof = total**4 / (known.u**4 / known.dof + u**4 / dof)
    return replace(known, u=total, dof=dof, u_own=math.hypot(known.u_own, u))


def weighted_sum(terms: Sequence[tuple[float, Estimate]]) -> Estimate:
    """Return the sum of weight times estimate, all of one vehicle, with their covariance."""
    effects = terms[0][1].effects
    return estimate(
        math.fsum(weight * term.value for weight, term in terms),
        np.sum([weight * term.slope for weight, term in terms], axis=0),
        effects,
        math.hypot(*(weight * term.u_own for weight, term in terms)),
    )
