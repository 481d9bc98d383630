"""Sums of a cloud by cubes of one size, and the points in some of them, each by one pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..vectors import Array, Rows
from .moments import SUMS, sums_by
from .selection import COMPILED_ROWS, HALF, MIX, machine_for
from .threads import over_blocks

VOXEL_BITS = 21
_WIDE = 64


@dataclass(frozen=True)
class VoxelGrid:
    """Sums of a cloud by cubes of one edge: those that hold points, in the order of their keys.

    low_m: (3,) the corner of cube 0, 0, 0. key: (C,) of `cube_key`. sums: (C, 10) about the middle
    of each cube.
    """

    low_m: Array
    edge_m: float
    key: Rows
    sums: Array

    @cached_property
    def place(self) -> Rows:
        """Column, row and level (C, 3) of each cube."""
        mask = (1 << VOXEL_BITS) - 1
        return np.stack(
            [self.key >> (2 * VOXEL_BITS), self.key >> VOXEL_BITS & mask, self.key & mask], 1
        )

    @cached_property
    def middle_m(self) -> Array:
        """Middle (C, 3) of each cube."""
        return self.low_m + (self.place + 0.5) * self.edge_m

    def between(self, low_m: float, high_m: float) -> tuple[int, int]:
        """Rows start, stop of all cubes whose x may lie between; they are in the order of x."""
        column = (np.array([low_m, high_m + self.edge_m]) - self.low_m[0]) / self.edge_m
        wanted = np.clip(np.floor(column), 0.0, 1 << VOXEL_BITS).astype(np.int64)
        start, stop = np.searchsorted(self.key, wanted << (2 * VOXEL_BITS))
        return int(start), int(stop)


def lowest(points_m: Array) -> Array:
    """The least coordinates (3,) of points_m (N, 3)."""

    def of(block: slice) -> Array:
        part = points_m[block]
        wide = len(part) // _WIDE * _WIDE
        low = part[wide:].min(axis=0, initial=np.inf)
        if wide:  # rows side by side, which is quicker than three columns
            side_by_side = part[:wide].reshape(-1, 3 * _WIDE).min(axis=0).reshape(-1, 3)
            low = np.minimum(low, side_by_side.min(axis=0))
        return np.asarray(low)

    return np.asarray(np.min(over_blocks(of, len(points_m)), axis=0))


def voxel_key(place: Rows) -> Rows:
    """One number (N,) for the cube at place (N, 3)."""
    return np.asarray(place[:, 0] << (2 * VOXEL_BITS) | place[:, 1] << VOXEL_BITS | place[:, 2])


def voxel_moments(points_m: Array, low_m: Array, edge_m: float) -> VoxelGrid:
    """Sums of points_m (N, 3), all above low_m, over the cubes of edge_m that hold any."""
    machine = machine_for(len(points_m), COMPILED_ROWS)
    share = -(-len(points_m) // 2) if machine is not None else len(points_m)

    def add(block: slice) -> tuple[Rows, Array]:
        part = points_m[block]
        if machine is None:
            place = ((part - low_m) * (1.0 / edge_m)).astype(np.int64)
            local = (part - low_m) - (place + 0.5) * edge_m
            keys, group = np.unique(voxel_key(place), return_inverse=True)
            return keys, sums_by(group, local, len(keys))
        capacity = 1 << int(np.clip((len(part) // 16).bit_length(), 14, 21))
        while True:
            table, sums = np.full(capacity, -1, np.int64), np.zeros((capacity, SUMS))
            if machine.voxel_moments(part, low_m, edge_m, table, sums) >= 0:
                break
            capacity *= 4
        used = np.nonzero(table >= 0)[0]
        return table[used], sums[used]

    parts = over_blocks(add, len(points_m), max(share, 1))
    keys, group = np.unique(np.concatenate([p[0] for p in parts]), return_inverse=True)
    total = np.zeros((len(keys), SUMS))
    start = 0
    for part in parts:
        total[group[start : start + len(part[0])]] += part[1]
        start += len(part[0])
    return VoxelGrid(low_m, edge_m, keys, total)


def within_voxels(points_m: Array, voxels: VoxelGrid, keys: Rows) -> Rows:
    """Rows of points_m (N, 3) that lie in the cubes of these keys (K,)."""
    machine = machine_for(len(points_m), COMPILED_ROWS)
    keys = np.unique(keys)
    table = _hash_table(keys) if machine is not None else keys

    def find(block: slice) -> Rows:
        part = points_m[block]
        if machine is not None:
            marked = np.empty(len(part), np.bool_)
            machine.in_voxels(part, voxels.low_m, voxels.edge_m, keys, table, marked)
            return np.asarray(np.nonzero(marked)[0] + block.start)
        place = ((part - voxels.low_m) * (1.0 / voxels.edge_m)).astype(np.int64)
        return np.asarray(np.nonzero(np.isin(voxel_key(place), keys))[0] + block.start)

    found = over_blocks(find, len(points_m))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def _hash_table(keys: Rows) -> Rows:
    """The keys in a table of open addresses, as compiled.in_cubes looks them up."""
    capacity = 1 << max(4, int(2 * len(keys)).bit_length())
    table = np.full(capacity, -1, np.int64)
    slots = (keys.astype(np.uint64) * MIX[0] >> HALF).astype(np.int64) & (capacity - 1)
    for key, slot in zip(keys.tolist(), slots.tolist(), strict=True):
        while table[slot] != -1:
            slot = (slot + 1) & (capacity - 1)
        table[slot] = key
    return table
