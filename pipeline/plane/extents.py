"""Sides of the smallest rectangle about points of a plane."""

from __future__ import annotations

import numpy as np

from ..vectors import Array


def smallest_rectangle(uv_m: Array) -> tuple[float, float]:
    """Return the sides of the rectangle of least area about points uv_m (N, 2), the longer first.

    One of its sides lies along an edge of the convex hull. The main directions of points are no
    guide: those of a square are arbitrary. Source: Freeman, Shapira, Commun. ACM 18 (1975) 409.
    """
    hull = _hull(uv_m)
    edges = np.roll(hull, -1, axis=0) - hull
    along = np.arctan2(edges[:, 1], edges[:, 0])
    turns = np.mod(along - along[0], 2.0 * np.pi)  # growing: the vertices lie counterclockwise

    def farthest(quarters: int) -> Array:
        """Return the vertex (K, 2) farthest in the direction of each edge, turned by quarters."""
        ahead = np.mod(turns + (quarters + 1) * 0.5 * np.pi, 2.0 * np.pi)
        return np.asarray(hull[np.searchsorted(turns, ahead) % len(hull)])

    units = np.stack([np.cos(along), np.sin(along)], axis=1)
    across = np.stack([-units[:, 1], units[:, 0]], axis=1)
    length = np.sum((farthest(0) - farthest(2)) * units, axis=1)
    width = np.sum((farthest(1) - hull) * across, axis=1)
    best = int(np.argmin(length * width))
    short, long = np.sort(np.maximum([length[best], width[best]], 0.0))
    return float(long), float(short)


def _hull(uv_m: Array) -> Array:
    """Return the vertices of the convex hull (K, 2), counterclockwise; of a line its two ends."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(uv_m[ConvexHull(uv_m).vertices])
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        one = _farthest_from(uv_m[0], uv_m)
        return np.stack([one, _farthest_from(one, uv_m)])


def _farthest_from(point_m: Array, uv_m: Array) -> Array:
    return np.asarray(uv_m[np.argmax(np.linalg.norm(uv_m - point_m, axis=1))])
