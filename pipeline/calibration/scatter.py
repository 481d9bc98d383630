"""Scatter of the readings of one quantity: repeatability, reproducibility, rounding, as effects.

Readings stand in cells: one point, one level (series and operator), one direction of approach.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..system import frozen
from ..uncertainty import Effect, f_beyond, quantile
from ..vectors import Array, Mask

REPEATABILITY, REPRODUCIBILITY, RESOLUTION = "repeatability", "reproducibility", "resolution"
HARMONICS, BISECTIONS = 1000, 60
LEVEL, NEGLIGIBLE = 0.95, 1e-6
UNLIKE = 1e-3  # probability below which the scatter of a point is not that of the others
ROUNDING = 1e-14  # of means of equal numbers, in parts of these: a step that all readings have
OF_MEDIAN = 0.4  # part of the degrees of freedom that a median of variances has
WHOLE, AT_ONCE = np.ones(1), np.zeros(1)
Factors = tuple[tuple[int, ...], ...]


@frozen
class Between:
    """Mean squares of P points by L levels, per cell mean: of levels, and of point by level."""

    levels: int
    common: float
    rest: float


@frozen
class Scatter:
    """Errors of indication of P points, L levels, D directions, n readings each.

    means: (P, L, D) mean error of each cell; counts: (P, L, D) numbers of readings; squares: (P,)
    sums of squares about the cells' means, and dofs: (P,) their degrees of freedom. alike: (P,)
    points whose readings scatter alike; of others, each has a deviation of its own. factors: of
    levels that share something, as all series of an operator and all operators of a series do, the
    number (L,) of what each shares; none where levels are independent.
    """

    means: Array
    counts: Array
    squares: Array
    dofs: Array
    alike: Mask
    factors: Factors = ()

    @property
    def dof(self) -> float:
        """Degrees of freedom of the pooled deviation."""
        return float(self.dofs[self.alike].sum())

    @property
    def deviation(self) -> float:
        """Standard deviation of a single reading, pooled over points that scatter alike.

        nan where none is repeated.
        """
        return math.sqrt(self.squares[self.alike].sum() / self.dof) if self.dof else math.nan

    @property
    def errors(self) -> Array:
        """Errors of indication (P,): means over levels and directions."""
        return np.asarray(self.means.mean(axis=(1, 2)))

    def between_levels(self) -> tuple[float, float]:
        """Return the variance of level means common to all points, and of point by level.

        Mean squares of the two-way table of P points by L levels, per cell mean:
        P sum (m.l - m..)^2 / (L - 1), and that of the interaction; of points that scatter alike.
        """
        found = mean_squares(self.means[self.alike].mean(axis=2))
        return found.common, found.rest

    @property
    def variances(self) -> Array:
        """Variance (P,) of a single reading over all levels, each direction about its mean.

        The variance of the cells' means between levels, and of single readings in a cell what these
        means do not hold already. The mean of both directions would scatter less: they are rounded
        unlike where they lie a part of a step apart.
        """
        levels = self.means.shape[1]
        within = self.squares / self.dofs.clip(min=1.0)
        if levels == 1:
            return np.asarray(within)
        between = np.var(self.means, axis=1, ddof=1).mean(axis=1)
        return np.asarray(between + within * (1.0 - (1.0 / self.counts).mean(axis=(1, 2))))

    def effects(self, resolution: float) -> list[Effect]:
        """Return the effects of the readings on the P errors.

        Directions whose readings lie a part of a step apart are rounded differently. What differs
        between levels is in their scatter already; of the rounding, what they share counts besides:
        that of readings which scatter as those of all levels do, since levels that lie tau apart
        share B(0) of the variance sigma^2 + tau^2 (`rounding_covariance`).
        """
        between = squares_by_factor(self.means[self.alike].mean(axis=2), self.factors)
        spread, rounding = self._spread(), self._rounding(resolution)
        pooled = spread[self.alike]
        found = mean_effects(pooled, self.deviation, self.dof, between, rounding)
        return [*(self._on_all(effect) for effect in found), *self._of_others(spread)]

    def _on_all(self, effect: Effect) -> Effect:
        """Return an effect on the points that scatter alike as one on all of them (P,).

        What all points of a level share is that of the others too.
        """
        factor = np.zeros((len(self.alike), effect.factor.shape[1]))
        factor[self.alike] = effect.factor
        if effect.name == REPRODUCIBILITY:
            factor[~self.alike] = effect.factor[0]
        return replace(effect, factor=factor)

    def _of_others(self, spread: Array) -> list[Effect]:
        """Return the effect of each point that scatters unlike the others, on it alone."""
        found = []
        levels = self.means.shape[1]
        by_level = deviations_by_level(self.means)
        groups = self.factors or (tuple(range(levels)),)
        by_group = [_averaged(by_level, each) for each in groups]
        for point in np.flatnonzero(~self.alike).tolist():
            dof = float(self.dofs[point])
            variance = self.squares[point] / max(dof, 1.0) * spread[point]
            if levels > 1:
                dofs = [each.shape[1] - 1.0 for each in by_group]
                squares = [float(np.sum(each[point] ** 2)) for each in by_group]
                dof = min(dofs)
                each = zip(squares, dofs, strict=True)
                variance = max(variance, sum(s / nu / (nu + 1.0) for s, nu in each))
            own = np.zeros((len(spread), 1))
            own[point] = math.sqrt(variance)
            found.append(Effect(REPEATABILITY, own, dof, False))
        return found

    def _rounding(self, resolution: float) -> float:
        """Return the variance that the rounding of all readings leaves in each error.

        It follows from the scatter and from the distance of the directions, which few points show:
        of readings within a step, those near the edge of one scatter alone. The variance V(w, d)
        of an error has the degrees of freedom nu = 2 V^2/((V_w u(w))^2 + (V_d u(d))^2) (JCGM 100,
        G.4.2) by the means w of the points' variances and d of their directions' distances, u from
        their spread; what is rounded takes Student's factor over the normal one.
        """
        by_point = np.column_stack([self.variances, self._distances()])[self.alike]
        points = len(by_point)
        mean = by_point.mean(axis=0)
        left = self._left(mean, resolution)
        if points == 1 or not left > 0.0:
            return left
        spread = float(self._spread()[self.alike].mean())
        total, square = spread * mean[0] + left, 0.0
        for axis, u in zip(
            np.eye(2), by_point.std(axis=0, ddof=1) / math.sqrt(points), strict=True
        ):
            high, low = mean + u * axis, (mean - u * axis).clip(min=(0.0, -math.inf))
            rise = self._left(high, resolution) - self._left(low, resolution)
            square += ((spread * (high - low)[0] + rise) / 2.0) ** 2
        if square < NEGLIGIBLE * total**2:
            return left
        dof = max(1.0, 2.0 * total**2 / square)
        return left * (quantile(0.5 + LEVEL / 2.0, dof) / quantile(0.5 + LEVEL / 2.0)) ** 2

    def _distances(self) -> Array:
        """Return the mean distance (P,) of two directions; 0 of one."""
        return np.asarray((self.means[..., 0] - self.means[..., -1]).mean(axis=-1))

    def _left(self, known: Array, resolution: float) -> float:
        """Return the variance of the rounding in the mean of directions; known: w and d."""
        ways = np.linspace(known[1], 0.0, self.means.shape[2])
        return max(0.0, float(rounding_covariance(math.sqrt(known[0]), resolution, ways).mean()))

    def _spread(self) -> Array:
        """Return the variances (P,) of the means for readings of unit variance."""
        cells = self.counts.shape[1] * self.counts.shape[2]
        return np.asarray((1.0 / self.counts).sum(axis=(1, 2)) / cells**2)

    def hysteresis(self, resolution: float) -> tuple[Array, list[Effect]]:
        """Return upward less downward means of D = 2 directions, and the effects on them.

        Of the points that scatter alike. With several levels their differences show how they
        scatter, the rounding that differs from one level to the next included; where they do not
        show all of that, as of few differences that are alike by chance, the rest of it counts.
        """
        levels, means = self.means.shape[1], self.means[self.alike]
        by_level = means[:, :, 0] - means[:, :, -1]
        differences = by_level.mean(axis=1)
        spread = (1.0 / self.counts[self.alike]).sum(axis=(1, 2)) / levels**2
        whole = math.sqrt(float(self.variances[self.alike].mean()))
        shared, own = rounding_by_level(differences, self.deviation, whole, resolution)
        between = squares_by_factor(by_level, self.factors)
        if between:
            table = mean_squares(by_level)
            own = max(0.0, own - (table.rest if len(by_level) > 1 else table.common))
        rounding = shared + own / levels
        return differences, difference_effects(spread, self.deviation, self.dof, between, rounding)


def rounding_by_level(
    differences: Array, deviation: float, whole: float, step: float
) -> tuple[float, float]:
    """Return the variance of the rounding of P differences that levels share, and of each alone.

    deviation: of the readings of one level, whole: of those of all, whose rounding levels share.
    """
    own, shared = (rounding_of_differences(differences, each, step) for each in (deviation, whole))
    return shared, max(0.0, own - shared)


def deviation_with(deviation: float, step: float, between: float) -> float:
    """Return the deviation of rounded readings whose levels differ by the deviation `between`."""
    if step == 0.0:
        return math.hypot(deviation, between)
    variance = _variance_before((deviation / step) ** 2) + (between / step) ** 2
    return step * math.sqrt(variance + 1.0 / 12.0 - _covariance(variance, 0.0))


def rounding_of_differences(differences: Array, deviation: float, step: float) -> float:
    """Return the variance of the rounding of P differences, that of two roundings at least.

    A difference whose true value lies a part f of a step above a whole one is shown, without
    scatter, as that one or the next, with the variance f (1 - f) step^2; all points share f where
    the hysteresis does not depend on the point. f by Agresti and Coull, The American Statistician
    52 (1998) 119.
    """
    count, independent = len(differences), 2.0 * rounding_variance(deviation, step)
    part = float(differences.mean()) / step % 1.0 if step > 0.0 else 0.0
    if part * (1.0 - part) < 1e-6:
        return independent
    apart = step * np.array([(count * part + 2.0) / (count + 4.0), 0.0])
    return max(independent, rounding_variance(deviation, step, np.array([1.0, -1.0]), apart))


def mean_effects(
    spread: Array,
    deviation: float,
    dof: float,
    between: Sequence[Between],
    rounding: float,
) -> list[Effect]:
    """Return the effects of readings on P mean errors; factors (P, k).

    spread: (P,) variances of the means for readings of unit variance. rounding: variance that the
    rounding leaves in each. One level: the pooled repeatability of each mean. Several: the mean
    squares `between` of the two-way table, which hold repeatability as well; the covariance of the
    points' means is MS_PL/L (I - 11'/P) + MS_L/L 11'/P, the sum of such where levels share series
    and operators. Source: ISO 5725-2, 7.4; JCGM 100, H.5.
    """
    points = len(spread)
    rounded = Effect(
        RESOLUTION, math.sqrt(rounding) * np.eye(points), math.inf, False, uniform=True
    )
    if not between:
        factor = np.diag(deviation * np.sqrt(spread))
        return [Effect(REPEATABILITY, factor, dof, False), rounded]
    own, common = [], []
    for one in between:
        dof = one.levels - 1.0
        equal = np.full((points, 1), math.sqrt(one.common / one.levels / points))
        common.append(Effect(REPRODUCIBILITY, equal, dof, False))
        if points > 1:
            across = math.sqrt(one.rest / one.levels) * (np.eye(points) - 1.0 / points)
            own.append(Effect(REPEATABILITY, across, (points - 1.0) * dof, False))
    return [*own, *common, rounded]


def mean_squares(cells: Array) -> Between:
    """Return the mean squares of a table (P, L) of cell means."""
    points, levels = cells.shape
    of_levels = cells.mean(axis=0)
    common = points * float(np.var(of_levels, ddof=1))
    if points == 1:
        return Between(levels, common, 0.0)
    rest = float(np.sum(_by_point_and_level(cells) ** 2))
    return Between(levels, common, rest / ((points - 1) * (levels - 1)))


def squares_by_factor(cells: Array, factors: Factors) -> list[Between]:
    """Return the mean squares of a table (P, L) by each factor of its levels; none of one level.

    Of two crossed factors the variance of the mean is MS_A/(n_A) + MS_B/(n_B) less that of their
    interaction, MS_AB/(n_A n_B), which either holds as it holds the repeatability; both are made
    smaller by the same share, their sum no less than either. Source: Cornfield and Tukey, Ann.
    Math. Stat. 27 (1956) 907.
    """
    points, levels = cells.shape
    if levels == 1:
        return []
    if not factors:
        return [mean_squares(cells)]
    found = [mean_squares(_averaged(cells, each)) for each in factors]
    dof = math.prod(one.levels - 1 for one in found)
    if len(found) == 1 or math.prod(one.levels for one in found) > levels:
        return found
    of_levels, own = cells.mean(axis=0, keepdims=True), _by_point_and_level(cells)
    common = points * _interaction(of_levels, factors) / dof / levels
    rest = _interaction(own, factors) / dof / levels / max(1, points - 1)
    shares = [_share([one.common / one.levels for one in found], common),
              _share([one.rest / one.levels for one in found], rest)]  # fmt: skip
    return [Between(one.levels, one.common * shares[0], one.rest * shares[1]) for one in found]


def _share(variances: Sequence[float], twice: float) -> float:
    """Return the share that is left of a sum of variances of which all hold one part."""
    total = sum(variances)
    return max(total - twice, *variances) / total if total > 0.0 else 1.0


def _interaction(table: Array, factors: Factors) -> float:
    """Return the sum of squares of a table (P, L) beyond the means by each of two factors."""
    left = table + table.mean(axis=1, keepdims=True)
    for each in factors:
        left = left - _averaged(table, each)[:, list(each)]
    return float(np.sum(left**2))


def _averaged(table: Array, factor: Sequence[int]) -> Array:
    """Return the means (P, G) of a table (P, L) over the levels of each number of a factor."""
    numbers = np.array(factor)
    groups = range(int(numbers.max()) + 1)
    return np.stack([table[:, numbers == one].mean(axis=1) for one in groups], axis=1)


def _by_point_and_level(cells: Array) -> Array:
    """Return what a table (P, L) leaves of the means of its points and levels."""
    return np.asarray(cells - cells.mean(axis=1, keepdims=True) - cells.mean(axis=0) + cells.mean())


def difference_effects(
    spread: Array, deviation: float, dof: float, between: Sequence[Between], rounding: float
) -> list[Effect]:
    """Return the effects of readings on P differences of directions.

    spread: (P,) variances of the differences for readings of unit variance. between: mean squares
    of the differences by levels, as of `mean_effects`. rounding: variance that the rounding of both
    directions leaves in each.
    """
    own = math.sqrt(rounding / 2.0) * np.eye(len(spread))
    return [
        *mean_effects(spread, deviation, dof, between, 0.0)[:-1],
        Effect(RESOLUTION, np.hstack([own, -own]), math.inf, False, uniform=True),
    ]


def rounding_variance(
    deviation: float, step: float, weights: Array = WHOLE, offsets: Array = AT_ONCE
) -> float:
    """Return the variance that rounding to `step` leaves in a weighted sum of means of readings.

    weights, offsets: (C,) of the means; the others as of `rounding_covariance`.
    """
    covariance = rounding_covariance(deviation, step, offsets)
    return max(0.0, float(weights @ covariance @ weights))


def rounding_covariance(deviation: float, step: float, offsets: Array) -> Array:
    """Return the covariance (C, C) that rounding to `step` leaves in C means of readings.

    step^2/12 for a single mean without scatter; less where the scatter sigma of the readings before
    rounding spreads them over several steps, and where the means lie parts of a step apart: the
    rounding errors of two that lie d apart have the covariance B(d) = sum over k of
    step^2/(2 pi^2 k^2) cos(2 pi k d/step) exp(-(2 pi k sigma/step)^2). deviation: of the rounded
    readings, whose square is sigma^2 + step^2/12 - B(0) on average; nan where it is not known,
    which counts as none. offsets: (C,) of the means. Source: Widrow and Kollar, Quantization Noise,
    Cambridge 2008, chapter 4.
    """
    count = len(offsets)
    if step == 0.0:
        return np.zeros((count, count))
    variance = _variance_before(0.0 if math.isnan(deviation) else (deviation / step) ** 2)
    apart = np.subtract.outer(offsets, offsets) / step % 1.0
    rows = [[_covariance(variance, part) for part in row] for row in apart.tolist()]
    return step**2 * np.array(rows)


def _variance_before(square: float) -> float:
    """Return the variance of readings before rounding by that of the rounded ones; in steps."""
    low, high = 0.0, square
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        if middle + 1.0 / 12.0 - _covariance(middle, 0.0) < square:
            low = middle
        else:
            high = middle
    return low


def _covariance(variance: float, apart: float) -> float:
    """Return B(d) by the variance of the readings before rounding and d, 0 to 1; all in steps.

    Harmonics above 1/sigma are damped to e^-39.
    """
    if variance == 0.0:
        return 1.0 / 12.0 - apart * (1.0 - apart) / 2.0
    k = np.arange(1, min(HARMONICS, 1.0 + 1.0 / math.sqrt(variance)) + 1.0)
    damped = np.exp(-((2.0 * math.pi * k) ** 2) * variance) / (2.0 * (math.pi * k) ** 2)
    return float(np.cos(2.0 * math.pi * apart * k) @ damped)


def scatter_of(
    cells: Sequence[Sequence[Sequence[Sequence[float]]]],
    references: Array | float = 0.0,
    resolution: float = 0.0,
    factors: Factors = (),
) -> Scatter:
    """Return the scatter of readings by point, level and direction, each cell with one or more.

    references: (P, L) or one of all, of which the errors are. resolution: of the readings. factors:
    of the levels.
    """
    shown = np.array([[[np.mean(c) for c in level] for level in point] for point in cells])
    counts = np.array([[[len(c) for c in level] for level in point] for point in cells], float)
    squares = [
        sum(float(np.sum((np.array(c) - np.mean(c)) ** 2)) for level in point for c in level)
        for point in cells
    ]
    means = shown - np.asarray(references)[..., None]
    dofs = (counts - 1.0).sum(axis=(1, 2))
    found = Scatter(means, counts, np.array(squares), dofs, np.ones(len(dofs), bool), factors)
    finest = ROUNDING * float(np.abs(shown).max())
    return replace(found, alike=_alike(found, max(resolution, finest)))


def deviations_by_level(means: Array) -> Array:
    """Return what means (P, L, D) of cells leave (P, L) of a point's mean and a level's median.

    The median, since a level's mean would carry one point's error to all of them.
    """
    cells = means.mean(axis=2)
    about_points = cells - cells.mean(axis=1, keepdims=True)
    return np.asarray(about_points - np.median(about_points, axis=0))


def _alike(found: Scatter, resolution: float) -> Mask:
    """Return which points (P,) scatter alike; others by more than chance, UNLIKE in all, explains.

    By the F of a point's variance over that of the others, their median first, so that several
    do not hide each other, then pooled. Variances are of readings within their cells, and of cells
    about their points and levels; no point is set aside whose readings lie on two steps alone. A
    test of each point on its own takes unlike numbers of readings, which Cochran's (ISO 5725-2,
    7.3.3) does not.
    """
    points, levels, ways = found.means.shape
    per_cell = ways / (1.0 / found.counts).sum(axis=(1, 2)) * levels  # readings a level, harmonic
    by_level = per_cell * np.sum(deviations_by_level(found.means) ** 2, axis=1)
    dofs = found.dofs + (levels - 1.0) * (1.0 - 1.0 / points)
    squares, shown = found.squares + by_level, dofs > 0.0
    variances = squares / np.where(shown, dofs, 1.0)
    cells = levels * ways
    two_steps = resolution**2 / 4.0 * (dofs + cells) / np.where(shown, dofs, 1.0)
    tried = int(np.count_nonzero(shown))

    def is_unlike(point: int, among: Mask, robust: bool) -> bool:
        rest = among & shown
        rest[point] = False
        dof = float(dofs[rest].sum())
        if not (dof > 0.0 and variances[point] > two_steps[point]):
            return False
        known = float(squares[rest].sum()) / dof
        if robust and np.count_nonzero(rest) > 2:
            known = float(np.median(variances[rest] / (1.0 - 2.0 / (9.0 * dofs[rest])) ** 3))
            dof *= OF_MEDIAN
        known = max(known, resolution**2 / 12.0)
        if not known > 0.0:
            return True
        return f_beyond(variances[point] / known, round(dofs[point]), dof) * tried < UNLIKE

    alike = np.ones(points, bool)
    for robust in (True, False, False):
        unlike = [shown[point] and is_unlike(point, alike, robust) for point in range(points)]
        alike = ~np.array(unlike, bool)
    return alike
