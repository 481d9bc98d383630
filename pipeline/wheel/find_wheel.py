"""The wheel in a scan, cut out as the patch that its axis is fitted to."""

from __future__ import annotations

import numpy as np

from ..plane import Patch
from ..vectors import Array
from .find_axis import RoughAxis, find_axis
from .normal_lines import Axis

BESIDE_M = 0.05  # beyond the surfaces that slope
DEPTH_M = 0.25  # of the surfaces before and behind its middle
BEFORE_M = 0.03
CLOSE = (0.7, 0.92)  # of the radius: the tyre's side wall


def find_wheel(points_m: Array, near_m: Array | None = None, outward: Array | None = None) -> Patch:
    """Find the wheel in points_m (N, 3) and cut its patch, its normal outwards.

    near_m: (3,) a point on it, where there may be several. outward: (3,) about its normal, where
    that is known.
    Raises NotMeasuredError 'too-few-points', 'wheel-not-found' or 'ambiguous-target'.
    """
    return cut_wheel(points_m, find_axis(points_m, near_m), outward)


def cut_wheel(points_m: Array, rough: RoughAxis, outward: Array | None = None) -> Patch:
    """Cut the patch of the wheel about a rough axis out of points_m (N, 3), its normal outwards.

    outward: (3,) about its normal; without it, the way in which less lies before the side wall.
    """
    axis, reach = rough.axis, rough.radius_m + BESIDE_M
    local = points_m - axis.point_m
    height = local @ axis.direction
    square = np.einsum("ij,ij->i", local, local) - height**2
    near = (square < reach**2) & (np.abs(height) < DEPTH_M)
    radius = np.sqrt(square[near].clip(min=0.0))
    inwards = (
        _points_inwards(height[near], radius, rough.radius_m)
        if outward is None
        else axis.direction @ outward < 0.0
    )
    if inwards:
        axis = Axis(axis.point_m, -axis.direction)
    return Patch(
        origin_m=axis.point_m,
        face_m=local[near],
        around_m=np.zeros((0, 3), dtype=np.float32),
        match=rough.score,
        basis=axis.basis,
        sigma_m=0.0,
    )


def _points_inwards(height_m: Array, radius_m: Array, outer_m: float) -> bool:
    """Return whether more lies before the side wall than behind it: rim, spokes, brake.

    Only within the tyre's radius, as the floor lies before it too.
    """
    wall = (radius_m > CLOSE[0] * outer_m) & (radius_m < CLOSE[1] * outer_m)
    level = float(np.median(height_m[wall])) if wall.any() else 0.0
    height_m = height_m[radius_m < CLOSE[1] * outer_m]
    before = np.count_nonzero(height_m > level + BEFORE_M)
    behind = np.count_nonzero(height_m < level - BEFORE_M)
    return bool(before > behind)
