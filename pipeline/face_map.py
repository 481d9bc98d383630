"""A small map of a target's face: where its points lie above and below the fitted plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.candidates import FACE_BAND
from pipeline.fit_plane import PlaneFit
from pipeline.kernels import Array
from pipeline.locate_centre import TargetFit
from pipeline.patch import Patch

REACH = 1.25  # of the radius: half the map's edge
CELLS = 240


@dataclass(frozen=True)
class FaceMap:
    """Square raster of the plane about the target's centre.

    residual_m: (240, 240) float32, mean distance of the face's points from the plane, positive
    towards the scanner; NaN where there are none. behind: (240, 240) bool, cells that show only
    other surfaces. Row 0 is at the top; half_width_m: from the centre to the map's edge.
    radius_m: of the target.
    """

    residual_m: npt.NDArray[np.float32]
    behind: npt.NDArray[np.bool_]
    half_width_m: float
    radius_m: float


def face_map(patch: Patch, plane: PlaneFit, target: TargetFit, radius_m: float) -> FaceMap:
    """Map of the points of `patch` about the centre of `target`, on the fitted plane."""
    half = REACH * radius_m
    shift = (patch.origin_m - target.centre_m) @ plane.basis.T
    shift[2] += (target.centre_m - plane.centroid_m) @ plane.normal
    points = np.concatenate([patch.face_m.astype(np.float32), patch.around_m])
    uvw = points @ plane.basis.T.astype(np.float32)
    uvw += shift.astype(np.float32)
    uvw = uvw[np.max(np.abs(uvw[:, :2]), axis=1) < half]
    column, row = ((uvw[:, axis] * sign + half) * (CELLS / (2 * half)) for axis, sign in _TURN)
    cell = row.astype(np.int32).clip(0, CELLS - 1) * CELLS
    cell += column.astype(np.int32).clip(0, CELLS - 1)
    on_face = np.abs(uvw[:, 2]) < FACE_BAND * radius_m
    count = np.bincount(cell[on_face], minlength=CELLS**2)
    total = np.bincount(cell[on_face], uvw[on_face, 2], minlength=CELLS**2)
    others = np.bincount(cell[~on_face], minlength=CELLS**2)
    mean: Array = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    shape = (CELLS, CELLS)
    residual_m = mean.astype(np.float32).reshape(shape)
    return FaceMap(residual_m, ((others > 0) & (count == 0)).reshape(shape), half, radius_m)


_TURN = ((0, 1.0), (1, -1.0))  # columns run along u, rows down along v
