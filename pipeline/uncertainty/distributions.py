"""Probability distributions for tests and coverage factors; scipy stays behind this file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from ..vectors import Array

DRAWS = 20_000
BOX_BLOCKS = 10


def coverage_factor(level: float, dof: Array) -> Array:
    """Return k of the symmetric interval of probability `level`: Student's t, normal for inf."""
    from scipy.special import ndtri, stdtrit

    finite = np.isfinite(dof)
    probability = 0.5 + level / 2.0
    student = stdtrit(np.where(finite, dof, 1.0), probability)
    return np.asarray(np.where(finite, student, ndtri(probability)))


def tail(x: float, dof: float = math.inf) -> float:
    """Return the probability that Student's t, standard normal for inf, exceeds x."""
    if math.isinf(dof):
        return math.erfc(x / math.sqrt(2.0)) / 2.0
    from scipy.special import stdtr

    return float(stdtr(dof, -x))


def tails(x: Array, dof: Array) -> Array:
    """Return the probabilities that Student's t, standard normal for inf, exceeds each x."""
    from scipy.special import ndtr, stdtr

    finite = np.isfinite(dof)
    return np.asarray(np.where(finite, stdtr(np.where(finite, dof, 1.0), -x), ndtr(-x)))


def quantile(probability: float, dof: float = math.inf) -> float:
    """Return the quantile of Student's t, standard normal for inf."""
    if math.isinf(dof):
        return NormalDist().inv_cdf(probability)
    from scipy.special import stdtrit

    return float(stdtrit(dof, probability))


def chi_square_beyond(value: float, dof: int) -> float:
    """Return the probability that a chi-square of `dof` degrees of freedom is `value` or more."""
    from scipy.special import chdtrc

    return float(chdtrc(dof, value))


def chi_square_limits(level: float, dof: float) -> tuple[float, float]:
    """Return the limits between which a chi-square lies with probability `level`."""
    from scipy.special import chdtri

    side = (1.0 - level) / 2.0
    return float(chdtri(dof, 1.0 - side)), float(chdtri(dof, side))


def f_beyond(value: float, count: int, dof: float) -> float:
    """Return the probability that F of `count` and `dof` degrees of freedom is `value` or more."""
    if math.isinf(dof):
        return chi_square_beyond(count * value, count)
    from scipy.special import fdtrc

    return float(fdtrc(count, dof, value))


def f_sum_limits(level: float, counts: Sequence[int], dofs: Sequence[float]) -> tuple[float, float]:
    """Return the limits between which a sum of p F(p, nu) lies with probability `level`.

    p: each of counts; nu: each of dofs. A chi-square where every nu is infinite; else by draws,
    which move the level by 0.15 % (one standard deviation).
    """
    known = sum(p for p, nu in zip(counts, dofs, strict=True) if math.isinf(nu))
    if known == sum(counts):
        return chi_square_limits(level, known) if known else (0.0, 0.0)
    rng = np.random.default_rng(0)
    total = rng.chisquare(known, DRAWS) if known else np.zeros(DRAWS)
    for p, nu in zip(counts, dofs, strict=True):
        if math.isfinite(nu):
            total += rng.chisquare(p, DRAWS) * (nu / rng.chisquare(nu, DRAWS))
    side = (1.0 - level) / 2.0
    low, high = np.quantile(total, (side, 1.0 - side))
    return float(low), float(high)


def power_of_t(shift: float, level: float, dof: float = math.inf) -> float:
    """Return the power of a two-sided t-test of `level` for `shift` >= 0 standard errors.

    Rejections on the side of the shift count.
    """
    limit = quantile(0.5 + level / 2.0, dof)
    if math.isinf(dof):
        return tail(limit - shift)
    from scipy.special import nctdtr

    return float(1.0 - nctdtr(dof, shift, limit))


def power_of_f(noncentrality: float, level: float, count: int, dof: float = math.inf) -> float:
    """Return the power of an F-test of `level`, a chi-square test for inf, for d' V^-1 d."""
    from scipy.special import chdtri, chndtr, fdtri, ncfdtr

    if math.isinf(dof):
        return float(1.0 - chndtr(chdtri(count, 1.0 - level), count, noncentrality))
    limit = float(fdtri(count, dof, level))
    return float(1.0 - ncfdtr(count, dof, noncentrality, limit))


def box_probability(lower: Array, upper: Array, correlation: Array) -> float:
    """Return the probability that standard normal variables (n,) lie between limits (n,).

    correlation: (n, n), possibly singular. By draws, whose standard deviation is 0.0011 at most.
    """
    values, vectors = np.linalg.eigh(correlation)
    kept = values > 1e-12 * max(1.0, float(values.max(initial=0.0)))
    root = vectors[:, kept] * np.sqrt(values[kept])
    rng, inside = np.random.default_rng(0), 0
    for _ in range(BOX_BLOCKS):
        drawn = rng.standard_normal((DRAWS, root.shape[1])) @ root.T
        inside += int(np.count_nonzero(np.all((lower <= drawn) & (drawn <= upper), axis=1)))
    return inside / (BOX_BLOCKS * DRAWS)


def normal_scores(x: Array, dof: Array) -> Array:
    """Return standard normal variables (n,) as probable as Student's t of dof (n,) at x (n,)."""
    from scipy.special import ndtri

    below = np.minimum(tails(x, dof), tails(-x, dof))  # of the nearer tail, precise
    return np.asarray(np.where(np.isinf(x), x, np.sign(x) * -ndtri(below)))


def share_limits(hits: int, total: int, level: float) -> tuple[float, float]:
    """Return the confidence limits of a proportion, `hits` of `total` observed.

    Source: Clopper and Pearson, Biometrika 26 (1934) 404.
    """
    from scipy.special import betaincinv

    side = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else betaincinv(hits, total - hits + 1, side)
    high = 1.0 if hits == total else betaincinv(hits + 1, total - hits, 1.0 - side)
    return float(low), float(high)


def binomial_tail(hits: int, total: int, probability: float) -> float:
    """Return the probability of `hits` or more in `total` trials of one probability."""
    if hits == 0:
        return 1.0
    from scipy.special import bdtrc

    return float(bdtrc(hits - 1, total, probability))
