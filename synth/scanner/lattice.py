"""Beams of a panorama, and a coarse preview of its scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Panorama
from ..scene.scene import Scene
from .echoes import trace
from .raycast import RayCaster
from .scanner import directions

PREVIEW = (90, 360)  # rows and columns of the preview
SAFETY = 0.8  # factor on the shortest range of the preview
PHASE = 4  # stream of random numbers, with the seed


@dataclass(frozen=True)
class Lattice:
    """Beams on a grid: azimuth_rad (W,), elevation_rad (H,) ascending, step_rad between rows.

    closed: the columns cover a full turn.
    """

    azimuth_rad: Array
    elevation_rad: Array
    step_rad: float
    closed: bool

    @property
    def beams(self) -> int:
        """Number of beams."""
        return len(self.azimuth_rad) * len(self.elevation_rad)

    def jittered(self, rows: slice, jitter: Array) -> Array:
        """Return unit vectors (H', W, 3) of rows, jittered by (H', 2, W) rad across the beam."""
        up = self.elevation_rad[rows, None]
        turn = self.azimuth_rad + jitter[:, 0] / np.cos(up)
        return directions(turn, up + jitter[:, 1])


@dataclass(frozen=True)
class Preview:
    """Preview of a scene: the share of beams that return, and a lower bound of the range."""

    share: float
    nearest_m: float


def draw_lattice(
    panorama: Panorama, middle_m: Array, step_rad: float, stream: tuple[int, int]
) -> Lattice:
    """Draw a window about the azimuth of `middle_m` (3,), in station coordinates, with its phase.

    The columns of a full turn are evenly spaced. stream: seed and number of the station.
    """
    seed, station = stream
    phase = np.random.default_rng([seed, PHASE, station]).uniform(-0.5, 0.5, 2)
    wide = np.radians(panorama.window_deg)
    low, high = np.radians([panorama.lowest_deg, panorama.highest_deg])
    columns, rows = int(np.ceil(wide / step_rad)), int((high - low) / step_rad)
    start = np.arctan2(middle_m[1], middle_m[0]) - wide / 2
    azimuth = start + (np.arange(columns) + phase[0]) * (wide / columns)
    elevation = low + (np.arange(rows) + phase[1]) * step_rad
    return Lattice(azimuth, elevation, step_rad, panorama.window_deg == 360.0)


def preview_scene(scene: Scene, caster: RayCaster, panorama: Panorama, middle_m: Array) -> Preview:
    """Cast some thousand beams over the window."""
    rows, columns = PREVIEW
    wide = np.radians(panorama.window_deg)
    low, high = np.radians([panorama.lowest_deg, panorama.highest_deg])
    start = np.arctan2(middle_m[1], middle_m[0]) - wide / 2
    azimuth = start + (np.arange(columns) + 0.5) * wide / columns
    elevation = low + (np.arange(rows) + 0.5) * (high - low) / rows
    beams = directions(*np.meshgrid(azimuth, elevation)).reshape(-1, 3)
    range_m = trace(scene, caster, 0.0, beams).range_m
    return Preview(float(np.mean(~np.isnan(range_m))), SAFETY * float(np.nanmin(range_m)))
