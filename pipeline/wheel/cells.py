"""Points about an axis, and their mean heights over a meridian by cells of radius and angle."""

from __future__ import annotations

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask, Rows
from .normal_lines import Axis

QUANTA = 1 << 20  # steps of a value by which points of a cell are sorted


@frozen
class Grid:
    """Rings of equal width about an axis from low_m outwards, each in equal sectors.

    least: points in a cell that counts.
    """

    low_m: float
    width_m: float
    rings: int
    sectors: int
    least: int = 2

    @property
    def radius_m(self) -> Array:
        """Middle radius (rings,) of each ring."""
        return np.asarray(self.low_m + (np.arange(self.rings) + 0.5) * self.width_m)

    @property
    def angle(self) -> Array:
        """Middle angle (sectors,) of each sector."""
        return np.asarray((np.arange(self.sectors) + 0.5) * (2.0 * np.pi / self.sectors))

    @property
    def shape(self) -> tuple[int, int]:
        """Rings and sectors."""
        return self.rings, self.sectors

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.rings * self.sectors


@frozen(eq=False)
class CellPoints:
    """Points in the cells of a grid: cell, radius_m, height_m along the axis, each (N,)."""

    grid: Grid
    cell: Rows
    radius_m: Array
    height_m: Array

    @classmethod
    def of(cls, points_m: Array, axis: Axis, basis: Array, grid: Grid) -> CellPoints:
        """Return points (N, 3) about an axis; angles from basis[0] towards basis[1]."""
        u, v, height = basis @ (points_m - axis.point_m).T
        radius = np.hypot(u, v)
        ring = np.floor((radius - grid.low_m) / grid.width_m).astype(np.int64)
        inside = np.flatnonzero((ring >= 0) & (ring < grid.rings))
        turn = np.arctan2(v[inside], u[inside]) * (grid.sectors / (2.0 * np.pi))
        sector = np.floor(turn).astype(np.int64) % grid.sectors
        return cls(grid, ring[inside] * grid.sectors + sector, radius[inside], height[inside])

    @property
    def ring(self) -> Rows:
        """Ring (N,) of each point."""
        return np.asarray(self.cell // self.grid.sectors)

    def chosen(self, kept: Mask) -> CellPoints:
        """Return the points of a mask (N,)."""
        return CellPoints(self.grid, self.cell[kept], self.radius_m[kept], self.height_m[kept])


@frozen(eq=False)
class Heights:
    """Heights over a meridian by cells, each (rings, sectors).

    mean_m: of the points kept, 0 where there are none; count: of these.
    """

    mean_m: Array
    count: Array


def medians(group: Rows, value: Array, groups: int) -> tuple[Array, Rows]:
    """Return the median of the values (N,) of each group, NaN of empty ones, and their counts.

    To a millionth of the values' range.
    """
    middle = np.full(groups, np.nan)
    count = np.bincount(group, minlength=groups)
    if not len(value):
        return middle, count
    low, high = float(value.min()), float(value.max())
    scale = (QUANTA - 1) / max(high - low, 1e-12)
    key = np.sort(group * QUANTA + ((value - low) * scale).astype(np.int64))
    start = np.cumsum(count) - count
    full = count > 0
    middle[full] = (key[start[full] + count[full] // 2] % QUANTA) / scale + low
    return middle, count


def clipped_means(points: CellPoints, over_m: Array, centre_m: Array, limit_m: Array) -> Heights:
    """Return the means of over_m (N,) within limit_m of centre_m, both (cells,), by cells."""
    grid = points.grid
    near = np.abs(over_m - centre_m[points.cell]) < limit_m[points.cell]
    own = points.cell[near]
    count = np.bincount(own, minlength=grid.cells).astype(float)
    total = np.bincount(own, over_m[near], minlength=grid.cells)
    return Heights((total / np.maximum(count, 1.0)).reshape(grid.shape), count.reshape(grid.shape))
