"""Run-out scans: wheels rotated about their axles, with targets that wobble off centre."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..parameters.parameters import Runout
from ..parameters.recipe import Recipe
from ..scene.target import Mount
from .vehicle import Z_TARGET, Wheel, about


@dataclass(frozen=True)
class RunoutScans:
    """Run-out of one wheel: the mounting of its target, and the rotations at which it is scanned.

    tilt_rad: about x and y of the target; shift_m: along x and y. stated_deg: rotations as stated,
    the first that of the reference scan; turns_deg: the true ones, > 0 as the wheel rolls forwards.
    """

    wheel: str
    tilt_rad: tuple[float, float]
    shift_m: tuple[float, float]
    stated_deg: tuple[float, ...]
    turns_deg: tuple[float, ...]
    u_turn_deg: float

    def on(self, mount: Mount) -> Mount:
        """Return the mounting with the tilt and shift of this run-out added."""
        tilt, shift = np.add(mount.tilt_rad, self.tilt_rad), np.add(mount.shift_m, self.shift_m)
        return replace(
            mount,
            tilt_rad=(float(tilt[0]), float(tilt[1])),
            shift_m=(float(shift[0]), float(shift[1])),
        )

    def scans(self, wheel: Wheel) -> list[Wheel]:
        """Return the wheel at every rotation but that of the reference scan."""
        found = []
        for number, turn in enumerate(self.turns_deg[1:], 2):
            pose = wheel.T_vehicle_target.copy()
            pose[:3, :3] = pose[:3, :3] @ about(Z_TARGET, wheel.side * np.radians(turn))
            name = f"{wheel.name} turn {number}"
            found.append(replace(wheel, name=name, role="runout", T_vehicle_target=pose))
        return found

    def to_json(self, wheel: Wheel, target: Wheel) -> dict[str, Any]:
        """Return the true values, of the target as it is mounted on its wheel."""
        axle, normal = wheel.normal_vehicle, target.normal_vehicle
        aside_m = target.centre_vehicle_m - wheel.centre_vehicle_m
        wobble = np.arctan2(np.linalg.norm(np.cross(axle, normal)), axle @ normal)
        return {
            "wheel": self.wheel,
            "wobble_deg": float(np.degrees(wobble)),
            "eccentricity_m": float(np.linalg.norm(np.cross(axle, aside_m))),
            "turns_deg": list(self.turns_deg),
        }


def draw_runouts(
    recipe: Recipe, names: tuple[str, ...], rng: np.random.Generator
) -> list[RunoutScans]:
    """Draw one run-out per wheel, with its own direction of wobble and eccentricity, or none."""
    stated = [recipe.draw("runout", Runout, rng) for _ in names]
    return [_draw(name, one, rng) for name, one in zip(names, stated, strict=True) if one.positions]


def _draw(name: str, stated: Runout, rng: np.random.Generator) -> RunoutScans:
    one, other = rng.uniform(0.0, 2.0 * np.pi, 2)
    stated_deg = 360.0 / stated.positions * np.arange(stated.positions)
    errors = rng.normal(0.0, 1.0, stated.positions) * stated.turn_sigma_deg
    errors[0] = 0.0
    wobble, shift = np.radians(stated.wobble_deg), stated.eccentricity_m
    if stated.scatter == "normal":
        wobble, shift = (wobble, shift) * np.sqrt(rng.standard_exponential(2))
    return RunoutScans(
        name,
        (float(wobble * np.cos(one)), float(wobble * np.sin(one))),
        (
            float(shift * np.cos(other)),
            float(shift * np.sin(other)),
        ),
        tuple(stated_deg.tolist()),
        tuple((stated_deg + errors).tolist()),
        max(stated.turn_sigma_deg, 0.1),
    )
