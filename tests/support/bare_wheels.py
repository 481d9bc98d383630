"""Bare wheels before a scanner: clouds whose axes are known."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wheelplane_synth.parameters.parameters import (
    Beam,
    Calibration,
    Grid,
    ScannerFile,
    VehicleFile,
)
from wheelplane_synth.parameters.recipe import Recipe, read_recipe
from wheelplane_synth.scanner.scanner import Stand, draw_stand, scan
from wheelplane_synth.vehicle.vehicle import Vehicle, Wheel, draw_vehicle, draw_wheel
from wheelplane_synth.wheel.bare_wheel import DrawnWheel, draw_bare_wheel
from wheelplane_synth.wheel.scan import bare_scene, rim_axis

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
NAMES = ("RR", "RL", "FR", "FL")


@dataclass(frozen=True)
class BareScan:
    """A cloud in station coordinates with the rim's axis; spin: axis and centre."""

    points_m: np.ndarray
    rim: tuple[np.ndarray, np.ndarray]
    spin: tuple[np.ndarray, np.ndarray]
    up: np.ndarray
    drawn: DrawnWheel


def recipes(**bare) -> tuple[Recipe, Recipe]:
    """The vehicle's and the scanner's recipe; bare: values of [bare_wheel] that replace its own."""
    car = read_recipe(CONFIGS / "vehicles" / "saloon-bare-wheels.toml", VehicleFile)
    scanner = read_recipe(CONFIGS / "scanners" / "default.toml", ScannerFile)
    own = {**car.tree["bare_wheel"], **bare}
    return Recipe(car.source, {**car.tree, "bare_wheel": own}), scanner


@dataclass(frozen=True)
class Bay:
    """One wheel of one car, and a scanner before it."""

    car: Vehicle
    wheel: Wheel
    drawn: DrawnWheel
    stand: Stand
    grid: Grid
    beam: Beam

    def scan(self, rng, turn_rad: float = 0.0) -> BareScan:
        position = self.stand.position_vehicle_m
        scene = bare_scene(self.car, self.wheel, self.drawn, position, turn_rad)
        R = self.car.T_site_vehicle[:3, :3]
        centre = R @ (self.wheel.centre_vehicle_m - position)
        found = scan(scene, centre, self.grid, self.beam, rng, Calibration())
        own = rim_axis(self.drawn, self.wheel, turn_rad)
        rim = R @ own.direction, R @ (own.centre_m - position)
        spin = R @ self.wheel.normal_vehicle, centre
        return BareScan(found.points_station_m, rim, spin, R[:, 2], self.drawn)


def draw_bay(
    seed: int,
    noise_m: float = 0.0008,
    spacing_m: float = 0.001,
    incidence_deg: tuple[float, float] = (3.0, 25.0),
    **bare,
) -> Bay:
    """Draw a wheel and a scanner; incidence_deg: least and most angle off its axle."""
    rng = np.random.default_rng([seed, 22])
    car_recipe, scanner = recipes(**bare)
    station = {**scanner.tree["station"], "incidence_deg": list(incidence_deg)}
    scanner = Recipe(scanner.source, {**scanner.tree, "station": station})
    car = draw_vehicle(car_recipe, rng)
    wheel = draw_wheel(car, car_recipe, NAMES[seed % 4], rng)
    drawn = draw_bare_wheel(car.body, car_recipe, rng)
    stand = draw_stand(car, wheel, scanner, rng)
    grid = scanner.draw("grid", Grid, rng).model_copy(
        update={"spacing_m": spacing_m, "half_width_m": 0.38}
    )
    beam = scanner.draw("beam", Beam, rng).model_copy(update={"range_sigma_m": noise_m})
    return Bay(car, wheel, drawn, stand, grid, beam)
