"""Wheels of whole vehicles without targets: found and named, in bays and beside other wheels.

.venv/bin/python -m tests.bench.bare_vehicles [--kind bay|spare|car-park|trailer|two-cars]
    [--scenes 10] [--first 0] [--spot 0.0] [--keep DIR]
.venv/bin/python -m tests.bench.bare_vehicles --kind all --scenes 200

One cloud of each vehicle from four stations, 0.8 mm noise, some 6 mm between points on the wheels,
beams of the radius --spot in metres, by default without width. right: all four named and within 50
mm and 1 degree of the truth; wrong: measured, but not that. Refused with a line of what was found
are: option, right with a point near the vehicle's front; chosen, right with a point on each wheel,
as an operator chooses it; lost, refused with that too. Angles against the rims' axes, minutes of
arc. all: the kinds in turn. A scene takes 8 to 25 s of processor time; --keep DIR keeps the clouds
of the scenes that were not right at once.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from wheelplane.capture import CaptureOptions, open_capture  # noqa: E402
from wheelplane.config import Config  # noqa: E402
from wheelplane.errors import InputError  # noqa: E402
from wheelplane.measure import measure_capture  # noqa: E402
from wheelplane_synth.output.whole import write_whole  # noqa: E402

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
MINUTE = np.radians(1.0 / 60.0)
KINDS = ("bay", "spare", "car-park", "trailer", "two-cars")
WIDE = ("car-park", "two-cars")  # other cars are seen behind the stations
POINTS = {True: 7_000_000, False: 3_000_000}


def make(kind: str, seed: int, out: Path, spot_m: float = 0.0) -> None:
    """Write the cloud, truth and capture of one scene."""
    site = "bay" if kind == "spare" else kind
    usual = (CONFIGS / "vehicles" / "saloon-bare-wheels.toml").read_text(encoding="utf-8")
    more = f'\n[site]\nkind = "{site}"\nspare = {str(kind == "spare").lower()}\n'
    scanner = (CONFIGS / "scanners" / "default.toml").read_text(encoding="utf-8")
    wide = kind in WIDE
    for old, new in (
        ("spot_radius_m = 0.0015", f"spot_radius_m = {spot_m}"),
        ("window_deg = 360.0", f"window_deg = {360.0 if wide else 140.0}"),
        ("lowest_deg = -60.0", "lowest_deg = -55.0"),
        ("highest_deg = 40.0", "highest_deg = 15.0"),
    ):
        scanner = scanner.replace(old, new)
    with TemporaryDirectory() as folder:
        files = {"vehicle": Path(folder) / "car.toml", "scanner": Path(folder) / "scanner.toml"}
        files["vehicle"].write_text(usual + more, encoding="utf-8")
        files["scanner"].write_text(scanner, encoding="utf-8")
        target = CONFIGS / "targets" / "wheel.toml"
        write_whole(out, seed=seed, target=target, points=POINTS[wide], **files)
    forward = json.loads((out / "truth.json").read_text(encoding="utf-8"))["frame"]["forward"]
    text = f'cloud = "vehicle.ply"\nfront = {forward}\ntarget = "wheel"\n'
    (out / "capture.toml").write_text(text, encoding="utf-8")


def judged(folder: Path) -> Judged:
    """Measure a scene; where it is refused again with its front, and with a point on each wheel."""
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    start = time.process_time()
    result = measured(folder, truth, CaptureOptions())
    seconds = time.process_time() - start
    if not isinstance(result, str):
        return replace(result, seconds=seconds)
    centres = np.array([wheel["rim_centre_m"] for wheel in truth["wheels"]])
    rng = np.random.default_rng(len(result))
    bumper = centres[2:].mean(axis=0) + 0.9 * np.array(truth["frame"]["forward"])
    near = (bumper + rng.uniform(-0.3, 0.3, 3)).tolist()
    clicked = (centres + rng.uniform(-0.05, 0.05, (4, 3))).tolist()
    chosen = {wheel["name"]: tuple(at) for wheel, at in zip(truth["wheels"], clicked, strict=True)}
    for verdict, options in (
        ("option", CaptureOptions(front_point=(near[0], near[1], near[2]))),
        ("chosen", CaptureOptions(hints=chosen)),
    ):
        again = measured(folder, truth, options)
        if not isinstance(again, str):
            right = again.verdict == "right"
            return Judged(verdict if right else f"wrong: {verdict}", again.rows, result, seconds)
    return Judged("lost", (), f"{result}; chosen: {again}", seconds)


@dataclass(frozen=True)
class Judged:
    """Verdict of a scene, and per wheel the errors (rad), whether both are inside; message."""

    verdict: str
    rows: tuple[tuple[float, float, bool], ...]
    message: str = ""
    seconds: float = 0.0


def measured(folder: Path, truth: dict, options: CaptureOptions) -> Judged | str:
    """Return errors across the line of sight of each wheel, or the line by which it is refused."""
    try:
        with open_capture(folder, options=options) as capture:
            found = measure_capture(capture, Config())
    except InputError as error:
        return str(error)[:600]
    rows, right = [], True
    up = np.array(truth["frame"]["up"])
    for wheel, true in zip(found.wheels, truth["wheels"], strict=True):
        assert wheel.observation.name == true["name"]
        fitted = wheel.observation.fitted
        axis = np.array(true["rim_normal"])
        level = np.cross(up, axis) / np.linalg.norm(np.cross(up, axis))
        across = np.stack([level, np.cross(axis, level)])
        off = across @ (fitted.normal - axis)
        u = np.sqrt(np.diag(across @ fitted.covariance[:3, :3] @ across.T))
        away = np.linalg.norm(fitted.centre_m - true["rim_centre_m"])
        right &= bool(away < 0.05 and np.abs(off).max() < np.radians(1.0))
        rows.append((*(off / MINUTE).tolist(), bool(np.all(np.abs(off) < 2.2 * u))))
    return Judged("right" if right else "wrong", tuple(rows))


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--kind", choices=(*KINDS, "all"), default="bay")
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--spot", type=float, default=0.0)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    results: dict[str, list[Judged]] = {}
    with TemporaryDirectory() as folder:
        for seed in range(given.first, given.first + given.scenes):
            kind = KINDS[seed % len(KINDS)] if given.kind == "all" else given.kind
            place = (given.keep or Path(folder)) / f"{kind}-{seed}"
            if not (place / "capture.toml").is_file():
                make(kind, seed, place, given.spot)
            one = judged(place)
            results.setdefault(kind, []).append(one)
            off = ", ".join(f"{a:+.1f} {b:+.1f}{'' if c else '!'}" for a, b, c in one.rows)
            print(f"{place.name}: {one.verdict}, {one.seconds:.1f} s: {off} {one.message}")
            if given.keep is None or one.verdict == "right":
                shutil.rmtree(place)
    for kind, found in results.items():
        report(kind, found)
    report("all", [one for found in results.values() for one in found])


def report(kind: str, found: list[Judged]) -> None:
    """Print the verdicts and errors of one kind of scene."""
    print(f"{kind}: {dict(Counter(one.verdict for one in found))}")
    rows = [row for one in found for row in one.rows]
    if rows:
        table = np.array([row[:2] for row in rows])
        rms, worst = np.sqrt(np.mean(table**2, axis=0)), np.abs(table).max(axis=0)
        inside = np.mean([row[2] for row in rows])
        print(f"toe {rms[0]:.1f}' ({worst[0]:.1f}'), camber {rms[1]:.1f}' ({worst[1]:.1f}')")
        print(f"both within 2.2 u: {inside:.0%} of {len(rows)} wheels")


if __name__ == "__main__":
    main()
