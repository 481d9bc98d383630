"""Writer of a capture of a synthetic vehicle: scans, capture.toml, five points, and the truth."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import SynthError
from ..machine.forms import item_toml, machine_truth, readings_csv
from ..machine.indicate import indicate, with_points
from ..machine.read import read_machine
from ..parameters.instruments import Instruments, draw_instruments
from ..parameters.machine import MachineFile
from ..parameters.parameters import Obstacle
from ..parameters.plate_file import BareWheelFile, DiscFile
from ..parameters.recipe import Recipe
from ..scanner.scanner import draw_stand, scan
from ..scanner.sensors import sense
from ..scanner.stations import draw_misplacement
from ..scene.obstacle import draw_board
from ..scene.scene import Mounted, build_scene
from ..scene.solids import Solid
from ..scene.target import Mount, draw_mount
from ..vehicle.turning import draw_turning
from ..vehicle.vehicle import WHEELS, Vehicle, Wheel, draw_trial, draw_vehicle, draw_wheel
from ..wheel.bare_wheel import DrawnWheel
from ..wheel.clamp import Clamped, draw_clamped
from ..wheel.scan import bare_scene, draw_bare_wheels, with_rims
from .files import capture_toml, five_point_text, ply, scan_file
from .five_point import draw_position, measure_five
from .folder import check_free, check_seed, new_folder, write_text
from .truth import Truth, site_point


def _silent(_: str) -> None:
    """Ignore progress."""


def write_capture(
    out: Path,
    *,
    seed: int,
    vehicle: Path,
    scanner: Path,
    target: Path,
    trials: int = 2,
    machine: Path | None = None,
    targets: Mapping[str, Path] | None = None,
    made: Mapping[str, Path] | None = None,
    progress: Callable[[str], None] = _silent,
) -> Truth:
    """Write the folder `out`, all of it or nothing, and return its truth.

    vehicle, scanner, target: parameter files; targets: those of single wheels, where others are
    bare; made: those of plates on single wheels as they were made, of which `target` states the
    drawing; machine: that of a machine under test, whose item file and readings are written too.
    `progress` is called with the name of each file when it is written. The same arguments give the
    same bytes; the draws of a scan depend neither on other scans nor on the number of trials that
    follow. Raises SynthError.
    """
    check_seed(seed)
    if trials < 0:
        raise SynthError(f"--trials {trials}: negative; give a whole number from 0")
    check_free(out)
    tested = None if machine is None else read_machine(machine, seed)
    seeds = np.random.SeedSequence(seed).spawn(3 + len(WHEELS) + trials)
    vehicle_rng, instruments_rng, survey_rng, *scan_rngs = (
        np.random.default_rng(child) for child in seeds
    )
    instruments = draw_instruments(vehicle, scanner, target, instruments_rng, targets, made)
    car = draw_vehicle(instruments.vehicle_recipe, vehicle_rng)
    with new_folder(out) as folder:
        return _fill(folder, seed, car, instruments, survey_rng, scan_rngs, progress, tested)


def _fill(
    folder: Path,
    seed: int,
    car: Vehicle,
    kit: Instruments,
    survey_rng: np.random.Generator,
    scan_rngs: list[np.random.Generator],
    progress: Callable[[str], None],
    machine: MachineFile | None,
) -> Truth:
    wheels: list[Wheel] = []
    mounts: list[Mount] = []
    used: list[dict[str, Any]] = []
    clamps: list[dict[str, Any]] = []
    clamped: list[Clamped | None] = []
    turning = draw_turning(kit.vehicle_recipe, seed)
    bare = draw_bare_wheels(car, kit, seed)
    turning = with_rims(turning, bare)
    for number, rng in enumerate(scan_rngs):
        wheel = _next_wheel(number, car, kit.vehicle_recipe, rng)
        drawn = draw_mount(kit.target, rng)
        clamps.append(drawn.to_json(kit.target))
        mount = turning.mount(wheel, drawn)
        own = bare.get(wheel.wheel)
        mount = own.mount if own else mount
        plate = kit.clamped.get(wheel.wheel)
        clamped.append(draw_clamped(plate, rng) if plate else None)
        wheels.append(wheel)
        mounts.append(mount)
        scanned = _write_scan(folder, car, wheel, mount, kit, rng, own, clamped[-1])
        used.append(scanned | clamps[-1])
        progress(used[-1]["file"])
    position_m = draw_position(car, kit.total_station, survey_rng)
    mounted = [
        one.mounted(wheel, bare[wheel.wheel]).pose if one else mount.on(wheel)
        for wheel, mount, one in zip(wheels, mounts, clamped, strict=True)
    ]
    rows = measure_five(car, mounted, kit.total_station, position_m, survey_rng)
    write_text(folder / "five-point.txt", five_point_text(rows))
    more = turning.scanned(car, kit.vehicle_recipe, wheels, mounted)
    for turned, wheel in enumerate(more.wheels, 1):
        number, rng = WHEELS.index(wheel.wheel), turning.scan_rng(turned)
        own, one, mount = bare.get(wheel.wheel), clamped[number], mounts[number]
        used.append(_write_scan(folder, car, wheel, mount, kit, rng, own, one) | clamps[number])
        progress(used[-1]["file"])
    title = f"{Path(kit.vehicle_recipe.source).stem} {seed}"
    declared = capture_toml(title, kit.target, wheels, more.toml, kit.clamped)
    write_text(folder / "capture.toml", declared)
    all_wheels = (*wheels, *more.wheels)
    face = None if isinstance(kit.target, DiscFile | BareWheelFile) else kit.target
    truth = Truth(seed, car, all_wheels, _used(car, kit, used, position_m), more.truth, face)
    shown: list[dict[str, Any]] = [
        one.to_json(car, wheel, bare[wheel.wheel]) if one else {}
        for wheel, one in zip(wheels, clamped, strict=True)
    ]
    shown += [{} for _ in more.wheels]
    truth = truth.with_rims({name: one.mount for name, one in bare.items()}, tuple(shown))
    tree = truth.to_json()
    if machine is not None:
        tree["machine"] = _write_machine(folder, tree, machine, np.random.default_rng((seed, 19)))
    write_text(folder / "truth.json", json.dumps(tree, indent=1) + "\n")
    progress("truth.json")
    return truth


def _write_machine(
    folder: Path, truth: dict[str, Any], machine: MachineFile, rng: np.random.Generator
) -> dict[str, Any]:
    """Write the item file and the readings of a machine under test; return its truth."""
    machine = with_points(truth, machine)
    write_text(folder / "item.toml", item_toml(machine))
    write_text(folder / "readings.csv", readings_csv(indicate(truth, machine, rng)))
    return machine_truth(truth, machine)


def _next_wheel(number: int, car: Vehicle, recipe: Recipe, rng: np.random.Generator) -> Wheel:
    wheel = WHEELS[number % len(WHEELS)]
    if number < len(WHEELS):
        return draw_wheel(car, recipe, wheel, rng)
    return draw_trial(car, recipe, wheel, str(number - len(WHEELS) + 1), rng)


def _write_scan(
    folder: Path,
    car: Vehicle,
    wheel: Wheel,
    mount: Mount,
    kit: Instruments,
    rng: np.random.Generator,
    bare: DrawnWheel | None,
    clamped: Clamped | None = None,
) -> dict[str, Any]:
    """Scan one wheel, write its file, and return the values used for it."""
    stand = draw_stand(car, wheel, kit.scanner_recipe, rng)
    hidden = kit.scanner_recipe.draw("scene", Obstacle, rng).occluded_fraction
    position_m = stand.position_vehicle_m
    shown = clamped.mounted(wheel, bare) if clamped and bare else Mounted(wheel, mount, kit.target)
    obstacles = [_board(shown, wheel, position_m, hidden, rng)] if hidden else []
    if bare is None:
        plate = kit.plate(wheel.wheel)
        scene = build_scene(car, wheel, plate, position_m, mount, obstacles, kit.surfaces)
    else:
        scene = bare_scene(car, wheel, bare, position_m, 0.0, obstacles, clamped, kit.surfaces)
    R_site_vehicle = car.T_site_vehicle[:3, :3]
    centre_station_m = R_site_vehicle @ (wheel.centre_vehicle_m - stand.position_vehicle_m)
    if kit.sensor.kind == "laser-scanner":
        found = scan(scene, centre_station_m, kit.grid, kit.beam, rng, kit.calibration)
    else:
        found = sense(scene, centre_station_m, kit.sensor, kit.grid, kit.beam, rng)
    misplaced = draw_misplacement(kit.registration, rng)
    station_m = site_point(car, stand.position_vehicle_m)
    name = scan_file(wheel)
    points_m = misplaced.of(found.points_station_m) + station_m
    (folder / name).write_bytes(ply(points_m, found.intensity))
    return {
        "file": name,
        "station_m": station_m,
        "distance_m": stand.distance_m,
        "incidence_deg": float(np.degrees(stand.incidence_rad)),
        "stand_off_m": wheel.stand_off_m,
        "beams": found.beams,
        "points": len(found.points_station_m),
        "points_on_target": int(found.on_front.sum()),
        **({"occluded_fraction": hidden} if hidden else {}),
        **misplaced.to_json(),
    }


def _board(
    shown: Mounted, wheel: Wheel, station_vehicle_m: Array, hidden: float, rng: np.random.Generator
) -> Solid:
    """Build the board before the target shown on a wheel, in the coordinates of the wheel."""
    board = draw_board(shown.target, shown.wheel.to_target(station_vehicle_m), hidden, rng)
    if shown.wheel is wheel:
        return board
    T_wheel_vehicle = np.linalg.inv(wheel.T_vehicle_target)
    return board.placed(T_wheel_vehicle @ shown.wheel.T_vehicle_target)


def _used(
    car: Vehicle, kit: Instruments, scans: list[dict[str, Any]], station_vehicle_m: Array
) -> dict[str, Any]:
    return {
        "target": kit.target.stated,
        "axles": car.axles.model_dump(),
        "placement": car.placement.model_dump(),
        "body": car.body.model_dump(),
        "grid": kit.grid.model_dump(),
        "beam": kit.beam.model_dump(exclude_unset=True),
        **kit.stated(),
        "total_station": {
            **kit.total_station.model_dump(),
            "station_m": site_point(car, station_vehicle_m),
        },
        "scans": scans,
    }
