"""A plane and the noise across it by sums of points: trimmed at three sigma until it stands still.

One pass over the points sums those that are surely within, by cells, and keeps aside the few near
the limit; what follows, until the same points are kept twice, needs the sums and those few alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..cloud import SlabMoments, slab_moments
from ..errors import NotMeasuredError
from ..targets import Region
from ..vectors import Array
from .sigma_clipping import TRIMMED_AT_3

MARGIN = 0.15  # of the limit: how far its place may move before the points are summed again
MAX_TILT = 1e-3  # of the plane against the axes of its sums, above which they are summed again


@dataclass(frozen=True)
class ClipSlab:
    """Where points are summed: about the plane w = height_m in axes basis (3, 3).

    sigma_m: noise, at three of which points are left out. resolution_m: of the coordinates.
    """

    basis: Array
    height_m: float
    sigma_m: float
    resolution_m: float

    @property
    def limit_m(self) -> float:
        """Distance within which points are kept."""
        return max(3.0 * self.sigma_m, self.resolution_m)

    def sums(self, points_m: Array, region: Region, across: int) -> SlabMoments:
        """One pass over points_m (N, 3): sums of those surely kept, and those near the limit."""
        limits = ((1.0 - MARGIN) * self.limit_m, (1.0 + MARGIN) * self.limit_m)
        return slab_moments(points_m, self.basis, self.height_m, limits, region.bounds_m, across)

    def is_near(self, plane: ClippedPlane, radius_m: float) -> bool:
        """Whether the plane keeps what this one surely kept, wherever on the face."""
        tilt = float(np.hypot(*plane.tilt))
        moved = abs(float(plane.centroid_m[2]) - self.height_m) + tilt * radius_m
        moved += abs(3.0 * plane.sigma_m - 3.0 * self.sigma_m)
        return tilt < MAX_TILT and moved < MARGIN * self.limit_m

    def moved_to(self, plane: ClippedPlane) -> ClipSlab:
        """The slab about another plane."""
        basis = plane.basis(self.basis)
        height = float(plane.centroid_m @ self.basis @ basis[2])
        return ClipSlab(basis, height, plane.sigma_m, self.resolution_m)


@dataclass(frozen=True)
class ClippedPlane:
    """A plane of total least squares in the axes of its slab: w - w0 = lean . (u - u0, v - v0).

    sums: (cells, 10) of its points. centroid_m: (3,). lean: (2,). scatter_m2: (2, 2) along u, v.
    square_m2: sum of the squared distances.
    """

    sums: Array
    centroid_m: Array
    tilt: Array
    scatter_m2: Array
    square_m2: float
    count: int

    @classmethod
    def of(cls, sums: Array) -> ClippedPlane:
        """By the sums; square = (S_ww - 2 t.s + t.S t) / (1 + t.t), t = (S - square)^-1 s.

        Raises NotMeasuredError.
        """
        total = sums.sum(axis=0)
        count = int(total[0])
        if count < 4:
            raise NotMeasuredError("too-few-points", "fewer than 4 points agree on a plane")
        mean = total[1:4] / count
        uu, uv, vv, uw, vw, ww = total[4:]
        scatter = np.array([[uu, uv, uw], [uv, vv, vw], [uw, vw, ww]])
        scatter -= count * np.outer(mean, mean)
        across, along, square = scatter[:2, :2], scatter[:2, 2], 0.0
        if not np.linalg.eigvalsh(across)[0] > max(scatter[2, 2], 0.0):
            raise NotMeasuredError("too-few-points", "the points on the face span no plane")
        for _ in range(4):
            tilt = np.linalg.solve(across - square * np.eye(2), along)
            square = scatter[2, 2] - 2.0 * tilt @ along + tilt @ across @ tilt
            square = max(float(square / (1.0 + tilt @ tilt)), 0.0)
        return cls(sums, mean, tilt, across, square, count)

    @property
    def sigma_m(self) -> float:
        """Noise across the plane, corrected for the trimming."""
        return float(np.sqrt(self.square_m2 / (self.count - 3))) / TRIMMED_AT_3

    def distance_m(self, uvw_m: Array) -> Array:
        """Of uvw_m (N, 3) from the plane, with sign."""
        across = (uvw_m[:, :2] - self.centroid_m[:2]) @ self.tilt
        height = uvw_m[:, 2] - self.centroid_m[2] - across
        return np.asarray(height / np.sqrt(1.0 + self.tilt @ self.tilt))

    def basis(self, axes: Array) -> Array:
        """Rows (3, 3): the axes u and v laid into the plane, then its normal."""
        normal = axes[2] - self.tilt @ axes[:2]
        normal /= np.linalg.norm(normal)
        first = axes[0] - (axes[0] @ normal) * normal
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(normal, first), normal])

    def residual_sums(self) -> Array:
        """The sums (cells, 10) about the centroid, with distances from the plane for w.

        Of the mixed ones only w w is filled in.
        """
        n = self.sums[:, :1]
        mean = self.centroid_m
        first = self.sums[:, 1:4] - n * mean
        pairs = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
        uu, uv, vv, uw, vw, ww = (
            self.sums[:, 4 + k] - mean[i] * self.sums[:, 1 + j] - mean[j] * first[:, i]
            for k, (i, j) in enumerate(pairs)
        )
        a, b = self.tilt
        scale = 1.0 / np.sqrt(1.0 + a * a + b * b)
        out = np.zeros_like(self.sums)
        out[:, :1], out[:, 1:3] = n, first[:, :2]
        out[:, 3] = scale * (first[:, 2] - first[:, :2] @ self.tilt)
        square = ww - 2.0 * (a * uw + b * vw) + a * a * uu + 2.0 * a * b * uv + b * b * vv
        out[:, 9] = scale**2 * square
        return out


def settle(held: SlabMoments, slab: ClipSlab, max_iterations: int) -> tuple[ClippedPlane, int]:
    """The plane that keeps the points it is fitted to, and how many steps led there."""
    keep = np.abs(held.edge[:, 2] - slab.height_m) < slab.limit_m
    steps = 0
    while steps < max_iterations:
        steps += 1
        plane = ClippedPlane.of(held.with_edge(keep))
        limit = max(3.0 * plane.sigma_m, slab.resolution_m)
        before, keep = keep, np.abs(plane.distance_m(held.edge)) < limit
        if np.array_equal(before, keep):
            break
    return plane, steps
