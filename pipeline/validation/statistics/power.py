"""Smallest detectable error of a comparison, and the number of captures to detect a given one.

Detectable: a test at 95 % confidence, with 5 % false alarms, finds the error with 99 % power.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ...uncertainty import power_of_f, power_of_t

CONFIDENCE, POWER = 0.95, 0.99
MOST_CAPTURES = 10_000_000
BISECTIONS = 60


def detectable_alone(u: float, dof: float = math.inf) -> float:
    """Return the smallest error of one value detectable by Student's test; u: its uncertainty.

    4.286 u where u is known: sum of the quantiles of confidence and power.
    Source: the noncentral t; Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions.
    """
    return u * _least(lambda shift: power_of_t(shift, CONFIDENCE, dof))


def detectable_jointly(gain: float, count: int, dof: float = math.inf) -> float:
    """Return the smallest size of an error detectable by the joint test of `count` values.

    gain: g' V^-1 g of the pattern g of an error of size 1.
    """
    if not gain > 0.0:
        return math.inf
    noncentrality = _least(lambda square: power_of_f(square, CONFIDENCE, count, dof))
    return math.sqrt(noncentrality / gain)


def captures_needed(size: float, deviation: float) -> int:
    """Return the number of captures in whose mean a bias of `size` is detectable.

    deviation: standard deviation between captures. Student's test at 95 % confidence and 99 %
    power; MOST_CAPTURES at most.
    """
    low, high = 1, 2
    while high < MOST_CAPTURES and detectable_alone(deviation / math.sqrt(high), high - 1) > size:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        enough = detectable_alone(deviation / math.sqrt(middle), middle - 1) <= size
        low, high = (low, middle) if enough else (middle, high)
    return min(high, MOST_CAPTURES)


def _least(power: Callable[[float], float]) -> float:
    """Return the smallest x >= 0 of sufficient power, which increases with x."""
    high = 1.0
    while power(high) < POWER:
        high *= 2.0
        if high > 1e9:
            return math.inf
    low = 0.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (low, middle) if power(middle) >= POWER else (middle, high)
    return high
