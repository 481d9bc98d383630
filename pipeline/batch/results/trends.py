"""Statistics of many measurements: spread, drift over time, and outliers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...uncertainty import quantile, tail
from ...vectors import Array
from ..catalogue.catalogue import Catalogue
from .query import ALL, Filter
from .series import Series, series

__all__ = [
    "MONTH_DAYS",
    "Drift",
    "Outlier",
    "Series",
    "Summary",
    "drift",
    "drifts",
    "series",
    "summarised",
    "summary",
    "with_holm",
    "worst",
]

LEVEL = 0.95
MONTH_DAYS = 30.0  # to which slopes are stated
NORMAL_OF_MAD = 1.482602218505602  # 1 / the normal's upper quartile


@dataclass(frozen=True)
class Summary:
    """Summary statistics of one quantity over n captures.

    sd: divisor n - 1, nan for n = 1. robust_sd: 1.4826 times the median absolute deviation from
    the median, with a breakdown point of 50 % (Rousseeuw and Croux, 1993, JASA 88, 1273).
    u_rms: root mean square of the stated standard uncertainties; an sd far above it is a real
    difference between captures.
    """

    quantity: str
    unit: str
    n: int
    mean: float
    sd: float
    robust_sd: float
    median: float
    low: float
    high: float
    u_rms: float


@dataclass(frozen=True)
class Drift:
    """Straight line over time, value = at_mean + slope (day - mean_day).

    slope and u_slope (standard) in unit per day; expanded: half-width of its 95 % interval;
    scatter: standard deviation between captures in excess of u, in unit; p: p-value of the slope
    under no drift; significant: p below 5 % after Holm's correction for all quantities of the
    query. With too few data: n, the reason, and nan.
    """

    quantity: str
    unit: str
    n: int
    first_day: float = math.nan
    last_day: float = math.nan
    mean_day: float = math.nan
    at_mean: float = math.nan
    slope: float = math.nan
    u_slope: float = math.nan
    expanded: float = math.nan
    scatter: float = math.nan
    p: float = 1.0
    significant: bool = False
    reason: str = ""


@dataclass(frozen=True)
class Outlier:
    """Value of a capture far from the median.

    score: its distance from the median in robust sd, or in typical u if that is larger.
    """

    key: str
    name: str
    date: str | None
    quantity: str
    unit: str
    value: float
    u: float
    median: float
    score: float


def summary(
    catalogue: Catalogue, quantities: Sequence[str] | None = None, which: Filter = ALL
) -> tuple[Summary, ...]:
    """Compute the statistics of each quantity; without names of all, wheel angles first."""
    return tuple(summarised(one) for one in series(catalogue, quantities, which))


def summarised(one: Series) -> Summary:
    """Compute the statistics of a series of at least one value."""
    x = one.values
    median = float(np.median(x))
    return Summary(
        one.quantity,
        one.unit,
        n=len(x),
        mean=float(x.mean()),
        sd=float(x.std(ddof=1)) if len(x) > 1 else math.nan,
        robust_sd=NORMAL_OF_MAD * float(np.median(np.abs(x - median))),
        median=median,
        low=float(x.min()),
        high=float(x.max()),
        u_rms=math.sqrt(float(np.nanmean(one.u**2))) if np.isfinite(one.u).any() else math.nan,
    )


def drifts(
    catalogue: Catalogue, quantities: Sequence[str] | None = None, which: Filter = ALL
) -> tuple[Drift, ...]:
    """Fit the drift of each quantity, with Holm's correction for their number."""
    return with_holm([drift(one) for one in series(catalogue, quantities, which)])


def drift(one: Series) -> Drift:
    """Fit a straight line to a series over time, without correction for other quantities.

    Weights 1/(u^2 + s^2), with the scatter s between captures such that the weighted squared
    residuals sum to n - 2 (Paule and Mandel, 1982, J. Res. NBS 87, 377), s = 0 where u explains
    them; Student's t with n - 2 dof (Knapp and Hartung, 2003, Statistics in Medicine 22, 2693).
    Errors common to all captures do not change the slope; all others are taken as independent.
    """
    known = np.isfinite(one.day) & np.isfinite(one.u)
    day, y, u = one.day[known], one.values[known], one.u[known]
    n = len(day)
    if n < 3 or np.ptp(day) == 0.0:
        reason = "fewer than three dated values" if n < 3 else "all on one date"
        return Drift(one.quantity, one.unit, n, reason=reason)
    floor = (1e-12 * max(1e-3, float(np.abs(y).max()))) ** 2
    variance = np.maximum(u**2, floor)
    scatter2 = _scatter(day, y, variance)
    mean_day, at_mean, slope, weights, _ = _line(day, y, variance + scatter2)
    u_slope = 1.0 / math.sqrt(_sum(weights, (day - mean_day) ** 2))
    return Drift(
        one.quantity,
        one.unit,
        n,
        first_day=float(day.min()),
        last_day=float(day.max()),
        mean_day=mean_day,
        at_mean=at_mean,
        slope=slope,
        u_slope=u_slope,
        expanded=quantile(0.5 + LEVEL / 2, n - 2) * u_slope,
        scatter=math.sqrt(scatter2),
        p=min(1.0, 2.0 * tail(abs(slope) / u_slope, n - 2)),
    )


def _line(day: Array, y: Array, variance: Array) -> tuple[float, float, float, Array, Array]:
    """Return mean day, value there, slope, weights and residuals of the weighted line fit."""
    weights = 1.0 / variance
    total = float(weights.sum())
    mean_day, at_mean = _sum(weights, day) / total, _sum(weights, y) / total
    centred = day - mean_day
    weighted = weights * centred
    slope = _sum(weighted, y - at_mean) / _sum(weighted, centred)
    return mean_day, at_mean, slope, weights, y - at_mean - slope * centred


def _sum(a: Array, b: Array) -> float:
    """Sum the products by numpy's pairwise sum, independent of the number of BLAS threads."""
    return float((a * b).sum())


def _scatter(day: Array, y: Array, variance: Array) -> float:
    """Return the variance between captures, at least 0, by Newton's method on 1/Q.

    1/Q is nearly linear in the variance.
    """
    scatter2, dof = 0.0, len(day) - 2
    for _ in range(100):
        *_, weights, residuals = _line(day, y, variance + scatter2)
        squares = weights * residuals**2
        q = float(squares.sum())
        if q == 0.0:
            return 0.0
        step = (q / dof - 1.0) * q / _sum(weights, squares)
        after = max(0.0, scatter2 + step)
        if abs(after - scatter2) <= 1e-10 * after:
            return after
        scatter2 = after
    return scatter2


def with_holm(found: Sequence[Drift]) -> tuple[Drift, ...]:
    """Mark the drifts significant at a family-wise 5 % (Holm, 1979, Scand. J. Stat. 6, 65)."""
    ranked = sorted((d for d in found if not d.reason), key=lambda d: d.p)
    significant: set[str] = set()
    for rank, one in enumerate(ranked):
        if one.p > (1.0 - LEVEL) / (len(ranked) - rank):
            break
        significant.add(one.quantity)
    return tuple(replace(d, significant=d.quantity in significant) for d in found)


def worst(
    catalogue: Catalogue, n: int, quantities: Sequence[str] | None = None, which: Filter = ALL
) -> tuple[Outlier, ...]:
    """Return the n captures with the largest score of any quantity (see `Outlier`)."""
    found = series(catalogue, quantities, which)
    best: dict[int, tuple[float, Series, int, float]] = {}
    for one in found:
        stats = summarised(one)
        width = max(stats.robust_sd, stats.u_rms if stats.u_rms > 0.0 else 0.0, 1e-12)
        score = np.abs(one.values - stats.median) / width
        for at in np.argsort(-score, kind="stable")[:n]:
            number = int(one.numbers[at])
            if number not in best or score[at] > best[number][0]:
                best[number] = (float(score[at]), one, int(at), stats.median)
    ranked = sorted(best.items(), key=lambda item: (-item[1][0], item[0]))[:n]
    return tuple(_outlier(catalogue, number, *row) for number, row in ranked)


def _outlier(
    catalogue: Catalogue, number: int, score: float, one: Series, at: int, median: float
) -> Outlier:
    key, name, date = catalogue.connection.execute(
        "SELECT key, name, date FROM captures WHERE id = ?", (number,)
    ).fetchone()
    value, u = float(one.values[at]), float(one.u[at])
    return Outlier(key, name, date, one.quantity, one.unit, value, u, median, score)
