"""Limits of agreement (Bland and Altman) with repeated measures, and their confidence limits."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import numpy as np

from ...system import frozen
from ...uncertainty import chi_square_limits
from ...vectors import Array
from .power import CONFIDENCE

SPAN = 1.959963984540054  # standard deviations on each side of 95 % of a normal distribution


@frozen
class Limit:
    """A value with its 95 % confidence limits."""

    value: float
    low: float
    high: float


@frozen
class Components:
    """Variance components of differences within and between subjects, and of subjects' means.

    between: 0 where the means scatter less than expected from `within` alone. harmonic: harmonic
    mean of the number of measures per subject.
    """

    within: float
    between: float
    of_means: float
    harmonic: float
    subjects: int
    count: int

    @property
    def total(self) -> float:
        """Variance of a single difference."""
        return self.between + self.within


def components(difference: Array, subject: Sequence[Hashable]) -> Components:
    """Estimate variance components of differences (N,), true values varying within subjects.

    Source: Bland and Altman, J. Biopharm. Stat. 17 (2007) 571, section 3; Zou (see below) for the
    unweighted means.
    """
    groups: dict[Hashable, list[float]] = {}
    for value, whose in zip(difference, subject, strict=True):
        groups.setdefault(whose, []).append(float(value))
    sets = [np.array(group) for group in groups.values()]
    dof = len(difference) - len(sets)
    inside = sum(float(np.sum((g - g.mean()) ** 2)) for g in sets)
    within = inside / dof if dof else 0.0
    of_means = float(np.var([g.mean() for g in sets], ddof=1)) if len(sets) > 1 else 0.0
    harmonic = len(sets) / sum(1.0 / len(g) for g in sets)
    between = max(0.0, of_means - within / harmonic)
    return Components(within, between, of_means, harmonic, len(sets), len(difference))


def limits_of_agreement(bias: float, u_bias: float, parts: Components) -> tuple[Limit, Limit]:
    """Return bias -+ 1.96 standard deviations of a difference, each with confidence limits.

    The method of variance estimates recovery: Zou, Stat. Methods Med. Res. 22 (2013) 630, eq. 5-7.
    """
    deviation = math.sqrt(parts.total)
    below = above = 0.0
    for variance, dof in (
        (parts.of_means, parts.subjects - 1),
        ((1.0 - 1.0 / parts.harmonic) * parts.within, parts.count - parts.subjects),
    ):
        if dof > 0:
            least, most = chi_square_limits(CONFIDENCE, dof)
            below += (variance * (1.0 - dof / most)) ** 2
            above += (variance * (dof / least - 1.0)) ** 2
    small = math.sqrt(max(0.0, parts.total - math.sqrt(below)))
    large = math.sqrt(parts.total + math.sqrt(above))
    inner = math.hypot(SPAN * u_bias, SPAN * (deviation - small))
    outer = math.hypot(SPAN * u_bias, SPAN * (large - deviation))
    low, high = bias - SPAN * deviation, bias + SPAN * deviation
    return Limit(low, low - outer, low + inner), Limit(high, high - inner, high + outer)
