"""The kernels of kernels.c, called with arrays of numpy, where they were built for this machine.

Each has a fallback in selection.py, moments.py or voxel_grid.py, which defines what it does. The
interpreter's lock is let go while one runs.
"""

from __future__ import annotations

import ctypes
import hashlib
from ctypes import c_double, c_int64, c_uint64
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.ctypeslib import ndpointer

from ..vectors import Array, Array32, Mask, Rows

SOURCE, LIBRARY = (Path(__file__).with_name(f"kernels.{suffix}") for suffix in ("c", "so"))
ChunkRows = npt.NDArray[np.int32]  # indices of rows within a chunk
Runs = tuple[ChunkRows, ChunkRows]
Hashes = npt.NDArray[np.uint64]
SHORTEST_RUN = 4  # points in one voxel, on average, for which runs of them are kept


def _array(kind: type[np.generic]) -> Any:
    """Return the argument type of an array, refused where it is not contiguous or of that type."""
    return ndpointer(kind, flags="C_CONTIGUOUS")


DOUBLES, SINGLES, LONGS, INTS, HASHES, MARKS = map(
    _array, (np.float64, np.float32, np.int64, np.int32, np.uint64, np.bool_)
)
TABLE = [INTS, c_int64]
STEPPED = [ndpointer(np.float64), c_int64]
POINTS = [*STEPPED, c_int64]
COUNTED, SLAB, GRID = (
    [DOUBLES, c_int64],
    [DOUBLES, c_double, DOUBLES, c_double],
    [c_int64, c_double],
)
SIGNATURES: dict[str, tuple[list[Any], Any]] = {
    "source_digest": ([], ctypes.c_char_p),
    "hash": ([*COUNTED, HASHES], None),
    "hash_rows": ([*POINTS, c_uint64, LONGS, HASHES], c_int64),
    "thin_rows": ([*STEPPED, INTS, c_int64, c_uint64, INTS], c_int64),
    "all_within": ([*POINTS, c_double], c_int64),
    "widen": ([DOUBLES, *POINTS], None),
    "near_plane": ([*POINTS, *[DOUBLES] * 4, INTS, INTS, LONGS], None),
    "take": ([*STEPPED, DOUBLES, INTS, c_int64, DOUBLES], None),
    "take_single": ([*STEPPED, DOUBLES, INTS, c_int64, SINGLES], None),
    "slab_moments": ([*POINTS, *SLAB, *COUNTED, *COUNTED, *GRID, DOUBLES, DOUBLES], c_int64),
    "raster_sums": ([DOUBLES] * 3 + [c_int64] * 3 + [DOUBLES, c_int64, DOUBLES], None),
    "voxel_moments": (
        [*POINTS, DOUBLES, c_double, *TABLE, LONGS, *COUNTED, INTS, INTS, c_int64, LONGS],
        c_int64,
    ),
    "in_voxels": ([*POINTS, DOUBLES, c_double, LONGS, c_int64, MARKS], c_int64),
}


@lru_cache(maxsize=1)
def kernels() -> Kernels | None:
    """Return the kernels; None where none were built, or from another source than lies beside."""
    try:
        library = ctypes.CDLL(str(LIBRARY))
        for name, (arguments, result) in SIGNATURES.items():
            function = getattr(library, name)
            function.argtypes, function.restype = arguments, result
        built_from = library.source_digest().decode()
    except (OSError, AttributeError):
        return None
    of_source = hashlib.sha256(SOURCE.read_bytes()).hexdigest()
    return Kernels(library) if built_from == of_source else None


class Kernels:
    """Passes over points (N, 3), each point contiguous, or all are copied to be so."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library

    def hashes(self, points: Array) -> Hashes:
        """Return the hash (N,) of points."""
        hashes = np.empty(len(points), np.uint64)
        self._library.hash(*_counted(points), hashes)
        return hashes

    def hash_rows(self, points: Array, limit: np.uint64) -> tuple[Rows, Hashes]:
        """Return the rows of points with hashes up to the limit, and the hashes."""
        rows, hashes = np.empty(len(points), np.int64), np.empty(len(points), np.uint64)
        found = self._library.hash_rows(*_stepped(points), int(limit), rows, hashes)
        return rows[:found].copy(), hashes[:found].copy()

    def thin_rows(self, points: Array, limit: np.uint64, rows: ChunkRows) -> ChunkRows:
        """Return those rows of points with hashes up to the limit."""
        kept = np.empty_like(rows)
        table, step, _ = _stepped(points)
        found = self._library.thin_rows(table, step, rows, len(rows), int(limit), kept)
        return kept[:found].copy()

    def all_within(self, points: Array, limit: float) -> bool:
        """Return whether all coordinates of points are finite and smaller than a limit."""
        return bool(self._library.all_within(*_stepped(points), limit))

    def box(self, points: Array) -> Array:
        """Return the least and the greatest coordinates (2, 3) of points, at least one."""
        corners = np.stack([points[0], points[0]])
        self._library.widen(corners, *_stepped(points))
        return corners

    def near_plane(
        self, points: Array, centre: Array, normal: Array, face: Array, around: Array
    ) -> tuple[ChunkRows, ChunkRows]:
        """Return the rows of points in `face`, and of other points in `around`.

        face, around: (4,) reach, depth, slope and most reach of a slab.
        """
        rows, counts = np.empty((2, len(points)), np.int32), np.empty(2, np.int64)
        self._library.near_plane(
            *_stepped(points), _plain(centre), _plain(normal), face, around, *rows, counts
        )
        return rows[0, : counts[0]].copy(), rows[1, : counts[1]].copy()

    def take(self, points: Array, centre: Array, rows: ChunkRows, out: Array | Array32) -> None:
        """Write those rows of points, relative to the centre, to out, of either precision."""
        take = self._library.take if out.dtype == np.float64 else self._library.take_single
        table, step, _ = _stepped(points)
        take(table, step, _plain(centre), rows, len(rows), out)

    def slab_moments(
        self,
        points: Array,
        basis: Array,
        height: float,
        limits: tuple[float, float],
        bounds: tuple[float, Array, Array],
        grid: tuple[int, float],
    ) -> tuple[Array, Array]:
        """Return sums (cells, 10) and edge points (M, 3), as moments.slab_moments does.

        grid: cells across, and a cell's side.
        """
        (radius, sides, holes), (across, side) = bounds, grid
        sums, edge = np.zeros((across * across, 10)), np.empty((len(points), 3))
        region = (*_counted(sides), *_counted(holes))
        found = self._library.slab_moments(
            *_stepped(points), _plain(basis), height, np.array(limits), radius, *region, across,
            side, sums, edge,
        )  # fmt: skip
        return sums, edge[:found].copy()

    def raster_sums(
        self, uvw: Array, extra: Array | None, along: Array, shape: tuple[int, int], side: Array
    ) -> Array:
        """Return sums (cells, 5 or 6), as moments.raster_sums does; uvw: (3, N)."""
        uvw, along, side = _plain(uvw), _plain(along), _plain(side)
        columns = np.zeros(0) if extra is None else _plain(extra)
        sums = np.zeros((shape[0] * shape[1], 5 if extra is None else 6))
        self._library.raster_sums(
            uvw, columns, along, uvw.shape[1], *shape, side, sums.shape[1], sums
        )
        return sums

    def voxel_moments(
        self, points: Array, low: Array, edge: float, capacity: int
    ) -> tuple[Rows, Array, Runs | None] | None:
        """Return keys (C,), sums (C, 10) and runs of the voxels of points, all above low.

        runs: (R,) first of successive points in one voxel, and the row of that; None where they
        are hardly fewer than the points.
        None where they are more than three quarters of the capacity, a power of two.
        """
        room = 3 * capacity // 4
        slots, keys = np.full(capacity, -1, np.int32), np.empty(room, np.int64)
        sums = np.empty((room, 10))
        starts, rows = np.empty((2, len(points) // SHORTEST_RUN), np.int32)
        runs = np.empty(1, np.int64)
        used = self._library.voxel_moments(
            *_stepped(points), _plain(low), edge, slots, capacity, keys, *_counted(sums),
            starts, rows, len(starts), runs,
        )  # fmt: skip
        count = int(runs[0])
        of_points = (starts[:count], rows[:count]) if count <= len(starts) else None
        return (keys[:used], sums[:used], of_points) if used >= 0 else None

    def in_voxels(self, points: Array, low: Array, edge: float, table: Rows) -> Mask:
        """Return which of points, all above low, lie within voxels of a hash table (capacity,)."""
        marked = np.empty(len(points), np.bool_)
        self._library.in_voxels(*_stepped(points), _plain(low), edge, table, len(table), marked)
        return marked


def _plain(values: Array) -> Array:
    """Return values as a contiguous array in double precision, itself where it is one."""
    return np.ascontiguousarray(values, np.float64)


def _stepped(points: Array) -> tuple[Array, int, int]:
    """Return points, the bytes from one to the next, and their number; each point is contiguous."""
    if points.dtype != np.float64 or points.strides[1] != points.itemsize:
        points = _plain(points)
    return points, points.strides[0], len(points)


def _counted(rows: Array) -> tuple[Array, int]:
    """Return such an array and the number of its rows."""
    return _plain(rows), len(rows)
