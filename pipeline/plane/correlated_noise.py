"""Correlated noise on a plane: its size, its length, and what it adds to the plane's covariance.

The residuals are averaged over cells and modelled as y = X b + f + e: X b the error of the fitted
plane, e independent with the variance found within the cells, f a stationary field of variance s^2
and correlation exp(-d^2 / (2 L^2)). s and L maximise the restricted likelihood (REML) of the
residuals, which allows for the part of the field that the plane has absorbed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..vectors import Array

CELLS = 12  # across the target: 113 cells on a full disc
POINTS_A_CELL = 8  # on average; fewer points get larger cells
MIN_CELLS = 12
LENGTHS_OF_RADIUS = (0.02, 0.035, 0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5)
FORM_OF_RADIUS = 0.3  # longer waves are the target's form error, not noise of the scanner
SUSPECT = 2.5  # standard deviations of the score test above which the likelihood is maximised
SIGNIFICANT = 9.0  # of twice the gain in log-likelihood, before correlation is believed


@dataclass(frozen=True)
class CorrelatedNoise:
    """Correlated noise and form error found in the residuals of a plane.

    sigma_m, length_m: standard deviation and length L of the noise; 0 where there is none.
    covariance: (3, 3) of the plane's height (m) at the centroid and its slopes along u and v, by
    this noise; (3 + K, 3 + K) where K columns more were fitted to the cells. form_covariance: the
    same by longer waves. dof: degrees of freedom of the estimate. white_sigma_m: of the noise
    within a cell: the independent part and some of the correlated.
    """

    sigma_m: float
    length_m: float
    covariance: Array
    form_covariance: Array
    dof: float
    white_sigma_m: float

    @property
    def of_plane(self) -> CorrelatedNoise:
        """The same without further columns: covariances (3, 3)."""
        parts = (self.covariance[:3, :3], self.form_covariance[:3, :3])
        return replace(self, covariance=parts[0], form_covariance=parts[1])


@dataclass(frozen=True)
class Cells:
    """Residuals averaged over square cells.

    uv_m: (C, 2) mean position of the points; mean_m: (C,) of the residuals; count: (C,); index:
    (C, 2) column and row; side_m: of a cell; white_variance: of the residuals within cells. extra:
    (C, K) columns that were fitted besides the plane.
    """

    uv_m: Array
    mean_m: Array
    count: Array
    index: npt.NDArray[np.int64]
    side_m: float
    white_variance: float
    extra: Array | None = None

    @property
    def slopes(self) -> Array:
        """Derivatives (C, 3 + K) of each mean by a height, two tilts and the further columns."""
        plane = np.column_stack([np.ones(len(self.uv_m)), self.uv_m])
        return plane if self.extra is None else np.hstack([plane, self.extra])


def correlated_noise(
    cells: Cells | None, radius_m: float, spread_m: float, resolution_m: float = 0.0
) -> CorrelatedNoise:
    """Estimate correlated noise in the residuals of a plane, averaged over cells (None: too few).

    radius_m: of the target. spread_m: rms of the residuals. resolution_m: of the coordinates; noise
    below it counts as none.
    Source: REML, Patterson and Thompson, Biometrika 58 (1971) 545; the effective degrees of freedom
    are those of the variance's information.
    """
    nothing = np.zeros((3, 3))
    if cells is None or not cells.white_variance > resolution_m**2:
        return CorrelatedNoise(0.0, 0.0, nothing, nothing, math.inf, spread_m)
    nothing = np.zeros(2 * cells.slopes.shape[1:])
    white = math.sqrt(cells.white_variance)
    rest = _residual_projection(cells)
    if not any(_Field.of(cells, rest, k * radius_m).is_suspect() for k in LENGTHS_OF_RADIUS[::2]):
        return CorrelatedNoise(0.0, 0.0, nothing, nothing, math.inf, white)
    fields = [_Field.of(cells, rest, share * radius_m) for share in LENGTHS_OF_RADIUS]
    fits = [field.maximise() for field in fields]
    gain = np.array([fit.gain for fit in fits])
    if 2.0 * gain.max() < SIGNIFICANT:
        return CorrelatedNoise(0.0, 0.0, nothing, nothing, math.inf, white)
    belief = np.exp(gain - gain.max())
    belief /= belief.sum()
    noise, form = nothing.copy(), nothing.copy()
    for share, field, fit, weight in zip(LENGTHS_OF_RADIUS, fields, fits, belief, strict=True):
        part = noise if share <= FORM_OF_RADIUS else form
        part += weight * fit.variance * field.plane_covariance
    return CorrelatedNoise(
        sigma_m=math.sqrt(float(belief @ [fit.variance for fit in fits])),
        length_m=math.exp(float(belief @ [math.log(field.length_m) for field in fields])),
        covariance=noise,
        form_covariance=form,
        dof=float(belief @ [fit.dof for fit in fits]),
        white_sigma_m=white,
    )


def cells_across(points: int) -> int:
    """Return the number of cells along the raster's side for that many points on a target."""
    return int(np.clip(math.sqrt(points / POINTS_A_CELL), 1, CELLS))


def cells_of(sums: Array, across: int, side_m: float) -> Cells | None:
    """Return the filled cells of a raster, from sums (across^2, 10) of n, u .. w, uu .. ww.

    Order of the sums: n, u, v, w, uu, uv, vv, uw, vw, ww; u, v about the centroid; w: the residual.
    None where too few cells are filled.
    """
    count = sums[:, 0]
    full = count > max(2.0, 0.2 * float(count.max()))
    if np.count_nonzero(full) < MIN_CELLS:
        return None
    n = count[full]
    u, v, mean = (sums[full, axis] / n for axis in (1, 2, 3))
    within = float(np.sum(sums[full, 9] - n * mean**2) / np.sum(n - 1.0))
    index = np.stack([np.flatnonzero(full) % across, np.flatnonzero(full) // across], axis=1)
    return Cells(np.stack([u, v], axis=1), mean, n, index, side_m, within)


def _residual_projection(cells: Cells) -> Array:
    """Return (C-3-K, C), which whitens the means and projects them onto what no fit explains."""
    root = np.sqrt(cells.count)
    basis, _ = np.linalg.qr(cells.slopes * root[:, None], mode="complete")
    return np.asarray(
        basis[:, cells.slopes.shape[1] :].T * (root / math.sqrt(cells.white_variance))
    )


@dataclass(frozen=True)
class _Maximum:
    """Maximum of the likelihood. variance: s^2 there; gain: in log-likelihood over s = 0."""

    variance: float
    gain: float
    dof: float


@dataclass(frozen=True)
class _Field:
    """Field of length L in the whitened residual space of the cells.

    residual: (C-3,) of unit variance if there is no field; kernel: (C-3, C-3) what a field of unit
    variance adds to its covariance; plane_covariance: (3, 3) what it adds to the plane's.
    """

    length_m: float
    residual: Array
    kernel: Array
    plane_covariance: Array

    @classmethod
    def of(cls, cells: Cells, rest: Array, length_m: float) -> _Field:
        """Return the field over these cells; rest: (C-3, C) of `_residual_projection`."""
        kernel = _averaged_kernel(cells, length_m)
        weighted = cells.slopes.T * cells.count
        solve = np.linalg.solve(weighted @ cells.slopes, weighted)
        return cls(length_m, rest @ cells.mean_m, rest @ kernel @ rest.T, solve @ kernel @ solve.T)

    def is_suspect(self) -> bool:
        """Test s = 0 by the score: z'Kz against its mean tr K and variance 2 tr K^2 for white z."""
        score = float(self.residual @ self.kernel @ self.residual) - float(np.trace(self.kernel))
        return score > SUSPECT * math.sqrt(2.0 * float(np.sum(self.kernel**2)))

    def maximise(self) -> _Maximum:
        """Return the s^2 of greatest likelihood, by bisection on its slope in log s^2."""
        values, vectors = np.linalg.eigh(self.kernel)
        values = values.clip(min=0.0)
        square = (vectors.T @ self.residual) ** 2
        low, high = -40.0, 40.0
        scale = 1.0 / max(float(values[-1]), 1e-300)
        for _ in range(60):
            middle = 0.5 * (low + high)
            share = values * scale * math.exp(middle)
            slope = float(np.sum(share / (1.0 + share) * (square / (1.0 + share) - 1.0)))
            low, high = (middle, high) if slope > 0.0 else (low, middle)
        variance = scale * math.exp(0.5 * (low + high))
        share = values * variance
        gain = 0.5 * float(np.sum(square * share / (1.0 + share) - np.log1p(share)))
        dof = float(np.sum((share / (1.0 + share)) ** 2))
        return _Maximum(variance, max(gain, 0.0), max(dof, 1.0))


def _averaged_kernel(cells: Cells, length_m: float) -> Array:
    """Return the covariances (C, C) of the cell means of a field of unit variance.

    exp(-d^2 / (2 L^2)) is a product over the axes, so its mean over two cells is as well. With g
    the second integral of the kernel, the mean over two sides h that lie d apart is
    (g(d + h) - 2 g(d) + g(d - h)) / h^2.
    """
    apart = cells.side_m * np.arange(-1.0, float(cells.index.max()) + 2.0)
    t = apart / (math.sqrt(2.0) * length_m)
    g = apart * math.sqrt(math.pi / 2.0) * length_m * erf(t) + length_m**2 * np.exp(-t * t)
    table = (g[2:] - 2.0 * g[1:-1] + g[:-2]) / cells.side_m**2
    column, row = (np.abs(axis[:, None] - axis[None, :]) for axis in cells.index.T)
    return np.asarray(table[column] * table[row])


def erf(x: Array) -> Array:
    """Return the error function of x (N,), few values; needs no scipy."""
    return np.array([math.erf(value) for value in x])
