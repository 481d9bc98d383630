"""Errors and coverage of steering sweeps and run-outs.

.venv/bin/python -m tests.bench.turning sweep [--cars 2000] [--positions 9] [--target square-300]
.venv/bin/python -m tests.bench.turning runout [--cars 2000] [--positions 2]
.venv/bin/python -m tests.bench.turning scans [--kind sweep|runout|both] [--cars 10] [--positions 3]

`sweep` and `runout` draw normals, centres and in-plane rotations from the covariances of a scan
of the default scanner, which shows no rotation of disc-250;
`scans` makes whole captures with that scanner and measures them: a sweep with targets square on
their axles, run-outs, or both, the sweep then with misaligned targets.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy import stats

from tests.support.turning import Scene, rolled, swept
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file
from wheelplane.kinematics.sweep import DOUBT
from wheelplane.measure import measure_capture
from wheelplane.measurement.records import Measurement
from wheelplane_synth.output.archive import write_capture

Row = tuple[str, float, float, float, float]  # what, error, u, freedom, chance of the fit
# Of the turn about the normal, of a scan of the default scanner (k = 1).
U_TURN = {"disc-250": None, "square-300": 7e-5, "pattern-aruco": 4e-5}
THREE_MINUTES = np.radians(3.0 / 60.0)
SCALE = {'"': np.degrees(1.0) * 3600.0, "'": np.degrees(1.0) * 60.0}


def drawn_sweep(
    seed: int, positions: int, rounds: int, lock: float, target: str = "disc-250"
) -> list[Row]:
    """One car: both front wheels swept."""
    rng = np.random.default_rng([seed, 3])
    scene = Scene(seed, u_turn=U_TURN[target]).references()
    steers = np.radians(np.tile(np.linspace(-lock, lock, positions), rounds))
    truth = {}
    for wheel in ("FR", "FL"):
        truth[wheel] = np.radians(rng.uniform((-2.0, 5.0), (8.0, 15.0)))
        swept(scene, wheel, *truth[wheel], steers * 1.04, camber=np.radians(rng.uniform(-2, 1)),
              toe=np.radians(rng.uniform(-0.5, 0.5)))  # fmt: skip
    return _of_kingpins(scene.measure(), truth)


def _of_kingpins(measurement: Measurement, truth: dict[str, np.ndarray]) -> list[Row]:
    rows: list[Row] = []
    for found in measurement.steering_axes:
        for what, angle, true in zip(
            ("caster", "inclination"), (found.caster, found.inclination), truth[found.wheel],
            strict=True,
        ):  # fmt: skip
            error = np.nan if angle is None else angle.value - true
            u, dof = (np.nan, np.inf) if angle is None else (angle.u, angle.dof)
            rows.append((what, error, u, dof, found.probability))
    return rows


def drawn_runout(seed: int, positions: int, turn_deg: float) -> list[Row]:
    """One car: all wheels turned, the first scan being the reference."""
    rng = np.random.default_rng([seed, 4])
    scene = Scene(seed)
    truth, kept = {}, []
    for wheel in ("RR", "RL", "FR", "FL"):
        shown = 2 * np.pi / positions * np.arange(positions)
        turns = shown + np.radians(turn_deg) * rng.normal(size=positions) * (
            np.arange(positions) > 0
        )
        way, other = rng.uniform(0, 2 * np.pi, 2)
        toe, camber = np.radians(rng.uniform(-1, 1)), np.radians(rng.uniform(-2, 1))
        truth[wheel] = {"toe": toe, "camber": camber}
        kept.append(partial(
            rolled, wheel=wheel, turns=turns, toe=toe, camber=camber, stated=shown,
            wobble=np.radians(0.5) * np.array([np.cos(way), np.sin(way)]),
            eccentric_m=0.002 * np.array([np.cos(other), np.sin(other)]),
            u_turn=np.radians(max(turn_deg, 0.1)),
        ))  # fmt: skip
    first = Scene(seed)
    for roll in kept:
        roll(first)
    for wheel in truth:  # the reference is the first scan of each
        mine = next(s for s in first.seen if s.wheel == wheel)
        scene.seen.append(
            type(mine)(wheel, "reference", wheel, mine.source, "", 1, 0, evidence=mine.evidence)
        )
    scene.seen += first.seen
    return _of_runouts(scene.measure(), truth)


def _of_runouts(measurement: Measurement, truth: dict[str, dict[str, float]]) -> list[Row]:
    rows: list[Row] = []
    for found in measurement.runouts:
        if found.angles is None or found.on_axles is None:
            rows.append(
                (f"not measured: {found.status}", np.nan, np.nan, np.inf, found.probability)
            )
            continue
        for frame, angles in (("plates", found.angles), ("axles", found.on_axles)):
            for what in ("toe", "camber"):
                angle = getattr(angles, what)
                error = angle.value - truth[found.wheel][what]
                rows.append((f"{what}, frame of the {frame}", error, angle.u, angle.dof,
                             found.probability))  # fmt: skip
        plate = measurement.wheels[("RR", "RL", "FR", "FL").index(found.wheel)]
        assert plate.angles is not None
        error = plate.angles.toe_rad - truth[found.wheel]["toe"]
        rows.append(("toe of the plate", error, float(plate.u_toe_rad or 0.0), np.inf, 0.5))
    return rows


def scanned(
    seed: int, kind: str, positions: int, rounds: int, turn_deg: float, target: str = "disc-250"
) -> list[Row]:
    """One capture, from files to angles."""
    text = config_file("vehicles", "saloon-turning").read_text()
    counts = {"sweep": (positions, 0), "runout": (0, positions), "both": (positions, 2)}[kind]
    text = text.replace("positions = 3\nrounds = 1", f"positions = {counts[0]}\nrounds = {rounds}")
    text = text.replace("positions = 2\n", f"positions = {counts[1]}\n")
    text = text.replace("turn_sigma_deg = 0.0", f"turn_sigma_deg = {turn_deg}")
    with tempfile.TemporaryDirectory() as scratch:
        vehicle, folder = Path(scratch) / "car.toml", Path(scratch) / "capture"
        vehicle.write_text(text)
        write_capture(
            folder, seed=seed, vehicle=vehicle, scanner=config_file("scanners", "default"),
            target=config_file("targets", target), trials=0,
        )  # fmt: skip
        shown = json.loads((folder / "truth.json").read_text())
        with open_capture(folder) as capture:
            measurement = measure_capture(capture, Config())
    rows: list[Row] = []
    if kind == "runout":
        _add_axles(rows, measurement, shown)
        wheels = {w["name"]: w for w in shown["wheels"] if w["role"] == "reference"}
        return rows + _of_runouts(measurement, {
            name: {what: np.radians(w[f"{what}_deg"]) for what in ("toe", "camber")}
            for name, w in wheels.items()
        })  # fmt: skip
    truth = {
        k["wheel"]: np.radians([k["caster_deg"], k["inclination_deg"]]) for k in shown["kingpins"]
    }
    rows += _of_kingpins(measurement, truth)
    for found, true in zip(measurement.toe_out, shown["toe_out_on_turns"], strict=True):
        if found.difference is not None:
            error = found.difference.value - np.radians(true["difference_deg"])
            rows.append(("toe-out on turns", error, found.difference.u, np.inf, 0.5))
    return rows


def _add_axles(rows: list[Row], measurement: Measurement, shown: dict) -> None:
    """The axle's direction against the truth, whatever the frame: toe and camber apart."""
    true = {w["name"]: np.array(w["normal"]) for w in shown["wheels"] if w["role"] == "reference"}
    for found in measurement.runouts:
        if found.axis is not None and found.angles is not None:
            off = found.axis - true[found.wheel]
            for what, way in (("toe", "forward"), ("camber", "up")):
                u = getattr(found.angles, what).u
                rows.append((f"{what} of the axle itself", float(off @ shown["frame"][way]), u,
                             np.inf, found.probability))  # fmt: skip


def table(rows: list[Row], unit: str) -> str:
    """Markdown: one row a quantity."""
    lines = ["| quantity | values | rms error | worst | beyond 3' | 95 % of errors | u "
             "| inside 95 % | mean (error/u)^2 | doubted |",
             "|---|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for what in dict.fromkeys(row[0] for row in rows):
        error, u, dof, chance = np.array([row[1:] for row in rows if row[0] == what]).T
        k = stats.t.ppf(0.975, dof)
        size = np.abs(error) * SCALE[unit]
        lines.append(
            f"| {what} | {len(error)} | {np.sqrt(np.mean(size**2)):.2f}{unit} "
            f"| {size.max():.2f}{unit} | {np.mean(np.abs(error) > THREE_MINUTES):.2%} "
            f"| {np.quantile(size, 0.95):.2f}{unit} | {np.mean(u) * SCALE[unit]:.2f}{unit} "
            f"| {np.mean(np.abs(error) <= k * u):.2%} | {np.mean((error / u) ** 2):.3f}"
            f" | {np.mean(chance < DOUBT):.2%} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["sweep", "runout", "scans"])
    parser.add_argument("--cars", type=int, default=2000)
    parser.add_argument("--positions", type=int, default=3)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--lock-deg", type=float, default=20.0)
    parser.add_argument("--turn-deg", type=float, default=0.0)
    parser.add_argument("--target", choices=sorted(U_TURN), default="disc-250")
    parser.add_argument("--kind", choices=["sweep", "runout", "both"], default="sweep")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    task = {
        "sweep": partial(
            drawn_sweep, positions=options.positions, rounds=options.rounds, lock=options.lock_deg,
            target=options.target,
        ),
        "runout": partial(
            drawn_runout, positions=options.positions, turn_deg=options.turn_deg
        ),
        "scans": partial(
            scanned, kind=options.kind, positions=options.positions, rounds=options.rounds,
            turn_deg=options.turn_deg, target=options.target,
        ),
    }[options.what]  # fmt: skip
    with get_context("forkserver").Pool(options.jobs) as pool:
        rows = [row for rows in pool.map(task, range(options.cars), 1) for row in rows]
    turned = options.what == "runout" or options.kind == "runout"
    print(table(rows, '"' if turned else "'"))


if __name__ == "__main__":
    main()
