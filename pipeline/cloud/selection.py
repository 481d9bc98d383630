"""The passes over all points of a cloud: in numpy, and for large clouds compiled (compiled.py).

Both do the same on blocks of one size, so that the number of threads changes no bit; which of them
is taken depends on the number of points alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import numpy.typing as npt

from ..vectors import CHUNK_ROWS, GRID_PER_M, Array, Array32, Mask, plane_basis
from .threads import BLOCK_ROWS, over_blocks

COMPILED_ROWS = 2_500_000  # loading the compiled passes takes 0.2 s and 100 MB
WHOLE = np.uint64(0xFFFFFFFFFFFFFFFF)
MIX = (np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F), np.uint64(0x165667B19E3779F9))
# Plus x, of less than 2^51: x rounded to an integer, in the last bits.
WHOLE_ONLY = np.float64(1.5 * 2.0**52)
_FINISH, HALF = np.uint64(0xBF58476D1CE4E5B9), np.uint64(32)

Places = npt.NDArray[np.int32]  # of rows in a block


def machine_for(rows: int, enough: int) -> ModuleType | None:
    """The compiled passes, where the points are enough for them; None where numpy is as fast.

    None, too, where numba does not load, be it missing or at odds with another package.
    """
    if rows < enough:
        return None
    try:
        from . import compiled
    except (ImportError, AttributeError):
        return None
    return compiled


def coordinate_hash(points_m: Array) -> npt.NDArray[np.uint64]:
    """A number (N,) for each of points_m (N, 3), by its place to a micrometre, so that rounding in
    the file's last digits hardly ever changes it.

    Odd multipliers, and the finisher of Steele et al., OOPSLA 2014.
    """
    scaled = np.multiply(points_m, GRID_PER_M, dtype=np.float64)
    scaled += WHOLE_ONLY
    bits = scaled.view(np.uint64)
    bits -= WHOLE_ONLY.view(np.uint64)
    h = bits[:, 0] * MIX[0]
    h ^= bits[:, 1] * MIX[1]
    h ^= bits[:, 2] * MIX[2]
    h ^= h >> HALF
    h *= _FINISH
    h ^= h >> HALF
    return np.asarray(h)


def sample(points_m: Array, count: int) -> Array:
    """About `count` of points_m (N, 3), or all if they are fewer, as a copy.

    Those of the smallest hash of their coordinates, in its order: the same points in any order of
    the file, scattered over it.
    """
    total = len(points_m)
    limit = _share(count / max(total, 1))
    machine = machine_for(total, COMPILED_ROWS)

    def chosen(block: slice) -> tuple[Array, npt.NDArray[np.uint64]]:
        part = points_m[block]
        if machine is None:
            h = coordinate_hash(part)
            rows = np.nonzero(h <= limit)[0]
            return part[rows], h[rows]
        rows, h = np.empty(len(part), np.int64), np.empty(len(part), np.uint64)
        found = machine.hash_rows(part, limit, rows, h)
        return part[rows[:found]], h[:found].copy()

    parts = over_blocks(chosen, total)
    if not parts:
        return np.zeros((0, 3))
    hashes = np.concatenate([part[1] for part in parts])
    order = np.argsort(hashes)
    if (np.diff(hashes[order]) == 0).any():  # whose order another processor may turn round
        order = np.argsort(hashes, kind="stable")
    return np.concatenate([part[0] for part in parts])[order]


def _share(share: float) -> np.uint64:
    """The hash below which that share of all points lies."""
    return WHOLE if share >= 1.0 else np.uint64(int(share * 2.0**64))


@dataclass(frozen=True)
class Surroundings:
    """Points about a face, relative to its centre: all on it, then a share of those around.

    face_m: (N, 3). intensity: (N,) of them, or None. around_m: (M, 3) of single precision: half a
    metre from the centre it holds 30 nm.
    """

    face_m: Array
    intensity: Array32 | None
    around_m: Array32


def surroundings(
    points_m: Array,
    centre_m: Array,
    normal: Array,
    face: Slab,
    around: Slab,
    keep_around: float,
    intensity: Array32 | None = None,
) -> Surroundings:
    """Points of points_m (N, 3) in the slabs `face` and `around` about centre_m, along normal.

    keep_around: share that is kept of those in `around` but not in `face`, by their hash.
    """
    limit = _share(keep_around)
    machine = machine_for(len(points_m), COMPILED_ROWS)
    slabs = [np.array([s.reach_m, s.depth_m, s.slope, s.most_m]) for s in (face, around)]
    axes = plane_basis(normal)
    origin = (axes @ centre_m)[:, None]

    def choose(block: slice) -> tuple[Places, Places]:
        part = points_m[block]
        if machine is not None:
            rows = np.empty((2, len(part)), np.int32)
            counts = machine.near_plane(part, centre_m, normal, *slabs, limit, *rows)
            return rows[0, : counts[0]].copy(), rows[1, : counts[1]].copy()
        uvw = axes @ part.T
        uvw -= origin
        u, v, w = uvw
        depth, square = np.abs(w, out=w), np.multiply(u, u, out=u)
        square += np.multiply(v, v, out=v)
        on_face = face.holds(square, depth)
        beside = np.nonzero(around.holds(square, depth) > on_face)[0]
        if limit != WHOLE:
            beside = beside[coordinate_hash(part.take(beside, axis=0)) <= limit]
        return np.nonzero(on_face)[0].astype(np.int32), beside.astype(np.int32)

    chosen = over_blocks(choose, len(points_m))
    counts = np.array([[len(rows) for rows in both] for both in chosen], np.int64).reshape(-1, 2)
    starts = np.vstack([np.zeros((1, 2), np.int64), np.cumsum(counts, axis=0)])
    face_m = np.empty((starts[-1, 0], 3))
    around_m = np.empty((starts[-1, 1], 3), np.float32)
    shine = None if intensity is None else np.empty(len(face_m), np.float32)

    def fill(block: slice) -> None:
        number = block.start // BLOCK_ROWS
        (a, b), (c, d) = starts[number], starts[number + 1]
        on_face, beside = chosen[number]
        for rows, out in ((on_face, face_m[a:c]), (beside, around_m[b:d])):
            if machine is not None:
                machine.take(points_m[block], centre_m, rows, out)
            else:
                np.subtract(points_m[block].take(rows, axis=0), centre_m, out=out)
        if shine is not None and intensity is not None:
            shine[a:c] = intensity[block][on_face]

    over_blocks(fill, len(points_m))
    return Surroundings(face_m, shine, around_m)


def gather_ball(points_m: Array, centre_m: Array, radius_m: float) -> Array:
    """Points of points_m (N, 3) within radius_m of centre_m (3,), relative to it: (M, 3)."""
    kept = [np.zeros((0, 3))]
    for start in range(0, len(points_m), CHUNK_ROWS):
        x, y, z = offset = points_m[start : start + CHUNK_ROWS].T - centre_m[:, None]
        near = np.nonzero(x * x + y * y + z * z < radius_m**2)[0]
        kept.append(offset[:, near].T)
    return np.concatenate(kept)


@dataclass(frozen=True)
class Slab:
    """A disc of space about an axis along a plane's normal.

    reach_m: from the axis, growing by `slope` per metre of depth, to most_m. depth_m: from the
    plane.
    """

    reach_m: float
    depth_m: float
    slope: float = 0.0
    most_m: float = math.inf

    def holds(self, square_m2: Array, depth_m: Array) -> Mask:
        """Which points, by squared distance from the axis and distance from the plane (N,)."""
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
    """Which of points_m (N, 3) lie within threshold_m of the plane through point_m: (N,) bool."""
    inside = np.empty(len(points_m), dtype=bool)
    for start in range(0, len(points_m), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        np.less(np.abs((points_m[rows] - point_m) @ normal), threshold_m, out=inside[rows])
    return inside


def random_rows(points: Array, count: int, rng: np.random.Generator) -> Array:
    """At most `count` rows of points (N, 3), one from each of `count` equal stretches of the file.

    A stratified draw: the rows keep the file's spread at any file order.
    """
    total = len(points)
    if total <= count:
        return points.copy()
    rows = ((np.arange(count) + rng.random(count)) * (total / count)).astype(np.int64)
    return points[np.minimum(rows, total - 1)]
