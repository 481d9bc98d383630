"""Statistics of many measurements: spread, drift over time, and outliers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ...uncertainty import quantile, tail
from ...vectors import NORMAL_OF_MAD, Array
from ..catalogue.catalogue import Catalogue
from .query import ALL, Filter
from .series import Series, over_series, series, taken

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
BLOCK = 16_384  # values of 128 kB
MONTH_DAYS = 30.0  # to which slopes are stated


@frozen
class Summary:
    """Summary statistics of one quantity over n captures.

    sd: divisor n - 1. robust_sd: 1.4826 times the median absolute deviation from the median, with a
    breakdown point of 50 % (Rousseeuw and Croux, 1993, JASA 88, 1273). Both are nan for n = 1.
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


@frozen
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


@frozen
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
    return tuple(over_series(summarised, catalogue, quantities, which))


def summarised(one: Series) -> Summary:
    """Compute the statistics of a series of at least one value."""
    x, (known,) = one.values, taken(np.isfinite(one.u), one.u)
    median = median_of(x)
    return Summary(
        one.quantity,
        one.unit,
        n=len(x),
        mean=float(x.mean()),
        sd=float(x.std(ddof=1)) if len(x) > 1 else math.nan,
        robust_sd=NORMAL_OF_MAD * median_of(np.abs(x - median)) if len(x) > 1 else math.nan,
        median=median,
        low=float(x.min()),
        high=float(x.max()),
        u_rms=math.sqrt(float((known**2).mean())) if len(known) else math.nan,
    )


def median_of(x: Array) -> float:
    """Return the median of at least one value, none of them nan.

    By one partition, for which numpy has vector code: `np.median`, which also looks for nan, takes
    five to seven times as long.
    """
    half = len(x) // 2
    parted = np.partition(x, half)
    upper = float(parted[half])
    return upper if len(x) % 2 else 0.5 * (float(parted[:half].max()) + upper)


def drifts(
    catalogue: Catalogue, quantities: Sequence[str] | None = None, which: Filter = ALL
) -> tuple[Drift, ...]:
    """Fit the drift of each quantity, with Holm's correction for their number."""
    return with_holm(over_series(drift, catalogue, quantities, which))


def drift(one: Series, common: Array | None = None) -> Drift:
    """Fit a straight line to a series over time, without correction for other quantities.

    common: (N, N) covariance of the values beyond their u, None of independent ones.

    Weights 1/(u^2 + s^2), with the scatter s between captures such that the weighted squared
    residuals sum to n - 2 (Paule and Mandel, 1982, J. Res. NBS 87, 377), s = 0 where u explains
    them; Student's t with n - 2 dof (Knapp and Hartung, 2003, Statistics in Medicine 22, 2693).
    Errors common to all captures do not change the slope; all others are taken as independent.
    """
    known = np.isfinite(one.day) & np.isfinite(one.u)
    common = None if common is None else common[np.ix_(known, known)]
    day, y, u = taken(known, one.day, one.values, one.u)
    n = len(day)
    first, last = (float(day.min()), float(day.max())) if n else (math.nan, math.nan)
    if n < 3 or first == last:
        reason = "fewer than three dated values" if n < 3 else "all on one date"
        return Drift(one.quantity, one.unit, n, reason=reason)
    largest, variance = max(1e-3, float(y.max()), -float(y.min())), u**2
    np.maximum(variance, (1e-12 * largest) ** 2, out=variance)
    line, scatter2 = (
        _fit(day, y, variance) if common is None else _fit_common(day, y, variance, common)
    )
    u_slope = 1.0 / math.sqrt(line.steepness)
    return Drift(
        one.quantity,
        one.unit,
        n,
        first_day=first,
        last_day=last,
        mean_day=line.mean_day,
        at_mean=line.at_mean,
        slope=line.slope,
        u_slope=u_slope,
        expanded=quantile(0.5 + LEVEL / 2, n - 2) * u_slope,
        scatter=math.sqrt(scatter2),
        p=min(1.0, 2.0 * tail(abs(line.slope) / u_slope, n - 2)),
    )


@frozen
class _Line:
    """Weighted line; steepness: weighted sum of squared distances from mean_day."""

    mean_day: float
    at_mean: float
    slope: float
    steepness: float


def _fit(day: Array, y: Array, variance: Array) -> tuple[_Line, float]:
    """Return the line and the variance between captures, at least 0, by Newton's method on 1/Q.

    1/Q is nearly linear in the variance.
    """
    scatter2, dof = 0.0, len(day) - 2
    for _ in range(100):
        line = _line(day, y, variance, scatter2)
        q, steepness = _misfit(line, day, y, variance, scatter2)
        after = max(0.0, scatter2 + (q / dof - 1.0) * q / steepness) if q else 0.0
        if abs(after - scatter2) <= 1e-10 * after:
            break
        scatter2 = after
    return line, scatter2


def _fit_common(day: Array, y: Array, variance: Array, common: Array) -> tuple[_Line, float]:
    """Return the line by generalised least squares, and the variance between captures."""
    covariance = common + np.diag(variance)

    def fitted(scatter2: float) -> tuple[_Line, float]:
        W = np.linalg.inv(covariance + scatter2 * np.eye(len(day)))
        of_all = W.sum(axis=0) / W.sum()
        mean_day = float(of_all @ day)
        at_mean, centred = float(of_all @ y), day - mean_day
        steepness = float(centred @ W @ centred)
        line = _Line(mean_day, at_mean, float(centred @ W @ y) / steepness, steepness)
        rest = y - at_mean - line.slope * centred
        return line, float(rest @ W @ rest)

    dof = len(day) - 2
    low, high = 0.0, len(day) * float(np.var(y)) / dof  # of a level line through independent values
    if fitted(0.0)[1] <= dof:
        return fitted(0.0)[0], 0.0
    for _ in range(100):
        middle = (low + high) / 2.0
        low, high = (middle, high) if fitted(middle)[1] > dof else (low, middle)
    return fitted(high)[0], high


def _line(day: Array, y: Array, variance: Array, scatter2: float) -> _Line:
    """Fit the line with weights 1/(variance + scatter2)."""

    def means(part: slice) -> tuple[Array, ...]:
        weights = 1.0 / (variance[part] + scatter2)
        return weights, weights * day[part], weights * y[part]

    def moments(part: slice) -> tuple[Array, ...]:
        centred = day[part] - mean_day
        weighted = centred / (variance[part] + scatter2)
        return weighted * (y[part] - at_mean), weighted * centred

    total, of_day, of_y = _sums(means, len(day))
    mean_day, at_mean = of_day / total, of_y / total
    product, steepness = _sums(moments, len(day))
    return _Line(mean_day, at_mean, product / steepness, steepness)


def _misfit(line: _Line, day: Array, y: Array, variance: Array, scatter2: float) -> list[float]:
    """Return Q, the weighted sum of squared residuals, and how fast it falls with scatter2."""

    def squares(part: slice) -> tuple[Array, ...]:
        residuals = y[part] - line.at_mean - line.slope * (day[part] - line.mean_day)
        weighted = residuals / (variance[part] + scatter2)
        return weighted * residuals, weighted * weighted

    return _sums(squares, len(day))


def _sums(terms: Callable[[slice], tuple[Array, ...]], n: int) -> list[float]:
    """Sum terms over n values, in blocks that stay in the processor's cache.

    By numpy's pairwise sum, which is independent of the number of BLAS threads.
    """
    parts = [slice(at, at + BLOCK) for at in range(0, n, BLOCK)]
    blocks = np.array([[term.sum() for term in terms(part)] for part in parts])
    return [float(one) for one in blocks.T.copy().sum(axis=1)]


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
    best: dict[int, Outlier] = {}
    for found in over_series(partial(_outliers, n=n), catalogue, quantities, which):
        for number, outlier in found:
            if number not in best or outlier.score > best[number].score:
                best[number] = outlier
    ranked = sorted(best.items(), key=lambda item: (-item[1].score, item[0]))[:n]
    return tuple(_named(catalogue, number, outlier) for number, outlier in ranked)


def _outliers(one: Series, n: int) -> list[tuple[int, Outlier]]:
    """Return the n captures farthest from the median, by their numbers, still without names."""
    stats = summarised(one)
    width = max(1e-12, stats.robust_sd, stats.u_rms)  # nan, where unknown, is never larger
    scores = np.abs(one.values - stats.median) / width
    found = []
    for at in _largest(scores, n):
        value, u, score = float(one.values[at]), float(one.u[at]), float(scores[at])
        outlier = Outlier("", "", None, one.quantity, one.unit, value, u, stats.median, score)
        found.append((int(one.numbers[at]), outlier))
    return found


def _largest(scores: Array, n: int) -> npt.NDArray[np.intp]:
    """Return the indices of the n largest, the first of equal ones first."""
    n = min(n, len(scores))
    least = np.partition(scores, len(scores) - n)[len(scores) - n]
    among = np.flatnonzero(scores >= least)
    return among[np.argsort(-scores[among], kind="stable")[:n]]


def _named(catalogue: Catalogue, number: int, outlier: Outlier) -> Outlier:
    key, name, date = catalogue.connection.execute(
        "SELECT key, name, date FROM captures WHERE id = ?", (number,)
    ).fetchone()
    return replace(outlier, key=key, name=name, date=date)
