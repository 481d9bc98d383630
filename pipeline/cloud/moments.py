"""One pass over the points of a face: sums of those near its plane, by the cells of a raster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Mask, Rows
from .selection import machine_for
from .threads import over_blocks

COMPILED_FACE_ROWS = 800_000  # as COMPILED_ROWS, for points that cost more each
SUMS = 10  # n, x, y, z, xx, xy, yy, xz, yz, zz


@dataclass(frozen=True)
class SlabMoments:
    """What lies near a plane: sums over cells of a raster, and the points that may lie near it.

    sums: (cells, 10) of the points nearer than the lower limit: n, u, v, w, uu, uv, vv, uw, vw, ww.
    edge: (M, 3) u, v, w of those between both limits. across: cells of the raster's side; side_m:
    of a cell.
    """

    sums: Array
    edge: Array
    across: int
    side_m: float

    def cells(self, uvw: Array) -> Rows:
        """The cell (N,) of each of uvw (N, 3)."""
        place = (uvw.T[:2] / self.side_m + 0.5 * self.across).astype(np.int32)
        column, row = place.clip(0, self.across - 1)
        return np.asarray(row * self.across + column, dtype=np.int64)

    def with_edge(self, keep: Mask) -> Array:
        """The sums with the points of the edge that are kept (M,)."""
        kept = self.edge[keep]
        return self.sums + sums_by(self.cells(kept), kept, len(self.sums))


def sums_by(group: Rows, xyz: Array, groups: int) -> Array:
    """Sums (groups, 10) of xyz (N, 3): n, x, y, z, xx, xy, yy, xz, yz, zz."""
    out = np.zeros((groups, SUMS))
    count = np.bincount(group, minlength=groups)
    filled = np.nonzero(count)[0]
    if len(filled) == 0:
        return out
    narrow = np.min_scalar_type(groups)  # of one or two bytes, which are sorted by counting
    order = np.argsort(group.astype(narrow), kind="stable")
    start = (np.cumsum(count) - count)[filled]
    x, y, z = (axis[order] for axis in xyz.T)
    out[filled, 0] = count[filled]
    for k, term in enumerate((x, y, z, x * x, x * y, y * y, x * z, y * z, z * z), start=1):
        out[filled, k] = np.add.reduceat(term, start)
    return out


def slab_moments(
    points_m: Array,
    basis: Array,
    height_m: float,
    limits_m: tuple[float, float],
    bounds_m: tuple[float, Array, Array],
    across: int,
) -> SlabMoments:
    """Points (N, 3) about a plane w = height_m, by one pass.

    basis: (3, 3) rows u, v, w. limits_m: of the distance along w, within the first of which a point
    is surely near, beyond the second surely not. bounds_m: of u and v: the radius within which,
    the straight sides (K, 3), a u + b v < c, within which, and the holes (L, 3), u, v and radius,
    outside which they must lie. across: cells of the raster's side.
    """
    radius, sides_m, holes_m = bounds_m
    side = 2.0 * radius / across
    machine = machine_for(len(points_m), COMPILED_FACE_ROWS)

    def add(block: slice) -> tuple[Array, Array]:
        part = points_m[block]
        if machine is not None:
            sums, edge = np.zeros((across * across, SUMS)), np.empty((len(part), 3))
            limits, grid = np.array(limits_m), np.array([across, side])
            found = machine.slab_moments(
                part, basis, height_m, limits, radius, sides_m, holes_m, grid, sums, edge
            )
            return sums, edge[:found].copy()
        uvw = basis @ part.T
        u, v, w = uvw
        off = np.abs(w - height_m)
        inside = (off < limits_m[1]) & (u * u + v * v < radius**2)
        for a, b, limit in sides_m:
            inside &= a * u + b * v < limit
        for a, b, hole in holes_m:
            inside &= (u - a) ** 2 + (v - b) ** 2 > hole**2
        surely = inside & (off < limits_m[0])
        sure = np.compress(surely, uvw, axis=1)
        held = SlabMoments(np.zeros((across * across, SUMS)), sure[:, :0].T, across, side)
        sums = sums_by(held.cells(sure.T), sure.T, across * across)
        return sums, np.compress(inside & ~surely, uvw, axis=1).T

    parts = over_blocks(add, len(points_m))
    total = np.zeros((across * across, SUMS))
    for part in parts:
        total += part[0]
    edge = np.concatenate([part[1] for part in parts]) if parts else np.zeros((0, 3))
    return SlabMoments(total, edge, across, side)
