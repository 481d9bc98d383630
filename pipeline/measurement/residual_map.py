"""Map of a target: distances of its points from the fitted plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..centre import TargetFit
from ..detection import FACE_BAND
from ..plane import Patch, PlaneFit
from ..targets import Region, Target
from ..vectors import Array, Array32, Mask, turned

REACH = 1.25  # of the radius: half the map's edge
CELLS = 240
CORNERS = 96  # of a circle, as a polygon
BINS, SIGMAS = 60, 5.0  # of the histogram, from -SIGMAS to +SIGMAS of the plane's noise


@dataclass(frozen=True)
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


def residual_map(
    patch: Patch, plane: PlaneFit, fitted: TargetFit, target: Target, margin_m: float
) -> ResidualMap:
    """Map the points of `patch` about the centre of `fitted`, on the fitted plane.

    margin_m: distance from the edges within which points are not counted.
    """
    centre_m = (
        fitted.centre_m - ((fitted.centre_m - plane.centroid_m) @ plane.normal) * plane.normal
    )
    turn_rad = _turn(plane, fitted)
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
    uvw = _local(patch, basis, centre_m)
    uvw = uvw[np.max(np.abs(uvw[:, :2]), axis=1) < half]
    column, row = ((uvw[:, axis] * sign + half) * (CELLS / (2 * half)) for axis, sign in _AXES)
    cell = row.astype(np.int32).clip(0, CELLS - 1) * CELLS
    cell += column.astype(np.int32).clip(0, CELLS - 1)
    on_face = np.abs(uvw[:, 2]) < FACE_BAND * radius_m
    cell_on, w_on = cell[on_face], uvw[on_face, 2]
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


def _local(patch: Patch, basis: Array, centre_m: Array) -> Array32:
    """Return the patch's points (N, 3) from the centre along the plane's axes."""
    shift = (patch.origin_m - centre_m) @ basis.T
    points = np.concatenate([patch.face_m.astype(np.float32), patch.around_m])
    uvw = points @ basis.T.astype(np.float32)
    uvw += shift.astype(np.float32)
    return np.asarray(uvw)


def _turn(plane: PlaneFit, fitted: TargetFit) -> float:
    """Return the in-plane rotation of the target's axis u from the plane's; 0 if not visible."""
    if fitted.turn is None:
        return 0.0
    along, across = plane.basis[:2] @ fitted.turn.axis
    return math.atan2(across, along)


def _cell_centres(half_m: float) -> Array:
    """Return the cells' centres (CELLS^2, 2) along u and v, row by row from the top."""
    ticks = (np.arange(CELLS) + 0.5) * (2.0 * half_m / CELLS) - half_m
    u, v = np.meshgrid(ticks, -ticks)
    return np.column_stack([u.ravel(), v.ravel()])


_AXES = ((0, 1.0), (1, -1.0))  # columns run along u, rows down along v
