"""Coverage of the stated uncertainties: errors of synthetic vehicles against them.

.venv/bin/python -m tests.bench.intervals [--vehicles 1000] [--mode all] [--jobs 2] [--seed 0]

Each vehicle is drawn from configs/vehicles/saloon.toml; each wheel is scanned in closed form
(tests/support/scenes.py): a 250 mm disc before a tilted background, 7,400 beams on it 2.5 mm apart
with 0.8 mm of noise, and a 1.5 mm spot with mixed pixels at every edge, so that the whole program
runs as on a real scan, from files to angles, in a sixth of a second a wheel. Plates are as made:
their sizes are the stated ones but for what a shop leaves; the first mode states their chamfer.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from scipy import stats  # noqa: E402

from tests.support.made import RADIUS_M, SIZE_M, THICKNESS, draw_edge  # noqa: E402
from tests.support.scenes import Setup, make  # noqa: E402
from wheelplane.capture.open_capture import open_capture  # noqa: E402
from wheelplane.config import Config, config_file, load_config  # noqa: E402
from wheelplane.errors import InputError  # noqa: E402
from wheelplane.measure import measure_capture  # noqa: E402
from wheelplane.measurement.quantities import Stated, by_name  # noqa: E402
from wheelplane.measurement.records import Measurement  # noqa: E402
from wheelplane_synth.output.files import capture_toml, ply, scan_file  # noqa: E402
from wheelplane_synth.output.truth import Truth  # noqa: E402
from wheelplane_synth.parameters.parameters import VehicleFile  # noqa: E402
from wheelplane_synth.parameters.plate_file import TargetFile  # noqa: E402
from wheelplane_synth.parameters.recipe import read_recipe  # noqa: E402
from wheelplane_synth.parameters.target_file import read_target  # noqa: E402
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel  # noqa: E402

ARCSEC = np.degrees(1.0) * 3600.0
NOISE_M = 0.0008
CHAMFER_U_M = 0.00005  # of a stated one (k = 1)
SCENE = Setup(spacing_m=0.0025, half_width_m=0.2, noise_m=NOISE_M, pairs=12)


def correlated(length_m: float, share: float = 0.5) -> dict[str, float]:
    """Changes to a Setup: `share` of the noise's variance correlated over length_m."""
    return {
        "noise_m": NOISE_M * (1.0 - share) ** 0.5,
        "correlated_m": NOISE_M * share**0.5,
        "length_m": length_m,
    }


MODES: dict[str, dict[str, float]] = {
    "independent": {"chamfer_m": 0.0002},
    "unstated": {},
    "correlated-5": correlated(0.005),
    "correlated-10": correlated(0.010),
    "correlated-20": correlated(0.020),
    "flatness": {"flatness_m": 0.00005},
    "occluded": {"hidden": 0.4},
    "combined": correlated(0.010) | {"flatness_m": 0.00005, "hidden": 0.4},
}


@dataclass(frozen=True)
class Scores:
    """Errors and standard uncertainties (M, K) of K values of a kind in M vehicles.

    dof: (M, K) degrees of freedom of the uncertainty, inf where it is known.
    """

    error: np.ndarray
    u: np.ndarray
    dof: np.ndarray
    unit: str = ""
    scale: float = 1.0

    @classmethod
    def of(cls, said: list[Stated], true: list[float]) -> Scores:
        """One row, of quantities of one unit."""
        rows = [[q.value - t, q.u, q.dof] for q, t in zip(said, true, strict=True)]
        unit = ('"', ARCSEC) if said[0].unit == "rad" else ("mm", 1e3)
        return cls(*np.array(rows).T[:, None, :], *unit)

    @classmethod
    def stacked(cls, parts: Iterable[Scores]) -> Scores:
        """The rows of all parts."""
        parts = list(parts)
        rows = (np.vstack([getattr(p, name) for p in parts]) for name in ("error", "u", "dof"))
        return cls(*rows, parts[0].unit, parts[0].scale)

    def times(self, factor: float) -> Scores:
        """The same errors with another uncertainty."""
        return Scores(self.error, self.u * factor, self.dof, self.unit, self.scale)

    @property
    def normal(self) -> np.ndarray:
        """error/u, brought from Student's distribution to the normal one, (M, K)."""
        t = np.abs(self.error / self.u)
        return np.sign(self.error) * stats.norm.isf(stats.t.sf(t, self.dof).clip(1e-300))

    @property
    def inside(self) -> float:
        """Share of the errors within their interval of 95 %."""
        return float(np.mean(np.abs(self.normal) <= stats.norm.ppf(0.975)))

    @property
    def nees(self) -> float:
        """Mean of the squared normal scores; 1 is wanted."""
        return float(np.mean(self.normal**2))

    @property
    def independent(self) -> float:
        """How many independent values the M * K are worth.

        tr(R)^2 / tr(R^2) a vehicle, R the correlation of its values: Satterthwaite, Biometrics
        Bulletin 2 (1946) 110.
        """
        count, values = self.error.shape
        if values == 1 or count < 3:
            return float(count)
        R = np.atleast_2d(np.corrcoef(self.normal.T))
        noise = values * (values - 1) / (count - 1)  # what sampling alone adds to tr(R^2)
        return float(count * values**2 / max(np.sum(R**2) - noise, values))

    def nees_bounds(self, trust: float = 0.99) -> tuple[float, float]:
        """Within which the mean lies with probability `trust`, if u is right."""
        n = self.independent
        low, high = stats.chi2.ppf([(1 - trust) / 2, (1 + trust) / 2], n) / n
        return float(low), float(high)

    @property
    def width(self) -> float:
        """Mean uncertainty over the rms error: how much wider the intervals are than needed."""
        return float(np.mean(self.u) / np.sqrt(np.mean(self.error**2)))


def one_vehicle(
    index: int, seed: int, changes: dict[str, float], config: Config
) -> dict[str, Scores] | None:
    """Scores by quantity, one row each, of vehicle `index`; None where a target was refused."""
    rng = np.random.default_rng([seed, index])
    recipe = read_recipe(config_file("vehicles", "saloon"), VehicleFile)
    plate = read_target(config_file("targets", "disc-250"))
    stated = {"flatness": changes.get("flatness_m", 0.0), "chamfer": changes.get("chamfer_m")}
    plate = plate.model_copy(update=stated)
    car = draw_vehicle(recipe, rng)
    wheels = tuple(draw_wheel(car, recipe, name, rng) for name in WHEELS)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for wheel in wheels:
            setup = SCENE.but(
                distance_m=rng.uniform(2.0, 3.0),
                incidence_deg=rng.uniform(3.0, 25.0),
                azimuth_deg=rng.uniform(0.0, 360.0),
                background_m=rng.uniform(0.06, 0.14),
                background_tilt_deg=rng.uniform(0.0, 6.0),
                **changes | _as_made(plate, rng),
            )
            points = make(setup, rng, car.T_site_vehicle @ wheel.T_vehicle_target).points_m
            bytes_ = ply(points, np.ones(len(points), dtype=np.float32))
            (folder / scan_file(wheel)).write_bytes(bytes_)
        (folder / "capture.toml").write_text(capture_toml("", plate, wheels))
        try:
            with open_capture(folder) as capture:
                measurement = measure_capture(capture, config)
        except InputError:  # a target that is refused states no uncertainty
            return None
    return judged(measurement, Truth(seed, car, wheels, {}).to_json())


def _as_made(plate: TargetFile, rng: np.random.Generator) -> dict[str, float | bool]:
    """Draw the sizes of a plate, as changes to a Setup; half of unstated edges are rounded."""
    off, thicker, chamfer = rng.standard_normal(3).clip(-2.0, 2.0)
    if plate.chamfer is None:
        chamfer_m, rounded = draw_edge(rng)
    else:
        chamfer_m, rounded = max(plate.chamfer + CHAMFER_U_M * chamfer, 0.0), False
    return {
        "radius_m": RADIUS_M + float(SIZE_M * off),
        "thickness_m": float(plate.thickness * (1.0 + THICKNESS * thicker)),
        "chamfer_m": float(chamfer_m),
        "rounded": rounded,
    }


def judged(measurement: Measurement, truth: dict) -> dict[str, Scores]:
    """Errors and stated uncertainties of a measurement, against the content of truth.json."""
    said = by_name(measurement)
    scores = {
        kind: Scores.of([said[f"{w['name']}.{kind}"] for w in truth["wheels"]],
                        [np.radians(w[f"{kind}_deg"]) for w in truth["wheels"]])
        for kind in ("toe", "camber")
    }  # fmt: skip
    scores |= centres(measurement, truth)
    for name in ("rear_total_toe", "front_total_toe", "thrust_angle"):
        scores[name] = Scores.of([said[name]], [np.radians(truth["vehicle"][f"{name}_deg"])])
    for name in ("rear_track", "front_track", "wheelbase"):
        scores[name] = Scores.of([said[name]], [truth["frame"][f"{name}_m"]])
    return scores


def centres(measurement: Measurement, truth: dict) -> dict[str, Scores]:
    """Along the true axes of the vehicle, and as vectors whitened by their covariance."""
    axes = np.array([truth["frame"][way] for way in ("left", "forward", "up")])
    along, white = [], []
    for wheel, true in zip(measurement.wheels, truth["wheels"], strict=True):
        fitted = wheel.observation.fitted
        error = axes @ (fitted.centre_m - true["centre_m"])
        parts = [(axes @ c.covariance[3:, 3:] @ axes.T, c.dof) for c in fitted.components]
        whiten = np.linalg.inv(np.linalg.cholesky(axes @ fitted.centre_covariance_m2 @ axes.T))
        along.append(_components(error, parts))
        white.append(_components(whiten @ error, [(whiten @ c @ whiten.T, f) for c, f in parts]))
    table = np.array(along).transpose(1, 2, 0)  # error, u, dof; way; wheel
    whitened = np.array(white).transpose(1, 0, 2).reshape(3, -1)
    ways = ("centre left", "centre forward", "centre up")
    return {
        **{way: Scores(*table[:, k, None, :], "mm", 1e3) for k, way in enumerate(ways)},
        "centre, whitened": Scores(*whitened[:, None, :]),
    }


def _components(error: np.ndarray, parts: list[tuple[np.ndarray, float]]) -> np.ndarray:
    """(3, 3): error, u and effective degrees of freedom (JCGM 100, G.4) of each component."""
    variances = np.array([np.diag(covariance) for covariance, _ in parts])
    total = variances.sum(axis=0)
    fourths = (variances**2 / np.array([[dof] for _, dof in parts])).sum(axis=0)
    with np.errstate(divide="ignore"):
        return np.array([error, np.sqrt(total), total**2 / fourths])


def run(
    vehicles: int,
    changes: dict[str, float],
    config: Config,
    *,
    jobs: int = 1,
    seed: int = 0,
) -> dict[str, Scores]:
    """Scores of those of that many vehicles that were measured, whatever the number of jobs."""
    task = partial(one_vehicle, seed=seed, changes=changes, config=config)
    if jobs > 1:
        with get_context("forkserver").Pool(jobs) as pool:
            rows = pool.map(task, range(vehicles), 4)
    else:
        rows = [task(index) for index in range(vehicles)]
    rows = [row for row in rows if row is not None]
    return {name: Scores.stacked(row[name] for row in rows) for name in rows[0]}


def table(scores: dict[str, Scores]) -> str:
    """Markdown: one row a quantity."""
    lines = [
        "| quantity | rms error | bias/se | inside 95 % (u/2, 2u) | mean NEES | its 99 % bounds "
        "| mean u / rms |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, kind in scores.items():
        rms = np.sqrt(np.mean(kind.error**2))
        bias = np.mean(kind.error) / rms * np.sqrt(kind.error.size)
        low, high = kind.nees_bounds()
        flag = "" if low <= kind.nees <= high else " !"
        lines.append(
            f"| {name} | {rms * kind.scale:.4g} {kind.unit} | {bias:+.1f} "
            f"| {kind.inside:.2%} ({kind.times(0.5).inside:.1%}, {kind.times(2.0).inside:.1%}) "
            f"| {kind.nees:.3f}{flag} | {low:.3f}-{high:.3f} | {kind.width:.3f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=1000)
    parser.add_argument("--mode", choices=[*MODES, "all"], default="independent")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--config", type=Path, help="a configuration instead of the mode's own")
    parser.add_argument("--scene", type=json.loads, default={}, help='e.g. {"spacing_m": 0.002}')
    options = parser.parse_args()
    for mode in MODES if options.mode == "all" else [options.mode]:
        changes = MODES[mode] | options.scene
        config = load_config(options.config)
        scores = run(options.vehicles, changes, config, jobs=options.jobs, seed=options.seed)
        measured = len(scores["toe"].error)
        print(f"\n{mode}: {measured} measured of {options.vehicles} vehicles, seed {options.seed}")
        print(f"{changes}\n")
        print(table(scores), flush=True)


if __name__ == "__main__":
    main()
