"""What a capture holds beside wheels and trials: steering sweeps and run-outs, drawn and told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..output.files import scan_file
from ..parameters.parameters import Sweep
from ..parameters.recipe import Recipe
from ..scene.target import Mount
from .rolling import Rolled, draw_runouts
from .steering import STEERED, KingpinAxis, draw_kingpin, swept, toe_out
from .vehicle import WHEELS, Vehicle, Wheel


@dataclass(frozen=True)
class Turning:
    """Sweep and run-outs of one capture, drawn before the first scan."""

    sweep: Sweep
    runouts: list[Rolled]
    rng: np.random.Generator

    def mount(self, wheel: Wheel, mount: Mount) -> Mount:
        """How a plate sits on a reference wheel; a trial's is clamped for itself."""
        if wheel.role != "reference":
            return mount
        return next((r.on(mount) for r in self.runouts if r.wheel == wheel.name), mount)

    def scanned(self, vehicle: Vehicle, recipe: Recipe, wheels: list[Wheel]) -> Scanned:
        """All further scans, in the order of the capture."""
        found: list[Wheel] = []
        kingpins: list[KingpinAxis] = []
        if self.sweep.positions:
            by_name = {wheel.name: wheel for wheel in wheels}
            kingpins = [draw_kingpin(vehicle, by_name[w], recipe, self.rng) for w in STEERED]
            found += swept(wheels, kingpins, self.sweep, vehicle)
        turns = {r.wheel: r.scans(next(w for w in wheels if w.name == r.wheel))
                 for r in self.runouts}  # fmt: skip
        found += [wheel for scans in turns.values() for wheel in scans]
        told: dict[str, Any] = {}
        if kingpins:
            told["kingpins"] = [kingpin.to_json() for kingpin in kingpins]
            told["toe_out_on_turns"] = toe_out(wheels, self.sweep, vehicle)
        if self.runouts:
            told["runouts"] = [runout.to_json() for runout in self.runouts]
        return Scanned(tuple(found), tuple(self._toml(found)), told)

    def _toml(self, found: list[Wheel]) -> list[str]:
        lines = []
        for wheel in found:
            if wheel.role == "sweep":
                position = wheel.name.rpartition(" ")[2]
                lines += ["", "[[sweep]]", *_entry(wheel.name, wheel.wheel, scan_file(wheel))]
                lines += [f'position = "{position}"']
        for runout in self.runouts:
            scans = [w for w in found if w.role == "runout" and w.wheel == runout.wheel]
            entries = [(f"{runout.wheel} turn 1", f"{runout.wheel.lower()}.ply"),
                       *((w.name, scan_file(w)) for w in scans)]  # fmt: skip
            for (name, file), angle in zip(entries, runout.told_deg, strict=True):
                lines += ["", "[[runout]]", *_entry(name, runout.wheel, file)]
                lines += [f"angle_deg = {angle!r}", f"u_angle_deg = {runout.u_turn_deg!r}"]
        return lines


@dataclass(frozen=True)
class Scanned:
    """Further scans, what capture.toml says of them, and what truth.json does."""

    wheels: tuple[Wheel, ...]
    toml: tuple[str, ...]
    told: dict[str, Any]


def draw_turning(recipe: Recipe, seed: int) -> Turning:
    """From a stream of its own, so that all else of a capture is as without it."""
    rng = np.random.default_rng([seed, 1])
    return Turning(recipe.draw("sweep", Sweep, rng), draw_runouts(recipe, WHEELS, rng), rng)


def _entry(name: str, wheel: str, file: str) -> list[str]:
    return [f'name = "{name}"', f'wheel = "{wheel}"', f'file = "{file}"']
