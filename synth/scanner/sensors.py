"""Triangulating sensors: points on a regular grid, clean edges, shadow of projector or camera.

Sensor axes: x and y of the image, x level, z towards the target's centre.
Station coordinates have the axes of the site and the origin in the sensor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Array, Mask
from ..errors import SynthError
from ..parameters.parameters import Beam, Grid, Sensor
from ..scene.scene import Scene
from .echoes import Echoes, trace
from .raycast import RayCaster
from .scanner import MOST_BEAMS, Scan, range_sigma_m, report

SEEN_M = 0.0005  # least clearance of a ray that is in shadow


def sense(
    scene: Scene,
    centre_station_m: Array,
    sensor: Sensor,
    grid: Grid,
    beam: Beam,
    rng: np.random.Generator,
) -> Scan:
    """Scan the window round the target's centre (3,) with a triangulating sensor.

    Structured light: one point per pixel of a pinhole camera, `spacing_m` apart in the plane of
    the centre across the axis. Line profile: parallel sheets of light, `spacing_m` apart along the
    travel, y, and rays fanned in each; the sensor moves on a stage. A pixel has one range, of the
    surface on its axis: no point lies between two surfaces. It has none where the projector's, or
    for a profile the camera's, sight of the point is cut.
    """
    axes, far_m = _axes(centre_station_m), float(np.linalg.norm(centre_station_m))
    across, along = _lattice(grid, rng)
    travel = along[:, None] * axes[1] if sensor.kind == "line-profile" else np.zeros((1, 3))
    toward = across[:, None] * axes[0] + along[:, None] * axes[1] + far_m * axes[2] - travel
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    caster = RayCaster(scene.vertices_m, scene.faces)
    origins = np.broadcast_to(travel, toward.shape)
    echoes = trace(scene, caster, origins, toward)
    partners = origins + sensor.baseline_m * _baseline(sensor, axes)
    _, range_m = caster.cast(origins, toward)
    echoes = _lit(echoes, caster, origins + toward * range_m[:, None], partners)
    noise_m = rng.normal(0.0, 1.0, len(toward)) * range_sigma_m(beam.range_sigma_m, echoes, beam)
    return report(echoes, toward, noise_m, beam, rng, origins_m=origins)


def _axes(centre_m: Array) -> Array:
    """Return the axes (3, 3) of the sensor as rows."""
    ahead = centre_m / np.linalg.norm(centre_m)
    level = np.cross(ahead, [0.0, 0.0, 1.0])
    level /= np.linalg.norm(level)
    return np.stack([level, np.cross(level, ahead), ahead])


def _baseline(sensor: Sensor, axes: Array) -> Array:
    turn = np.radians(sensor.turn_deg)
    return np.asarray(np.cos(turn) * axes[0] + np.sin(turn) * axes[1])


def _lattice(grid: Grid, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the points (N,), (N,) of a square lattice over the window, its phase drawn."""
    half = int(grid.half_width_m / grid.spacing_m)
    if (2 * half + 1) ** 2 > MOST_BEAMS:
        raise SynthError(
            f"grid: spacing_m {grid.spacing_m} and half_width_m {grid.half_width_m} make "
            f"{4e-6 * half * half:.0f} million pixels, more than {MOST_BEAMS / 1e6:.0f}; "
            "increase the spacing or narrow the window"
        )
    steps, phase = np.arange(-half, half + 1), rng.uniform(-0.5, 0.5, 2)
    across, along = np.meshgrid(
        (steps + phase[0]) * grid.spacing_m, (steps + phase[1]) * grid.spacing_m
    )
    return across.ravel(), along.ravel()


def _lit(echoes: Echoes, caster: RayCaster, points_m: Array, partners_m: Array) -> Echoes:
    """Return the echoes without those that the partner, at (N, 3), does not see.

    points_m: (N, 3) of the facets, from which the form of a face is off.
    """
    met = ~np.isnan(echoes.range_m)
    sight = points_m[met] - partners_m[met]
    reach_m = np.linalg.norm(sight, axis=1)
    facet, range_m = caster.cast(partners_m[met], sight / reach_m[:, None])
    seen: Mask = np.zeros(len(met), dtype=bool)
    seen[met] = (facet >= 0) & (range_m > reach_m - SEEN_M)
    return replace(echoes, range_m=np.where(seen, echoes.range_m, np.nan))
