"""Error and stated uncertainty of toe, camber and centres, for one kind of physics at a time.

.venv/bin/python -m tests.bench.physics [--wheels 60] [--seed 0] [--target disc-250]

inside: shares of errors within 1.96 u, and within U by the degrees of freedom of u.
--stated: measure with the [instrument] of the scanner's file, as `measure --scanner` does.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file, with_scanner
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture
from wheelplane.uncertainty import coverage_factor
from wheelplane_synth.output.archive import write_capture

ARCSEC = np.degrees(1.0) * 3600.0
INSIDE, LEVEL = 1.96, 0.95
Values = dict[str, Any]

PLAIN: Values = {
    "station.distance_m": [2.0, 3.0],
    "station.incidence_deg": [3.0, 25.0],
    "grid.spacing_m": 0.0013,
    "grid.half_width_m": 0.2,
    "beam.range_sigma_m": 0.0008,
}
QUIET: Values = {"beam.range_sigma_m": 0.0002}
GAUSSIAN: Values = {"beam.spot_profile": "gaussian"}
LAMBERT: Values = {"beam.power_weighted": True}
HALF: Values = {"surfaces.dark_part": "half", "surfaces.dark_turn_deg": [0.0, 360.0]}
RETURNS: Values = {**GAUSSIAN, **LAMBERT, "beam.range_gate_m": 0.02}
LINES: Values = {"beam.line_sigma_m": 0.00015}
ARC15 = [-26.0, 26.0]  # uniform, of standard deviation 15
ANGLES: Values = {
    "calibration.collimation_arcsec": ARC15,
    "calibration.trunnion_arcsec": ARC15,
    "calibration.vertical_index_arcsec": ARC15,
    "calibration.azimuth_eccentricity_arcsec": ARC15,
    "calibration.azimuth_eccentricity_at_deg": [0.0, 360.0],
    "calibration.elevation_eccentricity_arcsec": ARC15,
    "registration.turn_sigma_arcsec": 15.0,
    "registration.shift_sigma_m": 0.0005,
}
SAME = ("collimation", "trunnion", "vertical_index", "azimuth_eccentricity")
STATED_ANGLES: Values = {
    **{f"instrument.{name}_arcsec": 15.0 for name in SAME},
    "instrument.same_face": True,
    "instrument.elevation_eccentricity_arcsec": 15.0,
    "instrument.pointing_urad": 72.7,
    "instrument.registration_m": 0.0005,
}
INCIDENCE: Values = {"station.incidence_deg": [20.0, 45.0], "beam.incidence_bias_m": 0.001}
AXES: Values = {key: value for key, value in ANGLES.items() if "registration" not in key}
CASES: dict[str, Values] = {
    "independent": {},
    "quiet": QUIET,
    "correlated": {"beam.correlated_sigma_m": 0.0002, "beam.correlation_length_m": 0.01},
    "anisotropic": {
        "beam.correlated_sigma_m": 0.0002,
        "beam.correlation_length_m": 0.04,
        "beam.correlation_aspect": 0.1,
    },
    "lambert": {**QUIET, **LAMBERT},
    "gaussian": {**QUIET, **GAUSSIAN},
    "gaussian-lambert": {**QUIET, **GAUSSIAN, **LAMBERT},
    "dark-half-0.1": {**HALF, "beam.brightness_bias_m": 0.0001},
    "dark-half-0.3": {**HALF, "beam.brightness_bias_m": 0.0003},
    "dark-half-1.0": {**HALF, "beam.brightness_bias_m": 0.001},
    "incidence": INCIDENCE,
    "incidence-stated": {**INCIDENCE, "instrument.incidence_bias_m": 0.001},
    "lines": LINES,
    "lines-level": {**LINES, "beam.scan_lines": "rows"},
    "axes": AXES,
    "axes-stated": {
        **AXES,
        **STATED_ANGLES,
        "instrument.pointing_urad": 0.0,
        "instrument.registration_m": 0.0,
    },
    "angles": ANGLES,
    "angles-stated": {**ANGLES, **STATED_ANGLES},
    "first": {**RETURNS, "beam.return_mode": "first"},
    "strongest": {**RETURNS, "beam.return_mode": "strongest"},
    "points-300": {"grid.spacing_m": 0.0128},
    "all": {
        **GAUSSIAN,
        **LAMBERT,
        **LINES,
        **ANGLES,
        "beam.incidence_bias_m": 0.0003,
        "beam.brightness_bias_m": 0.0001,
        "beam.correlated_sigma_m": 0.0002,
        "beam.correlation_length_m": 0.01,
    },
}
CASES["all-stated"] = {**CASES["all"], **STATED_ANGLES, "instrument.incidence_bias_m": 0.0003}


def scanner_file(folder: Path, values: Values, base: str = "default") -> Path:
    """Write the shipped scanner's file with these values, `table.key`, in its places."""
    tree = tomllib.loads(config_file("scanners", base).read_text())
    for key, value in values.items():
        table, _, name = key.partition(".")
        tree.setdefault(table, {})[name] = value
    lines = []
    for table, content in tree.items():
        lines += [f"[{table}]", *(f"{key} = {json.dumps(v)}" for key, v in content.items())]
    file = folder / "scanner.toml"
    file.write_text("\n".join(lines) + "\n")
    return file


def vehicle_rows(
    seed: int, values: Values, target: str, scanner: str, stated: bool
) -> list[list[float]]:
    """Return a row per wheel: errors and u of toe and camber (arcsec), of the centre (mm)."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "capture"
        write_capture(
            folder,
            seed=seed,
            vehicle=config_file("vehicles", "saloon"),
            scanner=(file := scanner_file(Path(scratch), values, scanner)),
            target=config_file("targets", target),
            trials=0,
        )
        truth = {w["name"]: w for w in json.loads((folder / "truth.json").read_text())["wheels"]}
        with open_capture(folder) as capture:
            config = with_scanner(Config(), str(file) if stated else None)
            measurement = measure_capture(capture, config)
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
            ]
        )
    return rows


def case_line(
    name: str,
    values: Values,
    wheels: int,
    target: str,
    scanner: str,
    stated: bool = False,
    first_seed: int = 0,
) -> str:
    """Measure that many wheels of one kind of physics, and return its line of the table."""
    rows: list[list[float]] = []
    refused: list[str] = []
    vehicles = -(-wheels // 4)
    stated = stated or any(key.startswith("instrument.") for key in values)
    for seed in range(first_seed, first_seed + vehicles):
        try:
            rows += vehicle_rows(seed, values, target, scanner, stated)
        except InputError as error:
            refused.append(str(error)[:100])
    if not rows:
        return f"{name:17s} none of {vehicles} captures measured: {refused[0]}"
    table = np.array(rows)
    rms, mean = np.sqrt(np.mean(table[:, :7] ** 2, axis=0)), table.mean(axis=0)
    cells = []
    for column, dof in ((0, 7), (2, 8)):
        ratio = np.abs(table[:, column]) / table[:, column + 1]
        inside = 100 * np.mean(ratio <= INSIDE)
        expanded = 100 * np.mean(ratio <= coverage_factor(LEVEL, table[:, dof]))
        size = f'{rms[column]:7.1f}" /{rms[column + 1]:6.1f}"'
        cells.append(f"{size} {inside:4.0f} {expanded:4.0f} %")
    text = f"{name:17s} {cells[0]}   {cells[1]}   {rms[4]:6.3f} /{rms[5]:6.3f} mm {mean[6]:8.0f}"
    return text + (f"   {len(refused)} of {vehicles} refused: {refused[0]}" if refused else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="of the first vehicle")
    parser.add_argument("--target", default="disc-250")
    parser.add_argument("--only", nargs="+", choices=[*CASES, *KINDS])
    parser.add_argument("--stated", action="store_true")
    options = parser.parse_args()
    print(
        f"{options.wheels} wheels a case, {options.target}: rms error / rms u, inside 1.96 u and U"
    )
    print(f"{'':17s} {'toe':>29s}   {'camber':>29s}   {'centre':>17s}   points")
    for name, values in CASES.items():
        if options.only is None or name in options.only:
            run = (options.wheels, options.target, "default", options.stated, options.seed)
            print(case_line(name, PLAIN | values, *run), flush=True)
    for name in KINDS:
        if options.only is None or name in options.only:
            run = (options.wheels, options.target, name, options.stated, options.seed)
            print(case_line(name, {}, *run), flush=True)


KINDS = ("phase-shift", "pulse", "structured-light", "line-profile")

if __name__ == "__main__":
    main()
