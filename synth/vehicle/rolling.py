"""Wheels turned about their axles, with plates that wobble and go round off their centres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..parameters.parameters import Runout
from ..parameters.recipe import Recipe
from ..scene.target import Mount
from .vehicle import Z_TARGET, Wheel, about


@dataclass(frozen=True)
class Rolled:
    """One wheel's run-out: how its plate sits, and the turns at which it is scanned.

    lean_rad: about x and y of the target; aside_m: along x and y. told_deg: the turns as told, the
    first that of the reference scan; turns_deg: as they are, > 0 as the wheel rolls forwards.
    """

    wheel: str
    lean_rad: tuple[float, float]
    aside_m: tuple[float, float]
    told_deg: tuple[float, ...]
    turns_deg: tuple[float, ...]
    u_turn_deg: float

    def on(self, mount: Mount) -> Mount:
        """The clamping with this plate's lean and offset added."""
        lean, aside = np.add(mount.tilt_rad, self.lean_rad), np.add(mount.shift_m, self.aside_m)
        return replace(
            mount,
            tilt_rad=(float(lean[0]), float(lean[1])),
            shift_m=(float(aside[0]), float(aside[1])),
        )

    def scans(self, wheel: Wheel) -> list[Wheel]:
        """The wheel at every turn but the reference's."""
        found = []
        for number, turn in enumerate(self.turns_deg[1:], 2):
            pose = wheel.T_vehicle_target.copy()
            pose[:3, :3] = pose[:3, :3] @ about(Z_TARGET, wheel.side * np.radians(turn))
            name = f"{wheel.name} turn {number}"
            found.append(replace(wheel, name=name, role="runout", T_vehicle_target=pose))
        return found

    def to_json(self) -> dict[str, Any]:
        """What was set."""
        return {
            "wheel": self.wheel,
            "wobble_deg": float(np.degrees(np.hypot(*self.lean_rad))),
            "eccentricity_m": float(np.hypot(*self.aside_m)),
            "turns_deg": list(self.turns_deg),
        }


def draw_runouts(recipe: Recipe, names: tuple[str, ...], rng: np.random.Generator) -> list[Rolled]:
    """One a wheel, each its own direction of wobble and eccentricity; none where none is asked."""
    stated = [recipe.draw("runout", Runout, rng) for _ in names]
    return [_draw(name, one, rng) for name, one in zip(names, stated, strict=True) if one.positions]


def _draw(name: str, stated: Runout, rng: np.random.Generator) -> Rolled:
    one, other = rng.uniform(0.0, 2.0 * np.pi, 2)
    told = 360.0 / stated.positions * np.arange(stated.positions)
    errors = rng.normal(0.0, 1.0, stated.positions) * stated.turn_sigma_deg
    errors[0] = 0.0
    wobble = np.radians(stated.wobble_deg)
    return Rolled(
        name,
        (float(wobble * np.cos(one)), float(wobble * np.sin(one))),
        (
            float(stated.eccentricity_m * np.cos(other)),
            float(stated.eccentricity_m * np.sin(other)),
        ),
        tuple(told.tolist()),
        tuple((told + errors).tolist()),
        max(stated.turn_sigma_deg, 0.1),
    )
