"""Plane of total least squares through points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..system import frozen
from ..vectors import CHUNK_ROWS, Array, Mask, cross, norm


@frozen(eq=False)
class PlaneMoments:
    """Plane of total least squares: n . (x - centroid) = 0.

    centroid_m: (3,) mean of the points. normal: (3,) unit, sign free.
    basis: (3, 3) rows of a right-handed basis: two directions in the plane, then the normal.
    scatter_m2: (3,) eigenvalues of the centred scatter in the order of the basis' rows.
    count: number of points.
    """

    centroid_m: Array
    basis: Array
    scatter_m2: Array
    count: int

    @property
    def normal(self) -> Array:
        """Unit normal (3,), the direction of least scatter."""
        return np.asarray(self.basis[2])


def total_least_squares(points_m: Array, keep: Mask | None = None) -> PlaneMoments:
    """Fit the plane of least squared orthogonal distances to points_m (N, 3), those in keep (N,).

    At least 3 points. Eigenvectors of the centred 3x3 scatter. The points are centred first on one
    of them, which is exact, then on the mean, so that coordinates of 1e7 m lose nothing but their
    own resolution. eigh gives the smallest eigenvalue and its vector only to eps times the largest,
    so the scatter is summed once more along its axes, and the plane tilted by the cross moments
    that remain. The normal's largest component is positive.
    Source: Shakarji, J. Res. NIST 103 (1998) 633, section 3.
    """
    if keep is not None and len(points_m) <= CHUNK_ROWS:
        points_m, keep = points_m[keep], None
    origin = points_m[0 if keep is None else int(np.argmax(keep))]
    count = len(points_m) if keep is None else int(np.count_nonzero(keep))
    total = np.zeros(3)
    for local in _chunks(points_m, keep, origin):
        total += local.sum(axis=0)
    mean = total / count
    scatter = np.zeros((3, 3))
    for local in _chunks(points_m, keep, origin):
        local -= mean
        scatter += local.T @ local
    values, vectors = np.linalg.eigh(scatter)
    basis = vectors.T[::-1]
    along = np.zeros((3, 3))
    for local in _chunks(points_m, keep, origin):
        uvw = (local - mean) @ basis.T
        along += uvw.T @ uvw
    basis, across = _tilted(basis, along)
    scatter_m2 = np.array([*values[:0:-1].clip(min=0.0), across])
    return PlaneMoments(origin + mean, basis, scatter_m2, count)


def _tilted(basis: Array, along: Array) -> tuple[Array, float]:
    """Return the basis, tilted by the cross moments that remain in `along` (3, 3), the scatter.

    Also return the scatter across the tilted plane: S33 - t . (S13, S23), t = S_i3 / (S_ii - S33).
    """
    wide = np.diag(along)[:2] - along[2, 2]
    tilt = np.divide(along[:2, 2], wide, out=np.zeros(2), where=wide > 0.0)
    normal = basis[2] - tilt @ basis[:2]
    normal /= norm(normal)
    normal *= np.sign(normal[np.argmax(np.abs(normal))])
    first = basis[0] - (basis[0] @ normal) * normal
    first /= norm(first)
    across = max(float(along[2, 2] - tilt @ along[:2, 2]), 0.0)
    return np.stack([first, cross(normal, first), normal]), across


def _chunks(points_m: Array, keep: Mask | None, origin_m: Array) -> Iterator[Array]:
    """Yield the kept points relative to origin_m, some rows at a time, as new arrays."""
    for start in range(0, len(points_m), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        yield (points_m[rows] if keep is None else points_m[rows][keep[rows]]) - origin_m
