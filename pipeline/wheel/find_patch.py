"""The patch of a scan that shows its target, or the wheel itself."""

from __future__ import annotations

import numpy as np

from ..config import Config
from ..detection import find_target
from ..plane import Patch
from ..targets import Target, WheelTarget
from ..vectors import Array, Array32

CHOSEN_M = 0.8  # about a point on the wheel: no tyre is larger across


def find_patch(
    points_m: Array,
    target: Target,
    config: Config,
    intensity: Array32 | None = None,
    axes: Array | None = None,
    near_m: Array | None = None,
    outward: Array | None = None,
) -> Patch:
    """Find the target in points_m (N, 3), or the wheel itself, and cut its patch.

    intensity: (N,) or None. axes, near_m: see `find_target`; of a wheel, the points within CHOSEN_M
    of near_m are searched, and its normal is that towards outward (3,). Raises NotMeasuredError.
    """
    if isinstance(target, WheelTarget):
        if near_m is not None:
            points_m = points_m[np.linalg.norm(points_m - near_m, axis=1) < CHOSEN_M]
        from .find_wheel import find_wheel

        return find_wheel(points_m, near_m, outward)
    return find_target(points_m, target, config.segment, config.seed, intensity, axes, near_m)
