"""Scatter of the readings of one quantity: repeatability, reproducibility, rounding, as effects.

Readings stand in cells: one point, one level (series and operator), one direction of approach.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..uncertainty import Effect
from ..vectors import Array

REPEATABILITY, REPRODUCIBILITY, RESOLUTION = "repeatability", "reproducibility", "resolution"
HARMONICS, BISECTIONS = 1000, 60


@dataclass(frozen=True)
class Scatter:
    """Errors of indication of P points, L levels, D directions, n readings each.

    means: (P, L, D) mean error of each cell; counts: (P, L, D) its number; squares: (P,) sums of
    squares about the cells' means, and dofs: (P,) their degrees of freedom.
    """

    means: Array
    counts: Array
    squares: Array
    dofs: Array

    @property
    def deviation(self) -> float:
        """Pooled standard deviation of a single reading; nan where none is repeated."""
        return math.sqrt(self.squares.sum() / self.dofs.sum()) if self.dofs.sum() else math.nan

    @property
    def errors(self) -> Array:
        """Errors of indication (P,): means over levels and directions."""
        return np.asarray(self.means.mean(axis=(1, 2)))

    def between_levels(self) -> tuple[float, float]:
        """Return the variance of level means common to all points, and of point by level.

        Mean squares of the two-way table of P points by L levels, per cell mean:
        P sum (m.l - m..)^2 / (L - 1), and that of the interaction.
        """
        cells = self.means.mean(axis=2)
        points, levels = cells.shape
        of_levels = cells.mean(axis=0)
        common = points * float(np.var(of_levels, ddof=1))
        if points == 1:
            return common, 0.0
        rest = cells - cells.mean(axis=1, keepdims=True) - of_levels + cells.mean()
        return common, float(np.sum(rest**2)) / ((points - 1) * (levels - 1))

    def effects(self, resolution: float) -> list[Effect]:
        """Return the effects of the readings on the P errors."""
        levels = self.means.shape[1]
        between = self.between_levels() if levels > 1 else None
        dof = float(self.dofs.sum())
        return mean_effects(self._spread(), self.deviation, dof, levels, between, resolution)

    def _spread(self) -> Array:
        """Return the variances (P,) of the means for readings of unit variance."""
        cells = self.counts.shape[1] * self.counts.shape[2]
        return np.asarray((1.0 / self.counts).sum(axis=(1, 2)) / cells**2)

    def hysteresis(self, resolution: float) -> tuple[Array, list[Effect]]:
        """Return upward less downward means (P,) of D = 2 directions, and the effects on them."""
        levels = self.means.shape[1]
        differences = (self.means[:, :, 0] - self.means[:, :, 1]).mean(axis=1)
        spread = (1.0 / self.counts).sum(axis=(1, 2)) / levels**2
        dof = float(self.dofs.sum())
        ratio = _rounding_ratio(differences, resolution)
        return differences, difference_effects(spread, self.deviation, dof, resolution, ratio)


def _rounding_ratio(differences: Array, step: float) -> float:
    """Return the variance of the rounding of P differences over step^2/6, 1 at least.

    A difference whose true value lies a part f of a step above a whole one is shown as that one or
    the next, with the variance f (1 - f) step^2; all points share f where the hysteresis does not
    depend on the point. f by Agresti and Coull, The American Statistician 52 (1998) 119.
    """
    count = len(differences)
    part = float(differences.mean()) / step % 1.0 if step > 0.0 else 0.0
    if part * (1.0 - part) < 1e-6:
        return 1.0
    part = (count * part + 2.0) / (count + 4.0)
    return max(1.0, 6.0 * part * (1.0 - part))


def mean_effects(
    spread: Array,
    deviation: float,
    dof: float,
    levels: int,
    between: tuple[float, float] | None,
    resolution: float,
) -> list[Effect]:
    """Return the effects of readings on P mean errors; factors (P, k).

    spread: (P,) variances of the means for readings of unit variance. One level: the pooled
    repeatability of each mean. Several: the mean squares `between` of the two-way table, which hold
    repeatability as well; the covariance of the points' means is
    MS_PL/L (I - 11'/P) + MS_L/L 11'/P. Source: ISO 5725-2, 7.4; JCGM 100, H.5.
    """
    points = len(spread)
    own = math.sqrt(rounding_variance(deviation, resolution))
    rounding = Effect(RESOLUTION, own * np.eye(points), math.inf, False, uniform=True)
    if between is None:
        factor = np.diag(deviation * np.sqrt(spread))
        return [Effect(REPEATABILITY, factor, dof, False), rounding]
    common, rest = between
    equal = np.full((points, 1), math.sqrt(common / levels / points))
    found = [Effect(REPRODUCIBILITY, equal, levels - 1.0, False), rounding]
    if points > 1:
        across = math.sqrt(rest / levels) * (np.eye(points) - 1.0 / points)
        found.insert(0, Effect(REPEATABILITY, across, (points - 1.0) * (levels - 1.0), False))
    return found


def difference_effects(
    spread: Array, deviation: float, dof: float, resolution: float, ratio: float = 1.0
) -> list[Effect]:
    """Return the effects of readings on P differences of directions; spread: of these.

    ratio: of the variance of their rounding to that of two roundings, step^2/6.
    """
    own = math.sqrt(ratio * rounding_variance(deviation, resolution)) * np.eye(len(spread))
    return [
        Effect(REPEATABILITY, np.diag(deviation * np.sqrt(spread)), dof, False),
        Effect(RESOLUTION, np.hstack([own, -own]), math.inf, False, uniform=True),
    ]


def rounding_variance(deviation: float, step: float) -> float:
    """Return the variance that rounding to `step` leaves in a mean of many readings.

    step^2/12 without scatter; less where the scatter sigma of the readings before rounding spreads
    them over several steps: B = sum over k of step^2/(2 pi^2 k^2) exp(-(2 pi k sigma/step)^2).
    deviation: of the rounded readings, whose square is sigma^2 + step^2/12 - B on average; nan
    where it is not known, which counts as none.
    Source: Widrow and Kollar, Quantization Noise, Cambridge 2008, chapter 4.
    """
    if step == 0.0:
        return 0.0
    square = 0.0 if math.isnan(deviation) else (deviation / step) ** 2
    low, high = 0.0, square
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        if middle + 1.0 / 12.0 - _left(middle) < square:
            low = middle
        else:
            high = middle
    return step**2 * _left(low)


def _left(variance: float) -> float:
    """Return B by the variance of the readings before rounding, both in steps squared."""
    k = np.arange(1, HARMONICS + 1)
    terms = np.exp(-((2.0 * math.pi * k) ** 2) * variance) / (2.0 * (math.pi * k) ** 2)
    return 1.0 / 12.0 if variance == 0.0 else float(terms.sum())


def scatter_of(cells: Sequence[Sequence[Sequence[Sequence[float]]]]) -> Scatter:
    """Return the scatter of errors by point, level and direction, each cell with one or more."""
    means = np.array([[[np.mean(c) for c in level] for level in point] for point in cells])
    counts = np.array([[[len(c) for c in level] for level in point] for point in cells], float)
    squares = [
        sum(float(np.sum((np.array(c) - np.mean(c)) ** 2)) for level in point for c in level)
        for point in cells
    ]
    return Scatter(means, counts, np.array(squares), (counts - 1.0).sum(axis=(1, 2)))
