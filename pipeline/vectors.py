"""The plane of least squares through points, and small passes over them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Array32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.int64]  # indices of points
GRID_PER_M = 2.0**20  # to which coordinates are rounded before they are hashed
CHUNK_ROWS = 32_768  # three float64 columns of it stay in a second-level cache


def cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors (3,), to the bit as np.cross has it, in a tenth of its time.

    np.cross takes vectors of any shape along any axis, and some 15 us to find out.
    """
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def plane_basis(normal: Array) -> Array:
    """Rows of a right-handed basis (3, 3) whose third row is the unit normal (3,)."""
    axis = np.zeros(3)
    axis[np.argmin(np.abs(normal))] = 1.0
    first = cross(axis, normal)
    first /= math.sqrt(first @ first)
    return np.stack([first, cross(normal, first), normal])


def turned(vectors: Array, turn_rad: float) -> Array:
    """Vectors (N, 2) turned from u towards v."""
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.asarray(vectors @ np.array([[c, s], [-s, c]]))
