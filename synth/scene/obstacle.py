"""Obstacle between scanner and target: a board that hides a set fraction of the face."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..parameters.plate_file import TargetFile
from ..vehicle.vehicle import about
from .solids import Solid, box

BEFORE_M = 0.15  # distance of the board from the face
THICK_M = 0.001
HALF_LENGTH_M = 1.0


def draw_band(fraction: float, rng: np.random.Generator) -> tuple[float, float]:
    """Draw two parallel chords, x = low and x = high, of a unit disc with `fraction` between.

    All bands of that area are equally likely. The share of the disc left of x is
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
    """Draw a board, parallel to the face, whose shadow is such a band in any direction.

    Its fraction is of the smallest circle about the face. station_target_m: (3,) in target
    coordinates, which are those of the board too.
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
