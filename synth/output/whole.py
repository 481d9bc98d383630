"""Writer of one cloud of a whole synthetic vehicle in its bay, from several stations, and truth."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import SynthError
from ..parameters.instruments import Instruments, draw_instruments
from ..parameters.parameters import Panorama
from ..parameters.plate_file import BareWheelFile
from ..scanner.lattice import Preview, draw_lattice, preview_scene
from ..scanner.panorama import scan_rows
from ..scanner.stations import Station, draw_misplacement
from ..scene.site import Site, draw_site
from ..vehicle.vehicle import WHEELS, Wheel, draw_vehicle
from .cloud_files import Cloud, PlyCloud
from .e57 import E57Cloud
from .files import five_point_text
from .five_point import draw_position, measure_five
from .folder import check_free, check_seed, new_folder, write_text
from .truth import Truth, site_point

FORMS = ("ply", "e57")
REGISTRATION = 7  # stream of random numbers, with the seed


def _silent(_: str) -> None:
    """Ignore progress."""


def write_whole(
    out: Path,
    *,
    seed: int,
    vehicle: Path,
    scanner: Path,
    target: Path,
    form: str = "ply",
    points: int | None = None,
    targets: Mapping[str, Path] | None = None,
    progress: Callable[[str], None] = _silent,
) -> Truth:
    """Write the folder `out`, all of it or nothing, and return its truth.

    vehicle, scanner, target: parameter files; form: one of FORMS; points: of the cloud, within 1 or
    2 %, instead of the scanner file's; targets: those of single wheels, where others are bare.
    `progress` is called with each station when it is written. Vehicle, targets and five points are
    those of the wheel scans of the same seed. The same arguments give the same bytes. Raises
    SynthError.
    """
    check_seed(seed)
    _check(form, points)
    check_free(out)
    seeds = np.random.SeedSequence(seed).spawn(3 + len(WHEELS))
    vehicle_rng, instruments_rng, survey_rng, *wheel_rngs = (
        np.random.default_rng(child) for child in seeds
    )
    kit = draw_instruments(vehicle, scanner, target, instruments_rng, targets)
    if kit.sensor.kind != "laser-scanner":
        raise SynthError(
            f"{scanner}: sensor.kind '{kit.sensor.kind}' scans wheel by wheel; leave --whole out, "
            "or name a laser scanner"
        )
    if kit.beam.return_mode == "two":
        raise SynthError(
            f"{scanner}: beam.return_mode 'two' scans wheel by wheel; leave --whole out, or name "
            "another return mode"
        )
    if kit.beam.edge_filter_m > 0.0:
        raise SynthError(
            f"{scanner}: beam.edge_filter_m filters scans of single wheels; leave --whole out, or "
            "set it to 0"
        )
    car = draw_vehicle(kit.vehicle_recipe, vehicle_rng)
    site = draw_site(car, kit, seed, points, wheel_rngs)
    with new_folder(out) as folder:
        file = folder / f"vehicle.{form}"
        with closing(E57Cloud(file, seed) if form == "e57" else PlyCloud(file)) as cloud:
            scans = _write_scans(site, kit, seed, cloud, progress)
        position_m = draw_position(car, kit.total_station, survey_rng)
        poses = {one.wheel.name: one.pose for one in (*site.mounted, *site.shown)}
        rows = measure_five(car, list(poses.values()), kit.total_station, position_m, survey_rng)
        write_text(folder / "five-point.txt", five_point_text(rows))
        wheels = tuple(mounted.wheel for mounted in site.mounted)
        used = {"file": file.name, **_used(site, kit, scans, position_m)}
        face = None if isinstance(kit.target, BareWheelFile) else kit.target
        truth = Truth(seed, car, wheels, used, target=face)
        shown = tuple(_clamped(site, wheel) for wheel in wheels)
        truth = truth.with_rims({name: one.mount for name, one in site.bare.items()}, shown)
        write_text(folder / "truth.json", json.dumps(truth.to_json(), indent=1) + "\n")
        return truth


def _check(form: str, points: int | None) -> None:
    if form not in FORMS:
        raise SynthError(f"form {form!r}: not known; give one of {', '.join(FORMS)}")
    low, high = 10_000, 1_000_000_000
    if points is not None and not low <= points <= high:
        raise SynthError(f"--points {points}: give a number from {low} to {high}")


def _write_scans(
    site: Site, kit: Instruments, seed: int, cloud: Cloud, progress: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Scan from every station; return the values used for each."""
    previews = [
        preview_scene(site.scene(s), site.caster(s), site.panorama, site.middle_m(s))
        for s in site.stations
    ]
    step = _step_rad(site.panorama, previews, kit.beam.dropout_fraction)
    used, first = [], 0
    for station, found in zip(site.stations, previews, strict=True):
        cloud.begin(station)
        scan = _write_station(site, kit, seed, station, found, step, cloud)
        used.append(scan | {"rows": [first, first + scan["points"]]})
        first += scan["points"]
        progress(f"station {station.number}")
    return used


def _step_rad(panorama: Panorama, previews: Sequence[Preview], dropout: float) -> float:
    """Return the step between beams that gives the wanted number of points of all stations."""
    wide, high = panorama.window_deg, panorama.highest_deg - panorama.lowest_deg
    returned = sum(one.share for one in previews) * (1.0 - dropout)
    return float(np.sqrt(np.radians(wide) * np.radians(high) * returned / panorama.points))


def _write_station(
    site: Site,
    kit: Instruments,
    seed: int,
    station: Station,
    preview: Preview,
    step_rad: float,
    cloud: Cloud,
) -> dict[str, Any]:
    stream = (seed, station.number)
    target_m = site.nearest_target_m(station)
    grid = draw_lattice(site.panorama, site.middle_m(station), step_rad, stream)
    names = ("", *(one.wheel.name for one in site.shown))
    on_targets = np.zeros(len(names), dtype=np.int64)
    rng = np.random.default_rng([seed, REGISTRATION, station.number])
    misplaced = draw_misplacement(kit.registration, rng)
    for block in scan_rows(
        site.scene(station),
        site.caster(station),
        grid,
        kit.beam,
        target_m,
        preview.nearest_m,
        stream,
        calibration=kit.calibration,
    ):
        cloud.add(misplaced.of(block.points_station_m), block.intensity)
        on_targets += np.bincount(block.target + 1, minlength=len(names))
    return {
        "station": station.number,
        "station_m": station.position_site_m.tolist(),
        "turn_deg": float(np.degrees(station.heading_rad)),
        "step_rad": grid.step_rad,
        "beams": grid.beams,
        "points": int(on_targets.sum()),
        "points_on_target": dict.fromkeys(WHEELS, 0)
        | dict(zip(names[1:], on_targets[1:].tolist(), strict=True)),
        **misplaced.to_json(),
    }


def _clamped(site: Site, wheel: Wheel) -> dict[str, Any]:
    """Return the target before a bare wheel, if there is one."""
    one = site.clamped.get(wheel.name)
    return one.to_json(site.vehicle, wheel, site.bare[wheel.name]) if one else {}


def _used(
    site: Site, kit: Instruments, scans: list[dict[str, Any]], station_vehicle_m: Array
) -> dict[str, Any]:
    car = site.vehicle
    mounts = {
        one.wheel.name: one.mount.to_json(kit.target)
        | ({"occluded_fraction": hidden} if hidden else {})
        for one, hidden in zip(site.mounted, site.hidden, strict=True)
    }
    return {
        "target": kit.target.stated,
        "axles": car.axles.model_dump(),
        "placement": car.placement.model_dump(),
        "body": car.body.model_dump(),
        "panorama": site.panorama.model_dump(),
        "beam": kit.beam.model_dump(exclude_unset=True),
        **kit.stated(),
        "total_station": {
            **kit.total_station.model_dump(),
            "station_m": site_point(car, station_vehicle_m),
        },
        "mounts": {name: mount for name, mount in mounts.items() if mount},
        "scans": scans,
    }
