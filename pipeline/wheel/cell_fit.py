"""Motion of an axis and run-out, from heights over a meridian that is free in height.

The height of a point at radius r over a meridian f, seen about an axis that is tilted by (s, t) and
shifted by (x, y) along two axes across it, is

    f(r) - (r + f' z)(s cos + t sin) - f' (x cos + y sin)

to first order, with cos and sin of its angle. Run-out of the second and third harmonic, lateral and
radial, adds a cos k + b sin k and -f' (c cos k + d sin k). The height of each ring is free.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask
from .cells import Heights
from .meridian import Meridian

HARMONICS = (2, 3)
MOTION = 4  # parameters of tilt and shift, before those of the harmonics
TUKEY = 4.0
ROUNDS = 8
MEDIAN_OF_SQUARE = 0.4549  # of a unit normal variable
SECTOR_PARTS, RING_PARTS = 24, 6
SAMPLED, HALVINGS = 2000, 14  # cells and steps by which their spread is found


@frozen(eq=False)
class CellFit:
    """Solution over the cells of the rings used.

    step: (P,) tilt s, t, shift x, y, then the harmonics. ring_m: (R,) heights added to the
    meridian. used: (rings,) those rings. y_m, rows, weight: (R, sectors), (R, sectors, P), (R,
    sectors) heights, their derivatives, and weights, 0 where rejected. white_m2: (R, sectors)
    variance of independent noise. excess_m: spread of the cells beyond that noise, on the level;
    steep: (R, sectors) its square on a slope over that on the level.
    """

    step: Array
    ring_m: Array
    used: Mask
    y_m: Array
    rows: Array
    weight: Array
    count: Array
    white_m2: Array
    excess_m: float
    steep: Array

    @property
    def residual_m(self) -> Array:
        """Heights (R, sectors) over the fitted surface."""
        return np.asarray(self.y_m - self.ring_m[:, None] - self.rows @ self.step)

    @property
    def kept(self) -> Array:
        """Share (rings,) of the cells of each ring that was kept; 0 where it was not used."""
        share = np.zeros(len(self.used))
        share[self.used] = np.mean(self.weight > 0.0, axis=1)
        return share

    @property
    def ring_u_m(self) -> Array:
        """Standard uncertainty (rings,) of the height of each ring used, by the noise; else NaN."""
        known = np.full(len(self.used), np.nan)
        seen = self.weight > 0.0
        count = np.maximum(seen.sum(axis=1), 1)
        variance = np.where(seen, self.white_m2 + self.excess_m**2, 0.0).sum(axis=1)
        known[self.used] = np.sqrt(variance) / count
        return known

    @property
    def white_covariance(self) -> Array:
        """Covariance (4, 4) of tilt and shift by independent noise."""
        return self._by_cells(self.white_m2)

    def _by_cells(self, variance_m2: Array) -> Array:
        """Return the covariance (4, 4) of tilt and shift by variances (R, sectors) of cells."""
        solved = _Normal.of(self.rows, self.weight)
        moved = solved.centred * self.weight[:, :, None]
        step = solved.sandwich(np.einsum("rsp,rs,rsq->pq", moved, variance_m2, moved))
        return step[:MOTION, :MOTION]

    @property
    def covariance(self) -> Array:
        """Covariance (4, 4) of tilt and shift by the scatter of the residuals, whatever its cause.

        Parts of the circle are left out one by one (jackknife), which shows what is alike within a
        part: noise that is correlated, waves, lettering. Likewise groups of neighbouring rings,
        whose axes differ where edges and steep flanks shift them. Independent noise, which both
        show, is counted once; the covariance is never less than by the spread of single cells. The
        harmonics are left out of it: the more parameters, the more of the larger of two scattering
        covariances is chance (u 8 % to 20 % too large, with them).
        Source: clustering in two ways, Cameron, Gelbach and Miller, J. Bus. Econ. Stat. 29 (2011)
        238.
        """
        both = positive(self._by_sectors + self._by_rings - self.white_covariance)
        return both + positive(self._by_cells(self.white_m2 + self.excess_m**2 * self.steep) - both)

    @property
    def dof(self) -> float:
        """Effective degrees of freedom of that covariance's tilts (Welch and Satterthwaite)."""
        parts = ((self._by_sectors, SECTOR_PARTS - 1.0), (self._by_rings, RING_PARTS - 1.0))
        sizes = [float(np.trace(part[:2, :2])) for part, _ in parts]
        loss = sum(size**2 / dof for size, (_, dof) in zip(sizes, parts, strict=True))
        return sum(sizes) ** 2 / loss if loss > 0.0 else SECTOR_PARTS - 1.0

    @cached_property
    def _by_sectors(self) -> Array:
        part = np.arange(self.weight.shape[1]) * SECTOR_PARTS // self.weight.shape[1]
        return self._jackknife(part[None, :] == k for k in range(SECTOR_PARTS))

    @cached_property
    def _by_rings(self) -> Array:
        part = np.arange(self.weight.shape[0]) * RING_PARTS // self.weight.shape[0]
        return self._jackknife(part[:, None] == k for k in range(RING_PARTS))

    def _jackknife(self, parts: Iterable[Mask]) -> Array:
        steps = []
        for part in parts:
            without = np.where(part, 0.0, self.weight)
            if np.any(without != self.weight) and np.any(without):
                steps.append(_Normal.of(self.rows, without).solve(self.y_m)[0])
        if len(steps) < 3:
            return np.zeros((MOTION, MOTION))
        off = (np.stack(steps) - self.step)[:, :MOTION]
        return np.asarray((len(steps) - 1.0) / len(steps) * off.T @ off)


def fit_cells(heights: Heights, meridian: Meridian, used: Mask) -> CellFit:
    """Fit tilt, shift and harmonics to heights over the meridian in the rings used (rings,).

    Cells are weighted by their noise and by what spreads them beyond it, which is estimated from
    them all, and those far off are rejected by Tukey's function.
    """
    y, count = heights.mean_m[used], heights.count[used]
    seen = count >= meridian.grid.least
    rows = _columns(meridian, used)
    steep = 1.0 + meridian.slope[used][:, None] ** 2 + np.zeros_like(y)
    white = meridian.noise_m[used][:, None] ** 2 / np.maximum(count, 1.0)
    ring = np.array([np.median(r[s]) if s.any() else 0.0 for r, s in zip(y, seen, strict=True)])
    rest, excess = y - ring[:, None], 0.0
    for _ in range(ROUNDS):
        excess = _excess(rest[seen], white[seen], steep[seen])
        variance = white + excess**2 * steep
        size = np.minimum(np.abs(rest) / (TUKEY * np.sqrt(variance)), 1.0)
        weight = np.where(seen, (1.0 - size**2) ** 2 / variance, 0.0)
        step, ring = _Normal.of(rows, weight).solve(y)
        rest = y - ring[:, None] - rows @ step
    return CellFit(step, ring, used, y, rows, weight, count, white, excess, steep)


def _columns(meridian: Meridian, used: Mask) -> Array:
    """Return the derivatives (R, sectors, P) of the heights."""
    grid = meridian.grid
    radius, slope = grid.radius_m[used], meridian.slope[used]
    lever = -(radius + slope * meridian.height_m[used])[:, None]
    flat, steep = np.ones_like(lever), -slope[:, None]
    parts = []
    for k in (1, *HARMONICS):
        cos, sin = np.cos(k * grid.angle), np.sin(k * grid.angle)
        lateral = lever if k == 1 else flat
        parts += [lateral * cos, lateral * sin, steep * cos, steep * sin]
    return np.stack(parts, axis=-1)


def _excess(rest: Array, white: Array, steep: Array) -> float:
    """Return the spread of cells beyond their noise, by the median of their squares."""
    some = slice(None, None, 1 + len(rest) // SAMPLED)
    square, white, steep = rest[some] ** 2, white[some], steep[some]
    low, high = 0.0, 3.0 * float(np.sqrt(np.median(square))) + 1e-9
    half = len(square) // 2
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        share = square < MEDIAN_OF_SQUARE * (white + middle**2 * steep)
        low, high = (low, middle) if np.count_nonzero(share) > half else (middle, high)
    return high


@frozen(eq=False)
class _Normal:
    """Normal equations without the rings' heights.

    centred: (R, sectors, P) derivatives less their ring's mean, which is `mean` (R, P).
    """

    centred: Array
    mean: Array
    weight: Array
    inverse: Array

    @classmethod
    def of(cls, rows: Array, weight: Array) -> _Normal:
        total = np.maximum(weight.sum(axis=1), 1e-300)
        mean = np.einsum("rs,rsp->rp", weight, rows) / total[:, None]
        centred = rows - mean[:, None, :]
        size = rows.shape[2]
        flat = (centred * np.sqrt(weight)[:, :, None]).reshape(-1, size)
        matrix = flat.T @ flat
        known = np.diag(matrix)
        scale = np.sqrt(np.where(known > 0.0, known, 1.0))
        inverse = np.linalg.inv(matrix / np.outer(scale, scale) + 1e-9 * np.eye(size))
        return cls(centred, mean, weight, inverse / np.outer(scale, scale))

    def solve(self, y_m: Array) -> tuple[Array, Array]:
        """Return the step (P,) and the heights (R,) of the rings."""
        total = np.maximum(self.weight.sum(axis=1), 1e-300)
        mean_y = (self.weight * y_m).sum(axis=1) / total
        off = self.weight * (y_m - mean_y[:, None])
        step = self.inverse @ np.einsum("rsp,rs->p", self.centred, off)
        return step, mean_y - self.mean @ step

    def sandwich(self, middle: Array) -> Array:
        """Return the covariance (P, P) by the variance `middle` of the right-hand side."""
        return np.asarray(self.inverse @ middle @ self.inverse)


def root_of(covariance: Array) -> Array:
    """Return F with F F^T the nearest covariance without negative variances."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(covariance)), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(values.clip(min=0.0)))


def positive(covariance: Array) -> Array:
    """Return the nearest covariance without negative variances."""
    root = root_of(covariance)
    return np.asarray(root @ root.T)
