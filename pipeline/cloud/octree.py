"""Octree of a cloud, for views from afar and near by: each point lies in exactly one node.

A node holds, of the points in its cell that no ancestor holds, the first in each cell of a grid of
2^GRID_BITS cells along its edge, in Morton order; so all nodes down to a depth are an even sample.
A node whose cell has at most LEAF points holds all of them that no ancestor does. In Morton order a
point is the first of its cell at each depth at which it and its predecessor differ: one pass over
sorted codes finds the node of every point. Trees of such nodes: Schuetz et al., "Fast Out-of-Core
Octree Generation for Massive Point Clouds", Computer Graphics Forum 39, 2020.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import numpy.typing as npt

from ..system import frozen
from ..vectors import Array32, Rows

CODE_BITS = 16  # of each axis
GRID_BITS = 7
MOST_DEPTH = CODE_BITS - GRID_BITS
LEAF = 40_000

Codes = npt.NDArray[np.uint64]
# Depth at which a point is the first of its cell, by the number of bits in which it differs.
_FIRST = np.array(
    [CODE_BITS + 1, *(CODE_BITS - bit // 3 for bit in range(3 * CODE_BITS))], np.uint8
)


@frozen(eq=False)
class NodeRows:
    """Part of a node: its depth, its cell (Morton code of `depth` bits an axis), rows of points."""

    depth: int
    cell: int
    rows: Rows


def morton_codes(points_m: Array32, edge_m: float) -> Codes:
    """Return the codes (N,) of points_m (N, 3), of a cube about the origin.

    edge_m: a power of two, so that the limits of cells are exact.
    """
    steps = points_m.astype(np.float64)
    steps += edge_m / 2.0
    steps *= (1 << CODE_BITS) / edge_m
    index = np.clip(steps, 0.0, (1 << CODE_BITS) - 1.0, out=steps).astype(np.uint16)
    table = _spread()
    codes = table[index[:, 0]]
    codes <<= np.uint64(1)
    codes |= table[index[:, 1]]
    codes <<= np.uint64(1)
    codes |= table[index[:, 2]]
    return codes


def cell_index(cell: int, depth: int) -> tuple[int, int, int]:
    """Return the column, row and level of a cell."""
    bits = [[cell >> (3 * k + axis) & 1 for k in range(depth)] for axis in (2, 1, 0)]
    x, y, z = (sum(bit << k for k, bit in enumerate(axis)) for axis in bits)
    return x, y, z


def divide(codes: Codes, depth: int, before: int | None, leaf: int | None) -> Iterator[NodeRows]:
    """Yield the nodes of all points of one cell of that depth, those above it in part.

    codes: (N,) in any order, equal ones in theirs. before: the largest code of the cells before it
    in Morton order. leaf: depth of an ancestor that holds all points of its cell.
    """
    rows, ordered = _sorted(codes, depth)
    first = _first_depth(ordered, before)
    level = np.minimum(np.maximum(first, GRID_BITS) - GRID_BITS, MOST_DEPTH).astype(np.uint8)
    np.minimum(level, _leaf_depth(first, depth) if leaf is None else np.uint8(leaf), out=level)
    by_level = np.argsort(level, kind="stable")
    ends = np.cumsum(np.bincount(level, minlength=MOST_DEPTH + 1))
    for k, own in enumerate(np.split(by_level, ends[:-1])):
        cells = ordered[own] >> np.uint64(3 * (CODE_BITS - k))
        starts = np.flatnonzero(np.diff(cells)) + 1
        for part in np.split(own, starts) if len(own) else ():
            yield NodeRows(k, int(ordered[part[0]]) >> 3 * (CODE_BITS - k), rows[part])


def mixed(count: int) -> Rows:
    """Return an order of `count` rows whose every prefix is even: that of their reversed bits."""
    reversed_bits = _reversed_bits(max(0, count - 1).bit_length())
    return reversed_bits[reversed_bits < count]


@cache
def _reversed_bits(bits: int) -> Rows:
    if bits == 0:
        return np.zeros(1, np.int64)
    fewer = 2 * _reversed_bits(bits - 1)
    return np.concatenate([fewer, fewer + 1])


@cache
def _spread() -> Codes:
    """Return each number of CODE_BITS bits with two zeros between its bits."""
    spread = np.arange(1 << CODE_BITS, dtype=np.uint64)
    for k in (8, 4, 2, 1):
        spread |= spread << np.uint64(2 * k)
        spread &= np.uint64(sum(((1 << k) - 1) << (3 * j) for j in range(0, CODE_BITS, k)))
    return spread


def _sorted(codes: Codes, depth: int) -> tuple[Rows, Codes]:
    """Return the rows in the order of their codes, then of themselves, and the codes in it."""
    bits = np.uint64(len(codes).bit_length())
    shared = np.uint64((1 << 3 * (CODE_BITS - depth)) - 1)  # the bits above are those of the cell
    keys = (codes & shared) << bits
    keys |= np.arange(len(codes), dtype=np.uint64)
    keys.sort()
    rows = (keys & np.uint64((1 << int(bits)) - 1)).astype(np.int64)
    keys >>= bits
    keys |= codes[0] & ~shared
    return rows, keys


def _first_depth(ordered: Codes, before: int | None) -> npt.NDArray[np.uint8]:
    """Return the least depth at which each point is the first of its cell; none: CODE_BITS + 1."""
    differing = np.empty(len(ordered), np.uint64)
    np.bitwise_xor(ordered[1:], ordered[:-1], out=differing[1:])
    differing[0] = 0 if before is None else int(ordered[0]) ^ before
    _, bits = np.frexp(differing.astype(np.float64))  # codes of 48 bits are exact
    first = _FIRST[bits]
    if before is None:
        first[0] = 0
    return first


def _leaf_depth(first: npt.NDArray[np.uint8], depth: int) -> npt.NDArray[np.uint8]:
    """Return the least depth, from `depth` on, at which the cell of each point is a leaf's."""
    leaf = np.full(len(first), MOST_DEPTH, np.uint8)
    for k in range(MOST_DEPTH - 1, depth - 1, -1):
        starts = np.flatnonzero(first <= k)
        counts = np.diff(starts, append=len(first))
        leaf[np.repeat(counts <= LEAF, counts)] = k
    return leaf
