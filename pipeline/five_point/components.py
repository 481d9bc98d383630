"""What makes the plane and the centre of five surveyed points uncertain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..config import StationConfig
from ..uncertainty import UncertaintyComponent, chi_square_beyond
from ..vectors import Array
from .fit_block import BlockFit

ARCSEC = math.pi / 648_000
DOUBT = 0.01  # chance of more scatter than was seen, below which the instrument does not explain it


@dataclass(frozen=True)
class Station:
    """A total station: what its file states, and where it stood (3,), coordinates of the points."""

    stated: StationConfig
    place_m: Array


@dataclass(frozen=True)
class PooledNoise:
    """Noise along each axis of every point, from the residuals of all blocks together."""

    sigma_m: float
    dof: int


def point_components(
    points_m: Array, fit: BlockFit, noise: PooledNoise, station: Station | None
) -> tuple[UncertaintyComponent, ...]:
    """Of one block (5, 3): by what the station states, or by the residuals where none is given.

    With a station, `noise` is what its statement leaves unexplained (see unexplained_noise).
    """
    components = [] if station is None else _station_components(points_m, fit, station)
    if noise.sigma_m > 0.0:
        name = "point noise" if station is None else "unexplained scatter"
        moved = noise.sigma_m * np.tile(np.eye(3), (5, 1, 1))
        components.append(
            UncertaintyComponent(name, _carry(points_m, fit, moved), noise.dof, pooled=True)
        )
    return tuple(components)


def unexplained_noise(
    noise: PooledNoise, blocks_m: Array, fits: list[BlockFit], station: Station
) -> PooledNoise:
    """Noise left when the station's own share is taken off; none unless it is beyond doubt."""
    stated = [
        np.sum((directions.transpose(0, 2, 1) @ fit.normal) ** 2) / 5.0
        for block, fit in zip(blocks_m, fits, strict=True)
        for directions in [np.concatenate(_noise_directions(block, station), axis=2)]
    ]
    expected = float(np.mean(stated))
    square = noise.sigma_m**2
    if expected > 0.0 and chi_square_beyond(noise.dof * square / expected, noise.dof) >= DOUBT:
        return PooledNoise(0.0, noise.dof)
    return PooledNoise(math.sqrt(max(square - expected, 0.0)), noise.dof)


def _station_components(
    points_m: Array, fit: BlockFit, station: Station
) -> list[UncertaintyComponent]:
    range_noise, angle_noise = _noise_directions(points_m, station)
    sight = _sight(points_m, station)
    bias = station.stated.range_bias_m * sight[:, :, None]
    aiming = np.zeros((6, 2))
    # A mark aimed at beside its place still lies on the plane: only the centre moves.
    aiming[3:] = station.stated.aiming_sigma_m / math.sqrt(5.0) * fit.axes[1:].T
    components = [
        UncertaintyComponent("range noise", _carry(points_m, fit, range_noise)),
        UncertaintyComponent("angle noise", _carry(points_m, fit, angle_noise)),
        UncertaintyComponent("aiming", aiming),
        UncertaintyComponent("range bias", _carry_together(points_m, fit, bias), shared="station"),
    ]
    return [component for component in components if component.factor.any()]


def _noise_directions(points_m: Array, station: Station) -> tuple[Array, Array]:
    """How each point moves by its own errors: (5, 3, 1) by the range, (5, 3, 2) by the angles.

    The azimuth's and the zenith's error are stated on the arc: across the sight, so that x = r d
    gives dx = r da e, with e horizontal or in the vertical plane.
    """
    stated, away = station.stated, points_m - station.place_m
    distance = np.linalg.norm(away, axis=1)
    sight = away / distance[:, None]
    spread = stated.range_sigma_m + stated.range_sigma_ppm * 1e-6 * distance
    level = np.stack([-sight[:, 1], sight[:, 0], np.zeros(5)], axis=1)
    level /= np.maximum(np.linalg.norm(level, axis=1), 1e-12)[:, None]
    arc = (stated.angle_sigma_arcsec * ARCSEC * distance)[:, None]
    across = np.stack([arc * level, arc * np.cross(sight, level)], axis=2)
    return (spread[:, None] * sight)[:, :, None], across


def _sight(points_m: Array, station: Station) -> Array:
    away = points_m - station.place_m
    return np.asarray(away / np.linalg.norm(away, axis=1)[:, None])


def _carry(points_m: Array, fit: BlockFit, moved: Array) -> Array:
    """Factor (6, 5 k) of errors that are each point's own: moved (5, 3, k)."""
    parts = []
    for index in range(5):
        alone = np.zeros_like(moved)
        alone[index] = moved[index]
        parts.append(_carry_together(points_m, fit, alone))
    return np.concatenate(parts, axis=1)


def _carry_together(points_m: Array, fit: BlockFit, moved: Array) -> Array:
    """Factor (6, k) of errors that move the points (5, 3, k) together.

    The plane's slope along axis a is sum q_a (n . dx) / sum q_a^2; the normal leans against it.
    """
    local = (points_m - fit.centre_m) @ fit.axes[1:].T
    height = np.einsum("i,pik->pk", fit.normal, moved)
    slopes = local.T @ height / fit.scatter_m2[1:, None]
    return np.vstack([-fit.axes[1:].T @ slopes, moved.mean(axis=0)])
