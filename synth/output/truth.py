"""Truth of a synthetic capture: the record, and its JSON for truth.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import Any

import numpy as np

from ..arrays import Array
from ..parameters.plate_file import TargetFile
from ..scene.target import Mount
from ..vehicle.vehicle import FORWARD, LEFT, UP, Vehicle, Wheel

SCHEMA = "wheelplane/truth/1"


@dataclass(frozen=True)
class Truth:
    """The vehicle, its wheels and trials in the order of the capture, and the values used.

    used: the drawn parameters and the positions of the instruments; turning: kingpins, toe-out on
    turns and run-outs, if any; both ready for JSON. target: given if the axes u and v of its face,
    and the ids of its markers, belong to the truth. rims: bare wheels by the rim's own axis.
    clamped: the target before each bare wheel, empty where there is none.
    """

    seed: int
    vehicle: Vehicle
    wheels: tuple[Wheel, ...]
    used: dict[str, Any]
    turning: dict[str, Any] = field(default_factory=dict)
    target: TargetFile | None = None
    rims: tuple[Wheel, ...] = ()
    clamped: tuple[dict[str, Any], ...] = ()

    def with_rims(
        self, mounts: Mapping[str, Mount], clamped: tuple[dict[str, Any], ...] = ()
    ) -> Truth:
        """Return the truth with the rims' own axes; mounts: of each wheel's rim, or none."""
        rims = tuple(mounts[w.wheel].on(w) for w in self.wheels if mounts)
        return replace(self, rims=rims, clamped=clamped)

    def to_json(self) -> dict[str, Any]:
        """Return the content of truth.json, in the coordinates of the capture."""
        by_name = {wheel.name: wheel for wheel in self.wheels if wheel.role == "reference"}
        toe = {name: _deg(wheel.toe_rad) for name, wheel in by_name.items()}
        return {
            "schema": SCHEMA,
            "seed": self.seed,
            "wheels": [
                _wheel(self.vehicle, wheel) | _face(self.vehicle, wheel, self.target) | rim
                for wheel, rim in zip(self.wheels, self._rims(), strict=True)
            ],
            "frame": _frame(self.vehicle),
            "vehicle": {
                "rear_total_toe_deg": toe["RL"] + toe["RR"],
                "front_total_toe_deg": toe["FL"] + toe["FR"],
                "thrust_angle_deg": (toe["RL"] - toe["RR"]) / 2,
            },
            **self.turning,
            "used": self.used,
        }

    def _rims(self) -> list[dict[str, Any]]:
        """Return each rim's own axis, and the target before it; nothing of simple wheels."""
        if not self.rims:
            return [{} for _ in self.wheels]
        return [
            {
                "rim_centre_m": site_point(self.vehicle, rim.centre_vehicle_m),
                "rim_normal": _site_direction(self.vehicle, rim.normal_vehicle),
                **({"clamped_target": clamped} if clamped else {}),
            }
            for rim, clamped in zip(self.rims, self.clamped or repeat({}), strict=False)
        ]


def site_point(vehicle: Vehicle, point_vehicle_m: Array) -> list[float]:
    """Transform a point (3,) of the vehicle to the coordinates of the capture."""
    T = vehicle.T_site_vehicle
    return [float(v) for v in T[:3, :3] @ point_vehicle_m + T[:3, 3]]


def _wheel(vehicle: Vehicle, wheel: Wheel) -> dict[str, Any]:
    iso = np.arctan(np.tan(wheel.camber_rad) / np.cos(wheel.toe_rad))
    return {
        "name": wheel.name,
        "role": wheel.role,
        "wheel": wheel.wheel,
        "toe_deg": _deg(wheel.toe_rad),
        "camber_deg": _deg(wheel.camber_rad),
        "camber_iso_deg": _deg(float(iso)),
        "centre_m": site_point(vehicle, wheel.centre_vehicle_m),
        "normal": _site_direction(vehicle, wheel.normal_vehicle),
    }


def _face(vehicle: Vehicle, wheel: Wheel, target: TargetFile | None) -> dict[str, Any]:
    if target is None:
        return {}
    u, v = wheel.T_vehicle_target[:3, :2].T
    ids = target.ids_of(wheel.wheel)
    axes = {"u": _site_direction(vehicle, u), "v": _site_direction(vehicle, v)}
    return axes | ({"ids": list(ids)} if ids else {})


def _frame(vehicle: Vehicle) -> dict[str, Any]:
    return {
        "origin_m": site_point(vehicle, np.zeros(3)),
        "left": _site_direction(vehicle, LEFT),
        "forward": _site_direction(vehicle, FORWARD),
        "up": _site_direction(vehicle, UP),
        "rear_track_m": vehicle.axles.rear_track_m,
        "front_track_m": vehicle.axles.front_track_m,
        "wheelbase_m": vehicle.axles.wheelbase_m,
    }


def _site_direction(vehicle: Vehicle, direction_vehicle: Array) -> list[float]:
    return [float(v) for v in vehicle.T_site_vehicle[:3, :3] @ direction_vehicle]


def _deg(angle_rad: float) -> float:
    return float(np.degrees(angle_rad))
