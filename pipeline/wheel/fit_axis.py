"""Axis of the rings between two radii, to convergence."""

from __future__ import annotations

import numpy as np

from ..errors import NotMeasuredError
from ..system import frozen
from ..vectors import Array
from .cell_fit import CellFit, fit_cells
from .cells import CellPoints, Grid
from .meridian import Meridian
from .normal_lines import Axis

SETTLED_RAD, ROUNDS, STARTS = 2e-5, 20, 6
LEVER_M = 0.2  # of a tilt, beside a shift
BACK = 0.6  # of a step that turns back, and of those after it; of tilt and shift by themselves
LEAST_RINGS = 3
LEAST_KEPT = 0.5  # of the cells of a ring, below which it is not of revolution


@frozen(eq=False)
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
    points_m: Array,
    start: Axis,
    grid: Grid,
    within_m: tuple[float, float],
    settled_rad: float = SETTLED_RAD,
) -> AxisFit:
    """Fit the axis of points (N, 3) in the rings between two radii.

    settled_rad: last tilt after which it ends, and with LEVER_M the last shift. From a start far
    aside it begins again where it ended: the meridian was smeared, and rings of revolution were
    left out. Raises NotMeasuredError 'wheel-not-found'.
    """
    for _ in range(STARTS):
        found = _settled(points_m, start, grid, within_m, settled_rad)
        if _distance_m(start, found.axis) < grid.width_m:
            break
        start = found.axis
    return found


def _distance_m(one: Axis, other: Axis) -> float:
    """Return how far apart two axes are at the wheel, and at LEVER_M aside by their tilt."""
    apart = other.point_m - one.point_m
    apart = apart - (apart @ one.direction) * one.direction
    tilt = np.linalg.norm(np.cross(one.direction, other.direction))
    return float(max(np.linalg.norm(apart), LEVER_M * tilt))


def _settled(
    points_m: Array, start: Axis, grid: Grid, within_m: tuple[float, float], settled_rad: float
) -> AxisFit:
    """Return the axis to which steps from a start lead."""
    axis, basis, meridian = start, start.basis, None
    share, last = np.ones(2), np.zeros((2, 2))
    between = (grid.radius_m > within_m[0]) & (grid.radius_m < within_m[1])
    for _ in range(ROUNDS):
        points = CellPoints.of(points_m, axis, basis, grid)
        meridian = Meridian.of(points) if meridian is None else meridian
        used = between & meridian.usable
        if np.count_nonzero(used) < LEAST_RINGS:
            raise NotMeasuredError(
                "wheel-not-found",
                f"{np.count_nonzero(used)} rings of a wheel are in the scan, {LEAST_RINGS} needed",
            )
        heights = meridian.heights(points.chosen(used[points.ring]))
        if not np.any(heights.count[used] >= grid.least):
            raise NotMeasuredError("wheel-not-found", "no ring of a wheel holds enough points")
        cells = fit_cells(heights, meridian, used)
        moves = cells.step[:4].reshape(2, 2)  # tilt, shift
        share *= np.where(np.sum(moves * last, axis=1) >= 0.0, 1.0, BACK)
        last = share[:, None] * moves
        direction = axis.direction + last[0] @ basis[:2]
        direction /= np.linalg.norm(direction)
        between &= ~used | (cells.kept >= LEAST_KEPT)
        axis = Axis(axis.point_m + last[1] @ basis[:2], direction)
        basis = _about(basis, direction)
        level = meridian.height_m.copy()
        level[used] += cells.ring_m
        meridian = Meridian(grid, level, meridian.noise_m)
        tilt, shift_m = np.abs(last).max(axis=1)
        if tilt < settled_rad and shift_m < LEVER_M * settled_rad:
            break
    assert meridian is not None
    return AxisFit(axis, basis, meridian, cells)


def _about(basis: Array, direction: Array) -> Array:
    """Return the basis (3, 3) turned with its third row to `direction`."""
    first = basis[0] - (basis[0] @ direction) * direction
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first), direction])
