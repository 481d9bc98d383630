"""Average of the echo over a beam's footprint, by sub-rays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..scene.scene import Scene
from .echoes import Echoes, trace
from .raycast import RayCaster

GOLDEN_RAD = np.pi * (3 - np.sqrt(5))
# Beams whose sub-rays are traced together.
CHUNK = 16_000


def average(
    scene: Scene,
    caster: RayCaster,
    beams: Array,
    radius_m: float,
    numbers: npt.NDArray[np.int64] | None = None,
) -> Echoes:
    """Return the echoes of beams (N, 3) averaged over their spots; none below half a spot.

    numbers: (N,), rotate the pattern of sub-rays of each beam; by default its index in the chunk.
    """
    if numbers is None:
        numbers = np.arange(len(beams)) % CHUNK
    chunks = [slice(k, k + CHUNK) for k in range(0, max(len(beams), 1), CHUNK)]
    parts = [_average_chunk(scene, caster, beams[k], numbers[k], radius_m) for k in chunks]
    return Echoes(*(np.concatenate([vars(p)[name] for p in parts]) for name in vars(parts[0])))


def spot_pattern() -> Array:
    """Return points (19, 2) in the unit disc: two rings of a hexagonal lattice about its centre.

    The lattice has the second moment of the uniform disc, mean(x^2 + y^2) = 1/2.
    """
    i, j = (k.ravel() for k in np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)))
    near = np.abs(i + j) <= 2
    lattice = np.column_stack([i + j / 2, j * np.sqrt(3) / 2])[near]
    scale = np.sqrt(2 * np.mean(np.sum(lattice**2, axis=1)))
    return np.asarray(lattice / scale, dtype=np.float64)


def _average_chunk(
    scene: Scene,
    caster: RayCaster,
    beams: Array,
    numbers: npt.NDArray[np.int64],
    radius_m: float,
) -> Echoes:
    origins, count = _sub_rays(beams, numbers, radius_m), len(spot_pattern())
    rays = trace(scene, caster, origins, np.repeat(beams, count, axis=0))
    hit = (rays.facet >= 0).reshape(-1, count)
    hits = np.sum(hit, axis=1)
    enough = 2 * hits >= count

    def mean(values: Array) -> Array:
        met = np.where(hit, values.reshape(-1, count), 0.0)
        return np.asarray(np.sum(met, axis=1) / np.maximum(hits, 1), dtype=np.float64)

    target = rays.target.reshape(-1, count)
    return Echoes(
        np.where(enough, mean(rays.range_m), np.nan),
        mean(rays.cosine),
        mean(rays.reflectance),
        np.where(enough, rays.facet.reshape(-1, count)[:, count // 2], -1),
        np.where(np.all(target >= 0, axis=1), target[:, 0], -1),
    )


def _sub_rays(beams: Array, numbers: npt.NDArray[np.int64], radius_m: float) -> Array:
    """Return the origins (N * 19, 3) of the sub-rays of N beams, across the beam.

    The pattern is rotated by the golden angle from beam to beam, so that its corners leave no
    systematic effect on outlines.
    """
    level = np.cross([0.0, 0.0, 1.0], beams)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    upward = np.cross(beams, level)
    turn = GOLDEN_RAD * numbers[:, None]
    one = radius_m * (np.cos(turn) * level + np.sin(turn) * upward)
    other = radius_m * (np.cos(turn) * upward - np.sin(turn) * level)
    pattern = spot_pattern()
    origins = pattern[:, 0, None] * one[:, None, :] + pattern[:, 1, None] * other[:, None, :]
    return np.asarray(origins.reshape(-1, 3), dtype=np.float64)
