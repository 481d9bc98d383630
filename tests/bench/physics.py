"""Error and stated uncertainty of toe, camber and centres, for one kind of physics at a time.

.venv/bin/python -m tests.bench.physics [--wheels 60] [--seed 0] [--target disc-250]

Each line: rms error / rms u, their ratio, and the share of errors within U; a star where the ratio
is not within 0.8 and 1.25, or the share not within 92 and 98.5 %. Behind the centres' errors stands
the mean square of them by their covariance, a component: 1 where u is right. Each case has vehicles
and noise of its own, from --seed on; the window of a scan reaches beyond the target. A case whose
errors a file can state is measured twice: without that file, and with it (+ stated). Its errors are
drawn from what is stated, most of them once a capture: it takes three times as many captures.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.support.made import (
    OF_EDGE,
    OF_SIZE,
    OF_THICKNESS,
    SIZE_M,
    THICKNESS,
    as_toml,
    draw_edge,
    parted,
)
from tests.support.scenes import Array
from tests.support.thinned import least_distance
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file, with_scanner
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture
from wheelplane.measurement import Measurement
from wheelplane.targets.registry import load_target
from wheelplane.uncertainty import coverage_factor
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.parameters.instruments import WHEELS

ARCSEC = np.degrees(1.0) * 3600.0
END = b"end_header\n"  # of a PLY file's header
LEVEL = 0.95
RATIO, INSIDE = (0.8, 1.25), (0.92, 0.985)  # wanted of rms error over rms u, and of the shares
SHARED = 3  # times as many captures where scans share errors
SEEDS = 10_000  # of a case
BEYOND_M = 0.02  # the target, of the narrowest window
Values = dict[str, Any]

PLAIN: Values = {
    "station.distance_m": [2.0, 3.0],
    "station.incidence_deg": [3.0, 25.0],
    "grid.spacing_m": 0.0013,
    "grid.half_width_m": 0.2,
    "beam.range_sigma_m": 0.0008,
}
QUIET: Values = {"beam.range_sigma_m": 0.0002}
NARROW: Values = {"grid.half_width_m": 0.17}
SPARSE: Values = {**NARROW, "grid.spacing_m": 0.0026}
BARE: Values = {  # hardly any noise
    "beam.range_sigma_m": 0.00003,
    "beam.angle_sigma_urad": 0.0,
    "beam.stray_fraction": 0.0,
    "grid.spacing_m": 0.003,
    "grid.half_width_m": 0.18,
}
GAUSSIAN: Values = {"beam.spot_profile": "gaussian"}
LAMBERT: Values = {"beam.power_weighted": True}
DARK_WALL: Values = {"surfaces.face": 0.8, "surfaces.wall": [0.2, 0.5]}
HALF: Values = {"surfaces.dark_part": "half", "surfaces.dark_turn_deg": [0.0, 360.0]}
SHOT: Values = {"beam.noise_by_brightness": 0.5}
RECEIVER: Values = {"beam.noise_by_brightness": 1.0}
RETURNS: Values = {**GAUSSIAN, **LAMBERT, "beam.range_gate_m": 0.02}
LINES: Values = {"beam.line_sigma_m": 0.00015}
ARC15 = [-26.0, 26.0]  # uniform, of standard deviation 15
AXES: Values = {
    **SPARSE,
    "calibration.collimation_arcsec": ARC15,
    "calibration.trunnion_arcsec": ARC15,
    "calibration.vertical_index_arcsec": ARC15,
    "calibration.azimuth_eccentricity_arcsec": ARC15,
    "calibration.azimuth_eccentricity_at_deg": [0.0, 360.0],
    "calibration.elevation_eccentricity_arcsec": ARC15,
    "calibration.elevation_eccentricity_at_deg": [0.0, 360.0],
    "instrument.collimation_arcsec": 15.0,
    "instrument.trunnion_arcsec": 15.0,
    "instrument.vertical_index_arcsec": 15.0,
    "instrument.azimuth_eccentricity_arcsec": 15.0,
    "instrument.elevation_eccentricity_arcsec": 15.0,
    "instrument.same_face": True,
}
STATIONS: Values = {
    **SPARSE,
    "registration.turn_sigma_arcsec": 15.0,
    "registration.shift_sigma_m": 0.0005,
    "instrument.pointing_urad": 72.7,
    "instrument.registration_m": 0.0005,
}
INCIDENCE: Values = {
    **SPARSE,
    "station.incidence_deg": [20.0, 45.0],
    "beam.incidence_bias_m": [-0.00173, 0.00173],
    "instrument.incidence_bias_m": 0.001,
}


@dataclass(frozen=True)
class Case:
    """One kind of physics: a scanner's file, and the values that replace its own.

    flatness_m, chamfer_m: of the target; a chamfer of None is drawn for each vehicle, see
    `made_targets`. merged: each wheel is scanned from two stations, in one file. step_m: to which
    coordinates are rounded. spaced_m: to which distance points are thinned. dim: without their
    intensities.
    """

    values: Values = field(default_factory=dict)
    base: str = "default"
    flatness_m: float = 0.0
    chamfer_m: float | None = None
    merged: bool = False
    step_m: float = 0.0
    spaced_m: float = 0.0
    dim: bool = False

    @property
    def is_stated(self) -> bool:
        """Whether a file can state its errors."""
        shipped = self.base in ("phase-shift", "structured-light")
        stated = any(key.startswith("instrument.") for key in self.values)
        return shipped or stated or self.flatness_m > 0.0 or self.chamfer_m is not None


CASES: dict[str, Case] = {
    "independent": Case(PLAIN),
    "quiet": Case(PLAIN | QUIET),
    "strays": Case(PLAIN | {"beam.stray_fraction": 0.05}),
    "correlated": Case(
        PLAIN | {"beam.correlated_sigma_m": 0.0002, "beam.correlation_length_m": 0.01}
    ),
    "anisotropic": Case(
        PLAIN
        | {
            "beam.correlated_sigma_m": 0.0002,
            "beam.correlation_length_m": 0.04,
            "beam.correlation_aspect": 0.1,
        }
    ),
    "lines": Case(PLAIN | LINES),
    "lines-level": Case(PLAIN | LINES | {"beam.scan_lines": "rows"}),
    "lambert": Case(PLAIN | QUIET | LAMBERT),
    "gaussian": Case(PLAIN | QUIET | GAUSSIAN),
    "elliptic-1.3": Case(PLAIN | QUIET | GAUSSIAN | {"beam.spot_aspect": 1.3}),
    "elliptic-1.6": Case(PLAIN | {"beam.spot_aspect": 1.6}),
    "gaussian-lambert": Case(PLAIN | QUIET | GAUSSIAN | LAMBERT),
    "wall-dark": Case(PLAIN | QUIET | GAUSSIAN | LAMBERT | DARK_WALL),
    "wall-dark-steep": Case(
        PLAIN | QUIET | GAUSSIAN | LAMBERT | DARK_WALL | {"station.incidence_deg": [35.0, 50.0]}
    ),
    "dark-half-0.1": Case(PLAIN | HALF | {"beam.brightness_bias_m": 0.0001}),
    "dark-half-0.3": Case(PLAIN | HALF | {"beam.brightness_bias_m": 0.0003}),
    "dark-half-1.0": Case(PLAIN | HALF | {"beam.brightness_bias_m": 0.001}),
    "first": Case(PLAIN | RETURNS | {"beam.return_mode": "first"}),
    "strongest": Case(PLAIN | RETURNS | {"beam.return_mode": "strongest"}),
    "two-returns": Case(PLAIN | RETURNS | {"beam.return_mode": "two"}),
    "strongest-3000": Case(
        PLAIN | RETURNS | NARROW | {"beam.return_mode": "strongest", "grid.spacing_m": 0.0039}
    ),
    "points-300": Case(PLAIN | NARROW | {"grid.spacing_m": 0.0125}),
    "points-3000": Case(PLAIN | NARROW | {"grid.spacing_m": 0.0039}),
    "points-90000": Case(PLAIN | {"grid.spacing_m": 0.0007, "grid.half_width_m": 0.155}),
    "points-1000000": Case(
        PLAIN
        | {
            "grid.spacing_m": 0.00021,
            "grid.half_width_m": 0.15,
            "station.incidence_deg": 10.0,
        }
    ),
    "near-0.75": Case(PLAIN | {"station.distance_m": [0.6, 0.9]}),
    "near-1.4": Case(PLAIN | {"station.distance_m": [1.0, 1.8]}),
    "far-5": Case(PLAIN | {"station.distance_m": [4.0, 6.0]}),
    "far-9": Case(PLAIN | {"station.distance_m": [8.0, 10.0]}),
    "rounded-1mm": Case(PLAIN, step_m=0.001),
    "spaced-2mm": Case(PLAIN, spaced_m=0.002),
    "edges-filtered": Case(PLAIN | GAUSSIAN | LAMBERT | {"beam.edge_filter_m": 0.01}),
    "form": Case(PLAIN | SPARSE | QUIET, flatness_m=0.0003),
    "chamfer-0.3": Case(PLAIN | QUIET, chamfer_m=0.0003),
    "chamfer-0.8": Case(PLAIN | QUIET, chamfer_m=0.0008),
    "chamfer-gaussian-lambert": Case(PLAIN | QUIET | GAUSSIAN | LAMBERT, chamfer_m=0.0005),
    "incidence": Case(PLAIN | INCIDENCE),
    "axes": Case(PLAIN | AXES | BARE),
    "stations": Case(PLAIN | STATIONS | BARE),
    "merged": Case(PLAIN | STATIONS, merged=True),
    "angles": Case(PLAIN | AXES | STATIONS),
    "all": Case(
        PLAIN
        | GAUSSIAN
        | LAMBERT
        | LINES
        | AXES
        | STATIONS
        | {
            "beam.incidence_bias_m": [-0.00052, 0.00052],
            "beam.brightness_bias_m": 0.0001,
            "beam.correlated_sigma_m": 0.0002,
            "beam.correlation_length_m": 0.01,
            "instrument.incidence_bias_m": 0.0003,
        }
    ),
    "phase-shift": Case(base="phase-shift"),
    "pulse": Case(base="pulse"),
    "structured-light": Case(base="structured-light"),
    "line-profile": Case(base="line-profile"),
    "phases-0.6": Case(PLAIN | QUIET | {"beam.ambiguity_m": 0.6, "instrument.ambiguity_m": 0.6}),
    "shot-noise": Case(PLAIN | QUIET | LAMBERT | SHOT),
    "receiver-noise": Case(PLAIN | QUIET | LAMBERT | RECEIVER),
    "dark-half-shot-noise": Case(PLAIN | QUIET | HALF | SHOT),
    "dark-half-receiver-noise": Case(PLAIN | QUIET | HALF | RECEIVER),
    "lambert-dim": Case(PLAIN | QUIET | LAMBERT, dim=True),
    "gaussian-lambert-dim": Case(PLAIN | QUIET | GAUSSIAN | LAMBERT, dim=True),
    "first-dim": Case(PLAIN | RETURNS | {"beam.return_mode": "first"}, dim=True),
    "strongest-dim": Case(PLAIN | RETURNS | {"beam.return_mode": "strongest"}, dim=True),
    "dark-half-beam": Case(PLAIN | QUIET | GAUSSIAN | LAMBERT | HALF),
}


def scanner_file(folder: Path, values: Values, base: str = "default") -> Path:
    """Write the shipped scanner's file with these values, `table.key`, in its places."""
    tree = tomllib.loads(config_file("scanners", base).read_text())
    for key, value in values.items():
        table, _, name = key.partition(".")
        tree.setdefault(table, {})[name] = value
    file = folder / "scanner.toml"
    file.write_text(as_toml(tree))
    return file


def stated_target(folder: Path, target: str, case: Case) -> Path:
    """Write a shipped target's file with the flatness and the chamfer of a case."""
    own = {"flatness": case.flatness_m or None, "chamfer": case.chamfer_m}
    return _target_file(folder / "stated.toml", tomllib.loads(_shipped(target)) | own)


def made_targets(folder: Path, target: str, case: Case, seed: int) -> dict[str, Path]:
    """Write the files of the four plates of one drawing as they were made: their sizes to SIZE_M.

    Their edges have the chamfer of the case, or are drawn: half of the sets have chamfers, half are
    rounded.
    """
    rng = np.random.default_rng(seed)
    drawing, files = tomllib.loads(_shipped(target)), {}
    sizes, thicknesses = (parted(rng, of, len(WHEELS)) for of in (OF_SIZE, OF_THICKNESS))
    edge_m, is_round = draw_edge(rng)
    edges = edge_m * np.clip(1.0 + OF_EDGE * rng.standard_normal(len(WHEELS)), 0.0, None)
    for wheel, by_size, by_thickness, own_m in zip(WHEELS, sizes, thicknesses, edges, strict=True):
        plate = dict(drawing)
        for key in ("diameter", "side", "width", "height"):
            if key in plate and plate["shape"] != "pattern":
                plate[key] += 2.0 * SIZE_M * float(by_size)
        plate["thickness"] *= 1.0 + THICKNESS * float(by_thickness)
        if case.chamfer_m is not None:
            plate["chamfer"] = case.chamfer_m
        else:
            plate["edge_radius" if is_round else "chamfer"] = float(own_m)
        plate["flatness"] = case.flatness_m or None
        files[wheel] = _target_file(folder / f"target-{wheel}.toml", plate)
    return files


def _shipped(target: str) -> str:
    return config_file("targets", target).read_text()


def _target_file(file: Path, plate: Values) -> Path:
    file.write_text(as_toml({k: v for k, v in plate.items() if v is not None and v != 0.0}))
    return file


def vehicle_rows(seed: int, case: Case, target: str) -> dict[bool, list[list[float]]]:
    """Return the rows (wheels, 10) of `_rows`, by whether the errors are stated."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, file = (
            Path(scratch) / "capture",
            scanner_file(Path(scratch), case.values | _window(case, target), case.base),
        )
        plates = made_targets(Path(scratch), target, case, seed)
        _capture(folder, seed, file, plates)
        if case.merged:
            place: Values = {"station.incidence_deg": [25.0, 40.0], "grid.spacing_m": 0.0023}
            place |= _window(case, target)
            other = scanner_file(Path(scratch), case.values | place, case.base)
            _capture(Path(scratch) / "other", seed, other, plates)
            for scan in folder.glob("*.ply"):
                _append(scan, Path(scratch) / "other" / scan.name)
        if case.step_m > 0.0:
            for scan in folder.glob("*.ply"):
                _round(scan, case.step_m)
        if case.spaced_m > 0.0:
            for scan in folder.glob("*.ply"):
                _thin(scan, case.spaced_m)
        if case.dim:
            for scan in folder.glob("*.ply"):
                _without_intensities(scan)
        truth = {w["name"]: w for w in json.loads((folder / "truth.json").read_text())["wheels"]}
        found = {}
        for stated in (False, True) if case.is_stated else (False,):
            config = with_scanner(Config(), str(file) if stated else None)
            stated_file = str(stated_target(Path(scratch), target, case)) if stated else target
            with open_capture(folder, stated_file) as capture:
                found[stated] = _rows(measure_capture(capture, config), truth)
    return found


def _window(case: Case, target: str) -> Values:
    """Return the half width of a scan's window, where the case's own would cut the target."""
    key = "grid.half_width_m"
    least_m = load_target(target).radius_m + BEYOND_M
    return {key: max(case.values[key], least_m)} if key in case.values else {}


def _capture(folder: Path, seed: int, scanner: Path, plates: dict[str, Path]) -> None:
    write_capture(
        folder,
        seed=seed,
        vehicle=config_file("vehicles", "saloon"),
        scanner=scanner,
        target=plates[WHEELS[0]],
        made=plates,
        trials=0,
    )


def _points(scan: Path) -> Array:
    """Return the points of a binary PLY file as written by synth: x, y, z and an intensity."""
    _, _, body = scan.read_bytes().partition(END)
    return np.frombuffer(body, [("xyz", "<f8", 3), ("intensity", "<f4")]).copy()


def _write(scan: Path, points: Array) -> None:
    """Replace the points of such a file."""
    head, _, _ = scan.read_bytes().partition(END)
    count = b"element vertex %d" % len(points)
    scan.write_bytes(re.sub(rb"element vertex \d+", count, head) + END + points.tobytes())


def _round(scan: Path, step_m: float) -> None:
    """Round the coordinates of a scan."""
    points = _points(scan)
    points["xyz"] = np.rint(points["xyz"] / step_m) * step_m
    _write(scan, points)


def _thin(scan: Path, distance_m: float) -> None:
    """Thin a scan so that its points lie that far apart, in their order."""
    points = _points(scan)
    _write(scan, points[least_distance(points["xyz"], distance_m)])


def _without_intensities(scan: Path) -> None:
    """Drop the intensities of a scan."""
    head, _, _ = scan.read_bytes().partition(END)
    rows = _points(scan)["xyz"].tobytes()
    scan.write_bytes(head.replace(b"property float intensity\n", b"") + END + rows)


def _append(scan: Path, other: Path) -> None:
    """Append the points of another scan to a scan's."""
    _write(scan, np.concatenate([_points(scan), _points(other)]))


def _rows(measurement: Measurement, truth: dict[str, Any]) -> list[list[float]]:
    """Return errors and u of toe and of camber (arcsec) and of the centre (mm), points, degrees of
    freedom of toe and camber, and the square of the centre's error by its covariance, by wheel.
    """
    rows = []
    for wheel in measurement.wheels:
        true, fitted = truth[wheel.observation.name], wheel.observation.fitted
        assert wheel.angles is not None
        off_m = fitted.centre_m - true["centre_m"]
        rows.append(
            [
                (wheel.angles.toe_rad - np.radians(true["toe_deg"])) * ARCSEC,
                wheel.u_toe_rad * ARCSEC,
                (wheel.angles.camber_rad - np.radians(true["camber_deg"])) * ARCSEC,
                wheel.u_camber_rad * ARCSEC,
                float(np.linalg.norm(off_m)) * 1e3,
                float(np.sqrt(np.trace(fitted.centre_covariance_m2))) * 1e3,
                fitted.points_on_target,
                wheel.dof_toe,
                wheel.dof_camber,
                float(off_m @ np.linalg.solve(fitted.centre_covariance_m2, off_m)) / 3.0,
            ]
        )
    return rows


def case_lines(name: str, case: Case, wheels: int, target: str, first_seed: int = 0) -> list[str]:
    """Measure that many wheels of one kind of physics, and return its lines of the table."""
    found: dict[bool, list[list[float]]] = {}
    refused: list[str] = []
    vehicles = -(-wheels // 4) * (SHARED if case.is_stated else 1)
    first_seed += SEEDS * list(CASES).index(name)
    for seed in range(first_seed, first_seed + vehicles):
        try:
            for stated, rows in vehicle_rows(seed, case, target).items():
                found.setdefault(stated, []).extend(rows)
        except InputError as error:
            refused.append(str(error)[-100:])
    lines = [
        _line("+ stated" if stated else name, np.array(rows)) for stated, rows in found.items()
    ]
    if refused:
        lines.append(f"  {len(refused)} of {vehicles} captures refused: {refused[0]}")
    return lines


def _line(name: str, table: Array) -> str:
    rms = np.sqrt(np.mean(table[:, :7] ** 2, axis=0))
    cells = []
    for column, dof in ((0, 7), (2, 8)):
        errors, u = np.abs(table[:, column]), table[:, column + 1]
        ratio = rms[column] / rms[column + 1]
        inside = np.mean(errors <= u * coverage_factor(LEVEL, table[:, dof]))
        good = RATIO[0] <= ratio <= RATIO[1] and INSIDE[0] <= inside <= INSIDE[1]
        size = f'{rms[column]:6.1f}" /{rms[column + 1]:6.1f}"'
        cells.append(f"{size} {ratio:5.2f} {100 * inside:6.1f} %{' ' if good else '*'}")
    centre = f"{rms[4]:6.3f} /{rms[5]:6.3f} mm {table[:, 9].mean():5.2f}"
    return f"{name:17s} {len(table):4d} {'  '.join(cells)}  {centre} {table[:, 6].mean():7.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="of the first vehicle")
    parser.add_argument("--target", default="disc-250")
    parser.add_argument("--only", nargs="+", choices=CASES)
    options = parser.parse_args()
    print(f"{options.target}: rms error / rms u, their ratio, inside U; * beyond the limits")
    print(f"{'':15s} wheels {'toe':>25s}   {'camber':>29s}   {'centre':>20s}       points")
    for name, case in CASES.items():
        if options.only is None or name in options.only:
            for line in case_lines(name, case, options.wheels, options.target, options.seed):
                print(line, flush=True)


if __name__ == "__main__":
    main()
