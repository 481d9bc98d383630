"""First and second moments of the points near a plane, by the cells of a grid, in one pass."""

from __future__ import annotations

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask, Rows
from .compiled import kernels
from .threads import over_chunks

SUMS = 10  # n, x, y, z, xx, xy, yy, xz, yz, zz


@frozen(eq=False)
class SlabMoments:
    """Moments of the points near a plane by the cells of a grid, and the points near its limits.

    sums: (cells, 10) of the points nearer than the lower limit: n, u, v, w, uu, uv, vv, uw, vw, ww.
    edge: (M, 3) u, v, w of the points between both limits. across: cells along the grid's side;
    side_m: side of a cell.
    """

    sums: Array
    edge: Array
    across: int
    side_m: float

    def cells(self, uvw: Array) -> Rows:
        """Return the cell (N,) of each of uvw (N, 3)."""
        index = (uvw.T[:2] / self.side_m + 0.5 * self.across).astype(np.int32)
        column, row = index.clip(0, self.across - 1)
        return np.asarray(row * self.across + column, dtype=np.int64)

    def with_edge(self, keep: Mask) -> Array:
        """Return the sums including the edge points that are kept, a mask (M,)."""
        kept = self.edge[keep]
        return self.sums + sums_by(self.cells(kept), kept, len(self.sums))


def sums_by(group: Rows, xyz: Array, groups: int) -> Array:
    """Return sums (groups, 10) of xyz (N, 3): n, x, y, z, xx, xy, yy, xz, yz, zz."""
    out = np.zeros((groups, SUMS))
    count = np.bincount(group, minlength=groups)
    filled = np.nonzero(count)[0]
    if len(filled) == 0:
        return out
    narrow = np.min_scalar_type(groups)  # one or two bytes: numpy sorts them by counting
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
    """Compute the moments of points (N, 3) near the plane w = height_m, in one pass.

    basis: (3, 3) rows u, v, w. limits_m: distances along w; a point within the first is near, a
    point beyond the second is not. bounds_m: of u and v: the radius within which, the straight
    sides (K, 3), a u + b v < c, within which, and the holes (L, 3), u, v and radius, outside which
    they must lie. across: cells along the grid's side.
    """
    radius, sides_m, holes_m = bounds_m
    side = 2.0 * radius / across
    compiled = kernels()

    def add(chunk: slice) -> tuple[Array, Array]:
        part = points_m[chunk]
        if compiled is not None:
            grid = (across, side)
            return compiled.slab_moments(part, basis, height_m, limits_m, bounds_m, grid)
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

    parts = over_chunks(add, len(points_m))
    total = np.zeros((across * across, SUMS))
    for part in parts:
        total += part[0]
    edge = np.concatenate([part[1] for part in parts]) if parts else np.zeros((0, 3))
    return SlabMoments(total, edge, across, side)


def raster_sums(
    uvw_m: Array, extra: Array | None, along_m: Array, shape: tuple[int, int], side_m: Array
) -> Array:
    """Return the sums (cells, 5 or 6) of n, u, v, w, w w and `extra`, if any, by a raster's cells.

    uvw_m: (M, 3). along_m: (2, M) coordinates along columns and rows. shape: number of columns and
    rows, side_m: (2,) of a cell. Points beyond the raster count in its outer cells.
    """
    compiled = kernels()
    if compiled is not None:
        return compiled.raster_sums(uvw_m.T, extra, along_m, shape, side_m)
    one, two = (
        (at / side + 0.5 * number).clip(0, number - 1).astype(np.int64)
        for at, side, number in zip(along_m, side_m, shape, strict=True)
    )
    u, v, w = uvw_m.T
    columns = [None, u, v, w, w * w, *([] if extra is None else [extra])]
    cell, number = two * shape[0] + one, shape[0] * shape[1]
    return np.stack([np.bincount(cell, column, number) for column in columns], axis=1)
