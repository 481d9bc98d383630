"""The distributions that tests and coverage factors need; scipy stays behind this file."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from ..vectors import Array


def coverage_factor(level: float, dof: Array) -> Array:
    """K of a symmetric interval that holds the share `level`: Student's t, normal for inf."""
    from scipy.special import ndtri, stdtrit

    finite = np.isfinite(dof)
    share = 0.5 + level / 2.0
    student = stdtrit(np.where(finite, dof, 1.0), share)
    return np.asarray(np.where(finite, student, ndtri(share)))


def tail(x: float, dof: float = math.inf) -> float:
    """Chance that Student's t of `freedom` degrees, a unit normal for inf, is beyond x."""
    if math.isinf(dof):
        return math.erfc(x / math.sqrt(2.0)) / 2.0
    from scipy.special import stdtr

    return float(stdtr(dof, -x))


def quantile(share: float, dof: float = math.inf) -> float:
    """Student's t of `freedom` degrees, a unit normal for inf, that is exceeded by 1 - share."""
    if math.isinf(dof):
        return NormalDist().inv_cdf(share)
    from scipy.special import stdtrit

    return float(stdtrit(dof, share))


def chi_square_beyond(value: float, dof: int) -> float:
    """Chance that a chi-square of `freedom` degrees is `value` or more."""
    from scipy.special import chdtrc

    return float(chdtrc(dof, value))


def chi_square_limits(level: float, dof: float) -> tuple[float, float]:
    """Between which a chi-square of `freedom` degrees lies with the chance `level`."""
    from scipy.special import chdtri

    side = (1.0 - level) / 2.0
    return float(chdtri(dof, 1.0 - side)), float(chdtri(dof, side))


def f_beyond(value: float, count: int, dof: float) -> float:
    """Chance that Fisher's F of `count` and `freedom` degrees is `value` or more."""
    if math.isinf(dof):
        return chi_square_beyond(count * value, count)
    from scipy.special import fdtrc

    return float(fdtrc(count, dof, value))


def power_of_t(shift: float, level: float, dof: float = math.inf) -> float:
    """Chance that a two-sided t test of `level` sees `shift` >= 0 standard errors, on its side."""
    limit = quantile(0.5 + level / 2.0, dof)
    if math.isinf(dof):
        return tail(limit - shift)
    from scipy.special import nctdtr

    return float(1.0 - nctdtr(dof, shift, limit))


def power_of_f(noncentrality: float, level: float, count: int, dof: float = math.inf) -> float:
    """Chance that an F test of `level`, a chi-square test for inf, sees d' V^-1 d so large."""
    from scipy.special import chdtri, chndtr, fdtri, ncfdtr

    if math.isinf(dof):
        return float(1.0 - chndtr(chdtri(count, 1.0 - level), count, noncentrality))
    limit = float(fdtri(count, dof, level))
    return float(1.0 - ncfdtr(count, dof, noncentrality, limit))


def share_limits(hits: int, total: int, level: float) -> tuple[float, float]:
    """Limits of a share of which `hits` of `total` were seen.

    Source: Clopper and Pearson, Biometrika 26 (1934) 404.
    """
    from scipy.special import betaincinv

    side = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else betaincinv(hits, total - hits + 1, side)
    high = 1.0 if hits == total else betaincinv(hits + 1, total - hits, 1.0 - side)
    return float(low), float(high)


def as_many(hits: int, total: int, chance: float) -> float:
    """Chance of `hits` or more of `total`, each having `chance`."""
    if hits == 0:
        return 1.0
    from scipy.special import bdtrc

    return float(bdtrc(hits - 1, total, chance))
