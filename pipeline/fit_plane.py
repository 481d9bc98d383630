"""The plane of a target's face, by total least squares over all its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.config import PlaneConfig
from pipeline.correlation import variance_inflation
from pipeline.kernels import Array, random_rows
from pipeline.segment import WIDEST_BAND, Patch
from pipeline.trimmed import Trim, converge, first_sigma

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
    start = Trim(patch.basis, np.zeros(3), first_sigma(depth, WIDEST_BAND * radius_m))
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
