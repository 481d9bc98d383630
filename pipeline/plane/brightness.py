"""Range by brightness: heights of points that follow their intensities, as one more slope.

Many scanners measure the dark parts of a print nearer or farther than its bright parts, so that a
face whose print is not symmetric appears tilted. Over cells of the face, y = X b + g z + noise: y
the mean height over the plane, X b the error of that plane, z the mean brightness, 0 where dark and
1 where bright; of a print in two brightnesses one or the other, whatever distance and incidence add
to these. The mean over a cell is nearly free of the noise of intensities, which would bias g
towards zero, and a print finer than the cells, which tilts nothing, is even there.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..cloud import scattered
from ..system import frozen
from ..targets import Region
from ..uncertainty import tail
from ..vectors import Array, Array32, Mask, in_axes
from .clipped_plane import ClippedFit, fit_clipped_plane
from .correlated_noise import MIN_CELLS, Cells, cells_of, correlated_noise, regressed

DARK, BRIGHT = 0.05, 0.95  # quantiles of the intensities; those beyond them count as these
TWO_VALUED = 0.8  # share of the variance between two classes; uniform 0.75, normal 0.64
MOST_ALIKE = 0.9  # share of the brightness that a tilt explains, above which only proof counts
FALSE_ALARM = 1e-6
KNOWN = 0.5  # share of the points whose intensity must be known
LEVELS = 256
FIRST_POINTS = 10_000  # enough to see whether there is anything to fit
MAX_REFITS, SETTLED = 6, 0.02  # of the standard uncertainty of g


@frozen(eq=False)
class RangeByBrightness:
    """Difference of the heights of bright and dark points of a face, towards the scanner.

    step_m: g; u_m: its standard uncertainty by independent noise. significant: whether it is
    beyond doubt; a face of two brightnesses has it fitted in any case. covariance: (3, 3) what
    fitting it adds to that of the plane's height (m) at the centroid and its slopes along u and v.
    """

    step_m: float
    u_m: float
    significant: bool
    covariance: Array

    @property
    def level_m(self) -> float:
        """How far off the mean range may be: half the step, beyond its uncertainty; its sign.

        Bright or dark, either may be measured at its true range.
        """
        half = math.sqrt(max(self.step_m**2 - self.u_m**2, 0.0)) / 2.0
        return math.copysign(half, self.step_m)


@frozen(eq=False)
class FittedBrightness:
    """Plane without range by brightness; cells: its residuals, with the brightness of each.

    level_m: (N, 3) the points without it; shade: (N,) their brightness about its mean.
    """

    fit: ClippedFit
    cells: Cells
    step_m: float
    significant: bool
    level_m: Array
    shade: Array

    def found(self, white_variance_m2: float) -> RangeByBrightness:
        """Return the difference of heights, by independent noise of that variance."""
        column = _shade(self.cells)
        explained, _ = regressed(self.cells, _plane(self.cells), column)
        square = _square(self.cells, _plane(self.cells), column)
        variance = white_variance_m2 / square
        covariance = variance * np.outer(explained, explained)
        return RangeByBrightness(self.step_m, math.sqrt(variance), self.significant, covariance)


def fit_brightness(
    points_m: Array,
    intensity: Array32,
    region: Region,
    fit: ClippedFit,
    across: int,
    max_iterations: int,
    resolution_m: float,
) -> FittedBrightness | None:
    """Fit a plane and range by brightness together, from the plane `fit` of points_m (N, 3).

    None where the intensities (N,) show nothing that ranges could follow: where they do not follow
    it beyond doubt, and the face is not of two brightnesses. A bowl of heights under a smooth trend
    of the intensities, as by incidence, proves nothing; noise correlated from point to point
    counts.
    """
    some = scattered(len(points_m), FIRST_POINTS)
    brightness = _Brightness.of(intensity[some], _used(points_m[some], region, fit))
    if brightness is None:
        return None
    cells = _cells(points_m[some], brightness.shade(intensity[some]), region, fit, across)
    if cells is None or not cells.white_variance > resolution_m**2:
        return None
    significant = _is_significant(cells, region.radius_m, resolution_m)
    if not significant and not (brightness.threshold is not None and _is_distinct(cells)):
        return None
    shade = brightness.shade(intensity)
    shade -= float(shade[_used(points_m, region, fit)].mean())
    step_m, normal = 0.0, fit.normal
    refined = _cells(points_m, shade, region, fit, across)
    for _ in range(MAX_REFITS):
        if refined is None:
            return None
        cells = refined
        change = _slope(cells, _plane(cells))
        step_m += change
        level = points_m - (step_m * shade)[:, None] * normal
        fit = fit_clipped_plane(level, region, fit.slab, region.radius_m, across, max_iterations)
        refined = _cells(level, shade, region, fit, across)
        square = _square(cells, _plane(cells), _shade(cells))
        if abs(change) < SETTLED * math.sqrt(max(cells.white_variance, 0.0) / square):
            break
    if refined is None:
        return None
    return FittedBrightness(fit, refined, step_m, significant, level, shade)


@frozen
class _Brightness:
    """Scale of the brightness of a face, from its intensities.

    dark, middle, bright: intensities. threshold: of the brightness, where a face has two.
    """

    dark: float
    middle: float
    bright: float
    threshold: float | None = None

    @classmethod
    def of(cls, intensity: Array32, used: Mask) -> _Brightness | None:
        """Return that of the points used; None where intensities are missing or all alike."""
        chosen = intensity[used & np.isfinite(intensity)].astype(np.float64)
        if not len(chosen) > KNOWN * np.count_nonzero(used):
            return None
        dark, middle, bright = np.quantile(chosen, (DARK, 0.5, BRIGHT)).tolist()
        if not bright > dark:
            return None
        scale = cls(dark, middle, bright)
        return replace(scale, threshold=_threshold(scale.shade(chosen)))

    def shade(self, intensity: Array | Array32) -> Array:
        """Return the brightness (N,) from 0 to 1, the middle one where it is not known."""
        known = np.where(np.isfinite(intensity), intensity, self.middle).astype(np.float64)
        shade = ((known - self.dark) / (self.bright - self.dark)).clip(0.0, 1.0)
        return np.asarray(shade if self.threshold is None else 1.0 * (shade > self.threshold))


def _threshold(shade: Array) -> float | None:
    """Return the threshold of the two classes that explain the brightness (N,), None if none do.

    Source: Otsu, IEEE Trans. SMC 9 (1979) 62.
    """
    count, edges = np.histogram(shade, LEVELS)
    middle = 0.5 * (edges[1:] + edges[:-1])
    share = np.cumsum(count) / len(shade)
    moment = np.cumsum(count * middle) / len(shade)
    mean = float(moment[-1])
    spread = float(count @ (middle - mean) ** 2) / len(shade)
    between = (mean * share - moment)[:-1] ** 2 / (share * (1.0 - share))[:-1].clip(min=1e-12)
    best = int(np.argmax(between))
    return float(edges[best + 1]) if between[best] > TWO_VALUED * spread else None


def _used(points_m: Array, region: Region, fit: ClippedFit) -> Mask:
    """Return which points (N,) the plane was fitted to."""
    uvw = in_axes(fit.slab.basis, points_m)
    off = np.abs(fit.plane.distance_m(uvw))
    return np.asarray(region.holds(uvw[:, :2]) & (off < fit.slab.limit_m))


def _cells(
    points_m: Array, shade: Array, region: Region, fit: ClippedFit, across: int
) -> Cells | None:
    """Return the cells of a plane's residuals with their mean brightness; None: too few.

    points_m: (N, 3), all or some of the plane's; cells without one of them are left out.
    """
    cells = cells_of(fit.plane.residual_sums(), across, fit.side_m)
    if cells is None:
        return None
    used = _used(points_m, region, fit)
    uv = in_axes(fit.slab.basis[:2], points_m[used])
    column, row = (uv.T / fit.side_m + 0.5 * across).astype(np.int32).clip(0, across - 1)
    cell = row * across + column
    number = cells.index[:, 1] * across + cells.index[:, 0]
    count = np.bincount(cell, minlength=across * across)[number]
    mean = np.bincount(cell, shade[used], across * across)[number] / count.clip(min=1)
    known = count > 0
    if np.count_nonzero(known) < MIN_CELLS:
        return None
    if not known.all():
        cells = replace(
            cells,
            uv_m=cells.uv_m[known],
            mean_m=cells.mean_m[known],
            count=cells.count[known],
            index=cells.index[known],
        )
    return replace(cells, extra=mean[known, None])


def _is_significant(cells: Cells, radius_m: float, resolution_m: float) -> bool:
    """Return whether heights follow the brightness beyond doubt, other than as a bowl does."""
    u, v = cells.uv_m.T / radius_m
    bowl = np.column_stack([_plane(cells), u * u, u * v, v * v])
    column = _shade(cells)
    square = _square(cells, bowl, column)
    if not square > 1e-9 * float(cells.count @ column**2):
        return False
    step, white = _slope(cells, bowl), cells.white_variance / square
    if 2.0 * tail(abs(step) / math.sqrt(white)) > FALSE_ALARM:
        return False
    curved = replace(cells, extra=np.column_stack([bowl[:, 3:], column]))
    noise = correlated_noise(curved, radius_m, math.sqrt(cells.white_variance), resolution_m)
    field = float((noise.covariance + noise.form_covariance)[-1, -1])
    dof = dof_of_both(white, field, noise.dof)
    return 2.0 * tail(abs(step) / math.sqrt(white + field), dof) < FALSE_ALARM


def dof_of_both(white: float, field: float, dof: float) -> float:
    """Return Welch-Satterthwaite degrees of freedom of two variances, `white` of infinitely many.

    JCGM 100, G.4.
    """
    return dof * (1.0 + white / field) ** 2 if field > 0.0 else math.inf


def _is_distinct(cells: Cells) -> bool:
    """Return whether the brightness differs enough from a tilt to be distinguished from one."""
    column = _shade(cells)
    total = _square(cells, np.ones((len(column), 1)), column)
    return _square(cells, _plane(cells), column) > (1.0 - MOST_ALIKE) * total


def _shade(cells: Cells) -> Array:
    """Return the brightness (C,), the column besides those of the plane."""
    return cells.slopes[:, 3]


def _plane(cells: Cells) -> Array:
    return np.column_stack([np.ones(len(cells.uv_m)), cells.uv_m])


def _square(cells: Cells, terms: Array, column: Array) -> float:
    """Return the weighted square of what terms (C, K) leave of a column (C,)."""
    return float(cells.count @ regressed(cells, terms, column)[1] ** 2)


def _slope(cells: Cells, terms: Array) -> float:
    """Return g, with terms (C, K) fitted as well."""
    _, rest = regressed(cells, terms, _shade(cells))
    return float((cells.count * rest) @ cells.mean_m) / float(cells.count @ rest**2)
