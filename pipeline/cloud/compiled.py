"""Kernels compiled by numba, for clouds so large that loading it pays.

Each has a numpy fallback in selection.py, moments.py or voxel_grid.py, which defines what it does.
They copy points in pieces to a buffer that stays in the first cache, and compute on that: a plain
copy reads large memory at its full rate, a loop that computes may wait for each line of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from ..vectors import GRID_PER_M
from .native import load_numba

F = TypeVar("F", bound=Callable[..., Any])
njit = load_numba().njit  # loaded with this module, which is imported late
PIECE = 1024  # points: 24 kB


def _compiled(function: F) -> F:
    """Compile a function; keep its machine code on disk where there is a folder for it."""
    try:
        return cast(F, njit(nogil=True, cache=True)(function))
    except RuntimeError:
        return cast(F, njit(nogil=True)(function))


@_compiled
def coordinate_hash(x: float, y: float, z: float) -> Any:
    """Return the hash of one point, as selection.coordinate_hash."""
    h = np.uint64(np.int64(np.rint(x * GRID_PER_M))) * np.uint64(0x9E3779B97F4A7C15)
    h ^= np.uint64(np.int64(np.rint(y * GRID_PER_M))) * np.uint64(0xC2B2AE3D27D4EB4F)
    h ^= np.uint64(np.int64(np.rint(z * GRID_PER_M))) * np.uint64(0x165667B19E3779F9)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0xBF58476D1CE4E5B9)
    return h ^ (h >> np.uint64(32))


@_compiled
def read_piece(points: Any, start: int, piece: Any) -> int:
    """Copy points (N, 3) from a row on to a piece (PIECE, 3); return how many."""
    count = min(len(piece), len(points) - start)
    piece.reshape(-1)[: 3 * count] = points.reshape(-1)[3 * start : 3 * (start + count)]
    return count


@_compiled
def hash_rows(points: Any, limit: Any, rows: Any, hashes: Any) -> int:
    """Write rows of points (N, 3) with hashes up to the limit, and the hashes; return how many."""
    found, piece = 0, np.empty((PIECE, 3))
    for start in range(0, len(points), PIECE):
        for i in range(read_piece(points, start, piece)):
            h = coordinate_hash(piece[i, 0], piece[i, 1], piece[i, 2])
            if h <= limit:
                rows[found] = start + i
                hashes[found] = h
                found += 1
    return found


@_compiled
def widen(corners: Any, points: Any) -> None:
    """Widen a box, its least and greatest coordinates (2, 3), to hold points (N, 3)."""
    piece = np.empty((PIECE, 3))
    for start in range(0, len(points), PIECE):
        for i in range(read_piece(points, start, piece)):
            for k in range(3):
                corners[0, k] = min(corners[0, k], piece[i, k])
                corners[1, k] = max(corners[1, k], piece[i, k])


@_compiled
def near_plane(
    points: Any,
    centre: Any,
    normal: Any,
    face: Any,
    around: Any,
    on_face: Any,
    beside: Any,
) -> tuple[Any, Any]:
    """Write rows of points (N, 3) in `face` to on_face; return the number of each.

    Rows of other points in `around` go to beside; both arrays have length N. face, around: (reach,
    depth, slope, most reach). Branchless: points in random order would be mispredicted.
    """
    faces, besides = np.int64(0), np.int64(0)
    cx, cy, cz = centre[0], centre[1], centre[2]
    nx, ny, nz = normal[0], normal[1], normal[2]
    reach, deep, slope, most = face[0], face[1], face[2], face[3]
    wide, far, rise, widest = around[0], around[1], around[2], around[3]
    piece = np.empty((PIECE, 3))
    for start in range(0, len(points), PIECE):
        for i in range(read_piece(points, start, piece)):
            x, y, z = piece[i, 0] - cx, piece[i, 1] - cy, piece[i, 2] - cz
            depth = abs(x * nx + y * ny + z * nz)
            square = x * x + y * y + z * z - depth * depth
            r, q = min(reach + slope * depth, most), min(wide + rise * depth, widest)
            one = (depth < deep) & (square < r * r)
            two = (depth < far) & (square < q * q) & (not one)
            on_face[faces] = start + i
            faces += np.int64(one)
            beside[besides] = start + i
            besides += np.int64(two)
    return faces, besides


@_compiled
def thin_rows(points: Any, limit: Any, rows: Any, kept: Any) -> int:
    """Write those of ascending rows of points (N, 3) with hashes up to the limit; return how many.

    kept: as long as rows.
    """
    found, j, piece = 0, 0, np.empty((PIECE, 3))
    while j < len(rows):
        start = rows[j]
        end = start + read_piece(points, start, piece)
        while j < len(rows) and rows[j] < end:
            i = rows[j] - start
            if coordinate_hash(piece[i, 0], piece[i, 1], piece[i, 2]) <= limit:
                kept[found] = rows[j]
                found += 1
            j += 1
    return found


@_compiled
def take(points: Any, centre: Any, rows: Any, out: Any) -> None:
    """Write those rows of points (N, 3), relative to the centre, to out (M, 3)."""
    cx, cy, cz = centre[0], centre[1], centre[2]
    for j in range(len(out)):
        i = rows[j]
        out[j, 0] = points[i, 0] - cx
        out[j, 1] = points[i, 1] - cy
        out[j, 2] = points[i, 2] - cz


@_compiled
def _add(cell: Any, x: float, y: float, z: float) -> None:
    """Add one point to sums (10,), in the order of moments.sums_by."""
    cell[0] += 1.0
    cell[1] += x
    cell[2] += y
    cell[3] += z
    cell[4] += x * x
    cell[5] += x * y
    cell[6] += y * y
    cell[7] += x * z
    cell[8] += y * z
    cell[9] += z * z


@_compiled
def slab_moments(
    points: Any,
    basis: Any,
    height: float,
    limits: Any,
    radius: float,
    sides: Any,
    holes: Any,
    grid: Any,
    sums: Any,
    edge: Any,
) -> int:
    """Add the points near a plane to the sums of their cells; return the number of edge points.

    Points between both limits go to edge (N, 3). sides: rows (a, b, c): a u + b v < c. grid: cells
    across, and a cell's side. sums: (cells, 10).
    """
    found, piece = 0, np.empty((PIECE, 3))
    across = int(grid[0])
    for start in range(0, len(points), PIECE):
        for i in range(read_piece(points, start, piece)):
            x, y, z = piece[i, 0], piece[i, 1], piece[i, 2]
            w = basis[2, 0] * x + basis[2, 1] * y + basis[2, 2] * z
            u = basis[0, 0] * x + basis[0, 1] * y + basis[0, 2] * z
            v = basis[1, 0] * x + basis[1, 1] * y + basis[1, 2] * z
            off = abs(w - height)
            if off >= limits[1] or u * u + v * v >= radius * radius:
                continue
            hidden = False
            for k in range(len(sides)):
                if sides[k, 0] * u + sides[k, 1] * v >= sides[k, 2]:
                    hidden = True
            for k in range(len(holes)):
                du, dv = u - holes[k, 0], v - holes[k, 1]
                if du * du + dv * dv <= holes[k, 2] * holes[k, 2]:
                    hidden = True
            if hidden:
                continue
            if off >= limits[0]:
                edge[found, 0], edge[found, 1], edge[found, 2] = u, v, w
                found += 1
                continue
            column = min(max(int(u / grid[1] + 0.5 * across), 0), across - 1)
            row = min(max(int(v / grid[1] + 0.5 * across), 0), across - 1)
            _add(sums[row * across + column], u, v, w)
    return found


@_compiled
def voxel_moments(points: Any, low: Any, edge: float, keys: Any, sums: Any) -> int:
    """Add points (N, 3) to sums (capacity, 10) of their voxels in a hash table; -1 if it is full.

    Returns the number of voxels used. keys: (capacity,) int64, -1 where free; the capacity is a
    power of two.
    """
    mask = len(keys) - 1
    per_edge = 1.0 / edge
    used, piece = 0, np.empty((PIECE, 3))
    last_key, slot = np.int64(-2), np.int64(0)
    for start in range(0, len(points), PIECE):
        for i in range(read_piece(points, start, piece)):
            x = (piece[i, 0] - low[0]) * per_edge
            y = (piece[i, 1] - low[1]) * per_edge
            z = (piece[i, 2] - low[2]) * per_edge
            ix, iy, iz = np.int64(x), np.int64(y), np.int64(z)
            key = (ix << 42) | (iy << 21) | iz
            if key != last_key:
                h = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
                slot = np.int64(h >> np.uint64(32)) & mask
                while keys[slot] != key and keys[slot] != -1:
                    slot = (slot + 1) & mask
                if keys[slot] == -1:
                    if 4 * used >= 3 * len(keys):
                        return -1
                    keys[slot] = key
                    used += 1
                last_key = key
            x, y, z = (x - ix - 0.5) * edge, (y - iy - 0.5) * edge, (z - iz - 0.5) * edge
            _add(sums[slot], x, y, z)
    return used


@_compiled
def in_voxels(points: Any, low: Any, edge: float, table: Any, marked: Any) -> int:
    """Mark points (N, 3) within voxels of a hash table (capacity,) int64; return how many."""
    mask = len(table) - 1
    per_edge = 1.0 / edge
    found, piece = 0, np.empty((PIECE, 3))
    last_key, inside = np.int64(-2), False
    for start in range(0, len(points), PIECE):
        for i in range(read_piece(points, start, piece)):
            ix = np.int64((piece[i, 0] - low[0]) * per_edge)
            iy = np.int64((piece[i, 1] - low[1]) * per_edge)
            iz = np.int64((piece[i, 2] - low[2]) * per_edge)
            key = (ix << 42) | (iy << 21) | iz
            if key != last_key:
                h = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
                slot = np.int64(h >> np.uint64(32)) & mask
                while table[slot] != key and table[slot] != -1:
                    slot = (slot + 1) & mask
                inside = table[slot] == key
                last_key = key
            marked[start + i] = inside
            found += inside
    return found
