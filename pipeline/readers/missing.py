"""Missing returns that a format cannot mark: points at one place or on one plane, and nowhere else.

Scanners write a beam without a return as 0 0 0, -9999, 1e30 or the end of their range. No noisy
surface puts many points at exactly one place, nor on exactly one plane.
"""

from __future__ import annotations

import numpy as np

from ..cloud import coordinate_hash, coordinate_steps
from ..system import frozen
from ..vectors import Array, Mask, Rows, fraction

ROWS = 1 << 14  # points that are looked at, at most
GOLDEN = 0.6180339887498949  # which half of a run: multiples of it, modulo 1, have no period
SAME_M = 1e-6  # a pose that is applied block by block moves a place by less
LEAST = 10  # points at one place
OUTSTANDING = 4  # times as many points as the next place, or the next value of an axis
PLANE_SHARE = 0.01  # of the points, at least, that have one value of an axis
FAR = 3.0  # times as far from all others as these reach
FINE_M = 1e-6  # coarser steps of rounded coordinates may put a surface on one plane
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


class LookedAt:
    """Collector of those of successive valid points by which marks are found.

    They are `points_m[rows_looked_at(0, N, N)]` of all N points, however these came in blocks.
    """

    def __init__(self) -> None:
        self._seen = 0
        self._rows: list[Rows] = []
        self._points: list[Array] = []

    def add(self, points_m: Array) -> None:
        """Look at the next points (N, 3)."""
        start, self._seen = self._seen, self._seen + len(points_m)
        rows = rows_looked_at(start, self._seen, self._seen)
        self._rows.append(rows)
        self._points.append(points_m[rows - start])

    def points_m(self) -> Array:
        """Return the points (S, 3)."""
        chosen = np.isin(
            np.concatenate([np.zeros(0, np.int64), *self._rows]),
            rows_looked_at(0, self._seen, self._seen),
        )
        return np.asarray(np.concatenate([np.zeros((0, 3)), *self._points])[chosen])


def rows_looked_at(start: int, stop: int, count: int) -> Rows:
    """Return the rows of start:stop, of `count` in all, by which marks are found: ROWS at most.

    One of each run of a power of two, of whose halves it lies in either: rows of more points are
    among those of fewer, and meet no period of a raster.
    """
    halvings = max(0, -(-count // ROWS) - 1).bit_length()
    rows = np.arange(start >> halvings, -(-stop >> halvings))
    for halving in range(halvings, 0, -1):
        rows = 2 * rows + (fraction((rows + halving) * GOLDEN) < 0.5)
    return np.asarray(rows[(rows >= start) & (rows < stop)])


def find_markers(some_m: Array) -> Markers:
    """Find the places and planes of some_m (S, 3) that mark missing returns."""
    markers = Markers(_places(some_m))
    rest = some_m[~markers.mask(some_m)] if markers else some_m
    planes = tuple((axis, value) for axis in range(3) for value in _plane(rest, axis, some_m))
    found = Markers(markers.places_m, planes)
    return found if not found.mask(some_m).all() else Markers(np.zeros((0, 3)))


def is_huge(values: Array) -> Mask:
    """Return which values are numbers that stand for none: 1e30, or the largest of float32."""
    size = np.abs(values)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        exponent = np.rint(np.log10(size))
        power = np.abs(size - 10.0**exponent) < 1e-6 * size
    largest = np.isin(size, [float(np.finfo(np.float32).max), float(np.finfo(np.float64).max)])
    return np.asarray(((size >= HUGE) & power) | largest)


def _places(some: Array) -> Array:
    """Return the places (P, 3) where more of `some` (S, 3) lie than noise puts anywhere."""
    hashes = coordinate_hash(some)
    ordered = np.sort(hashes)
    shared = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    count = np.searchsorted(ordered, shared, "right") - np.searchsorted(ordered, shared)
    order = np.argsort(-count, kind="stable")
    count = np.append(count[order], 1)
    chosen = np.flatnonzero(count[:-1] >= OUTSTANDING * count[1:])
    last = chosen[-1] + 1 if len(chosen) else 0
    first = [int(np.argmax(hashes == place)) for place in shared[order[:last]]]
    places = np.rint(some[first] / SAME_M) * SAME_M
    kept = [at for at in places if np.count_nonzero(Markers(at[None]).mask(some)) >= LEAST]
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
