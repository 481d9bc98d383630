"""Rounded coordinates: errors of a target's normal against its uncertainty, by tilt, noise, step.

.venv/bin/python -m tests.bench.rounding [--seeds 20] [--single] [--tilts 0,0.1,1]

A 250 mm disc, tilted by a little from an axis of the file, is scanned in closed form
(tests/support/scenes.py), its points are rounded to steps, and one scan goes the whole way, from
the check of the cloud to the fitted target. A cell of the table is one tilt, noise and step: three
orientations (the face square to x, y or z), `seeds` scans each, two angles a scan. The errors of a
scan's two angles are brought to the normal distribution by their Student's t.

Of so few errors, 95 % within their interval is no bar that a right u passes in every cell: the
column `p` is the probability of as few inside, if 93 % are right, and the last line compares the
least of all p with what as many right cells would show.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from scipy import stats  # noqa: E402

from tests.support.scenes import Cloud, Setup, make  # noqa: E402
from wheelplane.config import Config  # noqa: E402
from wheelplane.detection.find_target import find_target  # noqa: E402
from wheelplane.diagnostics.plausibility import check_wheel_scan  # noqa: E402
from wheelplane.errors import InputError, NotMeasuredError  # noqa: E402
from wheelplane.measure import fit_target  # noqa: E402
from wheelplane.targets.plates import DiscTarget  # noqa: E402

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
CONFIG = Config()
SCENE = Setup(spacing_m=0.0025, half_width_m=0.2, pairs=8, background_tilt_deg=3.0)
TILTS_DEG = (0.0, 0.05, 0.1, 0.2, 0.3, 0.6, 1.0, 2.0)
NOISES_M = (5e-5, 1e-4, 3e-4, 6e-4, 1e-3)
STEPS_M = (1e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2)
OFFSETS_M = (1e3, 5e3, 2e4, 5e4, 5e5, 5e6)  # of the site, along the axis that the face is square to
ARCSEC = np.degrees(1.0) * 3600.0
CLAIM = 0.93


@dataclass(frozen=True)
class Scores:
    """Scores of N scans: angle and centre (N, 2) each, error over u brought to the normal one.

    u_rad: (N,) of the angle; ratio: (N,) larger error of the two angles over u. refused: statuses
    of the scans that gave none.
    """

    angle: np.ndarray
    centre: np.ndarray
    u_rad: np.ndarray
    ratio: np.ndarray
    refused: tuple[str, ...]

    @property
    def inside(self) -> tuple[int, int]:
        """Angles within their interval of 95 %, and all."""
        return int(np.count_nonzero(np.abs(self.angle) <= stats.norm.ppf(0.975))), self.angle.size


def face(
    tilt_deg: float, noise_m: float, axis: int, seed: int, shift_m: Sequence[float]
) -> tuple[Cloud, np.ndarray]:
    """Scan of a target tilted from an axis in any direction; its points, not rounded."""
    key = [seed, axis, round(tilt_deg * 1e3), round(noise_m * 1e7)]
    rng = np.random.default_rng(key)
    tilt, way = np.radians(tilt_deg), rng.uniform(0.0, 2.0 * np.pi)
    normal = np.array([np.sin(tilt) * np.cos(way), np.sin(tilt) * np.sin(way), np.cos(tilt)])
    normal = np.roll(normal, axis + 1)
    first = np.cross(normal, rng.normal(size=3))
    first /= np.linalg.norm(first)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([first, np.cross(normal, first), normal], axis=1)
    pose[:3, 3] = np.asarray(shift_m) + rng.uniform(-1.0, 1.0, 3)
    setup = SCENE.but(
        noise_m=noise_m,
        incidence_deg=rng.uniform(3.0, 25.0),
        azimuth_deg=rng.uniform(0.0, 360.0),
    )
    cloud = make(setup, rng, pose)
    return cloud, cloud.points_m


def judge(cloud: Cloud, points_m: np.ndarray) -> tuple[np.ndarray, ...]:
    """Scores of a scan's angle and centre (2,), u, and error over u. Raises a refusal."""
    check_wheel_scan(points_m, DISC.diameter, "m", "scan")
    fitted = fit_target(find_target(points_m, DISC, CONFIG.segment, 0), DISC, CONFIG).target
    along = cloud.R[:, :2].T
    angle, centre = along @ fitted.normal, along @ (fitted.centre_m - cloud.centre_m)
    parts = [(np.diag(along @ c.covariance[:3, :3] @ along.T), c.dof) for c in fitted.components]
    u = np.sqrt(sum(variance for variance, _ in parts))
    u_centre = np.sqrt(np.diag(along @ fitted.centre_covariance_m2 @ along.T))
    dof = u**4 / np.maximum(sum(variance**2 / dof for variance, dof in parts), 1e-300)
    tail = stats.t.sf(np.abs(angle / u), np.minimum(dof, 1e9)).clip(1e-300)
    return (
        np.sign(angle) * stats.norm.isf(tail),
        centre / u_centre,
        u.mean(),
        np.abs(angle / u).max(),
    )


def cell(
    tilt_deg: float, noise_m: float, seeds: int, step_m: float = 0.0, offset_m: float = 0.0
) -> Scores:
    """Scores of three orientations: rounded to step_m, or float32 with the face offset_m away."""
    rows, refused = [], []
    for axis in range(3):
        for seed in range(seeds):
            cloud, points = face(tilt_deg, noise_m, axis, seed, offset_m * np.eye(3)[axis])
            if step_m:
                points = np.round(points / step_m) * step_m
            if offset_m:
                points = points.astype(np.float32).astype(np.float64)
            try:
                rows.append(judge(cloud, points))
            except NotMeasuredError as error:
                refused.append(error.status)
            except InputError:
                refused.append("unusable")
    columns = [np.array([row[k] for row in rows]) for k in range(4)]
    shapes = ((-1, 2), (-1, 2), (-1,), (-1,))
    return Scores(
        *(c.reshape(shape) for c, shape in zip(columns, shapes, strict=True)), tuple(refused)
    )


def tables(options: argparse.Namespace) -> Iterator[str]:
    """Lines of Markdown."""
    heads = ("step / mm", "tilt / °", "noise / mm", "measured", "refused", "inside 95 %", "p")
    heads += ("worst / u", 'u / "', "centre")
    yield "| " + " | ".join(heads) + " |"
    yield "|" + "---|" * len(heads)
    every, least = [], []
    sizes = OFFSETS_M if options.single else options.steps
    for size in sizes:
        for tilt in options.tilts:
            for noise in options.noises:
                how = {"offset_m": size} if options.single else {"step_m": size}
                found = cell(tilt, noise, options.seeds, **how)
                yield row(size, tilt, noise, found, options.single)
                if len(found.angle):
                    every.append(found)
                    least.append(chance(found))
    angle = np.concatenate([found.angle.ravel() for found in every])
    centre = np.concatenate([found.centre.ravel() for found in every])
    worst = max(found.ratio.max() for found in every)
    inside = np.mean(np.abs(angle) <= stats.norm.ppf(0.975))
    yield ""
    yield (
        f"{len(angle)} angles, {inside:.2%} inside, mean NEES {np.mean(angle**2):.3f}, worst "
        f"{worst:.2f}; centres: mean NEES {np.mean(centre**2):.3f}, worst "
        f"{np.abs(centre).max():.2f}"
    )
    yield (
        f"least p of {len(least)} cells: {min(least):.4f}; of as many right ones, below that with "
        f"probability {1.0 - (1.0 - min(least)) ** len(least):.2f}"
    )


def chance(found: Scores) -> float:
    """Probability of as few angles inside, where CLAIM of them are right."""
    return float(stats.binom.cdf(*found.inside, CLAIM))


def row(size: float, tilt: float, noise: float, found: Scores, single: bool) -> str:
    head = f"{size:.0f} m" if single else f"{size * 1e3:g}"
    cells = [head, f"{tilt:g}", f"{noise * 1e3:g}", str(len(found.angle))]
    cells.append(", ".join(counted(found)))
    if len(found.angle):
        inside, total = found.inside
        centre = np.sqrt(np.mean(found.centre**2))
        u = np.median(found.u_rad) * ARCSEC
        worst = found.ratio.max()
        cells += [f"{inside / total:.1%}", f"{chance(found):.3f}", f"{worst:.2f}", f"{u:.1f}"]
        cells.append(f"{centre:.2f}")
    return "| " + " | ".join(cells) + " |"


def counted(found: Scores) -> list[str]:
    """Statuses of refusals with their numbers."""
    statuses, numbers = np.unique(found.refused, return_counts=True)
    return [f"{number} {status}" for status, number in zip(statuses, numbers, strict=True)]


def numbers(text: str) -> tuple[float, ...]:
    """Parse numbers separated by commas."""
    return tuple(float(part) for part in text.split(","))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="of each orientation of a cell")
    parser.add_argument("--tilts", type=numbers, default=TILTS_DEG, help="degrees")
    parser.add_argument("--noises", type=numbers, default=NOISES_M, help="metres")
    parser.add_argument("--steps", type=numbers, default=STEPS_M, help="metres")
    parser.add_argument("--single", action="store_true", help="float32 at sites instead of steps")
    for line in tables(parser.parse_args()):
        print(line, flush=True)


if __name__ == "__main__":
    main()
