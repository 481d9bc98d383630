"""The synthetic vehicle: its parameters, and the true poses of its targets.

Vehicle coordinates are x forward, y left, z up (right-handed, as ISO 8855), origin midway between
the rear target centres. The side s is +1 on the left and -1 on the right, so s * y points outward.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Axles, Body, Placement, Trials, Wheels
from ..parameters.recipe import Recipe

FORWARD: Array = np.array([1.0, 0.0, 0.0])
LEFT: Array = np.array([0.0, 1.0, 0.0])
UP: Array = np.array([0.0, 0.0, 1.0])
Z_TARGET: Array = np.array([0.0, 0.0, 1.0])
WHEELS = ("RR", "RL", "FR", "FL")


@dataclass(frozen=True)
class Wheel:
    """The true pose of one target.

    T_vehicle_target (4, 4): origin the centre of the front face, z its outward normal.
    """

    name: str
    role: Literal["reference", "trial", "sweep", "runout"]
    wheel: str
    toe_rad: float
    camber_rad: float
    stand_off_m: float
    T_vehicle_target: Array

    @property
    def side(self) -> int:
        """+1 on the left of the car, -1 on the right."""
        return 1 if self.wheel.endswith("L") else -1

    @property
    def centre_vehicle_m(self) -> Array:
        """Centre of the target's front face."""
        return self.T_vehicle_target[:3, 3]

    @property
    def normal_vehicle(self) -> Array:
        """Unit normal of the target's front face, away from the car."""
        return self.T_vehicle_target[:3, 2]

    def to_target(self, point_vehicle_m: Array) -> Array:
        """Transform a point (3,) of the vehicle to target coordinates."""
        return (point_vehicle_m - self.centre_vehicle_m) @ self.T_vehicle_target[:3, :3]


@dataclass(frozen=True)
class Vehicle:
    """Parameters common to all wheels of a capture; T_site_vehicle (4, 4): pose in the capture."""

    axles: Axles
    placement: Placement
    body: Body
    T_site_vehicle: Array

    @property
    def floor_m(self) -> float:
        """Height of the floor in vehicle coordinates; a loaded tyre is flattened by 10 mm."""
        return 0.01 - self.body.tyre_radius_m

    @property
    def T_vehicle_floor(self) -> Array:
        """Pose (4, 4) of the floor, z = 0: lower under the left wheels by body.left_rise_m."""
        roll = np.arctan2(self.body.left_rise_m, self.axles.rear_track_m)
        pose = np.eye(4)
        pose[2, 3] = self.floor_m
        pose[1:3, 1:3] = [[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]]
        return pose


def draw_vehicle(recipe: Recipe, rng: np.random.Generator) -> Vehicle:
    """Draw axles, placement and body."""
    axles = recipe.draw("axles", Axles, rng)
    placement = recipe.draw("placement", Placement, rng)
    return Vehicle(axles, placement, recipe.draw("body", Body, rng), _pose(placement))


def draw_wheel(vehicle: Vehicle, recipe: Recipe, wheel: str, rng: np.random.Generator) -> Wheel:
    """Draw a reference wheel, its target centre given by the axles."""
    return _wheel(recipe.draw("wheels", Wheels, rng), wheel, centre(vehicle.axles, wheel), wheel)


def draw_trial(
    vehicle: Vehicle, recipe: Recipe, wheel: str, name: str, rng: np.random.Generator
) -> Wheel:
    """Draw a trial of the wheel with angles of its own and a shifted centre."""
    shift = recipe.draw("trials", Trials, rng)
    shifted = centre(vehicle.axles, wheel) + (
        shift.shift_forward_m * FORWARD + shift.shift_left_m * LEFT + shift.shift_up_m * UP
    )
    return _wheel(recipe.draw("wheels", Wheels, rng), wheel, shifted, name)


def centre(axles: Axles, wheel: str) -> Array:
    """Return the target centre (3,) of a wheel in vehicle coordinates.

    The front axle passes through e, one wheelbase ahead of the rear midpoint; its direction is
    `left` tilted about forward, then yawed about up; its midpoint is offset along it from e.
    """
    side = 1 if wheel.endswith("L") else -1
    if wheel.startswith("R"):
        return side * axles.rear_track_m / 2 * LEFT
    axis = about(UP, np.radians(axles.front_yaw_deg)) @ (
        about(FORWARD, np.radians(axles.front_tilt_deg)) @ LEFT
    )
    along_m = axles.front_offset_m + side * axles.front_track_m / 2
    return axles.wheelbase_m * FORWARD + along_m * axis


def _wheel(angles: Wheels, wheel: str, centre_m: Array, name: str) -> Wheel:
    """Rotate a target that faces outward by camber about forward, then by toe about up.

    Left wheel (s = +1), toe-in: its outward normal rotates from left towards forward, which is
    negative about up. Top outward: the outward normal dips, which is negative about forward.
    On the right both rotations are mirrored.
    """
    side = 1 if wheel.endswith("L") else -1
    toe, camber = np.radians(angles.toe_deg), np.radians(angles.camber_deg)
    neutral = np.column_stack([-side * FORWARD, UP, side * LEFT])
    pose = np.eye(4)
    pose[:3, :3] = (
        about(UP, -side * toe)
        @ about(FORWARD, -side * camber)
        @ neutral
        @ about(Z_TARGET, np.radians(angles.spin_deg))
    )
    # The spin about z does not change the normal; its rounding must not enter the truth.
    pose[:3, 2] = about(UP, -side * toe) @ (about(FORWARD, -side * camber) @ (side * LEFT))
    pose[:3, 3] = centre_m
    role: Literal["reference", "trial"] = "reference" if name == wheel else "trial"
    return Wheel(name, role, wheel, float(toe), float(camber), angles.stand_off_m, pose)


def _pose(placement: Placement) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = (
        about(UP, np.radians(placement.yaw_deg))
        @ about(LEFT, np.radians(placement.pitch_deg))
        @ about(FORWARD, np.radians(placement.roll_deg))
    )
    pose[:3, 3] = placement.x_m, placement.y_m, placement.z_m
    return pose


def about(axis: Array, angle_rad: float) -> Array:
    """Return the rotation (3, 3) about a unit axis (Rodrigues): R = I + sin K + (1 - cos) K^2."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    half = np.sin(angle_rad / 2)
    rotation: Array = np.eye(3) + np.sin(angle_rad) * cross + 2 * half * half * (cross @ cross)
    return rotation
