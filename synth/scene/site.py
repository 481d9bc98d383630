"""All that stands still while the scanner goes round a whole vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import SynthError
from ..parameters.instruments import Instruments
from ..parameters.parameters import Obstacle, Panorama
from ..scanner.stations import Station, draw_stations
from ..vehicle.body import body_solids
from ..vehicle.turning import draw_turning
from ..vehicle.vehicle import FORWARD, WHEELS, Vehicle, draw_wheel
from .bay import bay_solids
from .obstacle import draw_board
from .scene import Mounted, Scene, seen_from
from .solids import Solid
from .target import draw_mount

PLACES = 2  # the stream of random numbers, beside the seed, of what stands round the vehicle


@dataclass(frozen=True)
class Site:
    """A vehicle with its targets, in the order of WHEELS, the bay about it, the stations.

    solids: in vehicle coordinates. hidden: share of each target's face behind a board, as seen
    from the station at its corner.
    """

    vehicle: Vehicle
    mounted: Sequence[Mounted]
    solids: Sequence[Solid]
    stations: Sequence[Station]
    hidden: Sequence[float]
    panorama: Panorama

    def scene(self, station: Station) -> Scene:
        """What a station has before itself."""
        return seen_from(station.position_vehicle_m, self.solids, self.mounted, self.vehicle)

    def seen(self, place_vehicle_m: Array, station: Station) -> Array:
        """A point (3,) of the vehicle, from a station in the axes of the site."""
        R_site_vehicle = self.vehicle.T_site_vehicle[:3, :3]
        return np.asarray(R_site_vehicle @ (place_vehicle_m - station.position_vehicle_m))

    def middle_m(self, station: Station) -> Array:
        """The middle of the vehicle, so seen."""
        return self.seen(self.vehicle.axles.wheelbase_m / 2 * FORWARD, station)

    def nearest_target_m(self, station: Station) -> Array:
        """The centre of the target that is nearest, so seen."""
        centres = [self.seen(one.wheel.centre_vehicle_m, station) for one in self.mounted]
        return min(centres, key=lambda centre: float(np.linalg.norm(centre)))


def draw_site(
    vehicle: Vehicle,
    kit: Instruments,
    seed: int,
    points: int | None,
    draws: Sequence[np.random.Generator],
) -> Site:
    """draws: one stream a wheel. points: in place of those of the scanner file."""
    _refuse_turning(kit, seed)
    mounted = []
    for name, rng in zip(WHEELS, draws, strict=True):
        wheel = draw_wheel(vehicle, kit.vehicle_recipe, name, rng)
        mounted.append(Mounted(wheel, draw_mount(kit.target, rng), kit.target))
    places = np.random.default_rng([seed, PLACES])
    panorama = kit.scanner_recipe.draw("panorama", Panorama, places)
    if points is not None:
        panorama = panorama.model_copy(update={"points": points})
    stations = draw_stations(vehicle, mounted, panorama.stations, kit.scanner_recipe, places)
    solids = [solid for one in mounted for solid in one.solids(vehicle.body)]
    solids += body_solids(vehicle, [one.wheel for one in mounted])
    solids += bay_solids(vehicle, places)
    hidden = [kit.scanner_recipe.draw("scene", Obstacle, places) for _ in mounted]
    for one, station, board in zip(mounted, stations, hidden, strict=False):
        if board.occluded_fraction > 0.0:
            seen = one.wheel.seen(station.position_vehicle_m)
            solid = draw_board(kit.target, seen, board.occluded_fraction, places)
            solids.append(solid.placed(one.wheel.T_vehicle_target))
    shares = [board.occluded_fraction for board in hidden]
    return Site(vehicle, mounted, solids, stations, shares, panorama)


def _refuse_turning(kit: Instruments, seed: int) -> None:
    turning = draw_turning(kit.vehicle_recipe, seed)
    if turning.sweep.positions or turning.runouts:
        raise SynthError(
            f"{kit.vehicle_recipe.source}: [sweep] and [runout] want wheels that turn between "
            "scans, and a whole vehicle stands still; name another vehicle"
        )
