"""Plane of the target, by total least squares over all its points within three sigma."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..cloud import Steps, find_lattice, over_chunks
from ..config import PlaneConfig
from ..system import frozen, stage
from ..targets import Region, Target
from ..vectors import Array, Rows, in_axes
from .brightness import FittedBrightness, RangeByBrightness, fit_brightness
from .clipped_plane import ClippedFit, ClipSlab, fit_clipped_plane
from .correlated_noise import (
    Cells,
    CorrelatedNoise,
    cells_across,
    cells_of,
)
from .face_break import FaceBreak, noise_and_break
from .patch import Patch
from .rounded_plane import fit_rounded
from .scan_lines import cells_along_lines
from .sigma_clipping import CLIPPED_SIGMA_RATIO
from .thinned.voxel_pull import LatticePull, Thinning, fit_pull

T = TypeVar("T")

LEAST_STEP_M = 1e-6  # finer steps are no coarser than the target is flat
NOTED = 0.35  # of the noise: a finer step adds less than 1 % to its variance
COARSE = 2.0  # step squared over the variance of the residuals, above which least squares are wrong
ROUNDED = 4.0  # steps: points on a lattice of shorter cells were rounded, not thinned
SPANNED = 1.5  # steps: no point within them of the plane is clipped


@frozen(eq=False)
class Rounding:
    """Effect of rounded coordinates on a plane.

    steps: of the coordinates. step_m: the longest of their parts across the plane. sigma_m: noise
    across the plane before rounding. covariance: (3, 3) what rounding adds to that of the height
    (m) at the centroid and of the slopes along u and v.
    """

    steps: Steps
    step_m: float
    sigma_m: float
    covariance: Array


@frozen(eq=False)
class PlaneFit:
    """Fitted plane and the evidence for it.

    centroid_m: (3,) scanner frame. basis: (3, 3) rows: the patch's axes u and v projected into the
    plane, then the unit normal towards the scanner. sigma_m: noise across the plane, corrected for
    the clipping; rms_m: root mean square of the residuals of the points used. scatter_m2: (2, 2)
    in-plane scatter along u and v. count: points used. iterations: until the set of points
    converged. correlated: noise correlated from point to point, from the residuals. rounding: of
    the coordinates, None where it does not matter. brightness: what ranges follow of it, None where
    none was fitted; the plane is that of the mean brightness. thinning: on a
    voxel lattice, whose pull was removed; None without. broken: step or bend of the face, which
    counts in the form of `correlated`; None where none is likely. spaced_m: least distance between
    points to which the scan was thinned, 0 without.
    """

    centroid_m: Array
    basis: Array
    sigma_m: float
    rms_m: float
    scatter_m2: Array
    count: int
    iterations: int
    correlated: CorrelatedNoise
    rounding: Rounding | None = None
    brightness: RangeByBrightness | None = None
    thinning: Thinning | None = None
    broken: FaceBreak | None = None
    spaced_m: float = 0.0

    @property
    def normal(self) -> Array:
        """Unit normal (3,) towards the scanner."""
        return np.asarray(self.basis[2])

    @property
    def noise_covariance(self) -> Array:
        """Covariance (3, 3) of the height (m) at the centroid and two slopes, independent noise."""
        return self._white_variance * _covariance(self.count, self.scatter_m2)

    @property
    def point_covariance(self) -> Array:
        """Covariance (3, 3) of the same by independent noise and what is fitted besides."""
        besides = (self.rounding, self.brightness, self.thinning)
        parts = [part.covariance for part in besides if part is not None]
        return np.asarray(sum(parts, self.noise_covariance))

    @property
    def normal_covariance(self) -> Array:
        """Covariance (3, 3) of the normal, rad^2, by all noise, independent and correlated."""
        slopes = (self.point_covariance + self.correlated.covariance)[1:, 1:]
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
        if self.rounding is not None:
            return self.rounding.sigma_m**2
        return _white_variance(self.sigma_m, self.correlated)


@stage("plane")
def fit_plane(patch: Patch, target: Target, config: PlaneConfig) -> PlaneFit:
    """Fit the plane of the target in `patch` to the points clear of its edges.

    Total least squares over points within 3 sigma, sigma estimated from the points themselves,
    until the set of points converges; at 3 sigma one step leaves 2.7 % of the error, so few steps
    suffice. Points nearer to an edge than the margin are left out: there the laser spot mixes
    target and background. Where the coordinates were rounded to steps that are not fine compared
    with the noise, the plane of the greatest likelihood follows (see rounded_plane.py). Otherwise
    the pull of a voxel lattice on which the points were thinned is removed (see voxel_pull.py);
    where ranges may follow the intensities, that is fitted with the plane (see brightness.py).
    Raises NotMeasuredError 'too-few-points' or 'steps-too-coarse'.
    """
    region = target.region.shrunk(config.edge_margin_m)
    across = cells_across(len(patch.face_m))
    resolution = 16.0 * np.finfo(float).eps
    resolution *= float(np.abs(patch.origin_m).max() + target.radius_m)
    spanned = SPANNED * float(patch.steps.across(patch.basis[2]))
    slab = ClipSlab(patch.basis, 0.0, patch.sigma_m, max(resolution, spanned))
    radius, most = target.radius_m, config.max_iterations
    fit = fit_clipped_plane(patch.face_m, region, slab, radius, across, most)
    if _step_across(patch.steps, fit.normal) ** 2 > COARSE * _rms(fit) ** 2:
        return _by_steps(patch, region, fit, radius, across, resolution)
    pull = _by_lattice(patch, region, fit)
    if pull is not None:
        patch = replace(patch, face_m=pull.levelled(patch.face_m))
        fit = fit_clipped_plane(patch.face_m, region, fit.slab, radius, across, most)
    shaded = _by_brightness(patch, region, fit, across, most, resolution)
    fit = fit if shaded is None else shaded.fit
    plane, rms = fit.plane, _rms(fit)
    cells = shaded.cells if shaded else cells_of(plane.residual_sums(), across, fit.side_m)
    lined = _along_lines(patch, region, fit, shaded)
    correlated, broken = noise_and_break(cells, radius, rms, resolution, lined)
    white = _white_variance(plane.sigma_m, correlated)
    return PlaneFit(
        centroid_m=patch.origin_m + fit.centroid_m,
        basis=fit.basis,
        sigma_m=plane.sigma_m,
        rms_m=rms,
        scatter_m2=plane.scatter_m2,
        count=plane.count,
        iterations=fit.iterations,
        correlated=correlated,
        rounding=_as_noise(patch.steps, fit, correlated),
        brightness=None if shaded is None else shaded.found(white),
        thinning=None if pull is None else pull.thinning(fit.centroid_m, fit.basis),
        broken=broken,
    )


def _by_lattice(patch: Patch, region: Region, fit: ClippedFit) -> LatticePull | None:
    """Fit the pull of the lattice on which the points were thinned; None without one.

    The boundaries of its layers show farther from the plane than points are used.
    """
    axes = patch.steps.axes
    lattice = find_lattice(patch.face_m, axes, fit.normal, _within(2.0, patch, region, fit))
    if lattice is None or not lattice.edge_m > ROUNDED * float(patch.steps.step_m.max()):
        return None
    return fit_pull(patch.face_m[_within(1.0, patch, region, fit)], lattice, axes)


def _within(limits: float, patch: Patch, region: Region, fit: ClippedFit) -> Rows:
    """Return the rows (M,) of points in the region, within so many times the limit."""
    axes, off_m = fit.plane.distances(fit.slab.basis)

    def near(rows: slice) -> Rows:
        uvw = in_axes(axes, patch.face_m[rows])
        off = np.abs(uvw[:, 2] - off_m)
        near = region.holds(uvw[:, :2]) & (off < limits * fit.slab.limit_m)
        return np.asarray(rows.start + np.flatnonzero(near))

    return np.concatenate(over_chunks(near, len(patch.face_m)))


def _along_lines(
    patch: Patch, region: Region, fit: ClippedFit, shaded: FittedBrightness | None
) -> list[Cells]:
    """Return the residuals of the points used in cells along the scan lines."""
    points = patch.face_m if shaded is None else shaded.level_m

    u0, v0, _ = fit.plane.centroid_m
    axes, off_m = fit.plane.distances(fit.slab.basis)

    def blocks(work: Callable[[Array, Array | None], T]) -> list[T]:
        def on(rows: slice) -> T:
            uvw = axes @ points[rows].T
            uvw[2] -= off_m
            used = region.holds(uvw[:2].T) & (np.abs(uvw[2]) < fit.slab.limit_m)
            uvw = np.compress(used, uvw, axis=1)
            uvw[0] -= u0
            uvw[1] -= v0
            return work(uvw.T, None if shaded is None else shaded.shade[rows][used])

        return over_chunks(on, len(points))

    return list(cells_along_lines(blocks, float(patch.steps.step_m.max())))


def _rms(fit: ClippedFit) -> float:
    return float(np.sqrt(fit.plane.square_m2 / fit.plane.count))


def _by_brightness(
    patch: Patch,
    region: Region,
    fit: ClippedFit,
    across: int,
    max_iterations: int,
    resolution_m: float,
) -> FittedBrightness | None:
    """Fit range by brightness, where there are intensities; None where there is nothing to fit."""
    if patch.face_intensity is None:
        return None
    return fit_brightness(
        patch.face_m, patch.face_intensity, region, fit, across, max_iterations, resolution_m
    )


def _step_across(steps: Steps, normal: Array) -> float:
    """Return the longest part across the plane of steps that matter, metres."""
    return float(steps.along(normal).max()) if steps.step_m.max() > LEAST_STEP_M else 0.0


def _as_noise(steps: Steps, fit: ClippedFit, correlated: CorrelatedNoise) -> Rounding | None:
    """Return the rounding of steps finer than the noise: independent noise, s^2 / 12 an axis."""
    plane = fit.plane
    if not steps.step_m.max() > max(NOTED * plane.sigma_m, LEAST_STEP_M):
        return None
    white = _white_variance(plane.sigma_m, correlated)
    variance = min(float(np.sum(steps.along(fit.normal) ** 2)) / 12.0, white)
    return Rounding(
        steps=steps,
        step_m=_step_across(steps, fit.normal),
        sigma_m=float(np.sqrt(white - variance)),
        covariance=variance * _covariance(plane.count, plane.scatter_m2),
    )


def _by_steps(
    patch: Patch, region: Region, fit: ClippedFit, radius_m: float, across: int, resolution_m: float
) -> PlaneFit:
    """Fit the plane of points on coarse steps, from that of least squares."""
    steps, basis, centroid = patch.steps, fit.basis, fit.centroid_m
    axis = int(np.argmax(steps.along(fit.normal)))
    step_m = _step_across(steps, fit.normal)
    uvw = in_axes(basis, patch.face_m)
    uvw[:, 2] -= centroid @ basis[2]
    limit = max(3.0 * fit.plane.sigma_m, SPANNED * float(steps.across(fit.normal)))
    used = region.holds(uvw[:, :2]) & (np.abs(uvw[:, 2]) < limit)
    along = (patch.face_m[used] - patch.face_m[0]) @ steps.axes[axis]
    level = np.rint(along / steps.step_m[axis]).astype(np.int64)
    found = fit_rounded(uvw[used], level, step_m, fit.plane.sigma_m, across, fit.side_m)
    uv = uvw[used, :2][found.kept]
    mean, count = uv.mean(axis=0), len(uv)
    scatter = (uv - mean).T @ (uv - mean)
    at_mean = np.eye(3)
    at_mean[0, 1:] = mean
    cells = None if found.cells is None else replace(found.cells, uv_m=found.cells.uv_m - mean)
    height = centroid @ basis[2] + found.height_m + found.slopes @ mean
    normal = basis[2] - found.slopes @ basis[:2]
    normal /= np.linalg.norm(normal)
    first = basis[0] - (basis[0] @ normal) * normal
    first /= np.linalg.norm(first)
    noise = found.sigma_m**2 * _covariance(count, scatter)
    correlated, broken = noise_and_break(cells, radius_m, found.rms_m, resolution_m)
    return PlaneFit(
        centroid_m=patch.origin_m + np.append(mean, height) @ basis,
        basis=np.stack([first, np.cross(normal, first), normal]),
        sigma_m=found.rms_m * float(np.sqrt(count / (count - 3))),
        rms_m=found.rms_m,
        scatter_m2=scatter,
        count=count,
        iterations=fit.iterations,
        correlated=correlated,
        rounding=Rounding(
            steps, step_m, found.sigma_m, at_mean @ found.covariance @ at_mean.T - noise
        ),
        broken=broken,
    )


def _covariance(count: int, scatter_m2: Array) -> Array:
    """Return the covariance (3, 3) of height at the centroid and slopes by noise of variance 1."""
    covariance = np.diag([1.0 / count, 0.0, 0.0])
    covariance[1:, 1:] = np.linalg.inv(scatter_m2)
    return covariance


def _white_variance(sigma_m: float, correlated: CorrelatedNoise) -> float:
    """Return the variance of the independent noise, of all noise where no correlation was found."""
    if not correlated.sigma_m > 0.0:
        return sigma_m**2
    return min(sigma_m, correlated.white_sigma_m / CLIPPED_SIGMA_RATIO) ** 2
