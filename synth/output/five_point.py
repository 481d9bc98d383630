"""The simulated total station: five points on every target, from one position.

Occlusion of a far target by the vehicle is ignored: a surveyor would move.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from ..parameters.parameters import TotalStation
from ..scanner.scanner import directions
from ..vehicle.vehicle import FORWARD, LEFT, UP, Vehicle, Wheel


def draw_position(vehicle: Vehicle, station: TotalStation, rng: np.random.Generator) -> Array:
    """Draw the position (3,) of the total station, in vehicle coordinates, in any direction."""
    azimuth = rng.uniform(0, 2 * np.pi)
    direction = np.cos(azimuth) * FORWARD + np.sin(azimuth) * LEFT
    middle = vehicle.axles.wheelbase_m / 2 * FORWARD
    height_m = vehicle.floor_m + station.height_m
    position_m: Array = middle + station.distance_m * direction + height_m * UP
    return position_m


def measure_five(
    vehicle: Vehicle,
    wheels: Sequence[Wheel],
    station: TotalStation,
    station_vehicle_m: Array,
    rng: np.random.Generator,
) -> Array:
    """Measure five points per target, (5 * W, 3) in the coordinates of the capture.

    Noise: aiming, normal along each axis of the face; range, normal with sigma a + b * range;
    azimuth (on the arc) and elevation, normal.
    """
    T = vehicle.T_site_vehicle
    rows = []
    for wheel in wheels:
        aimed = _aim(wheel, station, rng)
        true = (aimed - station_vehicle_m) @ T[:3, :3].T
        rows.append(_observed(true, station, rng))
    return np.vstack(rows) + (T[:3, :3] @ station_vehicle_m + T[:3, 3])


def _aim(wheel: Wheel, station: TotalStation, rng: np.random.Generator) -> Array:
    """Return the points aimed at: (5, 3) on the face, in vehicle coordinates."""
    angle = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(5) / 5
    ring = station.pentagon_radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    ring += rng.normal(0.0, 1.0, (5, 2)) * station.aiming_sigma_m
    aimed: Array = wheel.centre_vehicle_m + ring @ wheel.T_vehicle_target[:3, :2].T
    return aimed


def _observed(true_m: Array, station: TotalStation, rng: np.random.Generator) -> Array:
    """Return the points (5, 3) relative to the instrument, with noise of range and angles."""
    noise = rng.normal(0.0, 1.0, (3, len(true_m)))
    horizontal_m = np.hypot(true_m[:, 0], true_m[:, 1])
    range_m = np.hypot(horizontal_m, true_m[:, 2])
    arc = np.radians(station.angle_sigma_arcsec / 3600)
    azimuth = np.arctan2(true_m[:, 1], true_m[:, 0]) + noise[0] * arc * range_m / horizontal_m
    elevation = np.arctan2(true_m[:, 2], horizontal_m) + noise[1] * arc
    sigma = station.range_sigma_m + station.range_sigma_ppm * 1e-6 * range_m
    observed: Array = directions(azimuth, elevation) * (range_m + noise[2] * sigma)[:, None]
    return observed
