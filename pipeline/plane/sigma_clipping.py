"""Sigma clipping: plane and noise found together by fitting, clipping at three sigma, refitting."""

from __future__ import annotations

import math

import numpy as np

from ..errors import NotMeasuredError
from ..system import frozen
from ..vectors import Array, Mask
from .least_squares import PlaneMoments, total_least_squares

# Standard deviation of a normal variable clipped at k = 3 sigma, over sigma:
# sqrt(1 - 2 k phi(k) / (2 Phi(k) - 1)).
CLIPPED_SIGMA_RATIO = 0.98658


@frozen(eq=False)
class Clipping:
    """Plane through `point` and the noise across it, which decide the points that are kept.

    basis: (3, 3), the normal last. cap: distance beyond which no point is kept, metres.
    """

    basis: Array
    point: Array
    sigma: float
    cap: float = math.inf

    def limit(self, resolution: float, sigmas: float = 3.0) -> float:
        """Return the distance within which points are kept, at least the resolution, metres."""
        return max(min(sigmas * self.sigma, self.cap), resolution)


def first_sigma(depth: Array, band: float) -> float:
    """Estimate the noise from the median absolute deviation of the depths (N,) within band.

    Raises NotMeasuredError 'too-few-points'.
    """
    near = depth[np.abs(depth) < band]
    if len(near) < 10:
        raise NotMeasuredError("too-few-points", f"{len(near)} points on the target, 10 needed")
    return float(1.4826 * np.median(np.abs(near - np.median(near))))


def converge(
    points: Array, clipping: Clipping, resolution: float, max_iterations: int = 50
) -> tuple[Clipping, PlaneMoments]:
    """Fit points (N, 3), clip at 3 sigma and fit again until the same points are kept twice.

    resolution: of the coordinates, metres. Also return the moments of the last fit.
    Raises NotMeasuredError 'too-few-points'.
    """
    kept: Mask | None = None
    for _ in range(max_iterations):
        residual = (points - clipping.point) @ clipping.basis[2]
        keep = np.abs(residual) < clipping.limit(resolution)
        if kept is not None and np.array_equal(keep, kept):
            break
        kept = keep
        if np.count_nonzero(keep) < 4:
            raise NotMeasuredError("too-few-points", "fewer than 4 points agree on a plane")
        moments = total_least_squares(points, keep)
        if moments.scatter_m2[1] <= 100.0 * resolution**2:
            raise NotMeasuredError("too-few-points", "the points on the target span no plane")
        spread = float(np.sqrt(moments.scatter_m2[2] / (moments.count - 3))) / CLIPPED_SIGMA_RATIO
        clipping = Clipping(moments.basis, moments.centroid_m, spread, clipping.cap)
    return clipping, moments
