"""Error of toe, camber and centres of synthetic vehicles, against their truth.

.venv/bin/python -m tests.bench.accuracy [--vehicles 50] [--scanner default]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file
from wheelplane.measure import measure_capture
from wheelplane_synth.output.archive import write_capture

ARCSEC = np.degrees(1.0) * 3600.0


def one_vehicle(seed: int, scanner: str) -> np.ndarray:
    """Rows, one a wheel: errors of toe, camber (rad), of the centre (m); the same over u."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "capture"
        write_capture(
            folder,
            seed=seed,
            vehicle=config_file("vehicles", "saloon"),
            scanner=config_file("scanners", scanner),
            target=config_file("targets", "disc-250"),
            trials=0,
        )
        truth = {w["name"]: w for w in json.loads((folder / "truth.json").read_text())["wheels"]}
        with open_capture(folder) as capture:
            measurement = measure_capture(capture, Config())
    rows = []
    for wheel in measurement.wheels:
        true = truth[wheel.observation.name]
        toe = wheel.angles.toe_rad - np.radians(true["toe_deg"])
        camber = wheel.angles.camber_rad - np.radians(true["camber_deg"])
        fitted = wheel.observation.fitted
        centre = fitted.centre_m - true["centre_m"]
        nees = centre @ np.linalg.solve(fitted.centre_covariance_m2, centre)
        rows.append(
            [
                toe,
                camber,
                np.linalg.norm(centre),
                toe / wheel.u_toe_rad,
                camber / wheel.u_camber_rad,
                nees,
            ]
        )
    return np.array(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--scanner", default="default")
    options = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        rows = list(
            pool.map(partial(one_vehicle, scanner=options.scanner), range(options.vehicles))
        )
    table = np.concatenate(rows)
    print(f"{options.vehicles} vehicles, {len(table)} wheels, scanner {options.scanner}")
    print("            rms     worst   inside 95 % (k = 1.96)   mean (error/u)^2")
    for column, name in enumerate(("toe", "camber")):
        error, scaled = table[:, column] * ARCSEC, table[:, 3 + column]
        inside = np.mean(np.abs(scaled) < 1.96) * 100.0
        rms = np.sqrt(np.mean(error**2))
        worst, scatter = np.abs(error).max(), np.mean(scaled**2)
        print(f'{name:8s} {rms:6.1f}" {worst:8.1f}" {inside:12.1f} % {scatter:20.2f}')
    centre = table[:, 2] * 1e3
    print(
        f"centre   {np.sqrt(np.mean(centre**2)):6.3f} mm {centre.max():6.3f} mm"
        f"   mean NEES {table[:, 5].mean():.2f} (3 expected)"
    )


if __name__ == "__main__":
    main()
