"""Axis of the rings between two radii, to convergence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import NotMeasuredError
from ..vectors import Array
from .cell_fit import CellFit, fit_cells
from .cells import CellPoints, Grid
from .meridian import LEAST_IN_CELL, Meridian
from .normal_lines import Axis

SETTLED_RAD = 5e-6
LEAST_RINGS = 3
LEAST_KEPT = 0.5  # of the cells of a ring, below which it is not of revolution


@dataclass(frozen=True)
class AxisFit:
    """Fitted axis, with the evidence.

    basis: (3, 3) rows: the directions from which and towards which angles are counted, and the
    axis. meridian: about it. cells: the last solution.
    """

    axis: Axis
    basis: Array
    meridian: Meridian
    cells: CellFit


def fit_axis(
    points_m: Array, start: Axis, grid: Grid, within_m: tuple[float, float], rounds: int
) -> AxisFit:
    """Fit the axis of points (N, 3) in the rings between two radii.

    Raises NotMeasuredError 'wheel-not-found'.
    """
    axis, basis, meridian = start, start.basis, None
    between = (grid.radius_m > within_m[0]) & (grid.radius_m < within_m[1])
    for _ in range(rounds):
        points = CellPoints.of(points_m, axis, basis, grid)
        meridian = Meridian.of(points) if meridian is None else meridian
        used = between & meridian.usable
        if np.count_nonzero(used) < LEAST_RINGS:
            raise NotMeasuredError(
                "wheel-not-found",
                f"{np.count_nonzero(used)} rings of a wheel are in the scan, {LEAST_RINGS} needed",
            )
        heights = meridian.heights(points.chosen(used[points.ring]))
        if not np.any(heights.count[used] >= LEAST_IN_CELL):
            raise NotMeasuredError("wheel-not-found", "no ring of a wheel holds enough points")
        cells = fit_cells(heights, meridian, used)
        move = cells.step[:4]
        direction = axis.direction + move[:2] @ basis[:2]
        direction /= np.linalg.norm(direction)
        between &= ~used | (cells.kept >= LEAST_KEPT)
        axis = Axis(axis.point_m + move[2:] @ basis[:2], direction)
        basis = _about(basis, direction)
        level = meridian.height_m.copy()
        level[used] += cells.ring_m
        meridian = Meridian(grid, level, meridian.noise_m)
        if float(np.abs(move[:2]).max()) < SETTLED_RAD:
            break
    assert meridian is not None
    return AxisFit(axis, basis, meridian, cells)


def _about(basis: Array, direction: Array) -> Array:
    """Return the basis (3, 3) turned with its third row to `direction`."""
    first = basis[0] - (basis[0] @ direction) * direction
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first), direction])
