"""The plane of a target's face, by total least squares over all its points within three sigma."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..config import PlaneConfig
from ..targets import Target
from ..vectors import Array
from .clipped_plane import ClipSlab, settle
from .correlated_noise import (
    CorrelatedNoise,
    cells_across,
    cells_of,
    correlated_noise,
)
from .patch import Patch
from .sigma_clipping import TRIMMED_AT_3


@dataclass(frozen=True)
class PlaneFit:
    """A fitted plane and the evidence for it.

    centroid_m: (3,) scanner frame. basis: (3, 3) rows: the patch's axes u and v laid into the
    plane, then the unit normal that points to the scanner. sigma_m: noise across the plane,
    corrected for the trimming; rms_m: root mean square of the residuals of the points used.
    scatter_m2: (2, 2) in-plane scatter along u and v. count: points used. iterations: until the set
    of points stood still. correlated: what the residuals say of noise that is alike from point to
    point.
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
        covariance = np.diag([1.0 / self.count, 0.0, 0.0])
        covariance[1:, 1:] = np.linalg.inv(self.scatter_m2)
        return self._white_variance * covariance

    @property
    def normal_covariance(self) -> Array:
        """(3, 3), rad^2, by all noise, independent and correlated."""
        slopes = (self.noise_covariance + self.correlated.covariance)[1:, 1:]
        return np.asarray(self.basis[:2].T @ slopes @ self.basis[:2])

    @property
    def tilt_if_independent_rad(self) -> float:
        """What the usual formula would claim: root mean square over the two tilts, k = 1."""
        return float(self.sigma_m * np.sqrt(np.trace(np.linalg.inv(self.scatter_m2)) / 2.0))

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


def fit_plane(patch: Patch, target: Target, config: PlaneConfig) -> PlaneFit:
    """Plane of the target's face in `patch`, from the points clear of its edges.

    Total least squares over points within 3 sigma, sigma estimated from themselves, until the set
    stands still; at 3 sigma one step leaves 2.7 % of the error, so few steps suffice. Points nearer
    to an edge than the margin are left out: the laser spot mixes plate and background there.
    Raises NotMeasuredError 'too-few-points'.
    """
    region = target.region.shrunk(config.edge_margin_m)
    across = cells_across(len(patch.face_m))
    resolution = 16.0 * np.finfo(float).eps
    resolution *= float(np.abs(patch.origin_m).max() + target.radius_m)
    slab = ClipSlab(patch.basis, 0.0, patch.sigma_m, resolution)
    iterations = 0
    while True:
        held = slab.sums(patch.face_m, region, across)
        plane, steps = settle(held, slab, config.max_iterations)
        iterations += steps
        if iterations >= config.max_iterations or slab.is_near(plane, target.radius_m):
            break
        slab = slab.moved_to(plane)
    basis = plane.basis(slab.basis)
    rms = float(np.sqrt(plane.square_m2 / plane.count))
    cells = cells_of(plane.residual_sums(), across, held.side_m)
    return PlaneFit(
        centroid_m=patch.origin_m + plane.centroid_m @ slab.basis,
        basis=basis,
        sigma_m=plane.sigma_m,
        rms_m=rms,
        scatter_m2=plane.scatter_m2,
        count=plane.count,
        iterations=iterations,
        correlated=correlated_noise(cells, target.radius_m, rms, resolution),
    )
