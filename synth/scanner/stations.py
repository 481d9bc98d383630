"""Stations of the scanner round a whole vehicle, and the errors of their registration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..output.truth import site_point
from ..parameters.parameters import Corner, Registration
from ..parameters.recipe import Recipe
from ..scene.scene import Mounted
from ..vehicle.vehicle import FORWARD, LEFT, UP, WHEELS, Vehicle, about
from .systematic import ARCSEC


@dataclass(frozen=True)
class Station:
    """One station: its number from 1, its position, and the heading of the scanner's own axes.

    heading_rad: about the site's z, from the site's axes to the scanner's.
    """

    number: int
    position_vehicle_m: Array
    position_site_m: Array
    heading_rad: float


@dataclass(frozen=True)
class Misplacement:
    """Error of the registration of one station: a rotation vector about the scanner, and a shift.

    Both along the axes of the site.
    """

    turn_rad: Array
    shift_m: Array

    def of(self, points_station_m: Array) -> Array:
        """Return points (N, 3), so misplaced."""
        angle = float(np.linalg.norm(self.turn_rad))
        if angle > 0.0:
            points_station_m = points_station_m @ about(self.turn_rad / angle, angle).T
        return np.asarray(points_station_m + self.shift_m)

    def to_json(self) -> dict[str, list[float]]:
        """Return the drawn values, if any."""
        if not np.any([self.turn_rad, self.shift_m]):
            return {}
        turn = (self.turn_rad / ARCSEC).tolist()
        return {"registration_turn_arcsec": turn, "registration_shift_m": self.shift_m.tolist()}


def draw_misplacement(registration: Registration, rng: np.random.Generator) -> Misplacement:
    """Draw the error of one station; exact values draw nothing."""
    sigmas = registration.turn_sigma_arcsec * ARCSEC, registration.shift_sigma_m
    turn, shift = (rng.normal(0.0, one, 3) if one > 0.0 else np.zeros(3) for one in sigmas)
    return Misplacement(turn, shift)


def draw_stations(
    vehicle: Vehicle,
    mounted: Sequence[Mounted],
    count: int,
    recipe: Recipe,
    rng: np.random.Generator,
) -> list[Station]:
    """Draw `count` stations: outside each corner, ahead of or behind its target, then one per side.

    mounted: the targets, in the order of WHEELS.
    """
    stations = []
    for number in range(count):
        drawn = recipe.draw("corner", Corner, rng)
        if number < len(WHEELS):
            wheel = mounted[number].wheel
            ahead = 1.0 if wheel.name.startswith("F") else -1.0
            x, y, _ = wheel.centre_vehicle_m + ahead * drawn.ahead_m * FORWARD
            y += wheel.side * drawn.aside_m
        else:
            side = 1.0 if number == len(WHEELS) else -1.0
            x = vehicle.axles.wheelbase_m / 2
            y = side * (vehicle.axles.rear_track_m / 2 + 0.6 + drawn.aside_m)
        position_m = x * FORWARD + y * LEFT + (vehicle.floor_m + drawn.height_m) * UP
        heading = float(rng.uniform(-np.pi, np.pi))
        site_m = np.array(site_point(vehicle, position_m))
        stations.append(Station(number + 1, position_m, site_m, heading))
    return stations
