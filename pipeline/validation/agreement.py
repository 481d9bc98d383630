"""Agreement of two methods over many captures: bias, limits of agreement, fitted line.

A subject is one wheel of one vehicle; its repeated measures are captures of the vehicle and trials
on the wheel. Differences scatter between subjects and within them. The bias is the mean over
units: vehicles, or captures if there is one vehicle only. Units are independent, whatever their
wheels have in common, such as the frame, so that Student's t is exact for the bias's limits.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import numpy as np

from ..system import frozen
from ..uncertainty import chi_square_limits, f_beyond, quantile
from ..vectors import Array
from .comparison import KINDS, Comparison
from .statistics.bland_altman import Limit, components, limits_of_agreement
from .statistics.joint_test import Spread
from .statistics.line_fit import Line
from .statistics.line_test import LinePoints, fit_shared_line
from .statistics.power import CONFIDENCE, captures_needed, detectable_alone


@frozen
class Agreement:
    """Agreement of one kind of angle over all captures; radians.

    first, second: (N,) pairs. units: vehicles, or the captures of the only one. captures: of all
    units. deviation: standard deviation of the units' mean differences, from which bias and its
    limits follow. within, between: standard deviations of differences within
    and between subjects; total: of one difference. lower, upper: limits of agreement. detectable:
    smallest detectable bias. line: second method against the first.
    """

    kind: str
    first: Array
    second: Array
    subjects: int
    units: int
    captures: int
    bias: Limit
    deviation: float
    within: float
    between: float
    total: float
    lower: Limit
    upper: Limit
    detectable: float
    line: Line | None

    @property
    def by_vehicle(self) -> bool:
        """Whether units are vehicles of several captures each."""
        return self.units < self.captures

    def units_for(self, size_rad: float) -> int:
        """Return the number of units, like these, in which a bias of this size is detectable.

        Uses the upper 95 % limit of the deviation, so that a small pilot does not promise too much.
        Source: Browne, Statistics in Medicine 14 (1995) 1933.
        """
        dof = self.units - 1
        least, _ = chi_square_limits(2.0 * CONFIDENCE - 1.0, dof)
        return captures_needed(size_rad, self.deviation * math.sqrt(dof / least))


@frozen
class _Pairs:
    """Pairs of one kind, with uncertainties and covariance, subject and unit of each.

    dof: of the differences. spreads: covariance of the differences of each capture.
    """

    first: Array
    second: Array
    u_first: Array
    u_second: Array
    both: Array
    dof: Array
    subject: list[Hashable]
    unit: list[Hashable]
    spreads: tuple[Spread, ...]

    def points(self) -> LinePoints:
        """Return the points of a line, second over first."""
        return LinePoints(
            self.first,
            self.second,
            self.u_first**2,
            self.u_second**2,
            self.both,
            self.dof,
            self.spreads,
        )


def agreement(found: Sequence[Comparison], kind: str) -> Agreement | None:
    """Evaluate the agreement of toes or cambers; None for fewer than two units."""
    pairs = _pairs(found, kind)
    difference = pairs.first - pairs.second
    units = np.array(_means(difference, pairs.unit))
    if len(units) < 2:
        return None
    deviation = float(units.std(ddof=1))
    u = deviation / math.sqrt(len(units))
    reach = quantile(0.5 + CONFIDENCE / 2.0, len(units) - 1) * u
    bias = float(units.mean())
    parts = components(difference, pairs.subject)
    low, high = limits_of_agreement(bias, u, parts)
    return Agreement(
        kind=kind,
        first=pairs.first,
        second=pairs.second,
        subjects=parts.subjects,
        units=len(units),
        captures=len(found),
        bias=Limit(bias, bias - reach, bias + reach),
        deviation=deviation,
        within=math.sqrt(parts.within),
        between=math.sqrt(parts.between),
        total=math.sqrt(parts.total),
        lower=low,
        upper=high,
        detectable=detectable_alone(u, len(units) - 1),
        line=fit_shared_line(pairs.points()),
    )


def bias_probability(found: Sequence[Comparison]) -> float | None:
    """Return the p-value of the mean toe and camber differences, jointly.

    Hotelling's T^2 of the units' means; None for fewer than four units.
    Source: Hotelling, Annals of Mathematical Statistics 2 (1931) 360.
    """
    means = []
    for kind in KINDS:
        pairs = _pairs(found, kind)
        means.append(_means(pairs.first - pairs.second, pairs.unit))
    units = np.array(means).T
    count = len(units)
    if count < 4:
        return None
    S = np.cov(units.T)
    bias = units.mean(axis=0)
    square = count * float(bias @ np.linalg.pinv(S) @ bias)
    return f_beyond(square * (count - 2) / (2.0 * (count - 1)), 2, count - 2)


def _pairs(found: Sequence[Comparison], kind: str) -> _Pairs:
    columns: list[list[Array]] = [[], [], [], [], [], []]
    subject: list[Hashable] = []
    unit: list[Hashable] = []
    spreads: list[Spread] = []
    one_vehicle = len({comparison.vehicle for comparison in found}) < 2
    for index, one in enumerate(found):
        count = len(one.names)
        rows = slice(count * KINDS.index(kind), count * (KINDS.index(kind) + 1))
        u_first, u_second = one.u_first[rows], one.u_second[rows]
        spread = Spread(tuple(part[rows, rows] for part in one.spread.parts), one.spread.dofs)
        spreads.append(spread)
        both = (u_first**2 + u_second**2 - spread.u**2) / 2.0
        angles = one.first.angles_rad[rows], one.second.angles_rad[rows]
        values = *angles, u_first, u_second, both, spread.dof
        for column, value in zip(columns, values, strict=True):
            column.append(value)
        subject += [(one.vehicle, wheel) for wheel in one.wheels]
        unit += [index if one_vehicle else one.vehicle] * count
    first, second, u_first, u_second, both, dof = (np.concatenate(column) for column in columns)
    return _Pairs(first, second, u_first, u_second, both, dof, subject, unit, tuple(spreads))


def _means(values: Array, groups_of: Sequence[Hashable]) -> list[float]:
    groups: dict[Hashable, list[float]] = {}
    for value, key in zip(values, groups_of, strict=True):
        groups.setdefault(key, []).append(float(value))
    return [float(np.mean(group)) for group in groups.values()]
