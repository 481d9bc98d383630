"""Missing returns that a format cannot mark: points at one place or on one plane, and nowhere else.

Scanners write a beam without a return as 0 0 0, -9999, 1e30 or the end of their range. No noisy
surface puts many points at exactly one place, nor on exactly one plane.
"""

from __future__ import annotations

import numpy as np

from ..cloud import coordinate_steps
from ..system import frozen
from ..vectors import Array, Mask

ROWS = 8192  # points that are looked at
GOLDEN = 0.6180339887498949  # their rows: multiples of it, modulo 1, meet no period of a raster
SAME_M = 1e-6  # a pose that is applied block by block moves a place by less
LEAST = 10  # points at one place
OUTSTANDING = 4  # times as many points as the next place, or the next value of an axis
PLANE_SHARE = 0.01  # of the points, at least, that have one value of an axis
FAR = 3.0  # times as far from all others as these reach
FINE_M = 1e-6  # coarser steps of rounded coordinates may put a surface on one plane
MOST_NEAR = 50_000  # points among which neighbours are sought
SEEDS, NEIGHBOURS = 32, (8, 24)  # neighbourhoods by which the noise of the others is known
ROUGH = 0.5  # rms across few neighbours over that across many: a smooth surface has a third
HUGE = 1e10  # powers of ten from here on, and the largest numbers, are no coordinates


@frozen(eq=False)
class Markers:
    """Places (P, 3), and values along axes, that mark missing returns; metres."""

    places_m: Array
    planes: tuple[tuple[int, float], ...] = ()

    def __bool__(self) -> bool:
        return bool(len(self.places_m) or self.planes)

    def mask(self, points_m: Array) -> Mask:
        """Return which of points_m (N, 3) are missing returns."""
        missing = np.zeros(len(points_m), dtype=bool)
        for place in self.places_m:
            near = np.flatnonzero(np.abs(points_m[:, 0] - place[0]) < SAME_M)
            missing[near[(np.abs(points_m[near] - place) < SAME_M).all(axis=1)]] = True
        for axis, value in self.planes:
            missing |= points_m[:, axis] == value
        return missing


def find_markers(points_m: Array) -> Markers:
    """Find the places and planes of points_m (N, 3) that mark missing returns."""
    rows = (np.arange(min(len(points_m), ROWS)) * GOLDEN % 1.0 * len(points_m)).astype(np.int64)
    some = points_m[rows if len(points_m) > ROWS else slice(None)]
    markers = Markers(_places(some, points_m))
    rest = some[~markers.mask(some)]
    planes = tuple((axis, value) for axis in range(3) for value in _plane(rest, axis, points_m))
    found = Markers(markers.places_m, planes)
    return found if not found.mask(some).all() else Markers(np.zeros((0, 3)))


def is_huge(values: Array) -> Mask:
    """Return which values are numbers that stand for none: 1e30, or the largest of float32."""
    size = np.abs(values)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        exponent = np.rint(np.log10(size))
        power = np.abs(size - 10.0**exponent) < 1e-6 * size
    largest = np.isin(size, [float(np.finfo(np.float32).max), float(np.finfo(np.float64).max)])
    return np.asarray(((size >= HUGE) & power) | largest)


def _places(some: Array, points_m: Array) -> Array:
    """Return the places (P, 3) where more of `some` (S, 3) lie than noise puts anywhere."""
    place, count = np.unique(np.rint(some / SAME_M), axis=0, return_counts=True)
    order = np.argsort(-count)
    count = np.append(count[order], 1)
    chosen = np.flatnonzero(count[:-1] >= OUTSTANDING * count[1:])
    places = place[order[: chosen[-1] + 1]] * SAME_M if len(chosen) else np.zeros((0, 3))
    kept = [at for at in places if np.count_nonzero(Markers(at[None]).mask(points_m)) >= LEAST]
    return np.array(kept).reshape(-1, 3)


def _plane(some: Array, axis: int, points_m: Array) -> list[float]:
    """Return the value of an axis, if any, that marks missing returns among `some` (S, 3)."""
    values, count = np.unique(some[:, axis], return_counts=True)
    if len(values) < 2:
        return []
    most = int(np.argmax(count))
    marked, next_most = int(count[most]), int(np.delete(count, most).max())
    if marked < max(LEAST, PLANE_SHARE * len(some), OUTSTANDING * next_most):
        return []
    value, others = float(values[most]), some[some[:, axis] != values[most]]
    off = np.abs(others[:, axis] - value)
    if off.min() > FAR * float(np.linalg.norm(np.ptp(others, axis=0))):
        return [value]
    exact = not coordinate_steps(others).step_m[axis] > FINE_M
    return [value] if exact and _are_noisy(others, points_m) else []


def _are_noisy(others: Array, points_m: Array) -> bool:
    """Return whether the surfaces of the others (S, 3) among points_m (N, 3) are noisy, not smooth.

    Of a made scene without noise, an exact plane is a surface like all others. So it is where the
    points are too few to show their noise.
    """
    points_m = points_m[:: 1 + len(points_m) // MOST_NEAR]
    if len(points_m) <= NEIGHBOURS[1]:
        return False
    found = []
    for seed in others[:: max(1, len(others) // SEEDS)][:SEEDS]:
        square = np.sum((points_m - seed) ** 2, axis=1)
        near = points_m[np.argpartition(square, NEIGHBOURS[1])[: NEIGHBOURS[1]]]
        near = near[np.argsort(np.sum((near - seed) ** 2, axis=1))]
        found.append([_across(near[:count]) for count in NEIGHBOURS])
    few, many = np.median(np.array(found), axis=0)
    return bool(few > ROUGH * many)


def _across(points_m: Array) -> float:
    """Return the rms distance of points_m (N, 3) from their plane."""
    spread = np.linalg.svd(points_m - points_m.mean(axis=0), compute_uv=False)
    dof = len(points_m) - 3
    rms = float(spread[2]) / dof**0.5
    return rms if rms > 1e-9 * float(np.abs(points_m).max()) else 0.0
