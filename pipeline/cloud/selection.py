"""Sampling and cropping of a cloud, by compiled kernels or in numpy where none were built.

Both do the same on chunks of one size, so that the number of threads changes no bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ..system import frozen
from ..vectors import CHUNK_ROWS, GRID_PER_M, Array, Array32, Mask, Rows, plane_basis
from .compiled import ChunkRows, kernels
from .threads import ROWS_PER_CHUNK, over_chunks

WHOLE = np.uint64(0xFFFFFFFFFFFFFFFF)
MIX = (np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F), np.uint64(0x165667B19E3779F9))
# Added to a coordinate below 2^51 steps, it leaves the number of steps in the last bits.
ROUNDED = np.float64(1.5 * 2.0**52 / GRID_PER_M)
HASHED_ROWS = 16_384  # their bits and hashes stay in a second-level cache
SHOWING = 16  # of many values, the share that shows where the least ones end
_FINISH, HALF = np.uint64(0xBF58476D1CE4E5B9), np.uint64(32)


def coordinate_hash(points_m: Array) -> npt.NDArray[np.uint64]:
    """Return a hash (N,) of points_m (N, 3), their coordinates rounded to a micrometre.

    Rounding in the file's last digits hardly ever changes it. Odd multipliers, and the finisher of
    Steele et al., OOPSLA 2014.
    """
    compiled = kernels()
    if compiled is not None:
        return compiled.hashes(points_m)
    hashes = np.empty(len(points_m), np.uint64)
    for start in range(0, len(points_m), HASHED_ROWS):
        rows = slice(start, start + HASHED_ROWS)
        bits, h = np.add(points_m[rows], ROUNDED, dtype=np.float64).view(np.uint64), hashes[rows]
        bits -= ROUNDED.view(np.uint64)
        np.multiply(bits[:, 0], MIX[0], out=h)
        h ^= bits[:, 1] * MIX[1]
        h ^= bits[:, 2] * MIX[2]
        h ^= h >> HALF
        h *= _FINISH
        h ^= h >> HALF
    return hashes


def sample(points_m: Array, count: int) -> Array:
    """Return about `count` of points_m (N, 3), or all if they are fewer, as a copy.

    The points with the smallest hashes of their coordinates, in the order of the hash: the same
    points in any order of the file, scattered over the cloud.
    """
    return np.asarray(points_m[sample_rows(points_m, count)])


def sample_rows(points_m: Array, count: int) -> npt.NDArray[np.int64]:
    """Return the rows of points_m (N, 3) that `sample` returns, in its order."""
    total = len(points_m)
    limit = _hash_limit(count / max(total, 1))
    compiled = kernels()

    def chosen(chunk: slice) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint64]]:
        part = points_m[chunk]
        if compiled is not None:
            rows, h = compiled.hash_rows(part, limit)
        else:
            h = coordinate_hash(part)
            rows = np.nonzero(h <= limit)[0]
            h = h[rows]
        return rows + chunk.start, h

    parts = over_chunks(chosen, total)
    if not parts:
        return np.zeros(0, np.int64)
    hashes = np.concatenate([part[1] for part in parts])
    order = np.argsort(hashes)
    if (np.diff(hashes[order]) == 0).any():  # equal hashes: their order may depend on the processor
        order = np.argsort(hashes, kind="stable")
    return np.concatenate([part[0] for part in parts])[order]


def _hash_limit(share: float) -> np.uint64:
    """Return the hash below which that share of all points lies."""
    return WHOLE if share >= 1.0 else np.uint64(int(share * 2.0**64))


def thin(points_m: npt.NDArray[Any], share: float) -> Mask:
    """Return which of points_m (N, 3) belong to that share of all, by their hashes."""
    return np.asarray(coordinate_hash(points_m) <= _hash_limit(share))


@frozen(eq=False)
class Surroundings:
    """Points relative to a target's centre: all near its plane, and those around it.

    face_m: (N, 3). around_m: (M, 3) in single precision, which resolves 30 nm half a metre from the
    centre; after: (M,) how many of face_m stand before each in the cloud, whose order both keep;
    share: of them that was kept. face_intensity, around_intensity: (N,) and (M,), or None.
    """

    face_m: Array
    around_m: Array32
    after: Rows
    share: float
    face_intensity: Array32 | None = None
    around_intensity: Array32 | None = None


def surroundings(
    points_m: Array,
    centre_m: Array,
    normal: Array,
    face: Slab,
    around: Slab,
    most_around: int,
    intensity: Array32 | None = None,
) -> Surroundings:
    """Return points of points_m (N, 3) in the slabs `face` and `around` at centre_m, along normal.

    most_around: number kept of the points in `around` but not in `face`, chosen by their hash.
    """
    compiled = kernels()
    slabs = [np.array([s.reach_m, s.depth_m, s.slope, s.most_m]) for s in (face, around)]
    axes = plane_basis(normal)
    origin = (axes @ centre_m)[:, None]

    def choose(chunk: slice) -> tuple[ChunkRows, ChunkRows]:
        part = points_m[chunk]
        if compiled is not None:
            return compiled.near_plane(part, centre_m, normal, *slabs)
        uvw = axes @ part.T
        uvw -= origin
        u, v, w = uvw
        depth, square = np.abs(w, out=w), np.multiply(u, u, out=u)
        square += np.multiply(v, v, out=v)
        on_face = face.holds(square, depth)
        beside = np.nonzero(around.holds(square, depth) > on_face)[0]
        return np.nonzero(on_face)[0].astype(np.int32), beside.astype(np.int32)

    chosen = over_chunks(choose, len(points_m))
    share = min(1.0, most_around / max(sum(len(beside) for _, beside in chosen), 1))

    def thinned(chunk: slice) -> tuple[ChunkRows, ChunkRows]:
        on_face, beside = chosen[chunk.start // ROWS_PER_CHUNK]
        if compiled is not None:
            return on_face, compiled.thin_rows(points_m[chunk], _hash_limit(share), beside)
        return on_face, beside[thin(points_m[chunk].take(beside, axis=0), share)]

    if share < 1.0:
        chosen = over_chunks(thinned, len(points_m))
    counts = np.array([[len(rows) for rows in both] for both in chosen], np.int64).reshape(-1, 2)
    starts = np.vstack([np.zeros((1, 2), np.int64), np.cumsum(counts, axis=0)])
    face_m = np.empty((starts[-1, 0], 3))
    around_m = np.empty((starts[-1, 1], 3), np.float32)
    after = np.empty(len(around_m), np.int64)
    seen = [None if intensity is None else np.empty(len(m), np.float32) for m in (face_m, around_m)]

    def fill(chunk: slice) -> None:
        number = chunk.start // ROWS_PER_CHUNK
        (a, b), (c, d) = starts[number], starts[number + 1]
        on_face, beside = chosen[number]
        after[b:d] = a + np.searchsorted(on_face, beside)
        places = (on_face, slice(a, c)), (beside, slice(b, d))
        for (rows, place), out, light in zip(places, (face_m, around_m), seen, strict=True):
            if compiled is not None:
                compiled.take(points_m[chunk], centre_m, rows, out[place])
            else:
                np.subtract(points_m[chunk].take(rows, axis=0), centre_m, out=out[place])
            if light is not None and intensity is not None:
                light[place] = intensity[chunk][rows]

    over_chunks(fill, len(points_m))
    return Surroundings(face_m, around_m, after, share, *seen)


def gather_ball(points_m: Array, centre_m: Array, radius_m: float) -> Array:
    """Return the points of points_m (N, 3) within radius_m of centre_m, relative to it: (M, 3)."""
    kept = [np.zeros((0, 3))]
    for start in range(0, len(points_m), CHUNK_ROWS):
        x, y, z = offset = points_m[start : start + CHUNK_ROWS].T - centre_m[:, None]
        near = np.nonzero(x * x + y * y + z * z < radius_m**2)[0]
        kept.append(offset[:, near].T)
    return np.concatenate(kept)


def least_rows(values: Array, count: int) -> Rows:
    """Return the rows of the `count` least of values (N,), or of all, in no order.

    Of many, those are sorted that lie below a limit that every SHOWING-th shows.
    """
    if len(values) <= count:
        return np.arange(len(values))
    rows = np.arange(len(values))
    if len(values) > 8 * SHOWING * count:
        some, at = values[::SHOWING], 2 * count // SHOWING + SHOWING
        below = np.nonzero(values <= np.partition(some, at)[at])[0]
        rows = below if len(below) > count else rows
    return rows[np.argpartition(values[rows], count)[:count]]


def nearest_points(points_m: Array, place_m: Array, count: int) -> Array:
    """Return the `count` of points_m (N, 3) nearest to a place (3,), or all, in no order."""
    if len(points_m) <= count:
        return points_m

    def near(chunk: slice) -> Array:
        part = points_m[chunk]
        x, y, z = part.T - place_m[:, None]
        return np.asarray(part[least_rows(x * x + y * y + z * z, count)])

    found = np.concatenate(over_chunks(near, len(points_m)))
    return np.asarray(found[least_rows(np.sum((found - place_m) ** 2, axis=1), count)])


@frozen
class Slab:
    """A disc-shaped volume about an axis along a plane's normal.

    reach_m: radius about the axis; it grows by `slope` per metre of depth up to most_m. depth_m:
    half thickness, from the plane.
    """

    reach_m: float
    depth_m: float
    slope: float = 0.0
    most_m: float = math.inf

    def holds(self, square_m2: Array, depth_m: Array) -> Mask:
        """Return the mask (N,) of the points inside, from squared radius and depth (N,)."""
        near = depth_m < self.depth_m
        if self.slope == 0.0:
            near &= square_m2 < min(self.reach_m, self.most_m) ** 2
            return near
        reach = self.slope * depth_m
        reach += self.reach_m
        np.minimum(reach, self.most_m, out=reach)
        near &= square_m2 < np.multiply(reach, reach, out=reach)
        return near


def within_slab(points_m: Array, point_m: Array, normal: Array, threshold_m: float) -> Mask:
    """Return the mask (N,) of points_m (N, 3) within threshold_m of the plane through point_m."""
    inside = np.empty(len(points_m), dtype=bool)
    for start in range(0, len(points_m), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        np.less(np.abs((points_m[rows] - point_m) @ normal), threshold_m, out=inside[rows])
    return inside


def random_rows(points: Array, count: int, rng: np.random.Generator) -> Array:
    """Return at most `count` rows of points (N, 3), one from each of `count` equal intervals.

    A stratified sample: it keeps the file's spread at any file order.
    """
    total = len(points)
    if total <= count:
        return points.copy()
    rows = ((np.arange(count) + rng.random(count)) * (total / count)).astype(np.int64)
    return points[np.minimum(rows, total - 1)]
