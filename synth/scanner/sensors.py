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
from .noise import by_surfaces
from .raycast import RayCaster
from .scanner import MOST_BEAMS, Scan, range_noise, report, shared_noise

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
    for a profile the camera's, sight of the point is cut. Rows of the grid, as scan lines, are
    those of the image, or profiles.
    """
    axes, far_m = _axes(centre_station_m), float(np.linalg.norm(centre_station_m))
    lattice = _lattice(grid, rng)
    across, along = (one.ravel() for one in lattice)
    travel = along[:, None] * axes[1] if sensor.kind == "line-profile" else np.zeros((1, 3))
    nominal = across[:, None] * axes[0] + along[:, None] * axes[1] + far_m * axes[2] - travel
    nominal /= np.linalg.norm(nominal, axis=1, keepdims=True)
    toward = _jittered(nominal, axes, beam, rng)
    caster = RayCaster(scene.vertices_m, scene.faces)
    origins = np.broadcast_to(travel, toward.shape)
    echoes = trace(scene, caster, origins, toward)
    partners = origins + sensor.baseline_m * _baseline(sensor, axes)
    _, range_m = caster.cast(origins, toward)
    echoes = _lit(echoes, caster, origins + toward * range_m[:, None], partners)
    own, level = rng.normal(0.0, 1.0, len(toward)), np.zeros_like(lattice[0])
    noise_m = range_noise(own, shared_noise(level, grid, beam, rng), echoes, beam)
    if scene.optics is not None:
        echoes, noise_m = by_surfaces(echoes, noise_m, scene.optics, rng)
    return report(echoes, nominal, noise_m, beam, rng, origins_m=origins, shape=level.shape)


def _jittered(nominal: Array, axes: Array, beam: Beam, rng: np.random.Generator) -> Array:
    """Return the unit vectors (N, 3) along which the pixels look; exact ones draw nothing."""
    if beam.angle_sigma_urad == 0.0:
        return nominal
    aside = rng.normal(0.0, 1e-6 * beam.angle_sigma_urad, (len(nominal), 2))
    toward = nominal + aside @ axes[:2]
    return np.asarray(toward / np.linalg.norm(toward, axis=1, keepdims=True))


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
    """Return the points (H, W), (H, W) of a square lattice over the window, its phase drawn."""
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
    return across, along


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
