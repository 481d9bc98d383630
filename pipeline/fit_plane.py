"""The plane of a target's face, by total least squares over all its points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.config import PlaneConfig
from pipeline.correlation import CorrelatedNoise, correlated_noise
from pipeline.kernels import Array, random_rows
from pipeline.segment import WIDEST_BAND, Patch
from pipeline.trimmed import TRIMMED_AT_3, Trim, converge, first_sigma

FIRST_LOOK_ROWS = 20_000


@dataclass(frozen=True)
class PlaneFit:
    """A fitted plane and the evidence for it.

    centroid_m: (3,) scanner frame. basis: (3, 3) rows: two directions in the plane, then the unit
    normal that points to the scanner. sigma_m: noise across the plane, corrected for the trimming;
    rms_m: root mean square of the residuals of the points used. scatter_m2: (2,) in-plane scatter
    along the basis. count: points used. iterations: until the set of points stood still.
    correlated: what the residuals say of noise that is alike from point to point.
    """

    centroid_m: Array
    basis: Array
    sigma_m: float
    rms_m: float
    scatter_m2: Array
    count: int
    iterations: int
    correlated: CorrelatedNoise

    @property
    def normal(self) -> Array:
        """Unit normal (3,) towards the scanner."""
        return np.asarray(self.basis[2])

    @property
    def noise_covariance(self) -> Array:
        """(3, 3) by independent noise: of the height (m) at the centroid and the two slopes."""
        return self._white_variance * np.diag([1.0 / self.count, *(1.0 / self.scatter_m2)])

    @property
    def normal_covariance(self) -> Array:
        """(3, 3), rad^2, by all noise, independent and correlated."""
        slopes = (self.noise_covariance + self.correlated.covariance)[1:, 1:]
        return np.asarray(self.basis[:2].T @ slopes @ self.basis[:2])

    @property
    def tilt_if_independent_rad(self) -> float:
        """What the usual formula would claim: root mean square over the two tilts, k = 1."""
        return float(self.sigma_m * np.sqrt(np.mean(1.0 / self.scatter_m2)))

    @property
    def tilt_rad(self) -> float:
        """Standard uncertainty of the tilt by all noise, root mean square over two axes."""
        return float(np.sqrt(np.trace(self.normal_covariance) / 2.0))

    @property
    def effective_count(self) -> float:
        """Independent points of the same noise that would give the same uncertainty of the tilt."""
        if not self.tilt_rad > 0.0:
            return float(self.count)
        return self.count * min(1.0, (self.tilt_if_independent_rad / self.tilt_rad) ** 2)

    @property
    def _white_variance(self) -> float:
        """Of the noise that is independent; all of it where no correlation was seen."""
        if not self.correlated.sigma_m > 0.0:
            return self.sigma_m**2
        return min(self.sigma_m, self.correlated.white_sigma_m / TRIMMED_AT_3) ** 2


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
    basis = moments.basis if moments.normal @ patch.basis[2] > 0 else -moments.basis * _KEEP_HANDED
    used = (interior - moments.centroid_m) @ basis.T
    used = used[np.abs(used[:, 2]) < trim.limit(resolution)]
    return PlaneFit(
        centroid_m=patch.origin_m + moments.centroid_m,
        basis=basis,
        sigma_m=trim.sigma,
        rms_m=float(np.sqrt(np.mean(used[:, 2] ** 2))),
        scatter_m2=moments.scatter_m2[:2],
        count=moments.count,
        iterations=iterations,
        correlated=correlated_noise(used[:, :2], used[:, 2], radius_m, resolution),
    )


_KEEP_HANDED = np.array([[-1.0], [1.0], [1.0]])
