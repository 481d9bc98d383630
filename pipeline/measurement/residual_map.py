"""Map of a target: distances of its points from the fitted plane."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..centre import TargetFit
from ..detection import FACE_BAND
from ..plane import Patch, PlaneFit
from ..system import frozen, stage
from ..targets import Region, Target
from ..vectors import Array, Array32, Mask, in_axes, turned

REACH = 1.25  # of the radius: half the map's edge
CELLS = 240
CORNERS = 96  # of a circle, as a polygon
WIDTHS = 0.08, 0.3  # of the radius: standard deviation of the Gaussian that smooths a map
FORM_U_M = 5e-5  # standard uncertainty of a smoothed value that a wider Gaussian buys
FORM_STEP = 5  # cells of the map in one of its smoothed form
BINS, SIGMAS = 60, 5.0  # of the histogram, from -SIGMAS to +SIGMAS of the plane's noise


@frozen
class ResidualMap:
    """Square raster of the plane about the target's centre, along the plane's axes u and v.

    residual_m: (240, 240) float32, mean distance of the target's points from the plane, positive
    towards the scanner; NaN where there are none. behind: (240, 240) bool, cells that show only
    other surfaces. Row 0 is at the top; half_width_m: from the centre to the map's edge.
    region: of the target, rotated by turn_rad from u towards v. counts: (60,) histogram of the
    distances of points clear of its edges, from -span_m to span_m in equal bins.
    """

    residual_m: Array32
    behind: Mask
    half_width_m: float
    region: Region
    turn_rad: float
    counts: npt.NDArray[np.int64]
    span_m: float

    @property
    def radius_m(self) -> float:
        """Radius of the target, metres."""
        return self.region.radius_m

    @property
    def edges_m(self) -> tuple[Array, ...]:
        """Polygons (K, 2) along u and v from the centre: the outer edge, then those of holes."""
        return tuple(turned(p, self.turn_rad) for p in self.region.polygons_m(CORNERS))

    def on_face(self, uvw_m: Array) -> Mask:
        """Return which of uvw_m (N, 3), from the centre along u, v, normal, are on the target."""
        flat = np.abs(uvw_m[:, 2]) < FACE_BAND * self.radius_m
        return np.asarray(flat & self.region.holds(turned(uvw_m[:, :2], -self.turn_rad)))


@stage("plane")
def residual_map(
    patch: Patch, plane: PlaneFit, fitted: TargetFit, target: Target, margin_m: float
) -> ResidualMap:
    """Map the points of `patch` about the centre of `fitted`, on the fitted plane.

    margin_m: distance from the edges within which points are not counted.
    """
    centre_m = (
        fitted.centre_m - ((fitted.centre_m - plane.centroid_m) @ plane.normal) * plane.normal
    )
    turn_rad = fitted.turn_rad(plane)
    return map_about(patch, plane.basis, centre_m, turn_rad, plane.sigma_m, target, margin_m)


def map_about(
    patch: Patch,
    basis: Array,
    centre_m: Array,
    turn_rad: float,
    sigma_m: float,
    target: Target,
    margin_m: float,
) -> ResidualMap:
    """Map the points of `patch` about centre_m (3,), on the plane through it along basis (3, 3).

    turn_rad: rotation of the target from u towards v. sigma_m: noise across the plane. margin_m:
    distance from the edges within which points are not counted.
    """
    radius_m = target.radius_m
    half = REACH * radius_m
    uvw = _local(patch, basis, centre_m).T
    within = (np.abs(uvw[0]) < half) & (np.abs(uvw[1]) < half)
    u, v, w = np.compress(within, uvw, axis=1)
    column, row = ((along + half) * (CELLS / (2 * half)) for along in (u, -v))  # row 0 at the top
    cell = row.astype(np.int32).clip(0, CELLS - 1) * CELLS
    cell += column.astype(np.int32).clip(0, CELLS - 1)
    on_face = np.abs(w) < FACE_BAND * radius_m
    cell_on, w_on = cell[on_face], w[on_face]
    count = np.bincount(cell_on, minlength=CELLS**2)
    total = np.bincount(cell_on, w_on, minlength=CELLS**2)
    others = np.bincount(cell[~on_face], minlength=CELLS**2)
    mean: Array = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    clear = target.region.shrunk(margin_m).holds(turned(_cell_centres(half), -turn_rad))
    span_m = SIGMAS * max(sigma_m, 1e-9)
    shape = (CELLS, CELLS)
    return ResidualMap(
        residual_m=mean.astype(np.float32).reshape(shape),
        behind=((others > 0) & (count == 0)).reshape(shape),
        half_width_m=half,
        region=target.region,
        turn_rad=turn_rad,
        counts=np.histogram(w_on[clear[cell_on]], BINS, (-span_m, span_m))[0],
        span_m=span_m,
    )


@frozen
class FormMap:
    """Smoothed deviation of a target from its plane: (48, 48) float32 metres, NaN off the target.

    Laid out as the map it is made of. width_m: standard deviation of the Gaussian. u_m: standard
    uncertainty of a value by the noise, root mean square over the target.
    """

    deviation_m: Array32
    half_width_m: float
    width_m: float
    u_m: float


def smoothed(face: ResidualMap) -> FormMap:
    """Average the map over a Gaussian, within the target: form of 0.1 mm under 0.8 mm of noise.

    The mean of N points of a Gaussian of width s, n to the area, has u = sigma/sqrt(4 pi n) / s.
    """
    cell_m = 2.0 * face.half_width_m / CELLS
    on = face.region.holds(turned(_cell_centres(face.half_width_m), -face.turn_rad))
    on = on.reshape(face.residual_m.shape)
    known = on & np.isfinite(face.residual_m)
    noise_m = float(np.std(face.residual_m[known])) if known.any() else 0.0
    density = float(known.sum()) / max(1.0, float(on.sum())) / cell_m**2
    wanted_m = noise_m / FORM_U_M / math.sqrt(4.0 * math.pi * max(density, 1.0))
    least_m, most_m = (share * face.radius_m for share in WIDTHS)
    width_m = min(max(wanted_m, least_m), most_m)
    far = math.ceil(3.0 * width_m / cell_m)
    kernel = np.exp(-0.5 * (np.arange(-far, far + 1) * cell_m / width_m) ** 2)
    present = known.astype(np.float64)
    values: Array = np.where(known, face.residual_m, 0.0).astype(np.float64)
    weight, squares = _blurred(present, kernel), _blurred(present, kernel**2)
    shown = on & (weight > 0.5)
    total = _blurred(values, kernel)
    mean: Array = np.where(shown, total / np.maximum(weight, 1e-12), np.nan)
    spread = squares[shown] / weight[shown] ** 2
    middle = slice(FORM_STEP // 2, None, FORM_STEP)
    return FormMap(
        deviation_m=mean[middle, middle].astype(np.float32),
        half_width_m=face.half_width_m,
        width_m=width_m,
        u_m=noise_m * math.sqrt(float(spread.mean())) if spread.size else 0.0,
    )


def _blurred(values: Array, kernel: Array) -> Array:
    """Return the raster (N, N) convolved with the kernel along both axes, zero outside."""
    far = len(kernel) // 2
    for axis in (0, 1):
        padded = np.pad(values, [(far, far) if axis == each else (0, 0) for each in (0, 1)])
        values = np.lib.stride_tricks.sliding_window_view(padded, len(kernel), axis) @ kernel
    return values


def _local(patch: Patch, basis: Array, centre_m: Array) -> Array32:
    """Return the patch's points (N, 3) from the centre along the plane's axes."""
    shift = (patch.origin_m - centre_m) @ basis.T
    points = np.concatenate([patch.face_m.astype(np.float32), patch.around_m])
    uvw = in_axes(basis.astype(np.float32), points)
    uvw += shift.astype(np.float32)
    return uvw


def _cell_centres(half_m: float) -> Array:
    """Return the cells' centres (CELLS^2, 2) along u and v, row by row from the top."""
    ticks = (np.arange(CELLS) + 0.5) * (2.0 * half_m / CELLS) - half_m
    u, v = np.meshgrid(ticks, -ticks)
    return np.column_stack([u.ravel(), v.ravel()])
