"""Plane of the target, by total least squares over all its points within three sigma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..config import PlaneConfig
from ..targets import Target
from ..vectors import Array
from .clipped_plane import ClipSlab, fit_clipped_plane
from .correlated_noise import (
    CorrelatedNoise,
    cells_across,
    cells_of,
    correlated_noise,
)
from .patch import Patch
from .sigma_clipping import CLIPPED_SIGMA_RATIO


@dataclass(frozen=True)
class PlaneFit:
    """Fitted plane and the evidence for it.

    centroid_m: (3,) scanner frame. basis: (3, 3) rows: the patch's axes u and v projected into the
    plane, then the unit normal towards the scanner. sigma_m: noise across the plane, corrected for
    the clipping; rms_m: root mean square of the residuals of the points used. scatter_m2: (2, 2)
    in-plane scatter along u and v. count: points used. iterations: until the set of points
    converged. correlated: noise correlated from point to point, from the residuals.
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
        """Covariance (3, 3) of the height (m) at the centroid and two slopes, independent noise."""
        covariance = np.diag([1.0 / self.count, 0.0, 0.0])
        covariance[1:, 1:] = np.linalg.inv(self.scatter_m2)
        return self._white_variance * covariance

    @property
    def normal_covariance(self) -> Array:
        """Covariance (3, 3) of the normal, rad^2, by all noise, independent and correlated."""
        slopes = (self.noise_covariance + self.correlated.covariance)[1:, 1:]
        return np.asarray(self.basis[:2].T @ slopes @ self.basis[:2])

    @property
    def tilt_if_independent_rad(self) -> float:
        """Standard uncertainty of the tilt if all noise were independent, rms over two axes."""
        return float(self.sigma_m * np.sqrt(np.trace(np.linalg.inv(self.scatter_m2)) / 2.0))

    @property
    def tilt_rad(self) -> float:
        """Standard uncertainty of the tilt by all noise, rms over two axes."""
        return float(np.sqrt(np.trace(self.normal_covariance) / 2.0))

    @property
    def effective_count(self) -> float:
        """Number of points of independent noise that give the same uncertainty of the tilt."""
        if not self.tilt_rad > 0.0:
            return float(self.count)
        return self.count * min(1.0, (self.tilt_if_independent_rad / self.tilt_rad) ** 2)

    @property
    def _white_variance(self) -> float:
        """Variance of the independent noise: of all noise where no correlation was found."""
        if not self.correlated.sigma_m > 0.0:
            return self.sigma_m**2
        return min(self.sigma_m, self.correlated.white_sigma_m / CLIPPED_SIGMA_RATIO) ** 2


def fit_plane(patch: Patch, target: Target, config: PlaneConfig) -> PlaneFit:
    """Fit the plane of the target in `patch` to the points clear of its edges.

    Total least squares over points within 3 sigma, sigma estimated from the points themselves,
    until the set of points converges; at 3 sigma one step leaves 2.7 % of the error, so few steps
    suffice. Points nearer to an edge than the margin are left out: there the laser spot mixes
    target and background. Raises NotMeasuredError 'too-few-points'.
    """
    region = target.region.shrunk(config.edge_margin_m)
    across = cells_across(len(patch.face_m))
    resolution = 16.0 * np.finfo(float).eps
    resolution *= float(np.abs(patch.origin_m).max() + target.radius_m)
    slab = ClipSlab(patch.basis, 0.0, patch.sigma_m, resolution)
    radius, most = target.radius_m, config.max_iterations
    fit = fit_clipped_plane(patch.face_m, region, slab, radius, across, most)
    plane = fit.plane
    rms = float(np.sqrt(plane.square_m2 / plane.count))
    cells = cells_of(plane.residual_sums(), across, fit.side_m)
    return PlaneFit(
        centroid_m=patch.origin_m + fit.centroid_m,
        basis=fit.basis,
        sigma_m=plane.sigma_m,
        rms_m=rms,
        scatter_m2=plane.scatter_m2,
        count=plane.count,
        iterations=fit.iterations,
        correlated=correlated_noise(cells, radius, rms, resolution),
    )
