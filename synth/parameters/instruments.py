"""Instruments of a capture, drawn from its parameter files; the same for all its scans."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
from .plate_file import TargetFile
from .recipe import Recipe, read_recipe
from .target_file import read_target


@dataclass(frozen=True)
class Instruments:
    """Parameter files, target, scanner and total station of one capture."""

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

    def stated(self) -> dict[str, Any]:
        """Return what the scanner file states of the optional tables, ready for JSON."""
        names = ("surfaces", "sensor", "calibration", "registration")
        tables = {name: getattr(self, name).model_dump(exclude_unset=True) for name in names}
        return {name: table for name, table in tables.items() if table}


def draw_instruments(
    vehicle: Path, scanner: Path, target: Path, rng: np.random.Generator
) -> Instruments:
    """Read the parameter files and draw the instruments. Raises SynthError."""
    vehicle_recipe = read_recipe(vehicle, VehicleFile)
    scanner_recipe = read_recipe(scanner, ScannerFile)
    target_file = read_target(target)
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
    )
