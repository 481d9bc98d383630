"""Error of the centre in its plane against its u, by kind of edge and number of points.

.venv/bin/python -m tests.bench.edges [--wheels 60] [--seed 0] [--target disc-250] [--only NAME ...]
Inside: shares of errors within 1.96 u, and within U by the degrees of freedom of u.
Single targets, through plane and centre as `measure` fits them; of the bounds: tests/bench/bounds.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.bench.physics import (
    GAUSSIAN,
    LAMBERT,
    LEVEL,
    PLAIN,
    QUIET,
    RETURNS,
    Case,
    Values,
    made_targets,
    scanner_file,
)
from wheelplane.centre import TargetView, locate_centre
from wheelplane.centre.locate_centre import TargetFit
from wheelplane.config import Config, config_file
from wheelplane.detection.find_target import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.plane import fit_plane
from wheelplane.readers import read_scan
from wheelplane.targets.registry import load_target
from wheelplane.uncertainty import coverage_factor
from wheelplane_synth.output.archive import write_capture

INSIDE = 1.96
SPACING_M = {300: 0.0128, 3000: 0.00405, 30_000: 0.00128}  # on a 250 mm disc
STRONGEST: Values = {**RETURNS, "beam.return_mode": "strongest"}
STILL: Values = {"registration.shift_sigma_m": 0.0, "registration.turn_sigma_arcsec": 0.0}
KINDS: dict[str, tuple[str, Values]] = {
    "uniform": ("default", PLAIN),
    "quiet": ("default", {**PLAIN, **QUIET}),
    "lambert": ("default", {**PLAIN, **QUIET, **LAMBERT}),
    "gaussian": ("default", {**PLAIN, **QUIET, **GAUSSIAN}),
    "gaussian-lambert": ("default", {**PLAIN, **QUIET, **GAUSSIAN, **LAMBERT}),
    "first": ("default", {**PLAIN, **RETURNS, "beam.return_mode": "first"}),
    "strongest": ("default", {**PLAIN, **STRONGEST}),
}
CASES: dict[str, tuple[str, Values]] = {
    f"{name}-{count}": (base, {**values, "grid.spacing_m": spacing})
    for name, (base, values) in KINDS.items()
    for count, spacing in SPACING_M.items()
}
CASES |= {name: (name, STILL) for name in ("pulse", "structured-light", "line-profile")}


@dataclass(frozen=True)
class Row:
    """One target: error, u and U (m) towards the station and across, the method, seconds."""

    error_m: np.ndarray
    u_m: np.ndarray
    expanded_m: np.ndarray
    method: str
    seconds: float


def rows(seed: int, base: str, values: Values, target_name: str) -> Iterator[Row | str]:
    """Yield a row for each wheel of one vehicle, or the status of what is not measured."""
    target, config = load_target(target_name), Config()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "capture"
        write_capture(
            folder,
            seed=seed,
            vehicle=config_file("vehicles", "saloon"),
            scanner=scanner_file(Path(scratch), values, base),
            target=made_targets(Path(scratch), target_name, Case(), seed)["RR"],
            trials=0,
        )
        truth = json.loads((folder / "truth.json").read_text())
        for wheel, used in zip(truth["wheels"], truth["used"]["scans"], strict=True):
            scan = read_scan(folder / used["file"], "m", used["file"])
            try:
                patch = find_target(scan.points_m, target, config.segment, 0, scan.intensity)
                plane = fit_plane(patch, target, config.plane)
                start = time.process_time()
                found = locate_centre(TargetView(patch, plane, target, config.centre))
            except NotMeasuredError as error:
                yield error.status
                continue
            seconds = time.process_time() - start
            normal, centre = np.array(wheel["normal"]), np.array(wheel["centre_m"])
            sight = np.array(used["station_m"]) - centre
            along = sight - (sight @ normal) * normal
            along /= np.linalg.norm(along)
            axes = np.stack([along, np.cross(normal, along)])
            error_m, stated = axes @ (found.centre_m - centre), uncertainties(found, axes)
            yield Row(error_m, *stated, found.method, seconds)


def uncertainties(found: TargetFit, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return u and U (2,) of the centre along axes (2, 3), by Welch and Satterthwaite."""
    parts = [np.diag(axes @ c.covariance[3:, 3:] @ axes.T) for c in found.components]
    variance = np.sum(parts, axis=0)
    welch = np.sum([p**2 / c.dof for p, c in zip(parts, found.components, strict=True)], axis=0)
    dof = variance**2 / np.maximum(welch, 1e-12 * variance**2)
    return np.sqrt(variance), coverage_factor(LEVEL, dof) * np.sqrt(variance)


def line(name: str, seeds: range, target: str) -> str:
    """Return one line of the table."""
    found = [row for seed in seeds for row in rows(seed, *CASES[name], target)]
    seen = [row for row in found if isinstance(row, Row)]
    counts = Counter(row if isinstance(row, str) else row.method for row in found)
    if not seen:
        return f"{name:24s} {dict(counts)}"
    error, u = (np.stack([getattr(row, key) for row in seen]) for key in ("error_m", "u_m"))
    rms, stated = (float(np.sqrt(np.mean(values**2))) * 1e6 for values in (error, u))
    inside = 100.0 * float(np.mean(np.abs(error) <= INSIDE * u))
    expanded = np.stack([row.expanded_m for row in seen])
    covered = 100.0 * float(np.mean(np.abs(error) <= expanded))
    bias = error.mean(axis=0) * 1e6
    each = 1e3 * float(np.mean([row.seconds for row in seen]))
    return (
        f"{name:24s} {rms:8.1f} {stated:8.1f} {rms / stated:6.2f} {inside:6.0f} {covered:4.0f} % "
        f"{bias[0]:7.1f} {bias[1]:7.1f} {each:6.0f}  {dict(counts)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wheels", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="of the first four wheels")
    parser.add_argument("--target", default="disc-250")
    parser.add_argument("--only", nargs="+", choices=list(CASES))
    options = parser.parse_args()
    seeds = range(options.seed, options.seed - (-options.wheels // 4))
    print("um an axis                    rms        u  rms/u  1.96 u   U     along  across     ms")
    for name in options.only or CASES:
        print(line(name, seeds, options.target), flush=True)


if __name__ == "__main__":
    main()
