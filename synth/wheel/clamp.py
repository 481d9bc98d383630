"""A flat target clamped to the rim of a real wheel: its pose, and its solids."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import SynthError
from ..parameters.plate_file import TargetFile
from ..scene.scene import Mounted
from ..scene.solids import Solid, box, revolved
from ..scene.target import Mount, draw_mount, target_solid
from ..vehicle.vehicle import Vehicle, Wheel, about
from .bare_wheel import DrawnWheel

USUAL_M = 0.09  # stand-off where the target's file states none
PLATE_M, ARM_M, HALF_WIDTH_M = 0.010, 0.008, 0.012  # behind the target: plate, then arms
ARMS = 3
CLAW_M = (-0.006, 0.006)  # of a claw about the flange's edge
ALBEDO = 0.4
TURN = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Clamped:
    """A target on a rim; mount: tilt and shift against the rim's own axis."""

    target: TargetFile
    mount: Mount
    stand_off_m: float

    def mounted(self, wheel: Wheel, drawn: DrawnWheel) -> Mounted:
        """Return the target on `wheel`, whose own rim is that of `drawn`."""
        before = np.eye(4)
        before[2, 3] = self.stand_off_m
        pose = wheel.T_vehicle_target @ drawn.T_wheel_rim @ before
        return Mounted(replace(wheel, T_vehicle_target=pose), self.mount, self.target)

    def before(self, wheel: Wheel, drawn: DrawnWheel) -> list[Solid]:
        """Build target and clamp before `wheel`, in vehicle coordinates."""
        pose = self.mounted(wheel, drawn).pose.T_vehicle_target
        return [solid.placed(pose) for solid in self._solids(drawn.edge_m)]

    def _solids(self, edge_m: float) -> list[Solid]:
        """Build target and clamp in the target's coordinates; edge_m: radius of the flange."""
        back, inner = -self.target.thickness, self.target.open_m[0]
        behind = back - PLATE_M
        outer = self.target.open_m[1]
        plate = [(inner, behind), (outer, behind), (outer, back), (inner, back)]
        arms = []
        for number in range(ARMS):
            reach, foot = edge_m + CLAW_M[1], -self.stand_off_m - 0.004
            low, high = (inner, -HALF_WIDTH_M, behind - ARM_M), (reach, HALF_WIDTH_M, behind)
            claw = (edge_m + CLAW_M[0], -HALF_WIDTH_M, foot), (reach, HALF_WIDTH_M, behind - ARM_M)
            pose = np.eye(4)
            pose[:3, :3] = about(TURN, 2.0 * np.pi * number / ARMS + 0.4)
            arms += [box(*ends, ALBEDO).placed(pose) for ends in ((low, high), claw)]
        if inner > 0.0:
            plate.append(plate[0])
        return [target_solid(self.target), revolved(plate, 180, ALBEDO), *arms]

    def to_json(self, vehicle: Vehicle, wheel: Wheel, drawn: DrawnWheel) -> dict[str, Any]:
        """Return its normal and centre, in the coordinates of the capture, and its mounting."""
        pose, T = self.mounted(wheel, drawn).pose, vehicle.T_site_vehicle
        return {
            "shape": self.target.shape,
            "normal": (T[:3, :3] @ pose.normal_vehicle).tolist(),
            "centre_m": (T[:3, :3] @ pose.centre_vehicle_m + T[:3, 3]).tolist(),
            "stand_off_m": self.stand_off_m,
            "tilt_deg": np.degrees(self.mount.tilt_rad).tolist(),
            "shift_m": list(self.mount.shift_m),
        }


def draw_clamped(target: TargetFile, rng: np.random.Generator) -> Clamped:
    """Draw the mounting of a target as its file states it. Raises SynthError."""
    stand_off_m = USUAL_M if target.stand_off is None else target.stand_off
    stand_off_m += float(rng.normal(0.0, target.stand_off_u or 0.0))
    least = target.thickness + PLATE_M + ARM_M + 0.005
    if stand_off_m < least:
        raise SynthError(
            f"target stand_off {stand_off_m:.4f} m: less than {least:.4f} m, of target and clamp; "
            "raise stand_off or thin the target"
        )
    return Clamped(target, draw_mount(target, rng), stand_off_m)
