"""Scene of a bare wheel on its car, and its true axes before the scanner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array
from ..parameters.instruments import Instruments
from ..parameters.parameters import BareWheel, Surfaces
from ..parameters.plate_file import BareWheelFile
from ..scene.optics import Surface, optics_of
from ..scene.scene import BUILT, Scene, around, seen_from
from ..scene.solids import Solid
from ..vehicle.turning import Turning
from ..vehicle.vehicle import WHEELS, Vehicle, Wheel
from .bare_wheel import DrawnWheel, draw_bare_wheel
from .clamp import Clamped


@dataclass(frozen=True)
class TrueAxis:
    """An axis in vehicle coordinates: its outward direction, and its point level with the flange.

    Both (3,).
    """

    direction: Array
    centre_m: Array


def spin_axis(wheel: Wheel) -> TrueAxis:
    """Return the spin axis of a wheel."""
    return TrueAxis(wheel.normal_vehicle, wheel.centre_vehicle_m)


def rim_axis(drawn: DrawnWheel, wheel: Wheel, turn_rad: float = 0.0) -> TrueAxis:
    """Return the rim's own axis, with the wheel turned about its spin axis."""
    pose = wheel.T_vehicle_target.copy()
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    pose[:3, :3] = pose[:3, :3] @ turned
    pose = pose @ drawn.T_wheel_rim
    return TrueAxis(pose[:3, 2], pose[:3, 3])


def bare_scene(
    vehicle: Vehicle,
    wheel: Wheel,
    drawn: DrawnWheel,
    station_vehicle_m: Array,
    turn_rad: float = 0.0,
    obstacles: Sequence[Solid] = (),
    clamped: Clamped | None = None,
    surfaces: Surfaces = BUILT,
) -> Scene:
    """Build the scene of one bare wheel for the scanner at `station_vehicle_m` (3,).

    turn_rad: about its spin axis. obstacles: in the coordinates of the wheel. clamped: before it.
    """
    own = [*drawn.solids(wheel, turn_rad), *obstacles]
    solids = [solid.placed(wheel.T_vehicle_target) for solid in own]
    mounted = [clamped.mounted(wheel, drawn)] if clamped else []
    if clamped:
        solids += clamped.before(wheel, drawn)
    solids += around(vehicle, wheel)
    scene = seen_from(station_vehicle_m, solids, mounted, vehicle, surfaces)
    return replace(scene, optics=optics_of(solids, surfaces_of(drawn.form)))


def surfaces_of(form: BareWheel) -> dict[str, Surface]:
    """Return the optics of a wheel's materials."""
    return {
        "tyre": Surface(noise=form.tyre_noise, dropout=form.tyre_dropout),
        "rim": Surface(stray=form.rim_stray, multipath=form.rim_multipath),
    }


def draw_bare_wheels(vehicle: Vehicle, kit: Instruments, seed: int) -> dict[str, DrawnWheel]:
    """Draw the four wheels, from a stream of their own; none where targets are mounted."""
    if not isinstance(kit.target, BareWheelFile):
        return {}
    rng = np.random.default_rng([seed, 22])
    return {name: draw_bare_wheel(vehicle.body, kit.vehicle_recipe, rng) for name in WHEELS}


def with_rims(turning: Turning, bare: Mapping[str, DrawnWheel]) -> Turning:
    """Return the run-outs with those of the rims in the place of targets'."""
    own = [
        replace(one, tilt_rad=bare[one.wheel].tilt_rad, shift_m=bare[one.wheel].shift_m)
        for one in turning.runouts
        if bare
    ]
    return replace(turning, runouts=own) if bare else turning
