"""The beams of a panorama, and what a few of them meet before it is scanned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Panorama
from ..scene.scene import Scene
from .echoes import trace
from .raycast import RayCaster
from .scanner import directions

TRIAL = (90, 360)  # rows and columns by which a scene is tried before it is scanned
SAFETY = 0.8  # of the shortest range then met
PHASE = 4  # the stream of random numbers, beside the seed


@dataclass(frozen=True)
class Lattice:
    """Beams on a grid: azimuth_rad (W,), elevation_rad (H,) ascending, step_rad between rows.

    closed: the columns go all round.
    """

    azimuth_rad: Array
    elevation_rad: Array
    step_rad: float
    closed: bool

    @property
    def beams(self) -> int:
        """How many there are."""
        return len(self.azimuth_rad) * len(self.elevation_rad)

    def jittered(self, rows: slice, jitter: Array) -> Array:
        """Unit vectors (H', W, 3) of some rows, jittered by (H', 2, W) rad across the beam."""
        up = self.elevation_rad[rows, None]
        turn = self.azimuth_rad + jitter[:, 0] / np.cos(up)
        return directions(turn, up + jitter[:, 1])


@dataclass(frozen=True)
class Tried:
    """What a few beams met: the share of them, and a range that nothing falls short of."""

    share: float
    nearest_m: float


def draw_lattice(
    panorama: Panorama, middle_m: Array, step_rad: float, stream: tuple[int, int]
) -> Lattice:
    """A window about the azimuth of `middle_m` (3,), in station coordinates; its phase is drawn.

    The columns of a full turn close on themselves. stream: seed and number of the station.
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


def try_out(scene: Scene, panorama: Panorama, middle_m: Array) -> Tried:
    """Cast some thousand beams over the window."""
    rows, columns = TRIAL
    wide = np.radians(panorama.window_deg)
    low, high = np.radians([panorama.lowest_deg, panorama.highest_deg])
    start = np.arctan2(middle_m[1], middle_m[0]) - wide / 2
    azimuth = start + (np.arange(columns) + 0.5) * wide / columns
    elevation = low + (np.arange(rows) + 0.5) * (high - low) / rows
    beams = directions(*np.meshgrid(azimuth, elevation)).reshape(-1, 3)
    caster = RayCaster(scene.vertices_m, scene.faces)
    range_m = trace(scene, caster, 0.0, beams).range_m
    return Tried(float(np.mean(~np.isnan(range_m))), SAFETY * float(np.nanmin(range_m)))
