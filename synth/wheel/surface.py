"""Surfaces swept about z from a meridian curve, and then displaced point by point."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Array
from ..scene.solids import Solid

ROUNDS = 4
Displace = Callable[[Array, Array, Array], tuple[Array, Array]]


def rounded(corners: Array, rounds: int = ROUNDS) -> Array:
    """Return a smooth curve (K, 2) along a polygon (N, 2) with its ends: Chaikin's subdivision."""
    curve = np.asarray(corners, dtype=float)
    for _ in range(rounds):
        quarter = 0.75 * curve[:-1] + 0.25 * curve[1:]
        three = 0.25 * curve[:-1] + 0.75 * curve[1:]
        inner = np.stack([quarter, three], axis=1).reshape(-1, 2)
        curve = np.vstack([curve[:1], inner[1:-1], curve[-1:]])
    return curve


def at_steps(curve: Array, step_m: float) -> Array:
    """Return points (K, 2) of a curve at equal steps of its length, of at most `step_m`."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], int(np.ceil(length[-1] / step_m)) + 1)
    return np.column_stack([np.interp(at, length, column) for column in curve.T])


def swept(
    curve: Array, sections: int, reflectance: float, displace: Displace | None = None
) -> Solid:
    """Sweep a curve of rows (radius, z), which runs outwards seen from +z, about z.

    displace: returns the radius and z of vertices from their radius, z and angle, each (S, K).
    """
    angle = np.broadcast_to(
        (2.0 * np.pi / sections * np.arange(sections))[:, None], (sections, len(curve))
    )
    radius, z = (np.broadcast_to(column, angle.shape) for column in curve.T)
    if displace is not None:
        radius, z = displace(radius, z, angle)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    return grid_solid(vertices, reflectance, closed=True)


def grid_solid(vertices: Array, reflectance: float, *, closed: bool) -> Solid:
    """Build one smooth surface from a grid of vertices (S, K, 3); closed: along its first axis."""
    rows, columns = vertices.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    ahead = np.roll(number, -1, axis=0)
    if not closed:
        number, ahead = number[:-1], ahead[:-1]
    a, b = number[:, :-1].ravel(), number[:, 1:].ravel()
    c, d = ahead[:, :-1].ravel(), ahead[:, 1:].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([c, b, d])])
    corners = vertices.reshape(-1, 3)
    area = np.linalg.norm(
        np.cross(
            corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]]
        ),
        axis=1,
    )
    faces = faces[area > 1e-12].astype(np.int64)
    return Solid(
        corners,
        faces,
        np.zeros(len(faces), dtype=np.int64),
        np.zeros(len(faces), dtype=bool),
        reflectance,
    )
