"""Meridian of a surface of revolution, free: one height and one slope of each ring."""

from __future__ import annotations

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask
from .cells import CellPoints, Grid, Heights, clipped_means, medians

MOST_SLOPE = 2.5
LEAST_FILLED = 0.4  # of a ring's sectors
CLIP = 3.0  # of the noise of single points about the median of their cell
MAD = 1.4826


@frozen(eq=False)
class Meridian:
    """Heights, slopes and noise of single points, each (rings,); NaN where a ring is unknown."""

    grid: Grid
    height_m: Array
    noise_m: Array

    @property
    def slope(self) -> Array:
        """Slope (rings,) of the height by the radius."""
        return np.asarray(np.gradient(self.height_m, self.grid.width_m))

    @property
    def usable(self) -> Mask:
        """Return the rings (rings,) that are known and not steep."""
        slope = self.slope
        known = np.isfinite(slope) & np.isfinite(self.noise_m) & np.isfinite(self.height_m)
        return np.asarray(known & (np.abs(np.where(known, slope, 0.0)) < MOST_SLOPE))

    @classmethod
    def of(cls, points: CellPoints) -> Meridian:
        """Return the meridian by the medians of the cells of each ring."""
        grid = points.grid
        middle, count = medians(points.cell, points.height_m, grid.cells)
        middle[count < grid.least] = np.nan
        cells = middle.reshape(grid.shape)
        filled = np.mean(np.isfinite(cells), axis=1) >= LEAST_FILLED
        height = np.full(grid.rings, np.nan)
        height[filled] = np.nanmedian(cells[filled], axis=1)
        off = np.abs(points.height_m - middle[points.cell])
        known = np.isfinite(off)
        spread, _ = medians(points.ring[known], off[known], grid.rings)
        return cls(grid, height, MAD * spread)

    def over(self, points: CellPoints) -> Array:
        """Return the heights (N,) of points over the meridian, straight between its rings."""
        known = np.isfinite(self.height_m)
        radius = self.grid.radius_m[known]
        return np.asarray(
            points.height_m - np.interp(points.radius_m, radius, self.height_m[known])
        )

    def heights(self, points: CellPoints) -> Heights:
        """Return the mean heights over the meridian, by cells, without outliers in a cell."""
        over, sectors = self.over(points), self.grid.sectors
        middle, _ = medians(points.cell, over, self.grid.cells)
        noise = np.where(np.isfinite(self.noise_m), self.noise_m, 0.0)
        return clipped_means(points, over, middle, CLIP * np.repeat(noise, sectors))
