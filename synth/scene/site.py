"""Site of a whole vehicle: vehicle, targets, bay and stations, static between the scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import SynthError
from ..parameters.instruments import Instruments
from ..parameters.parameters import Obstacle, Panorama, Surfaces
from ..scanner.stations import Station, draw_stations
from ..vehicle.body import body_solids
from ..vehicle.turning import draw_turning
from ..vehicle.vehicle import FORWARD, WHEELS, Vehicle, draw_wheel
from .bay import bay_solids
from .obstacle import draw_board
from .scene import Mounted, Scene, seen_from
from .solids import Solid
from .target import draw_mount

SURROUNDINGS = 2  # stream of random numbers, with the seed, of bay and stations


@dataclass(frozen=True)
class Site:
    """A vehicle with its targets, in the order of WHEELS, the bay about it, the stations.

    solids: in vehicle coordinates. hidden: fraction of each target's face behind a board, from the
    station at its corner.
    """

    vehicle: Vehicle
    mounted: Sequence[Mounted]
    solids: Sequence[Solid]
    stations: Sequence[Station]
    hidden: Sequence[float]
    panorama: Panorama
    surfaces: Surfaces

    def scene(self, station: Station) -> Scene:
        """Return the scene of a station."""
        position_m = station.position_vehicle_m
        return seen_from(position_m, self.solids, self.mounted, self.vehicle, self.surfaces)

    def to_station(self, point_vehicle_m: Array, station: Station) -> Array:
        """Transform a point (3,) of the vehicle to station coordinates."""
        R_site_vehicle = self.vehicle.T_site_vehicle[:3, :3]
        return np.asarray(R_site_vehicle @ (point_vehicle_m - station.position_vehicle_m))

    def middle_m(self, station: Station) -> Array:
        """Return the middle of the vehicle in station coordinates."""
        return self.to_station(self.vehicle.axles.wheelbase_m / 2 * FORWARD, station)

    def nearest_target_m(self, station: Station) -> Array:
        """Return the centre of the nearest target in station coordinates."""
        centres = [self.to_station(one.wheel.centre_vehicle_m, station) for one in self.mounted]
        return min(centres, key=lambda centre: float(np.linalg.norm(centre)))


def draw_site(
    vehicle: Vehicle,
    kit: Instruments,
    seed: int,
    points: int | None,
    wheel_rngs: Sequence[np.random.Generator],
) -> Site:
    """Draw a site. wheel_rngs: one per wheel. points: instead of those of the scanner file."""
    _refuse_turning(kit, seed)
    mounted = []
    for name, wheel_rng in zip(WHEELS, wheel_rngs, strict=True):
        wheel = draw_wheel(vehicle, kit.vehicle_recipe, name, wheel_rng)
        mounted.append(Mounted(wheel, draw_mount(kit.target, wheel_rng), kit.target))
    rng = np.random.default_rng([seed, SURROUNDINGS])
    panorama = kit.scanner_recipe.draw("panorama", Panorama, rng)
    if points is not None:
        panorama = panorama.model_copy(update={"points": points})
    stations = draw_stations(vehicle, mounted, panorama.stations, kit.scanner_recipe, rng)
    solids = [solid for one in mounted for solid in one.solids(vehicle.body)]
    solids += body_solids(vehicle, [one.wheel for one in mounted])
    solids += bay_solids(vehicle, rng)
    hidden = [kit.scanner_recipe.draw("scene", Obstacle, rng) for _ in mounted]
    for one, station, board in zip(mounted, stations, hidden, strict=False):
        if board.occluded_fraction > 0.0:
            station_m = one.wheel.to_target(station.position_vehicle_m)
            solid = draw_board(kit.target, station_m, board.occluded_fraction, rng)
            solids.append(solid.placed(one.wheel.T_vehicle_target))
    shares = [board.occluded_fraction for board in hidden]
    return Site(vehicle, mounted, solids, stations, shares, panorama, kit.surfaces)


def _refuse_turning(kit: Instruments, seed: int) -> None:
    turning = draw_turning(kit.vehicle_recipe, seed)
    if turning.sweep.positions or turning.runouts:
        raise SynthError(
            f"{kit.vehicle_recipe.source}: [sweep] and [runout] need wheels that move between "
            "scans, and a whole vehicle is scanned at rest; name another vehicle"
        )
