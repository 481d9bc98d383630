"""The plane of least squares through points, and small passes over them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
GRID_PER_M = 2.0**20  # to which coordinates are rounded before they are hashed
CHUNK_ROWS = 32_768  # three float64 columns of it stay in a second-level cache


@dataclass(frozen=True)
class PlaneMoments:
    """A plane by total least squares: n . (x - centroid) = 0.

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


def total_least_squares(points_m: Array, keep: npt.NDArray[np.bool_] | None = None) -> PlaneMoments:
    """Plane of least squared orthogonal distance through points_m (N, 3), or those in keep (N,).

    At least 3 points. Eigenvectors of the centred 3x3 scatter. Centred first on a point of the
    cloud, which is exact, then on the mean, so that coordinates of 1e7 m lose nothing but their own
    resolution. eigh gives the smallest eigenvalue and its vector only to eps times the largest, so
    the scatter is summed once more along its axes, and the plane leant by what that leaves over.
    The normal's largest component is positive.
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
        turned = (local - mean) @ basis.T
        along += turned.T @ turned
    basis, across = _leant(basis, along)
    scatter_m2 = np.array([*values[:0:-1].clip(min=0.0), across])
    return PlaneMoments(origin + mean, basis, scatter_m2, count)


def _leant(basis: Array, along: Array) -> tuple[Array, float]:
    """The basis with its normal leant by the cross moments left in `along` (3, 3), the scatter.

    Also the scatter across the leant plane: S33 - t . (S13, S23), with t = S_i3 / (S_ii - S33).
    """
    wide = np.diag(along)[:2] - along[2, 2]
    lean = np.divide(along[:2, 2], wide, out=np.zeros(2), where=wide > 0.0)
    normal = basis[2] - lean @ basis[:2]
    normal /= np.linalg.norm(normal)
    normal *= np.sign(normal[np.argmax(np.abs(normal))])
    first = basis[0] - (basis[0] @ normal) * normal
    first /= np.linalg.norm(first)
    across = max(float(along[2, 2] - lean @ along[:2, 2]), 0.0)
    return np.stack([first, cross(normal, first), normal]), across


def cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors (3,), to the bit as np.cross has it, in a tenth of its time.

    np.cross takes vectors of any shape along any axis, and some 15 us to find out.
    """
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def _chunks(
    points_m: Array, keep: npt.NDArray[np.bool_] | None, origin_m: Array
) -> Iterator[Array]:
    """The kept points relative to origin_m, some rows at a time, as fresh arrays."""
    for start in range(0, len(points_m), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        yield (points_m[rows] if keep is None else points_m[rows][keep[rows]]) - origin_m


def plane_basis(normal: Array) -> Array:
    """Rows of a right-handed basis (3, 3) whose third row is the unit normal (3,)."""
    axis = np.zeros(3)
    axis[np.argmin(np.abs(normal))] = 1.0
    first = cross(axis, normal)
    first /= math.sqrt(first @ first)
    return np.stack([first, cross(normal, first), normal])


def gather_ball(points_m: Array, centre_m: Array, radius_m: float) -> Array:
    """Points of points_m (N, 3) within radius_m of centre_m (3,), relative to it: (M, 3)."""
    kept = [np.zeros((0, 3))]
    for start in range(0, len(points_m), CHUNK_ROWS):
        x, y, z = offset = points_m[start : start + CHUNK_ROWS].T - centre_m[:, None]
        near = np.nonzero(x * x + y * y + z * z < radius_m**2)[0]
        kept.append(offset[:, near].T)
    return np.concatenate(kept)


@dataclass(frozen=True)
class Slab:
    """A disc of space about an axis along a plane's normal.

    reach_m: from the axis, growing by `slope` per metre of depth, to most_m. depth_m: from the
    plane.
    """

    reach_m: float
    depth_m: float
    slope: float = 0.0
    most_m: float = math.inf

    def holds(self, square_m2: Array, depth_m: Array) -> npt.NDArray[np.bool_]:
        """Which points, by squared distance from the axis and distance from the plane (N,)."""
        near = depth_m < self.depth_m
        if self.slope == 0.0:
            near &= square_m2 < min(self.reach_m, self.most_m) ** 2
            return near
        reach = self.slope * depth_m
        reach += self.reach_m
        np.minimum(reach, self.most_m, out=reach)
        near &= square_m2 < np.multiply(reach, reach, out=reach)
        return near


def within_slab(
    points_m: Array, point_m: Array, normal: Array, threshold_m: float
) -> npt.NDArray[np.bool_]:
    """Which of points_m (N, 3) lie within threshold_m of the plane through point_m: (N,) bool."""
    inside = np.empty(len(points_m), dtype=bool)
    for start in range(0, len(points_m), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        np.less(np.abs((points_m[rows] - point_m) @ normal), threshold_m, out=inside[rows])
    return inside


def random_rows(points: Array, count: int, rng: np.random.Generator) -> Array:
    """At most `count` rows of points (N, 3), one from each of `count` equal stretches of the file.

    A stratified draw: the rows keep the file's spread at any file order.
    """
    total = len(points)
    if total <= count:
        return points.copy()
    rows = ((np.arange(count) + rng.random(count)) * (total / count)).astype(np.int64)
    return points[np.minimum(rows, total - 1)]
