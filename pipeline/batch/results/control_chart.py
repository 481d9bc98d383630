"""Control chart of individual values and moving ranges, and the rules of Nelson that points break.

Sigma is estimated by the mean moving range of two successive values, whose expectation is d2 sigma
with d2 = 2/sqrt(pi) for normal values; limits lie 3 sigma from the mean. Sources: NIST/SEMATECH
e-Handbook of Statistical Methods, 6.3.2.2; ISO 7870-2:2023; Nelson (1984), J. Quality Technology
16, 237, whose eight tests are RULES.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import numpy as np

from ...system import frozen
from ...vectors import Array, Mask
from ..catalogue.catalogue import Catalogue
from .query import ALL, Filter
from .series import series

D2, D3 = 2.0 / math.sqrt(math.pi), math.sqrt(2.0 - 4.0 / math.pi)  # of ranges of two normal values
RANGE_LIMIT = 1.0 + 3.0 * D3 / D2  # of moving ranges, in their mean: D4
RULES = range(1, 9)


@frozen
class ControlLimits:
    """Mean, standard deviation by moving ranges, and 3-sigma limits of values and ranges."""

    mean: float
    sigma: float
    lower: float
    upper: float
    range_mean: float
    range_upper: float


@frozen
class Point:
    """Value of one capture; moving_range: from the point before, None of the first.

    rules: numbers of the rules of Nelson that end at this point. jumps: whether its moving range is
    beyond the limit.
    """

    key: str
    name: str
    vehicle: str
    date: str | None
    value: float
    u: float
    moving_range: float | None
    rules: tuple[int, ...]
    jumps: bool


@frozen
class ControlChart:
    """Points in the order of their dates, or of all names where fewer than two have one.

    At least two.

    left_out: number of captures without a date.
    """

    quantity: str
    unit: str
    points: tuple[Point, ...]
    limits: ControlLimits
    left_out: int


def control_chart(catalogue: Catalogue, quantity: str, which: Filter = ALL) -> ControlChart | None:
    """Chart a quantity; None where fewer than two captures have it. Raises InputError."""
    found = series(catalogue, [quantity], which)
    if not found:
        return None
    (one,) = found
    known = _captures(catalogue, one.numbers.tolist())
    rows = [(*known[n], day, x, u) for n, day, x, u in
            zip(one.numbers.tolist(), one.day, one.values, one.u, strict=True)]  # fmt: skip
    dated = [row for row in rows if math.isfinite(row[4])]
    in_time = len(dated) > 1
    kept = sorted(dated if in_time else rows, key=lambda row: (in_time and row[4], row[1]))
    if len(kept) < 2:
        return None
    x = np.array([row[5] for row in kept])
    limits, ranges = control_limits(x), np.abs(np.diff(x))
    points = tuple(
        Point(*row[:4], float(row[5]), float(row[6]), None if i == 0 else float(ranges[i - 1]),
              rules, i > 0 and bool(ranges[i - 1] > limits.range_upper))
        for i, (row, rules) in enumerate(zip(kept, broken_rules(x, limits), strict=True))
    )  # fmt: skip
    return ControlChart(quantity, one.unit, points, limits, len(rows) - len(kept))


def _captures(
    catalogue: Catalogue, numbers: Sequence[int]
) -> dict[int, tuple[str, str, str, str | None]]:
    """Return key, name, vehicle and date by row number."""
    rows = catalogue.connection.execute(
        "SELECT id, key, name, vehicle, date FROM captures "
        "WHERE id IN (SELECT value FROM json_each(?))",
        (json.dumps(list(numbers)),),
    )
    return {row[0]: row[1:] for row in rows}


def control_limits(x: Array) -> ControlLimits:
    """Return the limits of at least two successive values (N,)."""
    mean, range_mean = float(x.mean()), float(np.abs(np.diff(x)).mean())
    sigma = range_mean / D2
    return ControlLimits(
        mean, sigma, mean - 3.0 * sigma, mean + 3.0 * sigma, range_mean, RANGE_LIMIT * range_mean
    )


def broken_rules(x: Array, limits: ControlLimits) -> list[tuple[int, ...]]:
    """Return for each value (N,) the numbers of the rules that are broken there.

    1 beyond 3 sigma; 2 nine in a row on one side of the mean; 3 six in a row rising, or falling;
    4 fourteen in a row alternating; 5 two of three beyond 2 sigma on one side; 6 four of five
    beyond 1 sigma on one side; 7 fifteen in a row within 1 sigma; 8 eight in a row beyond 1 sigma.
    """
    if limits.sigma == 0.0:
        return [()] * len(x)
    z = (x - limits.mean) / limits.sigma
    steps = np.sign(np.diff(x))
    turning = np.concatenate([[False] * 2, steps[1:] * steps[:-1] < 0.0])[: len(x)]
    found = [
        np.abs(z) > 3.0,
        _runs(z > 0.0, 9) | _runs(z < 0.0, 9),
        _rises(steps > 0.0) | _rises(steps < 0.0),
        _runs(turning, 12),
        _most(z > 2.0, 2, 3) | _most(z < -2.0, 2, 3),
        _most(z > 1.0, 4, 5) | _most(z < -1.0, 4, 5),
        _runs(np.abs(z) < 1.0, 15),
        _runs(np.abs(z) > 1.0, 8),
    ]
    return [tuple(n for n in RULES if found[n - 1][i]) for i in range(len(x))]


def _counts(mask: Mask, window: int) -> Array:
    """Return how many of the last `window` are true, at each; fewer at the begin."""
    total = np.concatenate([[0], np.cumsum(mask)])
    first = np.maximum(np.arange(len(mask)) + 1 - window, 0)
    return np.asarray(total[1:] - total[first])


def _runs(mask: Mask, count: int) -> Mask:
    return np.asarray(_counts(mask, count) >= count)


def _most(mask: Mask, count: int, window: int) -> Mask:
    """Return where `count` of the last `window` are true, the last of them among these."""
    return np.asarray(mask & (_counts(mask, window) >= count))


def _rises(steps: Mask) -> Mask:
    """Return where the last six values, five steps, go one way."""
    return np.concatenate([[False], _runs(steps, 5)])
