"""Steering sweeps: front wheels rotated about their steering axes, by Ackermann steering.

The steering axis is tilted by caster (top backwards) and inclination (top inwards), as projected,
and meets the floor inboard of the middle of the tyre by the scrub radius; seen from the side it
passes through the middle of the wheel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..parameters.parameters import Kingpin, Sweep
from ..parameters.recipe import Recipe
from .vehicle import FORWARD, UP, Vehicle, Wheel, about

STEERED = ("FR", "FL")
INNER_DEG = 20.0  # steer of the inner wheel for toe-out on turns
BISECTIONS = 60


@dataclass(frozen=True)
class KingpinAxis:
    """Steering axis of one wheel: unit (3,), upwards, and its floor point (3,); vehicle frame."""

    wheel: str
    stated: Kingpin
    axis: Array
    floor_point_m: Array

    def to_json(self) -> dict[str, Any]:
        """Return the true values."""
        return {"wheel": self.wheel, **self.stated.model_dump()}


def draw_kingpin(
    vehicle: Vehicle, wheel: Wheel, recipe: Recipe, rng: np.random.Generator
) -> KingpinAxis:
    """Draw the steering axis of a reference wheel."""
    stated = recipe.draw("kingpin", Kingpin, rng)
    back = np.tan(np.radians(stated.caster_deg))
    inwards = -wheel.side * np.tan(np.radians(stated.inclination_deg))
    up = np.array([-back, inwards, 1.0])
    hub = wheel.centre_vehicle_m - wheel.normal_vehicle * (
        wheel.stand_off_m + vehicle.body.tyre_width_m / 2
    )
    drop = hub[2] - vehicle.floor_m
    floor = np.array([hub[0] + back * drop, 0.0, vehicle.floor_m])
    ahead, across, high = wheel.normal_vehicle  # the middle plane: normal . (x - hub) = 0
    middle = hub[1] - (ahead * back * drop - high * drop) / across
    floor[1] = middle - wheel.side * stated.scrub_m
    return KingpinAxis(wheel.name, stated, up / np.linalg.norm(up), floor)


def swept(
    wheels: list[Wheel], kingpins: list[KingpinAxis], sweep: Sweep, vehicle: Vehicle
) -> list[Wheel]:
    """Return every front wheel at every position, from right lock to left lock, in rounds."""
    steps = np.radians(np.linspace(-sweep.lock_deg, sweep.lock_deg, sweep.positions))
    found = []
    for kingpin in kingpins:
        wheel = next(w for w in wheels if w.name == kingpin.wheel)
        for turn in range(sweep.rounds):
            for step, steer in enumerate(steps):
                name = f"{wheel.name} sweep {turn + 1}.{step + 1}"
                toe = wheel.toe_rad - wheel.side * _own_steer(float(steer), wheel, sweep, vehicle)
                found.append(replace(_steered(wheel, kingpin, toe), name=name, role="sweep"))
    return found


def toe_out(wheels: list[Wheel], sweep: Sweep, vehicle: Vehicle) -> list[dict[str, Any]]:
    """Return inner less outer angle, the inner wheel at 20 degrees toe-out, left and right turn."""
    differences = []
    by_name = {wheel.name: wheel for wheel in wheels}
    for turn, inner, outer in (("left", "FL", "FR"), ("right", "FR", "FL")):
        steer = np.radians(INNER_DEG) + by_name[inner].toe_rad
        sign = 1.0 if turn == "left" else -1.0
        outer_steer = abs(_own_steer(sign * steer, by_name[outer], sweep, vehicle))
        outer_deg = np.degrees(by_name[outer].toe_rad + outer_steer)
        differences.append({"turn": turn, "difference_deg": float(INNER_DEG - outer_deg)})
    return differences


def _own_steer(inner: float, wheel: Wheel, sweep: Sweep, vehicle: Vehicle) -> float:
    """Return a wheel's steer, > 0 to the left, for that of the inner wheel.

    cot(outer) = cot(inner) + track / wheelbase, Ackermann; or a fraction of that difference.
    """
    if inner == 0.0 or (inner > 0.0) == (wheel.side > 0):
        return inner
    ratio = sweep.ackermann * vehicle.axles.front_track_m / vehicle.axles.wheelbase_m
    return float(np.sign(inner) * np.arctan2(1.0, 1.0 / np.tan(abs(inner)) + ratio))


def _steered(wheel: Wheel, kingpin: KingpinAxis, toe_rad: float) -> Wheel:
    """Rotate the wheel about its steering axis until it has that toe, found by bisection."""
    low, high = -np.pi / 3, np.pi / 3
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        turned = _rotated(wheel, kingpin, middle)
        # A turn to the left, > 0 about up, reduces the toe of a left wheel.
        if wheel.side * (turned.toe_rad - toe_rad) > 0.0:
            low = middle
        else:
            high = middle
    return turned


def _rotated(wheel: Wheel, kingpin: KingpinAxis, angle_rad: float) -> Wheel:
    rotation = about(kingpin.axis, angle_rad)
    pose = np.eye(4)
    pose[:3, :3] = rotation @ wheel.T_vehicle_target[:3, :3]
    pose[:3, 3] = kingpin.floor_point_m + rotation @ (
        wheel.centre_vehicle_m - kingpin.floor_point_m
    )
    forward, up = float(pose[:3, 2] @ FORWARD), float(pose[:3, 2] @ UP)
    outward = wheel.side * float(pose[1, 2])
    return replace(
        wheel,
        toe_rad=float(np.arctan2(forward, outward)),
        camber_rad=float(-np.arcsin(up)),
        T_vehicle_target=pose,
    )
