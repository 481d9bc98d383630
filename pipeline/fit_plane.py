"""The plane of a target's face, by total least squares over all its points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.config import PlaneConfig
from pipeline.correlation import variance_inflation
from pipeline.errors import NotMeasuredError
from pipeline.kernels import Array, PlaneMoments, random_rows, total_least_squares
from pipeline.segment import Patch

# Standard deviation of a normal variable cut at 3 sigma, over sigma: with k = 3,
# sqrt(1 - 2 k phi(k)/(2 Phi(k) - 1)).
TRIMMED_AT_3 = 0.98658
FIRST_LOOK_ROWS = 20_000


@dataclass(frozen=True)
class PlaneFit:
    """A fitted plane and the evidence for it.

    centroid_m: (3,) scanner frame. basis: (3, 3) rows: two directions in the plane, then the unit
    normal that points to the scanner. sigma_m: noise across the plane, corrected for the trimming;
    rms_m: root mean square of the residuals of the points used. scatter_m2: (2,) in-plane scatter
    along the basis. count: points used. iterations: until the set of points stood still.
    inflation: of the variance by noise that is correlated; count / inflation points are effective.
    """

    centroid_m: Array
    basis: Array
    sigma_m: float
    rms_m: float
    scatter_m2: Array
    count: int
    iterations: int
    inflation: float

    @property
    def normal(self) -> Array:
        """Unit normal (3,) towards the scanner."""
        return np.asarray(self.basis[2])

    @property
    def normal_covariance(self) -> Array:
        """(3, 3), rad^2: sigma^2 / scatter along each in-plane direction, times the inflation."""
        variance = self.inflation * self.sigma_m**2 / self.scatter_m2
        return (self.basis[:2].T * variance) @ self.basis[:2]


def fit_plane(patch: Patch, radius_m: float, config: PlaneConfig) -> PlaneFit:
    """Plane of the target's face in `patch`, from the points clear of its edge.

    Points are trimmed at 3 sigma of a sigma estimated from themselves, until the set stands still;
    at 3 sigma one step leaves 2.7 % of the error, so few steps suffice. Points nearer to the edge
    than the margin are left out: the laser spot mixes plate and background there.
    Raises NotMeasuredError 'too-few-points'.
    """
    across = patch.face_m @ patch.basis[:2].T
    inside = np.einsum("ij,ij->i", across, across) < (radius_m - config.edge_margin_m) ** 2
    del across
    interior = patch.face_m[inside]
    resolution = 16.0 * np.finfo(float).eps * float(np.abs(patch.origin_m).max() + radius_m)
    sample = random_rows(interior, FIRST_LOOK_ROWS, np.random.default_rng(0))
    depth = sample @ patch.basis[2]
    start = Trim(patch.basis, np.zeros(3), _first_sigma(depth, 0.04 * radius_m))
    look, _, _ = converge(sample, start, resolution, config.max_iterations)
    trim, moments, iterations = converge(interior, look, resolution, config.max_iterations)
    used = (interior - moments.centroid_m) @ moments.basis.T
    used = used[np.abs(used[:, 2]) < trim.limit(resolution)]
    basis = moments.basis if moments.normal @ patch.basis[2] > 0 else -moments.basis * _KEEP_HANDED
    return PlaneFit(
        centroid_m=patch.origin_m + moments.centroid_m,
        basis=basis,
        sigma_m=trim.sigma,
        rms_m=float(np.sqrt(np.mean(used[:, 2] ** 2))),
        scatter_m2=moments.scatter_m2[:2],
        count=moments.count,
        iterations=iterations,
        inflation=variance_inflation(used[:, :2], used[:, 2], trim.sigma, radius_m),
    )


_KEEP_HANDED = np.array([[-1.0], [1.0], [1.0]])


@dataclass(frozen=True)
class Trim:
    """A plane through `point` and the noise across it, by which points are kept or left.

    basis: (3, 3), the normal last. cap: no point further away is ever kept, metres.
    """

    basis: Array
    point: Array
    sigma: float
    cap: float = math.inf

    def limit(self, resolution: float, sigmas: float = 3.0) -> float:
        """Distance within which points are kept: `sigmas` of noise, at least the resolution."""
        return max(min(sigmas * self.sigma, self.cap), resolution)


def _first_sigma(depth: Array, band: float) -> float:
    """Noise about the densest depth: from the median absolute deviation within the band."""
    near = depth[np.abs(depth) < band]
    if len(near) < 10:
        raise NotMeasuredError(
            "too-few-points", f"{len(near)} points on the target's face, 10 needed"
        )
    return float(1.4826 * np.median(np.abs(near - np.median(near))))


def converge(
    points: Array, trim: Trim, resolution: float, max_iterations: int = 50
) -> tuple[Trim, PlaneMoments, int]:
    """Fit points (N, 3), trim at 3 sigma, fit again, until the same points are kept twice.

    resolution: of the coordinates, metres. Raises NotMeasuredError 'too-few-points'.
    """
    kept = np.zeros(0, dtype=bool)
    iterations = 0
    while iterations < max_iterations:
        residual = (points - trim.point) @ trim.basis[2]
        keep = np.abs(residual) < trim.limit(resolution)
        if np.array_equal(keep, kept):
            break
        kept = keep
        if np.count_nonzero(keep) < 4:
            raise NotMeasuredError("too-few-points", "fewer than 4 points agree on a plane")
        moments = total_least_squares(points, keep)
        if moments.scatter_m2[1] <= 100.0 * resolution**2:
            raise NotMeasuredError("too-few-points", "the points on the face span no plane")
        spread = float(np.sqrt(moments.scatter_m2[2] / (moments.count - 3))) / TRIMMED_AT_3
        trim = Trim(moments.basis, moments.centroid_m, spread, trim.cap)
        iterations += 1
    return trim, moments, iterations
