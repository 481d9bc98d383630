"""Instruments of a capture, drawn from its parameter files; the same for all its scans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SynthError
from .parameters import (
    Beam,
    Calibration,
    Grid,
    Registration,
    ScannerFile,
    Sensor,
    Surfaces,
    TotalStation,
    VehicleFile,
)
from .plate_file import BareWheelFile, TargetFile
from .recipe import Recipe, read_recipe
from .target_file import read_target

WHEELS = ("RR", "RL", "FR", "FL")


@dataclass(frozen=True)
class Instruments:
    """Parameter files, targets, scanner and total station of one capture.

    clamped: targets of single wheels, where the others are bare; all wheels then have real shape.
    made: plates on single wheels as they were made, of which `target` states the drawing.
    """

    vehicle_recipe: Recipe
    scanner_recipe: Recipe
    target: TargetFile
    grid: Grid
    beam: Beam
    total_station: TotalStation
    surfaces: Surfaces
    sensor: Sensor
    calibration: Calibration
    registration: Registration
    clamped: Mapping[str, TargetFile] = field(default_factory=dict)
    made: Mapping[str, TargetFile] = field(default_factory=dict)

    def plate(self, wheel: str) -> TargetFile:
        """Return the target on a wheel as it was made."""
        return self.made.get(wheel, self.target)

    def stated(self) -> dict[str, Any]:
        """Return what files state that may be left out, ready for JSON."""
        own = {wheel: one.stated for wheel, one in self.clamped.items()}
        names = ("surfaces", "sensor", "calibration", "registration")
        tables = {name: getattr(self, name).model_dump(exclude_unset=True) for name in names}
        return {name: table for name, table in ({"targets": own} | tables).items() if table}


def draw_instruments(
    vehicle: Path,
    scanner: Path,
    target: Path,
    rng: np.random.Generator,
    targets: Mapping[str, Path] | None = None,
    made: Mapping[str, Path] | None = None,
) -> Instruments:
    """Read the parameter files and draw the instruments; targets, made: of single wheels.

    Raises SynthError.
    """
    vehicle_recipe = read_recipe(vehicle, VehicleFile)
    scanner_recipe = read_recipe(scanner, ScannerFile)
    target_file, clamped = _of_wheels(read_target(target), targets or {})
    return Instruments(
        vehicle_recipe,
        scanner_recipe,
        target_file,
        scanner_recipe.draw("grid", Grid, rng),
        scanner_recipe.draw("beam", Beam, rng),
        scanner_recipe.draw("total_station", TotalStation, rng),
        scanner_recipe.draw("surfaces", Surfaces, rng),
        scanner_recipe.draw("sensor", Sensor, rng),
        scanner_recipe.draw("calibration", Calibration, rng),
        scanner_recipe.draw("registration", Registration, rng),
        clamped,
        {wheel: read_target(path) for wheel, path in (made or {}).items()},
    )


def _of_wheels(
    common: TargetFile, named: Mapping[str, Path]
) -> tuple[TargetFile, dict[str, TargetFile]]:
    """Return what all wheels show, and the targets of single ones: where any is bare, by wheel."""
    own = {wheel: read_target(path) for wheel, path in named.items()}
    bare = [one for one in (common, *own.values()) if isinstance(one, BareWheelFile)]
    if not own:
        return common, {}
    if not bare:
        raise SynthError(
            "targets of single wheels, none of which is a bare wheel: give all wheels one target, "
            "or name 'wheel' for some or for all others"
        )
    all_four = dict.fromkeys(WHEELS, common) | own
    plates = {w: one for w, one in all_four.items() if not isinstance(one, BareWheelFile)}
    return bare[0], plates
