"""How long, wide and high the body of a car is about its four wheels, in vehicle coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .vehicle import Vehicle, Wheel

BELT_M = 0.93  # height of the lower edge of the windows
ARCH_TOP_M = 0.75  # that the wheel arches of such a body leave room for
OVERHANG_M = (0.92, 0.86)  # behind the rear axle, ahead of the front axle
SIDES = (1, -1)


@dataclass(frozen=True)
class Shell:
    """Where the body stands: centres (2, 2) in x and z of rear and front wheel, by side.

    half_m: how far left and right skin are from the middle. floor_m: height of the floor, or above
    it where large wheels want the body higher.
    """

    wheels_m: dict[int, Array]
    half_m: dict[int, float]
    floor_m: float
    arch_m: float

    @property
    def wheelbase_m(self) -> float:
        """Mean of both sides."""
        return float(np.mean([wheels[1, 0] - wheels[0, 0] for wheels in self.wheels_m.values()]))

    @property
    def rear_m(self) -> float:
        """Where the body ends."""
        return -OVERHANG_M[0]

    @property
    def front_m(self) -> float:
        """Where it begins."""
        return self.wheelbase_m + OVERHANG_M[1]

    def upper_m(self, x_m: Array) -> Array:
        """Height of the upper edge of the sides: boot, belt, bonnet."""
        base = self.wheelbase_m
        ahead = [self.rear_m, -0.45, base - 0.15, self.front_m]
        return np.interp(x_m, ahead, [0.96, BELT_M, BELT_M, 0.74])

    def across_m(self, side: int, x_m: Array) -> Array:
        """Place of the skin across the car: straight between the axles, drawn in at the ends."""
        beyond = np.maximum(np.maximum(-0.4 - x_m, x_m - self.wheelbase_m - 0.4), 0.0)
        return np.asarray(side * (self.half_m[side] - 0.35 * beyond**2))


def shell_of(vehicle: Vehicle, wheels: Sequence[Wheel]) -> Shell:
    """The body that fits a vehicle and its four reference wheels."""
    places, half = {}, {}
    for side in SIDES:
        mine = sorted(
            (wheel for wheel in wheels if wheel.side == side), key=lambda w: w.centre_vehicle_m[0]
        )
        places[side] = np.array([wheel.centre_vehicle_m[[0, 2]] for wheel in mine])
        sidewalls = [abs(w.centre_vehicle_m[1]) - w.stand_off_m for w in mine]
        half[side] = float(np.mean(sidewalls)) - 0.015
    wheel = vehicle.body
    raised = max(0.0, wheel.tyre_radius_m + wheel.arch_radius_m - ARCH_TOP_M)
    return Shell(places, half, vehicle.floor_m + raised, wheel.arch_radius_m)
