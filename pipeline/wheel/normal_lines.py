"""Axis of revolution from lines of normals: on a surface of revolution, each meets the axis.

A line through p along n has the moment p x n. It meets the axis, of direction a and moment m, where
n.m + (p x n).a = 0, which is linear in (a, m): a linear complex.
Source: Pottmann and Randrup, Computing 60 (1998) 307.
"""

from __future__ import annotations

import numpy as np

from ..system import frozen
from ..vectors import Array, plane_basis

ROUNDS = 12
CLIP = 2.5  # of the robust scale
LEAST_SCALE_M = 1e-5


@frozen(eq=False)
class Axis:
    """A line: a point on it, and its unit direction, each (3,)."""

    point_m: Array
    direction: Array

    def towards(self, way: Array) -> Axis:
        """Return the same line, its direction on the side of `way` (3,)."""
        return self if self.direction @ way > 0.0 else Axis(self.point_m, -self.direction)

    def cylindrical(self, points_m: Array, basis: Array | None = None) -> tuple[Array, Array]:
        """Return points (N, 3) along two axes across the line (N, 2), and along it (N,)."""
        rows = self.basis if basis is None else basis
        uvw = (points_m - self.point_m) @ rows.T
        return uvw[:, :2], uvw[:, 2]

    @property
    def basis(self) -> Array:
        """Rows (3, 3): two axes across the line, then its direction."""
        return plane_basis(self.direction)


def axis_of_normals(points_m: Array, normals: Array, weights: Array, start: Axis) -> Axis:
    """Return the axis that the lines through points (S, 3) along unit normals (S, 3) meet best.

    Weighted least squares of the distances, reweighted by Tukey's function until it has settled;
    start: by which the first weights are found. Lines parallel to the axis count for nothing, as
    the distance is times the sine of the angle to it.
    """
    axis, about_origin = start, np.cross(points_m, normals)
    for _ in range(ROUNDS):
        basis = axis.basis
        # (p - q) x n . b = p x n . b - n . (b x q): moments about the axis's point, by its basis
        moments = about_origin @ basis.T - normals @ np.cross(basis, axis.point_m).T
        off = moments[:, 2]
        scale = max(1.4826 * float(np.median(np.abs(off))), LEAST_SCALE_M)
        share = (off / (2.0 * CLIP * scale)) ** 2
        w = weights * np.where(share < 1.0, (1.0 - share) ** 2, 0.0)
        # a + s b1 + t b2, point + x b1 + y b2: the distance is linear in s, t, x, y at the start
        rows = np.column_stack(
            [moments[:, 0], moments[:, 1], -(normals @ basis[1]), normals @ basis[0]]
        )
        normal_matrix = (rows * w[:, None]).T @ rows
        if not np.trace(normal_matrix) > 0.0:
            break  # every line is off, or parallel to the axis
        damped = normal_matrix + 1e-9 * np.trace(normal_matrix) * np.eye(4)
        step = -np.linalg.solve(damped, (rows * w[:, None]).T @ off)
        direction = axis.direction + step[:2] @ basis[:2]
        axis = Axis(axis.point_m + step[2:] @ basis[:2], direction / np.linalg.norm(direction))
        if float(np.abs(step).max()) < 1e-7:
            break
    return axis
