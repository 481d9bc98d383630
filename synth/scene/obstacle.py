"""What stands between scanner and target: a board that hides a set share of the face."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..parameters.plate_file import TargetFile
from ..vehicle.vehicle import about
from .solids import Solid, box

BEFORE_M = 0.15  # the face, where the board stands
THICK_M = 0.001
HALF_LENGTH_M = 1.0


def draw_band(fraction: float, rng: np.random.Generator) -> tuple[float, float]:
    """Two parallel chords, at x = low and x = high of a unit disc, with `fraction` of it between.

    Any band of that area is as likely as another. Left of x lies the share
    1 - (arccos x - x sqrt(1 - x^2)) / pi.
    """
    x = np.linspace(-1.0, 1.0, 4001)
    share = 1.0 - (np.arccos(x) - x * np.sqrt(1.0 - x * x)) / np.pi
    start = rng.uniform(0.0, 1.0 - fraction)
    low, high = np.interp([start, start + fraction], share, x)
    return float(low), float(high)


def draw_board(
    target: TargetFile, station_target_m: Array, fraction: float, rng: np.random.Generator
) -> Solid:
    """A board, parallel to the face, whose shadow from the station is such a band of any direction.

    Its share is that of the smallest circle about the face.
    station_target_m: (3,) in target coordinates, which the board has as well.
    """
    low, high = draw_band(fraction, rng)
    radius = target.radius_m
    near = BEFORE_M / station_target_m[2]
    half = (1.0 - near) * (high - low) / 2 * radius
    solid = box((-half, -HALF_LENGTH_M, 0.0), (half, HALF_LENGTH_M, THICK_M), reflectance=0.3)
    pose = np.eye(4)
    pose[:3, :3] = about(np.array([0.0, 0.0, 1.0]), rng.uniform(0.0, 2 * np.pi))
    middle = (1.0 - near) * (low + high) / 2 * radius * pose[:3, 0]
    pose[:3, 3] = middle + near * station_target_m
    return solid.placed(pose)
