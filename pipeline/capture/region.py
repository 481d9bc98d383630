"""Region of a scan that an operator drew: a polygon, and all that lies before and behind it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..vectors import CHUNK_ROWS, Array, Mask, plane_basis

LEAST_WIDTH = 1e-3  # of a region over its length: less is a line


@np.errstate(over="ignore", invalid="ignore")
def normal_of(corners_m: Array) -> Array | None:
    """Return the unit normal (3,) of a polygon's corners (K, 3), None where they lie on a line.

    Newell's method: half the sum of the cross products of successive corners is area times normal.
    """
    local = corners_m - corners_m.mean(axis=0)
    area = np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0) / 2.0
    size = float(np.linalg.norm(area))
    longest = float(np.linalg.norm(local, axis=1).max())
    return area / size if size > LEAST_WIDTH * longest**2 else None


@np.errstate(over="ignore", invalid="ignore")
def in_region(points_m: Array, corners_m: Sequence[Sequence[float]]) -> Mask:
    """Return which of points_m (N, 3) lie in the polygon of corners_m (K, 3), along its normal.

    By the number of edges that a line from the point crosses, odd inside (Shimrat, 1962).
    """
    corners = np.array(corners_m)
    normal = normal_of(corners)
    if normal is None:
        return np.zeros(len(points_m), dtype=bool)
    middle, axes = corners.mean(axis=0), plane_basis(normal)[:2]
    polygon = (corners - middle) @ axes.T
    inside = np.zeros(len(points_m), dtype=bool)
    for start in range(0, len(points_m), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        u, v = axes @ (points_m[rows] - middle).T
        inside[rows] = _in_polygon(u, v, polygon)
    return inside


def _in_polygon(u: Array, v: Array, polygon: Array) -> Mask:
    """Return which points u, v (N,) lie in a polygon (K, 2)."""
    inside = np.zeros(len(u), dtype=bool)
    for (u0, v0), (u1, v1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        between = (v0 > v) != (v1 > v)
        if v0 != v1:
            inside ^= between & (u < u0 + (v - v0) * ((u1 - u0) / (v1 - v0)))
    return inside
