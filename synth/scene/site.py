"""Site of a whole vehicle: vehicle, targets, bay and stations, static between the scans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..arrays import Array
from ..errors import SynthError
from ..parameters.instruments import Instruments
from ..parameters.parameters import Obstacle, Panorama, Surfaces
from ..parameters.parameters import Site as SiteKind
from ..scanner.raycast import RayCaster
from ..scanner.stations import Station, draw_stations
from ..vehicle.body import body_solids
from ..vehicle.turning import draw_turning
from ..vehicle.vehicle import FORWARD, WHEELS, Vehicle, draw_wheel
from ..wheel.bare_wheel import DrawnWheel
from ..wheel.clamp import Clamped, draw_clamped
from ..wheel.others import COARSE, other_wheels
from ..wheel.scan import draw_bare_wheels, surfaces_of
from .bay import bay_solids, ground_solids
from .obstacle import draw_board
from .optics import optics_of
from .scene import Mounted, Scene, seen_from
from .solids import Solid
from .target import draw_mount

SURROUNDINGS = 2  # stream of random numbers, with the seed, of bay and stations


@dataclass(frozen=True)
class Site:
    """A vehicle with its targets, in the order of WHEELS, the bay about it, the stations.

    solids: in vehicle coordinates. hidden: fraction of each target's face behind a board, from the
    station at its corner. bare: the wheels themselves, by name, where not all show a target; then
    the mounts are those of their rims. clamped: the targets before single ones of these wheels.
    """

    vehicle: Vehicle
    mounted: Sequence[Mounted]
    solids: Sequence[Solid]
    stations: Sequence[Station]
    hidden: Sequence[float]
    panorama: Panorama
    surfaces: Surfaces
    bare: Mapping[str, DrawnWheel] = field(default_factory=dict)
    clamped: Mapping[str, Clamped] = field(default_factory=dict)

    @cached_property
    def shown(self) -> Sequence[Mounted]:
        """Targets in the site, in the order of WHEELS; none before bare wheels."""
        if not self.bare:
            return self.mounted
        wheels = [one.wheel for one in self.mounted if one.wheel.name in self.clamped]
        return [self.clamped[one.name].mounted(one, self.bare[one.name]) for one in wheels]

    def scene(self, station: Station) -> Scene:
        """Return the scene of a station."""
        return self._scene.seen_from(-self.to_station(np.zeros(3), station))

    def caster(self, station: Station) -> RayCaster:
        """Return the ray caster of a station's scene."""
        return self._caster.seen_from(-self.to_station(np.zeros(3), station))

    @cached_property
    def _scene(self) -> Scene:
        """Scene in the axes of the site, the origin that of the vehicle."""
        scene = seen_from(np.zeros(3), self.solids, self.shown, self.vehicle, self.surfaces)
        if not self.bare:
            return scene
        form = next(iter(self.bare.values())).form
        return replace(scene, optics=optics_of(self.solids, surfaces_of(form)))

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self._scene.vertices_m, self._scene.faces)

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
    bare = draw_bare_wheels(vehicle, kit, seed)
    mounted, clamped = [], {}
    for name, wheel_rng in zip(WHEELS, wheel_rngs, strict=True):
        wheel = draw_wheel(vehicle, kit.vehicle_recipe, name, wheel_rng)
        mount = draw_mount(kit.target, wheel_rng)
        mount = bare[name].mount if bare else mount
        mounted.append(Mounted(wheel, mount, kit.target))
        if name in kit.clamped:
            clamped[name] = draw_clamped(kit.clamped[name], wheel_rng)
    rng = np.random.default_rng([seed, SURROUNDINGS])
    panorama = kit.scanner_recipe.draw("panorama", Panorama, rng)
    if points is not None:
        panorama = panorama.model_copy(update={"points": points})
    stations = draw_stations(vehicle, mounted, panorama.stations, kit.scanner_recipe, rng)
    wheels = [one.wheel for one in mounted]
    solids = [solid for one in mounted for solid in _on_wheel(vehicle, one, bare, clamped)]
    solids += body_solids(vehicle, wheels)
    kind = kit.vehicle_recipe.draw("site", SiteKind, rng)
    solids += bay_solids(vehicle, rng) if kind.kind == "bay" else ground_solids(vehicle)
    solids += other_wheels(vehicle, wheels, kind, kit.vehicle_recipe, seed)
    hidden = [kit.scanner_recipe.draw("scene", Obstacle, rng) for _ in mounted]
    for one, station, board in zip(mounted, stations, hidden, strict=False):
        if board.occluded_fraction > 0.0:
            name = one.wheel.name
            shown = clamped[name].mounted(one.wheel, bare[name]) if name in clamped else one
            station_m = shown.wheel.to_target(station.position_vehicle_m)
            solid = draw_board(shown.target, station_m, board.occluded_fraction, rng)
            solids.append(solid.placed(shown.wheel.T_vehicle_target))
    shares = [board.occluded_fraction for board in hidden]
    seen = (stations, shares, panorama, kit.surfaces)
    return Site(vehicle, mounted, solids, *seen, bare, clamped)


def _on_wheel(
    vehicle: Vehicle,
    mounted: Mounted,
    bare: Mapping[str, DrawnWheel],
    clamped: Mapping[str, Clamped],
) -> Sequence[Solid]:
    """Build a wheel with its target, or the wheel itself, in vehicle coordinates."""
    wheel = mounted.wheel
    if not bare:
        return mounted.solids(vehicle.body)
    drawn = bare[wheel.name]
    own = drawn.solids(wheel, coarse=COARSE)
    solids = [solid.placed(wheel.T_vehicle_target) for solid in own]
    if wheel.name in clamped:
        solids += clamped[wheel.name].before(wheel, drawn)
    return solids


def _refuse_turning(kit: Instruments, seed: int) -> None:
    turning = draw_turning(kit.vehicle_recipe, seed)
    if turning.sweep.positions or turning.runouts:
        raise SynthError(
            f"{kit.vehicle_recipe.source}: [sweep] and [runout] need wheels that move between "
            "scans, and a whole vehicle is scanned at rest; name another vehicle"
        )
