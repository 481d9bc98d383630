"""Bare wheels about a vehicle that are not its own: other cars, a third axle, a spare wheel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Site
from ..parameters.recipe import Recipe
from ..scene.solids import Solid
from ..vehicle.body import body_solids
from ..vehicle.vehicle import FORWARD, LEFT, UP, WHEELS, Vehicle, Wheel, about, draw_wheel
from ..vehicle.vehicle import draw_vehicle as draw_car
from .bare_wheel import draw_bare_wheel

COARSE, COARSER = 3, 9  # times fewer facets than a wheel that is scanned alone; of others
OTHERS = 23  # stream of random numbers, with the seed
PITCH_M, BEHIND_M, AXLES_M = (5.4, 6.0), (5.6, 6.2), (0.95, 1.3)
SPARE_AHEAD_M, SPARE_LEAN_DEG = 1.9, (12.0, 25.0)


def other_wheels(
    vehicle: Vehicle, wheels: Sequence[Wheel], site: Site, recipe: Recipe, seed: int
) -> list[Solid]:
    """Build the other cars, axles and wheels of a site, in vehicle coordinates."""
    rng = np.random.default_rng([seed, OTHERS])
    solids: list[Solid] = []
    if site.kind == "car-park":
        for side in (1.0, -1.0):
            aside = side * rng.uniform(*PITCH_M) * LEFT + rng.uniform(-0.5, 0.5) * FORWARD
            car = _car(vehicle, aside, np.radians(rng.uniform(-3.0, 3.0)), recipe, rng)
            solids += _on_floor(vehicle, car)
    elif site.kind == "two-cars":
        back = -rng.uniform(*BEHIND_M) * FORWARD + rng.uniform(-0.3, 0.3) * LEFT
        car = _car(vehicle, back, np.radians(rng.uniform(-4.0, 4.0)), recipe, rng)
        solids += _on_floor(vehicle, car)
    elif site.kind == "trailer":
        back = -rng.uniform(*AXLES_M) * FORWARD
        for wheel in wheels[:2]:
            drawn = draw_bare_wheel(vehicle.body, recipe, rng)
            solids += _moved(drawn.solids(wheel, coarse=COARSER), wheel.T_vehicle_target, back)
    if site.spare:
        solids += _on_floor(vehicle, _spare(vehicle, wheels[0], recipe, rng))
    return solids


def _car(
    vehicle: Vehicle, shift_m: Array, yaw_rad: float, recipe: Recipe, rng: np.random.Generator
) -> list[Solid]:
    """Build another car on the same floor, shifted and turned."""
    car = draw_car(recipe, rng)
    wheels = [draw_wheel(car, recipe, name, rng) for name in WHEELS]
    solids = body_solids(car, wheels)
    for wheel in wheels:
        own = draw_bare_wheel(car.body, recipe, rng).solids(wheel, coarse=COARSER)
        solids += [solid.placed(wheel.T_vehicle_target) for solid in own]
    pose = np.eye(4)
    pose[:3, :3] = about(UP, yaw_rad)
    pose[:3, 3] = shift_m + (vehicle.floor_m - car.floor_m) * UP
    return [solid.placed(pose) for solid in solids]


def _spare(vehicle: Vehicle, wheel: Wheel, recipe: Recipe, rng: np.random.Generator) -> list[Solid]:
    """Build a spare wheel that leans, ahead of the car on the side of `wheel`."""
    lean = np.radians(rng.uniform(*SPARE_LEAN_DEG))
    pose = np.eye(4)
    pose[:3, :3] = about(FORWARD, -wheel.side * lean) @ wheel.T_vehicle_target[:3, :3]
    pose[:3, 3] = (vehicle.axles.wheelbase_m + SPARE_AHEAD_M) * FORWARD
    pose[:3, 3] += wheel.side * rng.uniform(0.2, 0.8) * LEFT
    own = draw_bare_wheel(vehicle.body, recipe, rng).solids(wheel, coarse=COARSER)
    placed = [solid.placed(pose) for solid in own]
    lowest = min(float(solid.vertices_m[:, 2].min()) for solid in placed[:1])
    return _moved(placed, np.eye(4), (vehicle.floor_m - lowest) * UP)


def _on_floor(vehicle: Vehicle, solids: Sequence[Solid]) -> list[Solid]:
    """Tilt what stands on a level floor, at the height of the vehicle's, as that floor is."""
    level = np.eye(4)
    level[2, 3] = -vehicle.floor_m
    return [solid.placed(vehicle.T_vehicle_floor @ level) for solid in solids]


def _moved(solids: Sequence[Solid], pose: Array, shift_m: Array) -> list[Solid]:
    moved = pose.copy()
    moved[:3, 3] = moved[:3, 3] + shift_m
    return [solid.placed(moved) for solid in solids]
