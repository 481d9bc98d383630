"""Moments of a cloud by voxels, and the points within some of them, each in one pass."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask, Rows
from .compiled import ChunkRows, Runs, kernels
from .moments import SUMS, sums_by
from .selection import HALF, MIX
from .steps import scattered
from .threads import over_chunks

VOXEL_BITS = 21
_WIDE = 64


@frozen(eq=False)
class VoxelRuns:
    """Runs of successive points of rows first:stop in one voxel each, in their order.

    start: (R,) the first point of each, counted from `first`. voxel: (R,) its row in the grid.
    """

    first: int
    stop: int
    start: ChunkRows
    voxel: ChunkRows

    @classmethod
    def of(cls, chunk: slice, start: ChunkRows, voxel: ChunkRows, row: Rows) -> VoxelRuns:
        """Return the runs of a chunk; row: in the grid, of each of the voxels that they name."""

        def rename(runs: slice) -> None:
            voxel[runs] = row[voxel[runs]]

        over_chunks(rename, len(voxel))
        return cls(chunk.start, chunk.stop, start, voxel)

    def rows(self, chosen: Mask) -> Rows:
        """Return the rows of the points in the voxels that are chosen, a mask (C,)."""
        inside = chosen[self.voxel]
        size = np.diff(self.start, append=self.stop - self.first)[inside]
        start = self.first + self.start[inside].astype(np.int64)
        rows = np.ones(int(size.sum()), np.int64)
        rows[:1] = start[:1]
        rows[np.cumsum(size[:-1])] = start[1:] - (start + size)[:-1] + 1
        return np.cumsum(rows, out=rows)


@frozen(eq=False)
class VoxelGrid:
    """Moments of a cloud in the C voxels that hold points, in the order of their keys.

    low_m: (3,) corner of voxel 0, 0, 0. key: (C,) of `voxel_key`. sums: (C, 10) about the centre of
    each voxel. runs: of all points of the cloud, None where these are in no order or left out.
    """

    low_m: Array
    edge_m: float
    key: Rows
    sums: Array
    runs: tuple[VoxelRuns, ...] | None = None

    @cached_property
    def index(self) -> Rows:
        """Column, row and level (C, 3) of each voxel."""
        mask = (1 << VOXEL_BITS) - 1
        return np.stack(
            [self.key >> (2 * VOXEL_BITS), self.key >> VOXEL_BITS & mask, self.key & mask], 1
        )

    @cached_property
    def middle_m(self) -> Array:
        """Centre (C, 3) of each voxel."""
        return self.low_m + (self.index + 0.5) * self.edge_m

    def between(self, low_m: float, high_m: float) -> tuple[int, int]:
        """Return rows start, stop of all voxels whose x may lie between; rows are in order of x."""
        column = (np.array([low_m, high_m + self.edge_m]) - self.low_m[0]) / self.edge_m
        columns = np.clip(np.floor(column), 0.0, 1 << VOXEL_BITS).astype(np.int64)
        start, stop = np.searchsorted(self.key, columns << (2 * VOXEL_BITS))
        return int(start), int(stop)


def box(points_m: Array) -> Array:
    """Return the least and the greatest coordinates (2, 3) of points_m (N, 3)."""
    compiled = kernels()

    def of(chunk: slice) -> Array:
        part = points_m[chunk]
        if compiled is not None:
            return compiled.box(part)
        return np.stack([_reduced(extreme, part) for extreme in (np.minimum, np.maximum)])

    corners = np.stack(over_chunks(of, len(points_m)))
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])


def all_within(points_m: Array, limit_m: float) -> bool:
    """Return whether all coordinates of points_m (N, 3) are finite and smaller than a limit."""
    compiled = kernels()

    def are(chunk: slice) -> bool:
        part = points_m[chunk]
        if compiled is not None:
            return compiled.all_within(part, limit_m)
        least, most = (extreme.reduce(part, axis=None) for extreme in (np.minimum, np.maximum))
        return bool(most < limit_m and least > -limit_m)  # a NaN is neither

    return all(over_chunks(are, len(points_m)))


def _reduced(extreme: np.ufunc, points_m: Array) -> Array:
    """Return the least or greatest coordinates; wide rows reduce faster than three columns."""
    wide = len(points_m) // _WIDE * _WIDE
    if not wide:
        return np.asarray(extreme.reduce(points_m))
    found = extreme.reduce(extreme.reduce(points_m[:wide].reshape(-1, 3 * _WIDE)).reshape(-1, 3))
    return np.asarray(extreme.reduce([found, *points_m[wide:]]))


def voxel_key(index: Rows) -> Rows:
    """Return one number (N,) for each voxel index (N, 3)."""
    return np.asarray(index[:, 0] << (2 * VOXEL_BITS) | index[:, 1] << VOXEL_BITS | index[:, 2])


def voxel_moments(points_m: Array, low_m: Array, edge_m: float) -> VoxelGrid:
    """Return the moments of points_m (N, 3), all above low_m, by voxels of edge_m."""
    compiled = kernels()
    share = -(-len(points_m) // 2) if compiled is not None else len(points_m)

    def add(chunk: slice) -> tuple[slice, Rows, Array, Runs | None]:
        part = points_m[chunk]
        if compiled is not None:
            capacity = 1 << int(np.clip((len(part) // 16).bit_length(), 14, 21))
            while (found := compiled.voxel_moments(part, low_m, edge_m, capacity)) is None:
                capacity *= 4
            return chunk, *found
        index = ((part - low_m) * (1.0 / edge_m)).astype(np.int64)
        local = (part - low_m) - (index + 0.5) * edge_m
        keys, group = np.unique(voxel_key(index), return_inverse=True)
        return chunk, keys, sums_by(group, local, len(keys)), None

    parts = over_chunks(add, len(points_m), max(share, 1))
    key, row = np.unique(np.concatenate([keys for _, keys, _, _ in parts]), return_inverse=True)
    total, of_parts = np.zeros((len(key), SUMS)), []
    known = all(runs is not None for _, _, _, runs in parts)
    while parts:  # each is freed
        chunk, keys, sums, runs = parts.pop(0)
        own, row = row[: len(keys)], row[len(keys) :]
        total[own] += sums
        if runs is not None:
            of_parts.append(VoxelRuns.of(chunk, *runs, own))
    return VoxelGrid(low_m, edge_m, key, total, tuple(of_parts) if known else None)


def voxels_without_strays(points_m: Array, edge_m: float) -> VoxelGrid:
    """Return the moments of points_m (N, 3) by voxels of edge_m that begin one below the least.

    Where these reach farther than their keys do, as by a single point at 0, 0, 0 of a cloud in
    coordinates of a country, points farther than half of that from the one nearest to their median
    are left out.
    """
    low, high = box(points_m)
    if not float((high - low).max()) < ((1 << VOXEL_BITS) - 2) * edge_m:
        some = points_m[scattered(len(points_m))]
        middle = some[np.argmin(np.abs(some - np.median(some, axis=0)).max(axis=1))]
        reach_m = ((1 << VOXEL_BITS - 1) - 2) * edge_m
        points_m = points_m[(np.abs(points_m - middle) < reach_m).all(axis=1)]
        low = box(points_m)[0]
        return replace(voxel_moments(points_m, low - edge_m, edge_m), runs=None)
    return voxel_moments(points_m, low - edge_m, edge_m)


def within_voxels(points_m: Array, voxels: VoxelGrid, keys: Rows) -> Rows:
    """Return the rows of points_m (N, 3) within the voxels of these keys (K,)."""
    if voxels.runs is not None:
        chosen = np.isin(voxels.key, keys)
        return np.concatenate([runs.rows(chosen) for runs in voxels.runs])
    compiled = kernels()
    keys = np.unique(keys)
    table = _hash_table(keys) if compiled is not None else keys

    def find(chunk: slice) -> Rows:
        part = points_m[chunk]
        if compiled is not None:
            marked = compiled.in_voxels(part, voxels.low_m, voxels.edge_m, table)
        else:
            index = ((part - voxels.low_m) * (1.0 / voxels.edge_m)).astype(np.int64)
            marked = np.isin(voxel_key(index), keys)
        return np.asarray(np.nonzero(marked)[0] + chunk.start)

    found = over_chunks(find, len(points_m))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def _hash_table(keys: Rows) -> Rows:
    """Return the keys in a hash table with linear probing, as the kernels read it."""
    capacity = 1 << max(4, int(2 * len(keys)).bit_length())
    table = np.full(capacity, -1, np.int64)
    slots = (keys.astype(np.uint64) * MIX[0] >> HALF).astype(np.int64) & (capacity - 1)
    for key, slot in zip(keys.tolist(), slots.tolist(), strict=True):
        while table[slot] != -1:
            slot = (slot + 1) & (capacity - 1)
        table[slot] = key
    return table
