"""Steering sweeps and run-outs of a capture: draws, scans, and their entries in capture.toml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..output.files import scan_file
from ..parameters.parameters import Sweep
from ..parameters.recipe import Recipe
from ..scene.target import Mount
from .rolling import RunoutScans, draw_runouts
from .steering import STEERED, KingpinAxis, draw_kingpin, swept, toe_out
from .vehicle import WHEELS, Vehicle, Wheel

TURNING = 1  # stream of random numbers, with the seed


@dataclass(frozen=True)
class Turning:
    """Sweep and run-outs of one capture, drawn before the first scan."""

    sweep: Sweep
    runouts: list[RunoutScans]
    rng: np.random.Generator
    seed: int

    def scan_rng(self, number: int) -> np.random.Generator:
        """Return the stream of the scan of that number, from 1: no other scan draws from it."""
        return np.random.default_rng([self.seed, TURNING, number])

    def mount(self, wheel: Wheel, mount: Mount) -> Mount:
        """Return the mounting on a reference wheel with its run-out; a trial has its own."""
        if wheel.role != "reference":
            return mount
        return next((r.on(mount) for r in self.runouts if r.wheel == wheel.name), mount)

    def scanned(
        self, vehicle: Vehicle, recipe: Recipe, wheels: list[Wheel], targets: list[Wheel]
    ) -> Scanned:
        """Return all further scans, in the order of the capture.

        targets: poses of the mounted targets, in the order of the wheels.
        """
        found: list[Wheel] = []
        kingpins: list[KingpinAxis] = []
        if self.sweep.positions:
            by_name = {wheel.name: wheel for wheel in wheels}
            kingpins = [draw_kingpin(vehicle, by_name[w], recipe, self.rng) for w in STEERED]
            found += swept(wheels, kingpins, self.sweep, vehicle)
        turns = {r.wheel: r.scans(next(w for w in wheels if w.name == r.wheel))
                 for r in self.runouts}  # fmt: skip
        found += [wheel for scans in turns.values() for wheel in scans]
        truth: dict[str, Any] = {}
        if kingpins:
            truth["kingpins"] = [kingpin.to_json() for kingpin in kingpins]
            truth["toe_out_on_turns"] = toe_out(wheels, self.sweep, vehicle)
        if self.runouts:
            on = {wheel.name: (wheel, one) for wheel, one in zip(wheels, targets, strict=True)}
            truth["runouts"] = [runout.to_json(*on[runout.wheel]) for runout in self.runouts]
        return Scanned(tuple(found), tuple(self._toml(found)), truth)

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
            for (name, file), angle in zip(entries, runout.stated_deg, strict=True):
                lines += ["", "[[runout]]", *_entry(name, runout.wheel, file)]
                lines += [f"angle_deg = {angle!r}", f"u_angle_deg = {runout.u_turn_deg!r}"]
        return lines


@dataclass(frozen=True)
class Scanned:
    """Further scans, their lines in capture.toml, and their truth for truth.json."""

    wheels: tuple[Wheel, ...]
    toml: tuple[str, ...]
    truth: dict[str, Any]


def draw_turning(recipe: Recipe, seed: int) -> Turning:
    """Draw from a stream of its own, so that the rest of a capture does not depend on it."""
    rng = np.random.default_rng([seed, TURNING])
    return Turning(recipe.draw("sweep", Sweep, rng), draw_runouts(recipe, WHEELS, rng), rng, seed)


def _entry(name: str, wheel: str, file: str) -> list[str]:
    return [f'name = "{name}"', f'wheel = "{wheel}"', f'file = "{file}"']
