"""Effect of scan settings on uncertainty and error: the tables of the manual's chapter on scanning.

.venv/bin/python -m tests.bench.scanning [--vehicles 6] [--only NAME]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture
from wheelplane.measurement.records import WheelResult
from wheelplane.readers import read_scan
from wheelplane.units import LengthUnit
from wheelplane_synth.output.archive import write_capture

ARCSEC = np.degrees(1.0) * 3600.0
UNIT: LengthUnit = "m"
PLAIN = {
    "distance_m": "2.5",
    "incidence_deg": "15.0",
    "spacing_m": "0.0009",
    "half_width_m": "0.24",
    "range_sigma_m": "0.0008",
    "spot_radius_m": "0.0015",
    "diameter": "0.25",
}
# One setting at a time; the others stay as in PLAIN.
VARIED = {
    "spacing_m": ("0.0005", "0.0009", "0.002", "0.004", "0.008", "0.0128"),
    "range_sigma_m": ("0.0002", "0.0004", "0.0008", "0.0016"),
    "diameter": ("0.15", "0.2", "0.25", "0.35"),
    "incidence_deg": ("0.0", "30.0", "45.0", "60.0", "70.0"),
    "spot_radius_m": ("0.0005", "0.0015", "0.003"),
}
NO_BACKGROUND = "no background"


def parameters(folder: Path, values: dict[str, str]) -> tuple[Path, Path]:
    """Files of the scanner and the target with `values` in the places of the shipped ones."""
    scanner = []
    table = ""
    for line in config_file("scanners", "default").read_text().splitlines():
        table = line.strip() if line.startswith("[") else table
        key = line.partition("=")[0].strip()
        ours = table in ("[station]", "[grid]", "[beam]") and key in values
        scanner.append(f"{key} = {values[key]}" if ours else line)
    files = folder / "scanner.toml", folder / "target.toml"
    files[0].write_text("\n".join(scanner))
    files[1].write_text(f'shape = "disc"\ndiameter = {values["diameter"]}\nthickness = 0.01\n')
    return files


def without_background(folder: Path) -> None:
    """Leave of each scan only what lies on its target: plate in front of nothing."""
    truth = {
        wheel["name"]: wheel for wheel in json.loads((folder / "truth.json").read_text())["wheels"]
    }
    for name in ("RR", "RL", "FR", "FL"):
        path = folder / f"{name.lower()}.ply"
        points_m = read_scan(path, UNIT).points_m
        off = points_m - np.array(truth[name]["centre_m"])
        height = off @ np.array(truth[name]["normal"])
        near = np.linalg.norm(off, axis=1) < 0.5
        np.save(path.with_suffix(".npy"), points_m[near & (np.abs(height) < 0.004)])
        path.unlink()
    file = folder / "capture.toml"
    file.write_text(file.read_text().replace(".ply", ".npy"))


def wheels(values: dict[str, str], seed: int, bare: bool) -> Iterator[tuple[WheelResult, dict]]:
    """Each measured wheel of a made vehicle, and its truth."""
    with tempfile.TemporaryDirectory() as scratch:
        scanner, target = parameters(Path(scratch), values)
        folder = Path(scratch) / "capture"
        vehicle = config_file("vehicles", "saloon")
        write_capture(folder, seed=seed, vehicle=vehicle, scanner=scanner, target=target, trials=0)
        truth = {w["name"]: w for w in json.loads((folder / "truth.json").read_text())["wheels"]}
        if bare:
            without_background(folder)
        try:
            with open_capture(folder) as capture:
                measurement = measure_capture(capture, Config())
        except InputError as error:
            print(f"  seed {seed}: {str(error)[:140]}")
            return
    for wheel in measurement.wheels:
        yield wheel, truth[wheel.observation.name]


def row(label: str, values: dict[str, str], vehicles: int, bare: bool = False) -> str:
    """Mean u and rms error of toe and camber, of the centre, and how many were measured."""
    found = []
    for seed in range(vehicles):
        for wheel, true in wheels(values, seed, bare):
            assert wheel.angles is not None
            fitted = wheel.observation.fitted
            found.append(
                [
                    wheel.u_toe_rad * ARCSEC,
                    (wheel.angles.toe_rad - np.radians(true["toe_deg"])) * ARCSEC,
                    wheel.u_camber_rad * ARCSEC,
                    (wheel.angles.camber_rad - np.radians(true["camber_deg"])) * ARCSEC,
                    np.linalg.norm(fitted.centre_m - true["centre_m"]) * 1e3,
                    fitted.points_on_target,
                ]
            )
    if not found:
        return f"{label:26s} none measured"
    table = np.array(found)
    rms = np.sqrt(np.mean(table**2, axis=0))
    mean = table.mean(axis=0)
    return (
        f'{label:26s} toe u {mean[0]:6.1f}" error {rms[1]:6.1f}"   camber u {mean[2]:6.1f}" '
        f'error {rms[3]:6.1f}"   centre {rms[4]:.3f} mm   points {mean[5]:7.0f}   '
        f"wheels {len(table)} of {4 * vehicles}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=6)
    parser.add_argument("--only")
    options = parser.parse_args()
    for key, settings in VARIED.items():
        if options.only in (None, key):
            for value in settings:
                changed = PLAIN | {key: value}
                print(row(f"{key} {value}", changed, options.vehicles), flush=True)
    if options.only in (None, NO_BACKGROUND):
        print(row(NO_BACKGROUND, PLAIN, options.vehicles, bare=True), flush=True)


if __name__ == "__main__":
    main()
