"""Where a scanner stands round a whole vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..output.truth import site_point
from ..parameters.parameters import Corner
from ..parameters.recipe import Recipe
from ..scene.scene import Mounted
from ..vehicle.vehicle import FORWARD, LEFT, UP, WHEELS, Vehicle


@dataclass(frozen=True)
class Station:
    """One stand: its number from 1, where it is, and how the scanner's own axes are turned.

    turn_rad: about the site's z, from the site's axes to the scanner's.
    """

    number: int
    position_vehicle_m: Array
    position_site_m: Array
    turn_rad: float


def draw_stations(
    vehicle: Vehicle,
    mounted: Sequence[Mounted],
    count: int,
    recipe: Recipe,
    rng: np.random.Generator,
) -> list[Station]:
    """`count` stands: outside each corner, ahead of or behind its target, then one a side.

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
        place = x * FORWARD + y * LEFT + (vehicle.floor_m + drawn.height_m) * UP
        turn = float(rng.uniform(-np.pi, np.pi))
        stations.append(Station(number + 1, place, np.array(site_point(vehicle, place)), turn))
    return stations
