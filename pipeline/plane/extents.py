"""Sides of the smallest rectangle about points of a plane."""

from __future__ import annotations

import numpy as np

from ..vectors import Array, Rows

STRIPS = 1000  # across the points, of each of which the two outermost ones are looked at
DIRECTIONS, ROUNDS = 90, 5  # compared at once; each round the best one's neighbours


def smallest_rectangle(uv_m: Array) -> tuple[float, float]:
    """Return the sides of the rectangle of least area about points uv_m (N, 2), the longer first.

    The main directions of points are no guide: those of a square are arbitrary.
    """
    outer = uv_m[_outermost(uv_m)]
    low, width = 0.0, 0.5 * np.pi
    for _ in range(ROUNDS):
        angles = low + width * np.arange(DIRECTIONS + 1) / DIRECTIONS
        best = float(angles[np.argmin([np.prod(_sides(outer, angle)) for angle in angles])])
        low, width = best - width / DIRECTIONS, 2.0 * width / DIRECTIONS
    short, long = np.sort(_sides(uv_m, best))
    return float(long), float(short)


def _outermost(uv_m: Array) -> Rows:
    """Return the rows of uv_m (N, 2) with the least and the largest v of each strip of u."""
    u, v = uv_m.T
    strip = ((u - u.min()) * (STRIPS / max(float(np.ptp(u)), 1e-300))).astype(np.int64)
    order = np.lexsort((v, strip))
    first = np.flatnonzero(np.diff(strip[order], prepend=-1))
    ends = np.concatenate([order[first], order[np.append(first[1:], len(order)) - 1]])
    return np.append(ends, [np.argmin(u), np.argmax(u)])


def _sides(uv_m: Array, angle_rad: float) -> Array:
    """Return the extents (2,) of uv_m (N, 2) along and across a direction."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.asarray(np.ptp(uv_m @ np.array([[cos, -sin], [sin, cos]]), axis=0))
