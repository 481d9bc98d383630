"""The workshop bay about a car: floor, walls, lift, workbench, people.

All in vehicle coordinates; heights are above the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..vehicle.vehicle import Vehicle
from .solids import Solid, box, ellipsoid, revolved

BEHIND_M, BEFORE_M, BESIDE_M = 3.9, 4.2, 3.65  # from rear and front axle, targets, to the walls
WALL_M = 3.2
POST_M = (0.17, 0.14)  # half width along and across


def bay_solids(vehicle: Vehicle, rng: np.random.Generator) -> list[Solid]:
    """Build the bay about a vehicle; positions of people and bench are drawn."""
    base = vehicle.axles.wheelbase_m
    half = max(vehicle.axles.rear_track_m, vehicle.axles.front_track_m) / 2
    solids = _walls(base, half + BESIDE_M)
    solids += _lift(base / 2 + rng.uniform(-0.1, 0.1), half + rng.uniform(0.65, 1.15))
    solids += _bench(rng.uniform(-2.5, 1.0))
    beside = (-BEHIND_M + 1.25, rng.uniform(-0.6, 0.6))
    before = (base + 1.8 + rng.uniform(0.0, 0.5), rng.uniform(-0.5, 0.5))
    for position_m in (beside, before):
        solids += _person(position_m, rng.uniform(1.6, 1.9), rng.uniform(0.0, 2 * np.pi))
    return [solid.placed(vehicle.T_vehicle_floor) for solid in solids]


def ground_solids(vehicle: Vehicle) -> list[Solid]:
    """Build the ground about a vehicle, out of doors."""
    slab = box((-12.0, -12.0, -0.1), (vehicle.axles.wheelbase_m + 12.0, 12.0, 0.0), 0.3)
    return [slab.of("floor").placed(vehicle.T_vehicle_floor)]


def _walls(base_m: float, side: float) -> list[Solid]:
    """Build floor, three walls, the pillars of the door, and a picture on the wall."""
    rear, front = -BEHIND_M, base_m + BEFORE_M
    slabs = [
        ((rear, -side, -0.1), (front + 3.0, side, 0.0), 0.3),
        ((rear - 0.1, -side, 0.0), (rear, side, WALL_M), 0.7),
        ((rear - 0.1, side, 0.0), (front, side + 0.1, WALL_M), 0.7),
        ((rear - 0.1, -side - 0.1, 0.0), (front, -side, WALL_M), 0.7),
        ((front, 2.2, 0.0), (front + 0.1, side + 0.1, WALL_M), 0.7),
        ((front, -side - 0.1, 0.0), (front + 0.1, -2.2, WALL_M), 0.7),
        ((0.5, side - 0.02, 1.2), (1.1, side, 2.0), 0.85),
    ]
    floor, *walls = (box(low, high, reflectance) for low, high, reflectance in slabs)
    return [floor.of("floor"), *walls]


def _lift(x_m: float, across_m: float) -> list[Solid]:
    """Build two posts on their foot plates, with arms under the car."""
    half_x, half_y = POST_M
    solids = []
    for side in (1, -1):
        y = side * across_m
        post = ((x_m - half_x, y - half_y, 0.0), (x_m + half_x, y + half_y, 2.8))
        foot = ((x_m - 0.3, y - 0.25, 0.0), (x_m + 0.3, y + 0.25, 0.02))
        solids += [box(*post, 0.4), box(*foot, 0.4)]
        for ahead in (-1, 1):
            low, high = sorted((y, side * 0.35))
            arm = x_m + ahead * 0.35
            solids.append(box((arm - 0.05, low, 0.06), (arm + 0.05, high, 0.14), 0.4))
    return solids


def _bench(y_m: float) -> list[Solid]:
    """Build a workbench along the rear wall, with a vice, boxes, and a shelf above."""
    wall = -BEHIND_M
    top = box((wall, y_m, 0.86), (wall + 0.65, y_m + 1.8, 0.90), 0.5)
    legs = [
        box((x, y, 0.0), (x + 0.06, y + 0.06, 0.86), 0.4)
        for x in (wall + 0.04, wall + 0.55)
        for y in (y_m + 0.04, y_m + 1.70)
    ]
    shelf = box((wall, y_m + 0.1, 1.5), (wall + 0.3, y_m + 1.7, 1.53), 0.5)
    boxes = [
        box((wall + 0.05, y, z), (wall + 0.25, y + 0.22, z + 0.24), reflectance)
        for y, z, reflectance in (
            (y_m + 0.2, 1.53, 0.7),
            (y_m + 0.6, 1.53, 0.2),
            (y_m + 1.2, 0.9, 0.6),
        )
    ]
    vice = ellipsoid((wall + 0.5, y_m + 0.5, 0.98), (0.12, 0.07, 0.08), 0.3)
    return [top, *legs, shelf, *boxes, vice]


def _person(position_m: Sequence[float], height_m: float, heading_rad: float) -> list[Solid]:
    """Build legs, trunk, arms and head, with any heading."""
    unit = height_m / 1.75
    parts = [
        *(_limb(0.085, 0.0, 0.86, y, 0.2) for y in (-0.10, 0.10)),
        *(_limb(0.05, 0.78, 1.40, y, 0.45) for y in (-0.24, 0.24)),
        ellipsoid((0.0, 0.0, 1.14), (0.13, 0.21, 0.36), 0.45),
        ellipsoid((0.0, 0.0, 1.62), (0.10, 0.08, 0.13), 0.55),
    ]
    pose = np.eye(4)
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    pose[:3, :3] = unit * np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    pose[:2, 3] = position_m
    return [part.placed(pose) for part in parts]


def _limb(radius_m: float, low_m: float, high_m: float, y_m: float, reflectance: float) -> Solid:
    """Build an upright capsule."""
    turn = np.linspace(0.0, np.pi / 2, 12)
    cap = radius_m * np.column_stack([np.sin(turn), np.cos(turn)])
    lower = [(r, low_m + radius_m - z) for r, z in cap]
    upper = [(r, high_m - radius_m + z) for r, z in cap[::-1]]
    pose = np.eye(4)
    pose[1, 3] = y_m
    return revolved([*lower, *upper], 48, reflectance).placed(pose)
