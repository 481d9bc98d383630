"""Dimensions of the body of a car about its four wheels, in vehicle coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .vehicle import Vehicle, Wheel

BELT_M = 0.93  # height of the lower edge of the windows
ARCH_TOP_M = 0.75  # height of the wheel arches
OVERHANG_M = (0.92, 0.86)  # behind the rear axle, ahead of the front axle
SIDES = (1, -1)


@dataclass(frozen=True)
class Shell:
    """Dimensions of the body: centres (2, 2) in x and z of rear and front wheel, by side.

    half_m: distance of left and right skin from the centre plane. floor_m: height of the floor, or
    above it where large wheels need the body higher.
    """

    wheels_m: dict[int, Array]
    half_m: dict[int, float]
    floor_m: float
    arch_m: float

    @property
    def wheelbase_m(self) -> float:
        """Mean wheelbase of both sides."""
        return float(np.mean([wheels[1, 0] - wheels[0, 0] for wheels in self.wheels_m.values()]))

    @property
    def rear_m(self) -> float:
        """Rear end of the body in x."""
        return -OVERHANG_M[0]

    @property
    def front_m(self) -> float:
        """Front end of the body in x."""
        return self.wheelbase_m + OVERHANG_M[1]

    def upper_m(self, x_m: Array) -> Array:
        """Return the height of the upper edge of the sides: boot, belt, bonnet."""
        base = self.wheelbase_m
        ahead = [self.rear_m, -0.45, base - 0.15, self.front_m]
        return np.interp(x_m, ahead, [0.96, BELT_M, BELT_M, 0.74])

    def across_m(self, side: int, x_m: Array) -> Array:
        """Return y of the skin: constant between the axles, narrower at the ends."""
        beyond = np.maximum(np.maximum(-0.4 - x_m, x_m - self.wheelbase_m - 0.4), 0.0)
        return np.asarray(side * (self.half_m[side] - 0.35 * beyond**2))


def shell_of(vehicle: Vehicle, wheels: Sequence[Wheel]) -> Shell:
    """Return the body that fits a vehicle and its four reference wheels."""
    centres, half = {}, {}
    for side in SIDES:
        on_side = sorted(
            (wheel for wheel in wheels if wheel.side == side), key=lambda w: w.centre_vehicle_m[0]
        )
        centres[side] = np.array([wheel.centre_vehicle_m[[0, 2]] for wheel in on_side])
        sidewalls = [abs(w.centre_vehicle_m[1]) - w.stand_off_m for w in on_side]
        half[side] = float(np.mean(sidewalls)) - 0.015
    wheel = vehicle.body
    raised = max(0.0, wheel.tyre_radius_m + wheel.arch_radius_m - ARCH_TOP_M)
    return Shell(centres, half, vehicle.floor_m + raised, wheel.arch_radius_m)
