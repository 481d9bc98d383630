"""Footprint of a beam: its sub-rays."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..parameters.parameters import Beam

GOLDEN_RAD = np.pi * (3 - np.sqrt(5))
GAUSSIAN_RAYS = 121


def spot_pattern(beam: Beam) -> Array:
    """Return the points (K, 2) of the sub-rays in units of the spot's radius; all count alike."""
    if beam.spot_profile == "gaussian":
        return _gaussian(beam.spot_truncation)
    return _uniform()


def extent_m(beam: Beam, range_m: float) -> float:
    """Return the largest distance of a sub-ray from the beam's axis at a range."""
    radius_m = beam.spot_radius_m + 1e-3 * beam.spot_divergence_mrad * range_m
    reach = 1.0
    if beam.spot_profile == "gaussian":
        reach = float(np.hypot(*spot_pattern(beam).T).max())
    return radius_m * reach * max(1.0, beam.spot_aspect)


def sub_rays(beam: Beam, directions: Array, numbers: npt.NDArray[np.int64]) -> tuple[Array, Array]:
    """Return origins and directions, both (N * K, 3), of the sub-rays of N beams.

    Their pattern is rotated by the golden angle from beam to beam, so that its corners leave no
    systematic effect on outlines. They diverge from the spot at the exit, so that the radius is
    spot_radius_m + divergence * range, as data sheets state it.
    """
    level = np.cross([0.0, 0.0, 1.0], directions)
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    upward = beam.spot_aspect * np.cross(directions, level)
    turn = GOLDEN_RAD * numbers[:, None]
    pattern = spot_pattern(beam)

    def across(radius: float) -> Array:
        one = radius * (np.cos(turn) * level + np.sin(turn) * upward)
        other = radius * (np.cos(turn) * upward - np.sin(turn) * level)
        spread = pattern[:, 0, None] * one[:, None, :] + pattern[:, 1, None] * other[:, None, :]
        return np.asarray(spread.reshape(-1, 3), dtype=np.float64)

    rays = np.repeat(directions, len(pattern), axis=0)
    if beam.spot_divergence_mrad > 0.0:
        rays = rays + across(1e-3 * beam.spot_divergence_mrad)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return across(beam.spot_radius_m), rays


@lru_cache
def _uniform() -> Array:
    """Return points (19, 2) in the unit disc: two rings of a hexagonal lattice about its centre.

    The lattice has the second moment of the uniform disc, mean(x^2 + y^2) = 1/2.
    """
    i, j = (k.ravel() for k in np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)))
    near = np.abs(i + j) <= 2
    lattice = np.column_stack([i + j / 2, j * np.sqrt(3) / 2])[near]
    scale = np.sqrt(2 * np.mean(np.sum(lattice**2, axis=1)))
    return np.asarray(lattice / scale, dtype=np.float64)


@lru_cache
def _gaussian(truncation: float) -> Array:
    """Return points (121, 2) of the power density exp(-2 rho^2), cut at `truncation`.

    A sunflower spiral at equal steps of the enclosed power, 1 - exp(-2 rho^2) (Vogel, Math.
    Biosci. 44 (1979) 179), with the density's own mean and second moments. The power on one side
    of any straight edge is right to 0.8 % of the beam's, rms over its position and direction.
    """
    k = np.arange(GAUSSIAN_RAYS)
    lost = np.exp(-2 * truncation**2)
    rho = np.sqrt(-np.log(1 - (k + 0.5) / GAUSSIAN_RAYS * (1 - lost)) / 2)
    points = rho[:, None] * np.column_stack([np.cos(GOLDEN_RAD * k), np.sin(GOLDEN_RAD * k)])
    points -= points.mean(axis=0)
    moment = (1 - 2 * truncation**2 * lost / (1 - lost)) / 4
    root = np.linalg.cholesky(points.T @ points / GAUSSIAN_RAYS)
    return np.asarray(np.sqrt(moment) * points @ np.linalg.inv(root).T, dtype=np.float64)
