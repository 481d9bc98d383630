"""Probability distributions for tests and coverage factors; scipy stays behind this file.

Importing scipy takes longer than measuring a scan, so what every result needs does without it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from ..vectors import Array

DRAWS = 20_000
BISECTIONS = 60
RECTANGLE_NODES = 200
NORMAL_DOF = 1e6  # from which Student's t is normal to eight digits
BOX_BLOCKS = 10
NODES = 40  # of Gauss's rule
MOST_STEPS, CONVERGED = 60, 1e-14
MOST_DOF = 1e8  # from which t is normal and F a chi-square to seven digits
MOST_TERMS, TERM = 10_000, 1e-16  # of a continued fraction
LARGE = 15.0  # from which Stirling's series is exact
FEW_DOF = 1000.0
LEAST_LEVEL, MOST_LEVEL = 0.5, 0.99  # of intervals whose factor needs no scipy


def coverage_factor(level: float, dof: Array) -> Array:
    """Return k of the symmetric interval of probability `level`: Student's t, normal for inf.

    dof: (N,) at least 1. level: up to 0.99. To 1e-11 of k at 95 %, 1e-9 at 99 %.
    Source: Abramowitz and Stegun (1964) 26.7.3. With t = sqrt(dof) tan(angle), the density of the
    angle is in proportion to cos^(dof - 1), which Gauss's rule integrates. Newton's steps rise to
    the angle from that of the normal quantile, which is never larger. Equal dof share their steps:
    most quantities of a vehicle have the same.
    """
    dof, place = np.unique(dof, return_inverse=True)
    normal = NormalDist().inv_cdf(0.5 + level / 2.0)
    finite = np.isfinite(dof)
    known = np.where(finite, dof, 1.0)[..., None]
    peak = np.array([_peak_of_angle(one) for one in known.flat]).reshape(known.shape)
    node, weight = _gauss_rule()
    angle = np.arctan(normal / np.sqrt(known))
    for _ in range(MOST_STEPS):
        mean = np.sum(weight * _power_of_cosine(angle * node, known - 1.0), axis=-1, keepdims=True)
        step = (0.5 * level / peak - angle * mean) / _power_of_cosine(angle, known - 1.0)
        angle = angle + step
        if float(np.max(np.abs(step) / angle, initial=0.0)) < CONVERGED:
            break
    return np.where(finite, (np.sqrt(known) * np.tan(angle))[..., 0], normal)[place]


@functools.cache
def _gauss_rule() -> tuple[Array, Array]:
    """Return the nodes and weights (NODES,) of Gauss's rule from 0 to 1."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (node + 1.0), 0.5 * weight


def _power_of_cosine(angle: Array, power: Array) -> Array:
    """Return cos^power, by its logarithm: small angles keep their digits in a large power."""
    return np.asarray(np.exp(0.5 * power * np.log1p(-(np.sin(angle) ** 2))))


def _peak_of_angle(dof: float) -> float:
    """Return the density at 0 of the angle of Student's t: G((dof + 1) / 2) / G(dof / 2) / sqrt pi.

    By the series of the ratio for large dof, where the gamma functions lose digits.
    """
    half = 0.5 * dof
    if dof < FEW_DOF:
        return math.exp(math.lgamma(half + 0.5) - math.lgamma(half)) / math.sqrt(math.pi)
    third = 1.0 + (5.0 - 21.0 / (32.0 * half)) / (8.0 * half)
    return math.sqrt(half / math.pi) * (1.0 - (1.0 - third / (16.0 * half)) / (8.0 * half))


def tail(x: float, dof: float = math.inf, uniform: float = 0.0) -> float:
    """Return the probability that Student's t, standard normal for inf, exceeds x.

    uniform: of a quantity of which a rectangular part has this share, 0 to 1, of the standard
    uncertainty u, x in units of u: `_tail_of_sum`.
    """
    if uniform > 0.0:
        return _tail_of_sum(x, dof, uniform)
    if dof > MOST_DOF:
        return math.erfc(x / math.sqrt(2.0)) / 2.0
    if x < 0.0:
        return 1.0 - tail(-x, dof)
    return 0.5 * _beta_tail(0.5 * dof, 0.5, x / math.sqrt(dof) * (x / math.sqrt(dof)))


def tails(x: Array, dof: Array) -> Array:
    """Return the probabilities that Student's t, standard normal for inf, exceeds each x."""
    from scipy.special import ndtr, stdtr

    finite = np.isfinite(dof)
    return np.asarray(np.where(finite, stdtr(np.where(finite, dof, 1.0), -x), ndtr(-x)))


def least_tail(x: Array, dof: Array) -> float:
    """Return the least of the probabilities (N,) that Student's t exceeds x; dof: (N,).

    Only those are calculated that no larger x of as many degrees of freedom or more undercuts.
    """
    undercut = np.any(np.less.outer(x, x) & np.less_equal.outer(dof, dof), axis=1)
    return min(map(tail, x[~undercut].tolist(), dof[~undercut].tolist()))


@functools.lru_cache(maxsize=1024)
def quantile(probability: float, dof: float = math.inf, uniform: float = 0.0) -> float:
    """Return the quantile of Student's t, standard normal for inf; uniform: as of `tail`."""
    if uniform > 0.0:
        return _quantile_of_sum(probability, dof, uniform)
    if math.isinf(dof):
        return NormalDist().inv_cdf(probability)
    level = abs(2.0 * probability - 1.0)
    if LEAST_LEVEL <= level <= MOST_LEVEL and dof >= 1.0:
        return math.copysign(float(coverage_factor(level, np.array([dof]))[0]), probability - 0.5)
    from scipy.special import stdtrit

    return float(stdtrit(dof, probability))


def _tail_of_sum(x: float, dof: float, uniform: float) -> float:
    """Return the probability that a sum of a rectangular and a t variable exceeds x.

    The rectangle has the standard deviation `uniform` and half the width a, the rest the scale
    s = sqrt(1 - uniform^2); dof: effective ones of the sum, of which s^4 are those of the rest. The
    tail of the rest, averaged over the rectangle: s/(2 a) times the integral of it over t from
    (x - a)/s to (x + a)/s. Source: JCGM 101:2008, 5.10; EA-4/02, S9.14 and S10.
    """
    own, scale = _rest(dof, uniform)
    half = math.sqrt(3.0) * uniform
    ends = [_tail_integral((x + side) / scale, own) for side in (-half, half)]
    return min(1.0, max(0.0, scale / (2.0 * half) * (ends[1] - ends[0])))


def _rest(dof: float, uniform: float) -> tuple[float, float]:
    """Return degrees of freedom and scale of what is not rectangular in a sum."""
    scale = math.sqrt(max(1e-12, 1.0 - uniform**2))
    own = dof * scale**4
    return (own if own < NORMAL_DOF else math.inf), scale


def _tail_integral(t: float, dof: float) -> float:
    """Return the integral of the tail of Student's t up to t, less a constant."""
    if math.isinf(dof):
        density = math.exp(-(t**2) / 2.0) / math.sqrt(2.0 * math.pi)
        return t * tail(t) - density
    if abs(dof - 1.0) < 1e-9:
        return t * tail(t, dof) + math.log1p(t**2) / (2.0 * math.pi)
    log_peak = math.lgamma((dof + 1.0) / 2.0) - math.lgamma(dof / 2.0) - math.log(math.pi * dof) / 2
    density = math.exp(log_peak - (dof + 1.0) / 2.0 * math.log1p(t**2 / dof))
    return t * tail(t, dof) - (dof + t**2) / (dof - 1.0) * density


def _quantile_of_sum(probability: float, dof: float, uniform: float) -> float:
    low, high = 0.0, 1.0
    side = min(probability, 1.0 - probability)
    while _tail_of_sum(high, dof, uniform) > side:
        high *= 2.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if _tail_of_sum(middle, dof, uniform) > side else (low, middle)
    return math.copysign(high, probability - 0.5)


def chi_square_beyond(value: float, dof: int) -> float:
    """Return the probability that a chi-square of `dof` degrees of freedom is `value` or more.

    Source: Abramowitz and Stegun (1964) 26.4.4 and 26.4.5.
    """
    if not value > 0.0:
        return 1.0
    half = 0.5 * value
    powers = np.arange(0.5 * (dof % 2), 0.5 * dof)
    terms = (power * math.log(half) - half - math.lgamma(power + 1.0) for power in powers)
    below = math.erfc(math.sqrt(half)) if dof % 2 else 0.0
    return below + math.fsum(map(math.exp, terms))


def chi_square_limits(level: float, dof: float) -> tuple[float, float]:
    """Return the limits between which a chi-square lies with probability `level`."""
    from scipy.special import chdtri

    side = (1.0 - level) / 2.0
    return float(chdtri(dof, 1.0 - side)), float(chdtri(dof, side))


def f_beyond(value: float, count: float, dof: float) -> float:
    """Return the probability that F of `count` and `dof` degrees of freedom is `value` or more."""
    if dof > MOST_DOF and float(count).is_integer():
        return chi_square_beyond(count * value, int(count))
    dof = min(dof, MOST_DOF)
    return _beta_tail(0.5 * dof, 0.5 * count, count * value / dof)


def _beta_tail(a: float, b: float, ratio: float) -> float:
    """Return the incomplete beta function ratio I_x(a, b) at x = 1/(1 + ratio).

    By its continued fraction on that side of the mean of x where it converges fast; to 1e-12 of it
    up to a = 5000, 1e-9 up to 5e6. Source: Abramowitz and Stegun (1964) 26.5.8.
    """
    if not ratio > 0.0:
        return 1.0
    if math.isinf(ratio):
        return 0.0
    if b + 1.0 < (a + b + 2.0) * ratio / (1.0 + ratio):
        return _beta_fraction(a, b, ratio)
    return 1.0 - _beta_fraction(b, a, 1.0 / ratio)


def _beta_fraction(a: float, b: float, ratio: float) -> float:
    """Return I_x(a, b) at x = 1/(1 + ratio) below (a + 1)/(a + b + 2)."""
    x = 1.0 / (1.0 + ratio)
    c, d = 1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0))
    value = d
    for m in range(1, MOST_TERMS):
        even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        d, c = 1.0 / (1.0 + even * d), 1.0 + even / c
        value *= c * d
        d, c = 1.0 / (1.0 + odd * d), 1.0 + odd / c
        value *= c * d
        if abs(c * d - 1.0) < TERM:
            break
    log_power = -a * math.log1p(ratio) - b * math.log1p(1.0 / ratio)
    return math.exp(log_power - _log_beta(a, b)) * value / a


def _log_beta(a: float, b: float) -> float:
    """Return the logarithm of B(a, b); by Stirling's series where lgamma loses digits."""
    a, b = max(a, b), min(a, b)
    if a < LARGE:
        return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
    ratio = (0.5 - a) * math.log1p(b / a) - b * math.log(a + b) + b
    if b < LARGE:
        return math.lgamma(b) + ratio + _stirling(a) - _stirling(a + b)
    own = (b - 0.5) * math.log(b) - b + 0.5 * math.log(2.0 * math.pi) + _stirling(b)
    return own + ratio + _stirling(a) - _stirling(a + b)


def _stirling(x: float) -> float:
    """Return ln G(x) less (x - 1/2) ln x - x + ln(2 pi)/2: Abramowitz and Stegun (1964) 6.1.41."""
    square = x * x
    return (1.0 - (1.0 / 30.0 - (1.0 / 105.0 - 1.0 / (140.0 * square)) / square) / square) / (
        12.0 * x
    )


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


def power_of_t(shift: float, level: float, dof: float = math.inf, uniform: float = 0.0) -> float:
    """Return the power of a two-sided t-test of `level` for `shift` >= 0 standard errors.

    Rejections on the side of the shift count. uniform: as of `tail`.
    """
    limit = quantile(0.5 + level / 2.0, dof, uniform)
    own, scale = _rest(dof, uniform)
    if math.isinf(own):
        return tail(limit - shift, dof, uniform)
    from scipy.special import nctdtr

    nodes = RECTANGLE_NODES if uniform else 1
    middles = (np.arange(nodes) + 0.5) / nodes
    inside = math.sqrt(3.0) * uniform * (2.0 * middles - 1.0)
    return float(np.mean(1.0 - nctdtr(own, (shift + inside) / scale, limit / scale)))


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
