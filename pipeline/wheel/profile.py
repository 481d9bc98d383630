"""Profile of a wheel about its axis: radii and heights of its surface, and what the axis leaves."""

from __future__ import annotations

import numpy as np

from ..centre import CentreMethod
from ..cloud import sample
from ..plane import Patch
from ..system import frozen
from ..vectors import Array, Mask
from .cells import CellPoints
from .fit_wheel import START_POINTS, WheelFit
from .meridian import Meridian

SHOWN = 1500  # points, cells that were kept, and cells that were rejected


@frozen(eq=False)
class WheelProfile:
    """Meridian of a wheel, heights from the centre outwards along the axis.

    radius_m, height_m: (K,) of its rings, heights NaN where a ring is unknown. used: (K,) those
    that the axis rests on. ring_m: (2,) radius and height of the flange's edge, or of the tyre's
    widest ring, by `method`. points_m: (N, 2) radius and height of a sample of points. kept_m,
    rejected_m: (L, 2) radii and residuals of the mean heights of cells.
    """

    radius_m: Array
    height_m: Array
    used: Mask
    ring_m: Array
    method: CentreMethod
    points_m: Array
    kept_m: Array
    rejected_m: Array


def profile_of(found: WheelFit, patch: Patch) -> WheelProfile:
    """Return the profile of the wheel in its patch about the fitted axis."""
    fit, cells = found.fit, found.fit.cells
    grid, level_m = fit.meridian.grid, found.level_m
    near = sample(patch.face_m, START_POINTS)
    points = CellPoints.of(near, fit.axis, fit.basis, grid)
    height_m = Meridian.of(points).height_m
    height_m[cells.used] = fit.meridian.height_m[cells.used]
    some = slice(None, None, 1 + len(points.cell) // SHOWN)
    seen = cells.count >= grid.least
    radius_m = np.broadcast_to(grid.radius_m[cells.used][:, None], seen.shape)
    over = np.stack([radius_m, cells.residual_m], axis=-1)
    return WheelProfile(
        radius_m=grid.radius_m,
        height_m=height_m - level_m,
        used=cells.used,
        ring_m=np.array([found.radius_m, 0.0]),
        method=found.method,
        points_m=np.column_stack([points.radius_m[some], points.height_m[some] - level_m]),
        kept_m=_some(over[seen & (cells.weight > 0.0)]),
        rejected_m=_some(over[seen & (cells.weight <= 0.0)]),
    )


def _some(rows: Array) -> Array:
    return rows[:: 1 + len(rows) // SHOWN]
