"""Whether stated uncertainties hold over many comparisons: coverage and normalised errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..system import frozen
from ..uncertainty import f_sum_limits, share_limits
from .comparison import KINDS, Comparison
from .statistics.power import CONFIDENCE


@frozen
class Score:
    """Errors of one kind of angle, radians; inside: how many of `count` are within 95 % intervals.

    low, high: 95 % limits of the coverage, as if all errors were independent.
    """

    kind: str
    count: int
    bias: float
    rms: float
    worst: float
    inside: int
    low: float
    high: float


@frozen
class Nees:
    """Mean normalised squared error over all angles, about 1 where uncertainties are correct.

    Sum of d' V^-1 d over the captures, covariances included, divided by the number of angles.
    low, high: 95 % interval where uncertainties are correct. Where V rests on few degrees of
    freedom nu, its mean is nu/(nu - 2), and its interval is wider than that of a chi-square.
    """

    mean: float
    low: float
    high: float
    count: int

    @property
    def position(self) -> Literal["within", "above", "below"]:
        """Where the mean lies relative to its interval."""
        if self.low <= self.mean <= self.high:
            return "within"
        return "above" if self.mean > self.high else "below"


def scores(found: Sequence[Comparison]) -> tuple[Score, ...]:
    """Return errors and coverage of toes and of cambers."""
    rows = []
    for index, kind in enumerate(KINDS):
        halves = [np.split(one.difference_rad, 2)[index] for one in found]
        error = np.concatenate(halves)
        ens = np.concatenate([np.split(one.en, 2)[index] for one in found])
        inside = int(np.count_nonzero(np.abs(ens) <= 1.0))
        worst = float(error[np.argmax(np.abs(error))])
        rms = float(np.sqrt(np.mean(error**2)))
        limits = share_limits(inside, len(error), CONFIDENCE)
        rows.append(Score(kind, len(error), float(error.mean()), rms, worst, inside, *limits))
    return tuple(rows)


def nees(found: Sequence[Comparison]) -> Nees:
    """Return the mean normalised squared error over all angles of all captures.

    V is estimated: of one capture d' V^-1 d is p F(p, nu) (Spread.test), and captures are
    independent.
    """
    tests = [one.joint for one in found if one.joint.count]
    count = sum(test.count for test in tests)
    total = sum(test.chi_square for test in tests)
    low, high = f_sum_limits(CONFIDENCE, [test.count for test in tests], [t.dof for t in tests])
    scale = max(count, 1)
    return Nees(total / scale, low / scale, high / scale, count)
