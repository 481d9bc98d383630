"""Steps in which coordinates were rounded, found from the coordinates themselves.

Rounded coordinates are multiples of a step but for the precision of the numbers: decimals of a
text, the scale of a LAS or E57 file, or the last bit of float32, which depends on the coordinate.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from ..system import frozen
from ..units import LENGTH_UNITS, in_metres
from ..vectors import Array, Mask, Rows, fraction

ROWS = 4096  # points that are looked at
LEVEL_ROWS = 20_000  # the same for irregular levels
BESIDE = 2  # levels on each side, whose distances are alike
SQUARE = 0.97  # cosine of a plane's normal to an axis, from which it lies along its levels
GOLDEN = 0.6180339887498949  # their rows: multiples of it, modulo 1, meet no period of a raster
NEARBY_M = 0.5  # along an axis: farther away float32 has other steps
CLOSE_M = 0.05  # the same where float32 changes its step nearby
ENOUGH = 200  # points nearby, below which all are looked at
PRECISION = 16.0  # units in the last place of a coordinate, within which two values are one
CLEAR = 8.0  # times the precision: the least step that is believed
DIVISORS = range(1, 11)  # of the shortest distance of two values: one of them is the step
COMPARED = (3.0, 10.0, 40.0)  # of the shortest distance: longer ones prove nothing
ON_GRID, OFF_GRID = 0.98, 0.1  # share of multiples of the step; how far off they may be
MANY_GAPS, OFF_GRID_OF_FEW = 12, 0.02  # fewer distances must be nearer to multiples
FEW_VALUES = 6  # of an axis, from which no step is inferred
OFTEN = 10.0  # points a value, from which its distance from the next one is a step
NEXT = 0.1  # share of such values whose next one is as near
RASTER = 50.0  # steps along two axes, of that along the third: positions of a raster
LEAST_PITCH_M = 1e-5  # of a raster
FILLED = 0.9  # share of a raster's positions that hold a point
WINDOW = 40.0  # steps: half the width in which that is counted


@frozen(eq=False)
class Steps:
    """Steps of rounded coordinates: step_m (3,), 0 where exact, along axes (3, 3), rows."""

    step_m: Array = field(default_factory=lambda: np.zeros(3))
    axes: Array = field(default_factory=lambda: np.eye(3))

    def along(self, direction: Array) -> Array:
        """Return the three steps' parts (..., 3) along a unit vector (..., 3)."""
        return np.asarray(np.abs(direction @ self.axes.T) * self.step_m)

    def across(self, normal: Array) -> Array:
        """Return the distance (...) along unit vectors (..., 3) that rounding may span."""
        return np.asarray(self.along(normal).sum(axis=-1))


EXACT = Steps()


def coordinate_steps(
    points_m: Array, about_m: Array | None = None, axes: Array | None = None
) -> Steps:
    """Find the steps of points_m (N, 3) near about_m (3,), by default their median.

    axes: (3, 3) rows along which the coordinates were rounded, those of a scan before its pose was
    applied; by default the points' own. An axis of few values, as where a face is square to it,
    has the coarsest step of the others, or of float32. A raster's positions, coarse along two axes
    and fine along the third or filled one by one, were not rounded; few values along its third have
    the distance between them, unless they are as far apart as its positions: surfaces.
    """
    axes = np.eye(3) if axes is None else axes
    if not len(points_m):
        return Steps(axes=axes)
    some = points_m[scattered(len(points_m))] @ axes.T
    about = np.median(some, axis=0) if about_m is None else axes @ about_m
    precision = float(np.spacing(np.abs(some).max(initial=0.0)))
    found = [_local_step(values, at, precision) for values, at in zip(some.T, about, strict=True)]
    step_m = np.array([np.nan if step is None else step for step in found])
    raster = _raster_axes(step_m, points_m, axes, about)
    if raster.any():
        pitch_m = float(np.nanmax(step_m))
        few_m = [_few_step(_near(*one), pitch_m) for one in zip(some.T, about, strict=True)]
        step_m = np.where(raster, 0.0, np.where(np.isnan(step_m), few_m, step_m))
    coarsest = float(np.nanmax(step_m, initial=0.0))
    for axis in np.flatnonzero(np.isnan(step_m)):
        step_m[axis] = max(coarsest, _single_step(some.T[axis]))
    return Steps(step_m, axes)


def level_step(values: Array, precision: float) -> float | None:
    """Return the step of values (N,) along one axis, 0 if they are exact; None of few values.

    precision: unit in the last place of the coordinates.
    """
    level = np.unique(values)
    if len(level) < FEW_VALUES:
        return None
    single = float(np.spacing(np.float32(np.abs(level).max())))
    step = _grid_step(level, single) or _grid_step(level, PRECISION * precision)
    if len(values) < OFTEN * len(level):
        return step
    gaps = np.diff(level)
    return max(step, float(np.quantile(np.minimum(gaps[1:], gaps[:-1]), NEXT)))


@frozen(eq=False)
class Levels:
    """Values that coordinates have along each axis, and the distance to the nearest other one.

    They are those of rounding, of a raster's rows or of profiles. value_m, gap_m: for each axis,
    (L,) each; empty where the coordinates are exact.
    """

    value_m: tuple[Array, ...]
    gap_m: tuple[Array, ...]

    def beside(self, point_m: Array, normal: Array) -> float:
        """Return the distance between levels at a plane through point_m (3,) nearly along them.

        0 for a plane with another normal (3,): it crosses so many that they make it noisy alone.
        """
        axis = int(np.argmax(np.abs(normal)))
        value, gap = self.value_m[axis], self.gap_m[axis]
        if not len(value) or abs(float(normal[axis])) < SQUARE:
            return 0.0
        return float(np.interp(point_m[axis], value, gap))


def coordinate_levels(points_m: Array, most_m: float) -> Levels:
    """Find the levels of points_m (N, 3), unless they are more than most_m apart, as a rule."""
    some = points_m[scattered(len(points_m), LEVEL_ROWS)]
    precision = float(np.spacing(np.abs(some).max(initial=0.0)))
    few_m = coordinate_steps(points_m).step_m
    found = [level_step(values, precision) for values in some.T]
    step_m = [few if step is None else step for few, step in zip(few_m, found, strict=True)]
    gaps = [
        _gaps(values, step) if 0.0 < step <= most_m else (np.zeros(0), np.zeros(0))
        for values, step in zip(some.T, step_m, strict=True)
    ]
    return Levels(tuple(value for value, _ in gaps), tuple(gap for _, gap in gaps))


def _gaps(values: Array, step: float) -> tuple[Array, Array]:
    """Return the levels (L,) of values (N,) and their distances; of few points a level, the step.

    The distance at a level is the median of those at it and at the next ones on both sides.
    """
    level = np.unique(values)
    if len(level) < FEW_VALUES or len(values) < OFTEN * len(level):
        return level[:1], np.array([step])
    gap = np.pad(np.diff(level), 1, mode="edge")
    nearest = np.pad(np.minimum(gap[1:], gap[:-1]), BESIDE, mode="edge")
    about = np.lib.stride_tricks.sliding_window_view(nearest, 2 * BESIDE + 1)
    return level, np.median(about, axis=1)


def scattered(count: int, most: int = ROWS) -> Rows:
    """Return rows of `count`, `most` at most, in the order of a sequence without a period."""
    if count <= most:
        return np.arange(count)
    return np.asarray((fraction(np.arange(most) * GOLDEN) * count).astype(np.int64))


def _local_step(values: Array, about: float, precision: float) -> float | None:
    """Return the step of the values (N,) near a coordinate."""
    step = level_step(_near(values, about), precision)
    if not step:
        return step
    single = _single_step(values[np.abs(values - about) < CLOSE_M])
    return single if abs(single - 2.0 * step) < OFF_GRID * step else step


def _near(values: Array, about: float) -> Array:
    """Return the values (N,) near a coordinate, or all where those are few."""
    near = values[np.abs(values - about) < NEARBY_M]
    return near if len(near) >= ENOUGH else values


def _few_step(values: Array, pitch_m: float) -> float:
    """Return the least distance between few values (N,); 0 of one, or beyond pitch_m."""
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > CLEAR * np.spacing(np.abs(values).max())]
    step = float(gaps.min(initial=np.inf))
    return step if step <= pitch_m else 0.0


def _grid_step(level: Array, same: float) -> float:
    """Return the step of which the distances of sorted values are multiples; 0 if there is none.

    same: distance within which two values are one.
    """
    gaps = np.diff(level)
    gaps = gaps[gaps > 2.0 * same]
    if len(gaps) < FEW_VALUES - 1:
        return 0.0
    for divisor in DIVISORS:
        step = float(gaps.min()) / divisor
        if step < CLEAR * same:
            return 0.0
        for most in COMPARED:
            short = gaps[gaps < most * divisor * step]
            step = float(np.sum(short) / np.sum(np.rint(short / step)))
        off = np.abs(short / step - np.rint(short / step))
        most_off = OFF_GRID if len(short) >= MANY_GAPS else OFF_GRID_OF_FEW
        if len(short) >= FEW_VALUES - 1 and np.mean(off < most_off) >= ON_GRID:
            return step
    return 0.0


def _single_step(values: Array) -> float:
    """Return the step of float32 at values (N,) that all are float32 in some unit; 0 otherwise."""
    for unit_m in (in_metres(1.0, unit) for unit in LENGTH_UNITS):
        single = (values / unit_m).astype(np.float32)
        if np.allclose(single * np.float64(unit_m), values, rtol=1e-14, atol=0.0):
            return float(np.spacing(np.abs(single).max(initial=0.0))) * unit_m
    return 0.0


def _raster_axes(step_m: Array, points_m: Array, axes: Array, about: Array) -> Mask:
    """Return which axes (3,) are those of a raster; step_m: (3,), nan where unknown."""
    coarse = step_m > LEAST_PITCH_M
    unknown = bool(np.isnan(step_m).any())
    if not unknown:
        coarse &= step_m > RASTER * step_m.min()
    if np.count_nonzero(coarse) != 2:
        return np.zeros(3, dtype=bool)
    if unknown:
        is_raster = _is_filled(points_m @ axes[coarse].T, about[coarse], step_m[coarse])
    else:
        is_raster = not _is_single(step_m[coarse], about[coarse])
    return np.asarray(coarse & is_raster)


def _is_single(step_m: Array, about_m: Array) -> bool:
    """Return whether steps (2,) are those of float32 at about_m (2,): 2^-24 to 2^-23 of it."""
    share = step_m / np.maximum(np.abs(about_m), 1e-300)
    return bool(((share > 0.9 * 2.0**-24) & (share < 1.1 * 2.0**-23)).all())


def _is_filled(uv_m: Array, about_m: Array, step_m: Array) -> bool:
    """Return whether nearly every position of a raster about about_m (2,) holds one of uv_m (N, 2).

    Rounded points leave positions empty, or share them.
    """
    ticks = np.rint((uv_m - uv_m[0]) / step_m).astype(np.int64)
    near = np.abs(uv_m - about_m) < WINDOW * step_m
    ticks = ticks[near.all(axis=1)]
    if len(ticks) < FEW_VALUES:
        return False
    places = len(np.unique(ticks, axis=0))
    return bool(places == len(ticks) > FILLED * np.prod(np.ptp(ticks, axis=0) + 1.0))
