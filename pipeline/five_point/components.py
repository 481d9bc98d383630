"""Uncertainty components of the plane and the centre of five surveyed points."""

from __future__ import annotations

import math

import numpy as np

from ..config import StationConfig
from ..diagnostics import length
from ..errors import InputError
from ..system import frozen
from ..uncertainty import UncertaintyComponent, chi_square_beyond
from ..vectors import Array
from .fit_block import BlockFit

ARCSEC = math.pi / 648_000
SIGHTS_M = (0.1, 1000.0)  # shorter than any total station focuses; longer than a mark is seen
SIGNIFICANCE = 0.01  # of the chi-square test of the residuals against the stated noise


@frozen
class Station:
    """A total station: its file, and its position (3,) in the coordinates of the points."""

    stated: StationConfig
    position_m: Array


def check_station(points_m: Array, station: Station, source: str) -> None:
    """Raise InputError, which names the file, where points (..., 3) are no sight's length away."""
    sights_m = np.linalg.norm(points_m - station.position_m, axis=-1)
    for sight_m, way in ((float(sights_m.min()), "nearest"), (float(sights_m.max()), "farthest")):
        if not SIGHTS_M[0] <= sight_m <= SIGHTS_M[1]:
            raise InputError(
                f"{source}: the {way} point lies {length(sight_m)} from the total station, sights "
                f"are {length(SIGHTS_M[0])} to {length(SIGHTS_M[1])} long: check "
                "--total-station-position and --length-unit"
            )


@frozen
class PooledNoise:
    """Noise along each axis of every point, from the residuals of all blocks together."""

    sigma_m: float
    dof: int


def point_components(
    points_m: Array, fit: BlockFit, noise: PooledNoise, station: Station | None
) -> tuple[UncertaintyComponent, ...]:
    """Return the components of a block, or of what is left of it, (n, 3).

    They are stated by the station, else from residuals.

    With a station, `noise` is what its statement does not explain (see unexplained_noise).
    """
    components = [] if station is None else _station_components(points_m, fit, station)
    if noise.sigma_m > 0.0:
        name = "point noise" if station is None else "unexplained scatter"
        shifts = noise.sigma_m * np.tile(np.eye(3), (len(points_m), 1, 1))
        components.append(
            UncertaintyComponent(name, _own_factor(points_m, fit, shifts), noise.dof, pooled=True)
        )
    return tuple(components)


def unexplained_noise(
    noise: PooledNoise, blocks_m: Array, fits: list[BlockFit], station: Station
) -> PooledNoise:
    """Return the noise beyond the stated one; zero unless a chi-square test rejects the latter."""
    each = zip(blocks_m, fits, strict=True)
    expected = float(np.mean([stated_variance(block, fit, station) for block, fit in each]))
    square = noise.sigma_m**2
    if (
        expected > 0.0
        and chi_square_beyond(noise.dof * square / expected, noise.dof) >= SIGNIFICANCE
    ):
        return PooledNoise(0.0, noise.dof)
    return PooledNoise(math.sqrt(max(square - expected, 0.0)), noise.dof)


def stated_variance(points_m: Array, fit: BlockFit, station: Station) -> float:
    """Return the variance across the plane of one point (n, 3), as the station states it."""
    directions = np.concatenate(_noise_directions(points_m, station), axis=2)
    return float(np.sum((directions.transpose(0, 2, 1) @ fit.normal) ** 2) / len(points_m))


def _station_components(
    points_m: Array, fit: BlockFit, station: Station
) -> list[UncertaintyComponent]:
    range_noise, angle_noise = _noise_directions(points_m, station)
    sight = _sight(points_m, station)
    bias = station.stated.range_bias_m * sight[:, :, None]
    aiming = np.zeros((6, 2))
    # A point aimed at beside its mark still lies on the plane: only the centre moves.
    aiming[3:] = station.stated.aiming_sigma_m / math.sqrt(5.0) * fit.axes[1:].T
    components = [
        UncertaintyComponent("range noise", _own_factor(points_m, fit, range_noise)),
        UncertaintyComponent("angle noise", _own_factor(points_m, fit, angle_noise)),
        UncertaintyComponent("aiming", aiming),
        UncertaintyComponent("range bias", _joint_factor(points_m, fit, bias), shared="station"),
    ]
    return [component for component in components if component.factor.any()]


def _noise_directions(points_m: Array, station: Station) -> tuple[Array, Array]:
    """Return the standard shifts of each point by range (n, 3, 1) and by angles (n, 3, 2).

    The errors of azimuth and zenith are stated on the arc, across the sight d: x = r d gives
    dx = r da e, with e horizontal or in the vertical plane.
    """
    stated, from_station = station.stated, points_m - station.position_m
    distance = np.linalg.norm(from_station, axis=1)
    sight = from_station / distance[:, None]
    range_sigma = stated.range_sigma_m + stated.range_sigma_ppm * 1e-6 * distance
    horizontal = np.stack([-sight[:, 1], sight[:, 0], np.zeros(len(sight))], axis=1)
    horizontal /= np.maximum(np.linalg.norm(horizontal, axis=1), 1e-12)[:, None]
    arc = (stated.angle_sigma_arcsec * ARCSEC * distance)[:, None]
    across = np.stack([arc * horizontal, arc * np.cross(sight, horizontal)], axis=2)
    return (range_sigma[:, None] * sight)[:, :, None], across


def _sight(points_m: Array, station: Station) -> Array:
    from_station = points_m - station.position_m
    return np.asarray(from_station / np.linalg.norm(from_station, axis=1)[:, None])


def _own_factor(points_m: Array, fit: BlockFit, shifts: Array) -> Array:
    """Return the factor (6, n k) of independent shifts (n, 3, k) of the points."""
    local, height = _local_and_height(points_m, fit, shifts)
    slopes = local[:, :, None] * height[:, None] / fit.scatter_m2[1:, None]
    moved = np.concatenate([-fit.axes[1:].T @ slopes, shifts / len(points_m)], axis=1)
    return np.asarray(moved.transpose(1, 0, 2).reshape(6, -1))


def _joint_factor(points_m: Array, fit: BlockFit, shifts: Array) -> Array:
    """Return the factor (6, k) of errors that shift all points (n, 3, k) together."""
    local, height = _local_and_height(points_m, fit, shifts)
    slopes = local.T @ height / fit.scatter_m2[1:, None]
    return np.vstack([-fit.axes[1:].T @ slopes, shifts.mean(axis=0)])


def _local_and_height(points_m: Array, fit: BlockFit, shifts: Array) -> tuple[Array, Array]:
    """Return the points in the plane (n, 2), and their shifts across it (n, k).

    The plane's slope along axis a is sum q_a (n . dx) / sum q_a^2; the normal tilts against it.
    """
    local = (points_m - fit.centre_m) @ fit.axes[1:].T
    return local, np.einsum("i,pik->pk", fit.normal, shifts)
