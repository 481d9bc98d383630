"""Correlated noise on a plane: its size, its length, and what it adds to the plane's covariance.

The residuals are averaged over cells and modelled as y = X b + f + e: X b the error of the fitted
plane, e independent with the variance found within the cells, f a stationary field of variance s^2
and correlation exp(-d^2 / (2 L^2)). s and L maximise the restricted likelihood (REML) of the
residuals, which allows for the part of the field that the plane has absorbed. In cells along scan
lines (see scan_lines.py) the correlation is exp(-a^2 / (2 A^2) - b^2 / (2 B^2)): over A along the
lines, the whole target for offsets of single lines, over B across them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from ..cloud import over_chunks
from ..system import frozen
from ..vectors import Array, Mask

CELLS = 12  # across the target: 113 cells on a full disc
POINTS_A_CELL = 8  # on average; fewer points get larger cells
MIN_CELLS = 12
FULL, DENSE = 0.2, 3.0  # of the points of a typical cell: a filled one, and one that is no measure
LENGTHS_OF_RADIUS = (0.02, 0.035, 0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5)
ALONG_OF_RADIUS = (0.1, 0.25, 0.5, 1.0, 3.0, math.inf)  # lengths in cells along scan lines
ACROSS_OF_RADIUS = (0.01, 0.02, 0.04, 0.08, 0.16, 0.3)  # the longest: ranges that drift
FORM_OF_RADIUS = 0.3  # longer waves are the target's form error, not noise of the scanner
LEVELS = np.arange(-40.0, 41.0)  # of log s^2, by the greatest eigenvalue: where a maximum is sought
MOST_STEPS, CLOSE = 60, 1e-13  # to the maximum, in log s^2
SUSPECT = 2.5  # standard deviations of the score test above which the likelihood is maximised
SIGNIFICANT = 9.0  # of twice the gain in log-likelihood, before correlation is believed
NEARLY = 0.6  # of that: where every other length shows less, those between are not looked at
SIGNIFICANT_LINED = 12.0  # the same in cells along scan lines, which show more kinds of noise


@frozen(eq=False)
class CorrelatedNoise:
    """Correlated noise and form error found in the residuals of a plane.

    sigma_m, length_m: standard deviation and length L of the noise; 0 where there is none; along
    scan lines the root of the product of both lengths.
    covariance: (3, 3) of the plane's height (m) at the centroid and its slopes along u and v, by
    this noise; (3 + K, 3 + K) where K columns more were fitted to the cells. form_covariance: the
    same by longer waves. dof: degrees of freedom of the estimate. white_sigma_m: of the noise
    within a cell: the independent part and some of the correlated. gains: of each kind of cells, in
    log-likelihood over independent noise; 0 where the noise is not clear.
    """

    sigma_m: float
    length_m: float
    covariance: Array
    form_covariance: Array
    dof: float
    white_sigma_m: float
    gains: tuple[float, ...] = ()

    @property
    def of_plane(self) -> CorrelatedNoise:
        """The same without further columns: covariances (3, 3)."""
        parts = (self.covariance[:3, :3], self.form_covariance[:3, :3])
        return replace(self, covariance=parts[0], form_covariance=parts[1])


@frozen(eq=False)
class Cells:
    """Residuals averaged over square cells.

    uv_m: (C, 2) mean position of the points; mean_m: (C,) of the residuals; count: (C,); index:
    (C, 2) column and row; side_m: of a cell, (2,) where they are not square; white_variance: of the
    residuals within cells. extra: (C, K) columns that were fitted besides the plane.
    """

    uv_m: Array
    mean_m: Array
    count: Array
    index: npt.NDArray[np.int64]
    side_m: float | Array
    white_variance: float
    extra: Array | None = None

    @property
    def sides_m(self) -> Array:
        """Sides (2,) of a cell, along columns and rows."""
        return np.broadcast_to(self.side_m, 2)

    def lengths_m(self, radius_m: float) -> list[tuple[float, float]]:
        """Return the correlation lengths along columns and rows that these cells can show."""
        if np.ndim(self.side_m) == 0:
            return [(share * radius_m, share * radius_m) for share in LENGTHS_OF_RADIUS]
        pairs = [(a * radius_m, b * radius_m) for b in ALONG_OF_RADIUS for a in ACROSS_OF_RADIUS]
        return pairs if self.sides_m[0] < self.sides_m[1] else [(b, a) for a, b in pairs]

    @property
    def slopes(self) -> Array:
        """Derivatives (C, 3 + K) of each mean by a height, two tilts and the further columns."""
        plane = np.column_stack([np.ones(len(self.uv_m)), self.uv_m])
        return plane if self.extra is None else np.hstack([plane, self.extra])


def correlated_noise(
    cells: Cells | None,
    radius_m: float,
    spread_m: float,
    resolution_m: float = 0.0,
    lined: Sequence[Cells] = (),
) -> CorrelatedNoise:
    """Estimate correlated noise in the residuals of a plane, averaged over cells (None: too few).

    radius_m: of the target. spread_m: rms of the residuals. resolution_m: of the coordinates; noise
    below it counts as none. lined: the same residuals in cells along scan lines. Each kind of cells
    weighs by how clearly it shows the noise.
    Source: REML, Patterson and Thompson, Biometrika 58 (1971) 545; the effective degrees of freedom
    are those of the variance's information.
    """
    nothing = np.zeros((3, 3))
    if cells is None or not cells.white_variance > resolution_m**2:
        return CorrelatedNoise(0.0, 0.0, nothing, nothing, math.inf, spread_m)
    nothing = np.zeros(2 * cells.slopes.shape[1:])
    white = math.sqrt(cells.white_variance)
    by_kind = [_likely_fields(cells, radius_m, SIGNIFICANT)]
    by_kind += [_likely_fields(one, radius_m, SIGNIFICANT_LINED) for one in lined]
    gains = tuple(max((fit.gain for _, fit in pairs), default=0.0) for pairs in by_kind)
    found = [pair for pairs in by_kind for pair in pairs]
    if not found:
        return CorrelatedNoise(0.0, 0.0, nothing, nothing, math.inf, white, gains)
    fields, fits = zip(*found, strict=True)
    gain = np.array([fit.gain for fit in fits])
    belief = np.exp(gain - gain.max())
    belief /= belief.sum()
    noise, form = nothing.copy(), nothing.copy()
    for field, fit, weight in zip(fields, fits, belief, strict=True):
        part = noise if min(field.lengths_m) <= FORM_OF_RADIUS * radius_m else form
        part += weight * fit.variance * field.plane_covariance
    reach = [np.minimum(field.lengths_m, radius_m) for field in fields]
    return CorrelatedNoise(
        sigma_m=math.sqrt(float(belief @ [fit.variance for fit in fits])),
        length_m=math.exp(float(belief @ np.log(reach).mean(axis=1))),
        covariance=noise,
        form_covariance=form,
        dof=_dof(fields, fits, belief),
        white_sigma_m=math.sqrt(float(belief @ [field.white_variance for field in fields])),
        gains=gains,
    )


def _dof(fields: Sequence[_Field], fits: Sequence[_Maximum], belief: Array) -> float:
    """Return the degrees of freedom of the tilt's variance, averaged over fields by belief (K,).

    2 m^2 / V by its mean m and variance V: within each field, and from field to field.
    """
    tilt = np.array([np.trace(field.plane_covariance[1:3, 1:3]) for field in fields])
    tilt *= [fit.variance for fit in fits]
    mean = float(belief @ tilt)
    within = 2.0 * tilt**2 / np.array([fit.dof for fit in fits])
    spread = float(belief @ (within + (tilt - mean) ** 2))
    return max(2.0 * mean**2 / spread, 1.0) if spread > 0.0 else math.inf


def _likely_fields(
    cells: Cells, radius_m: float, significant: float
) -> list[tuple[_Field, _Maximum]]:
    """Return the fields that these cells can show and their likelihoods, if one is clear."""
    white, lengths = _Whitened.of(cells), cells.lengths_m(radius_m)
    some = lengths[:: len(lengths) // 4]
    if not any(_Field.of(cells, white, pair).is_suspect() for pair in some):
        return []
    seek = partial(_most_likely, cells, white)
    every_other = over_chunks(partial(seek, lengths[::2]), len(lengths[::2]), 1)
    if _best_gain(every_other) < NEARLY * significant:
        return []
    found = every_other + over_chunks(partial(seek, lengths[1::2]), len(lengths[1::2]), 1)
    return found if _best_gain(found) >= significant else []


def _best_gain(found: list[tuple[_Field, _Maximum]]) -> float:
    """Return twice the greatest gain in log-likelihood."""
    return 2.0 * max(fit.gain for _, fit in found)


def _most_likely(
    cells: Cells, white: _Whitened, lengths: list[tuple[float, float]], one: slice
) -> tuple[_Field, _Maximum]:
    """Return the field of one pair of lengths, and the maximum of its likelihood."""
    field = _Field.of(cells, white, lengths[one.start])
    return field, field.maximise()


def cells_across(points: int) -> int:
    """Return the number of cells along the raster's side for that many points on a target."""
    return int(np.clip(math.sqrt(points / POINTS_A_CELL), 1, CELLS))


def cells_of(sums: Array, across: int, side_m: float) -> Cells | None:
    """Return the filled cells of a raster, from sums (across^2, 10) of n, u .. w, uu .. ww.

    Order of the sums: n, u, v, w, uu, uv, vv, uw, vw, ww; u, v about the centroid; w: the residual.
    None where too few cells are filled.
    """
    count = sums[:, 0]
    full = filled(count)
    if full is None:
        return None
    n = count[full]
    u, v, mean = (sums[full, axis] / n for axis in (1, 2, 3))
    within = float(np.sum(sums[full, 9] - n * mean**2) / np.sum(n - 1.0))
    index = np.stack([np.flatnonzero(full) % across, np.flatnonzero(full) // across], axis=1)
    return Cells(np.stack([u, v], axis=1), mean, n, index, side_m, within)


def regressed(cells: Cells, terms: Array, columns: Array) -> tuple[Array, Array]:
    """Return coefficients (K, ...) of columns (C, ...) by terms (C, K), and what these leave.

    Weighted by the number of points of each cell.
    """
    weighted = terms.T * cells.count
    coefficients = np.asarray(np.linalg.solve(weighted @ terms, weighted @ columns))
    return coefficients, columns - terms @ coefficients


def filled(count: Array) -> Mask | None:
    """Return which cells hold enough of the points, count (C,); None where too few cells do.

    Enough is a share of the fullest cell, or of one DENSE times as full as the median of those that
    hold points: a spot scanned several times as densely takes no cell from the rest of the target.
    """
    fullest = float(count.max())
    if fullest > 0.0:
        fullest = min(fullest, DENSE * float(np.median(count[count > 0.0])))
    full = count > max(2.0, FULL * fullest)
    return full if np.count_nonzero(full) >= MIN_CELLS else None


@frozen(eq=False)
class _Whitened:
    """Residuals (C,) of the cells at unit variance, without what the fit explains.

    root: (C,) one over the standard uncertainty of each mean. fitted: (C, 3 + K) orthonormal
    columns of the fit, whitened.
    """

    root: Array
    fitted: Array
    residual: Array

    @classmethod
    def of(cls, cells: Cells) -> _Whitened:
        """Whiten the means of the cells."""
        root = np.sqrt(cells.count / cells.white_variance)
        fitted, _ = np.linalg.qr(cells.slopes * root[:, None])
        means = root * cells.mean_m
        return cls(root, fitted, means - fitted @ (fitted.T @ means))

    def kernel(self, of_means: Array) -> Array:
        """Return the covariance (C, C) of the residuals where that of the means is `of_means`."""
        kernel = of_means * self.root[:, None] * self.root
        across = kernel @ self.fitted
        across -= self.fitted @ (self.fitted.T @ across / 2.0)
        half = across @ self.fitted.T
        return np.asarray(kernel - half - half.T)


@frozen
class _Maximum:
    """Maximum of the likelihood. variance: s^2 there; gain: in log-likelihood over s = 0."""

    variance: float
    gain: float
    dof: float


@frozen(eq=False)
class _Field:
    """Field of lengths (2,) in the whitened residuals of the cells.

    residual: (C,) of unit variance, but for what the fit explains, if there is no field; kernel:
    (C, C) what a field of unit variance adds to its covariance; plane_covariance: (3, 3) what it
    adds to the plane's. white_variance: of the residuals within the cells.
    """

    lengths_m: tuple[float, float]
    residual: Array
    kernel: Array
    plane_covariance: Array
    white_variance: float

    @classmethod
    def of(cls, cells: Cells, white: _Whitened, lengths_m: tuple[float, float]) -> _Field:
        """Return the field over these cells."""
        kernel = _averaged_kernel(cells, lengths_m)
        weighted = cells.slopes.T * cells.count
        solve = np.linalg.solve(weighted @ cells.slopes, weighted)
        of_plane = solve @ kernel @ solve.T
        residual, added = white.residual, white.kernel(kernel)
        return cls(lengths_m, residual, added, of_plane, cells.white_variance)

    @property
    def score(self) -> float:
        """Twice the slope of the log-likelihood at s^2 = 0: z'Kz less its mean tr K for white z."""
        return float(self.residual @ self.kernel @ self.residual) - float(np.trace(self.kernel))

    def is_suspect(self) -> bool:
        """Test s = 0 by the score, whose variance is 2 tr K^2 for white z."""
        return self.score > SUSPECT * math.sqrt(2.0 * float(np.sum(self.kernel**2)))

    def maximise(self) -> _Maximum:
        """Return the least s^2 at which the likelihood has a maximum, by its slope in log s^2.

        At a negative score that is 0. A smooth field of absurd size may pass for waves shorter than
        its length: a maximum beyond.
        """
        if self.score < 0.0:
            return _Maximum(0.0, 0.0, 1.0)
        values, vectors = np.linalg.eigh(self.kernel)
        values = values.clip(min=0.0)
        square = (vectors.T @ self.residual) ** 2
        scale = 1.0 / max(float(values[-1]), 1e-300)

        def slopes(level: Array) -> tuple[Array, Array]:
            """Return the slope of the likelihood by log s^2, and the slope of that."""
            ratio = np.multiply.outer(np.exp(level), values * scale)
            left = 1.0 / (1.0 + ratio)
            share, pull = ratio * left, square * left
            first = share * (pull - 1.0)
            second = first * left - share * share * pull
            return np.sum(first, axis=-1), np.sum(second, axis=-1)

        high = LEVELS[np.argmax(np.append(slopes(LEVELS[:-1])[0] <= 0.0, True))]
        low, level = high - 1.0, high - 0.5
        for _ in range(MOST_STEPS):
            first, second = slopes(level)
            low, high = (level, high) if first > 0.0 else (low, level)
            ahead = level - first / second if second < 0.0 else low
            before, level = level, ahead if low < ahead < high else 0.5 * (low + high)
            if abs(level - before) < CLOSE:
                break
        variance = scale * math.exp(level)
        share = values * variance
        gain = 0.5 * float(np.sum(square * share / (1.0 + share) - np.log1p(share)))
        dof = float(np.sum((share / (1.0 + share)) ** 2))
        return _Maximum(variance, max(gain, 0.0), max(dof, 1.0))


def _averaged_kernel(cells: Cells, lengths_m: tuple[float, float]) -> Array:
    """Return the covariances (C, C) of the cell means of a field of unit variance.

    exp(-d^2 / (2 L^2)) is a product over the axes, so its mean over two cells is as well. With g
    the second integral of the kernel, the mean over two sides h that lie d apart is
    (g(d + h) - 2 g(d) + g(d - h)) / h^2.
    """
    kernel = np.ones((len(cells.index),) * 2)
    for place, side_m, length_m in zip(cells.index.T, cells.sides_m, lengths_m, strict=True):
        if math.isinf(length_m):
            continue
        apart = side_m * np.arange(-1.0, float(place.max()) + 2.0)
        t = apart / (math.sqrt(2.0) * length_m)
        g = apart * math.sqrt(math.pi / 2.0) * length_m * erf(t) + length_m**2 * np.exp(-t * t)
        table = (g[2:] - 2.0 * g[1:-1] + g[:-2]) / side_m**2
        number = np.arange(len(table))
        kernel *= table[np.abs(number[:, None] - number)][place].take(place, axis=1)
    return kernel


def erf(x: Array) -> Array:
    """Return the error function of x (N,), few values; needs no scipy."""
    return np.array([math.erf(value) for value in x])
