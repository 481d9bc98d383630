"""Sigma-clipped plane of total least squares and the noise across it, from sums of points.

One pass over the points sums those surely within three sigma, by cells of a raster, and sets aside
the few near the limit. The iterations to convergence need the sums and those few points alone.
"""

from __future__ import annotations

import numpy as np

from ..cloud import SlabMoments, slab_moments
from ..errors import NotMeasuredError
from ..system import frozen
from ..targets import Region
from ..vectors import Array
from .sigma_clipping import CLIPPED_SIGMA_RATIO

MARGIN = 0.15  # of the limit: how far the plane may move before the points are summed again
MAX_TILT = 1e-3  # of the plane to the axes of its sums, above which the points are summed again


@frozen(eq=False)
class ClipSlab:
    """Slab in which points are summed, about the plane w = height_m in the axes basis (3, 3).

    sigma_m: noise across the plane; points beyond three sigma are clipped. resolution_m: of the
    coordinates; no point within it is clipped.
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
        """Sum the points_m (N, 3) that are surely kept; set aside those near the limit."""
        limits = ((1.0 - MARGIN) * self.limit_m, (1.0 + MARGIN) * self.limit_m)
        return slab_moments(points_m, self.basis, self.height_m, limits, region.bounds_m, across)

    def is_near(self, plane: ClippedPlane, radius_m: float) -> bool:
        """Return whether the plane keeps all points surely kept here, within radius_m."""
        tilt = float(np.hypot(*plane.tilt))
        moved = abs(float(plane.centroid_m[2]) - self.height_m) + tilt * radius_m
        moved += abs(3.0 * plane.sigma_m - 3.0 * self.sigma_m)
        return tilt < MAX_TILT and moved < MARGIN * self.limit_m

    def moved_to(self, plane: ClippedPlane) -> ClipSlab:
        """Return the slab about another plane, given in the axes of this one."""
        basis = plane.basis(self.basis)
        height = float(plane.centroid_m @ self.basis @ basis[2])
        return ClipSlab(basis, height, plane.sigma_m, self.resolution_m)


@frozen(eq=False)
class ClippedPlane:
    """Plane of total least squares in the axes of its slab: w - w0 = tilt . (u - u0, v - v0).

    sums: (cells, 10) of its points. centroid_m: (3,). tilt: (2,). scatter_m2: (2, 2) along u, v.
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
        """Fit the plane to the sums: square = (S_ww - 2 t.s + t.S t) / (1 + t.t).

        The tilt is t = (S - square)^-1 s. Raises NotMeasuredError 'too-few-points'.
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
            raise NotMeasuredError("too-few-points", "the points on the target span no plane")
        for _ in range(4):
            tilt = np.linalg.solve(across - square * np.eye(2), along)
            square = scatter[2, 2] - 2.0 * tilt @ along + tilt @ across @ tilt
            square = max(float(square / (1.0 + tilt @ tilt)), 0.0)
        return cls(sums, mean, tilt, across, square, count)

    @property
    def sigma_m(self) -> float:
        """Noise across the plane, corrected for the clipping."""
        return float(np.sqrt(self.square_m2 / (self.count - 3))) / CLIPPED_SIGMA_RATIO

    def distance_m(self, uvw_m: Array) -> Array:
        """Return the signed distance (N,) of uvw_m (N, 3) from the plane."""
        across = (uvw_m[:, :2] - self.centroid_m[:2]) @ self.tilt
        height = uvw_m[:, 2] - self.centroid_m[2] - across
        return np.asarray(height / np.sqrt(1.0 + self.tilt @ self.tilt))

    def distances(self, axes: Array) -> tuple[Array, float]:
        """Return rows (3, 3): the axes u and v as they are, and the normal; and its distance.

        A point p lies at normal . p - distance from the plane, as `distance_m` gives.
        """
        a, b = self.tilt
        across = np.array([-a, -b, 1.0]) / np.sqrt(1.0 + a * a + b * b)
        return np.stack([axes[0], axes[1], across @ axes]), float(across @ self.centroid_m)

    def basis(self, axes: Array) -> Array:
        """Return rows (3, 3): the axes u and v projected into the plane, then its normal."""
        normal = axes[2] - self.tilt @ axes[:2]
        normal /= np.linalg.norm(normal)
        first = axes[0] - (axes[0] @ normal) * normal
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(normal, first), normal])

    def residual_sums(self) -> Array:
        """Return the sums (cells, 10) about the centroid, with distances from the plane for w.

        Of the second moments only w w is filled in.
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


@frozen
class ClippedFit:
    """Converged plane, in the axes of its slab.

    side_m: of the raster's cells of plane.sums. iterations: fits until the same points were kept.
    """

    plane: ClippedPlane
    slab: ClipSlab
    side_m: float
    iterations: int

    @property
    def centroid_m(self) -> Array:
        """Centroid (3,) in the axes of the points."""
        return np.asarray(self.plane.centroid_m @ self.slab.basis)

    @property
    def basis(self) -> Array:
        """Rows (3, 3): the slab's first axes u and v projected into the plane, then its normal."""
        return self.plane.basis(self.slab.basis)

    @property
    def normal(self) -> Array:
        """Unit normal (3,), on the side of the slab's."""
        return np.asarray(self.basis[2])


def fit_clipped_plane(
    points_m: Array,
    region: Region,
    slab: ClipSlab,
    radius_m: float,
    across: int,
    max_iterations: int,
) -> ClippedFit:
    """Fit the plane of the points_m (N, 3) within the region, clipped at three sigma.

    slab: where to start; its axes u, v are those of the region, its origin that of the points.
    The points are summed again while the plane leaves the slab somewhere within radius_m.
    across: cells of the raster's side. Raises NotMeasuredError 'too-few-points'.
    """
    iterations = 0
    while True:
        moments = slab.sums(points_m, region, across)
        plane, steps = _converge(moments, slab, max_iterations)
        iterations += steps
        if iterations >= max_iterations or slab.is_near(plane, radius_m):
            return ClippedFit(plane, slab, moments.side_m, iterations)
        slab = slab.moved_to(plane)


def _converge(
    moments: SlabMoments, slab: ClipSlab, max_iterations: int
) -> tuple[ClippedPlane, int]:
    """Fit, clip and fit again until the same points are kept; also return the number of fits."""
    keep = np.abs(moments.edge[:, 2] - slab.height_m) < slab.limit_m
    steps = 0
    while steps < max_iterations:
        steps += 1
        plane = ClippedPlane.of(moments.with_edge(keep))
        limit = max(3.0 * plane.sigma_m, slab.resolution_m)
        before, keep = keep, np.abs(plane.distance_m(moments.edge)) < limit
        if np.array_equal(before, keep):
            break
    return plane, steps
