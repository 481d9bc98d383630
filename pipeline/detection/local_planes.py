"""Planes through neighbouring points, as a problem for RANSAC."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..cloud import gather_ball
from ..plane import total_least_squares
from ..vectors import Array


class LocalPlanes:
    """Planes through three neighbouring points, scored within a target's reach of the first.

    A model is a row (6,): a point on the plane, its unit normal.
    """

    def __init__(self, points: Array, radius_m: float, threshold: float) -> None:
        order, self._start, self._count = _voxels(points, radius_m)
        self._points = points[order]
        self._single = self._points.astype(np.float32)
        self._squares = np.einsum("ij,ij->i", self._single, self._single)
        self._reach = 1.2 * radius_m
        self._threshold = threshold

    def propose(self, count: int, rng: np.random.Generator) -> Sequence[Array]:
        """Return planes through a random point and two others of its voxel."""
        seeds = rng.integers(len(self._points), size=count)
        size, start = self._count[seeds], self._start[seeds]
        second, third = (self._points[start + (rng.random(count) * size).astype(int)] for _ in "bc")
        first = self._points[seeds]
        normal = np.cross(second - first, third - first)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
        return list(np.hstack([first, normal]))

    def score(self, models: Sequence[Array]) -> Array:
        """Return the MSAC score: sum over points in reach of 1 - (distance / threshold)^2, > 0."""
        rows = np.asarray(models, dtype=np.float32)
        point, normal = rows[:, :3], rows[:, 3:]
        score = self._single @ normal.T
        score -= np.einsum("ij,ij->i", point, normal)
        score *= score
        score *= np.float32(-1.0 / self._threshold**2)
        score += 1.0
        square = self._single @ (-2.0 * point.T)
        square += self._squares[:, None]
        reach = np.float32(self._reach**2) - np.einsum("ij,ij->i", point, point)
        score[(square > reach) | (score < 0.0)] = 0.0
        total = score.sum(axis=0, dtype=np.float64)
        return np.where(np.abs(normal).sum(axis=1) > 0.0, total, 0.0)

    def refine(self, model: Array) -> Array:
        """Fit the points in reach by least squares, then those within half the threshold."""
        for share in (1.0, 0.5):
            near = gather_ball(self._points, model[:3], self._reach)
            near = near[np.abs(near @ model[3:]) < share * self._threshold]
            if len(near) < 3:
                return model
            plane = total_least_squares(near)
            model = np.concatenate([model[:3] + plane.centroid_m, plane.normal])
        return model

    def success_rate(self, model: Array) -> float:
        """Return the share of points on the plane times 1/4, the chance of two good neighbours."""
        near = gather_ball(self._points, model[:3], self._reach)
        on_plane = np.count_nonzero(np.abs(near @ model[3:]) < self._threshold)
        return 0.25 * on_plane / len(self._points)


def _voxels(
    points: Array, size: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Sort points (N, 3) into voxels of edge `size`: order; start and count of each one's voxel."""
    index = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    key = (index[:, 0] << 42) + (index[:, 1] << 21) + index[:, 2]
    order = np.argsort(key, kind="stable")
    _, start, inverse, count = np.unique(
        key[order], return_index=True, return_inverse=True, return_counts=True
    )
    return order, start[inverse], count[inverse]
