"""A measured vehicle with all that a report shows: square boards scanned at places that are known.

Vehicle coordinates: x forward, y left, z up, as those of the 3D view.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from tests.support.given import standing
from tests.support.plates import patch_of
from tests.support.printing import setup_of
from tests.support.scenes import Cloud, Setup, make
from tests.support.turning import PLACES, WHEELS, facing, side
from wheelplane.centre import target_view
from wheelplane.centre.locate_centre import locate_centre
from wheelplane.cloud.preview import cloud_sample
from wheelplane.config import CentreConfig, Config, PlaneConfig
from wheelplane.measurement.evaluate import align
from wheelplane.measurement.records import Evidence, Measurement, Observation, Provenance
from wheelplane.measurement.residual_map import residual_map
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.targets.registry import Target, load_target

PLAIN = Setup(spacing_m=0.003, half_width_m=0.24, pairs=6)
ANGLES = {"RR": (0.004, -0.01), "RL": (-0.002, 0.012), "FR": (0.003, -0.005),
          "FL": (-0.001, 0.008), "1": (0.006, -0.02)}  # fmt: skip
TURNS = {"RR": 0.1, "RL": -0.3, "FR": 0.5, "FL": 0.2, "1": 0.0}
MADE = Provenance(
    source="a/capture", vehicle="AA-00-BB", version="1.2.3", seed=3,
    inputs={f"{wheel.lower()}.ply": f"sha256:{wheel * 32}" for wheel in WHEELS},
    config={"plane": {"edge_margin_m": 0.005}, "target": {"shape": "square", "side": 0.3}},
)  # fmt: skip


@dataclass(frozen=True)
class TargetView:
    """One scan: what was made, where its board truly lies in the vehicle, what is reported."""

    cloud: Cloud
    R_vehicle_board: np.ndarray
    centre_m: np.ndarray
    observation: Observation


def board(name: str, wheel: str, turn: float) -> np.ndarray:
    """Columns: the board's axes u, v, and its outward normal, in the vehicle."""
    n = facing(wheel, *ANGLES[name])
    u = np.cross([0.0, 0.0, 1.0], n)
    u /= np.linalg.norm(u)
    R = np.column_stack([u, np.cross(n, u), n])
    return R @ Rotation.from_rotvec([0.0, 0.0, turn]).as_matrix()


@cache
def scan(name: str, site: int, shape: str = "square-300") -> TargetView:
    """The board of a wheel, or of trial "1" on RR, in a vehicle that stands anywhere."""
    wheel = name if name in WHEELS else "RR"
    target = load_target(shape)
    R, centre = board(name, wheel, TURNS[name]), np.array(PLACES[wheel])
    pose = np.eye(4)
    pose[:3, :3] = site_of(site)[0] @ R
    pose[:3, 3] = site_of(site)[0] @ centre + site_of(site)[1]
    seed = 10 + list(ANGLES).index(name)
    cloud = make(setup_of(target, PLAIN), seed, pose)
    evidence = evidence_of(cloud, target, seed)
    role = "reference" if name in WHEELS else "trial"
    source = f"{name.lower()}.ply"
    observation = Observation(
        name, role, wheel, source, "sha256:0", len(cloud.points_m), 0,
        evidence=evidence, cloud=cloud_sample(cloud.points_m),
    )  # fmt: skip
    return TargetView(cloud, R, centre, observation)


def site_of(site: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and shift from the vehicle to the scanner; none for 0."""
    if site == 0:
        return np.eye(3), np.zeros(3)
    rng = np.random.default_rng(site)
    return standing(Rotation.random(random_state=site)).as_matrix(), rng.uniform(-20.0, 20.0, 3)


def evidence_of(cloud: Cloud, target: Target, seed: int = 0) -> Evidence:
    patch = patch_of(cloud, target, seed)
    plane = fit_plane(patch, target, PlaneConfig())
    fitted = locate_centre(target_view.TargetView(patch, plane, target, CentreConfig()))
    return Evidence(fitted, plane, residual_map(patch, plane, fitted, target, margin_m()))


def margin_m() -> float:
    return Config().plane.edge_margin_m


@cache
def measured(site: int = 1) -> Measurement:
    """Four wheels and a trial."""
    return align([scan(name, site).observation for name in ANGLES], MADE, ["A note."])


def renamed(vehicle: str, file: str, name: str = "1") -> Measurement:
    """The same with other names, of the vehicle, of the trial's file, and of the trial."""
    seen = [scan(wheel, 1).observation for wheel in ANGLES]
    seen[-1] = replace(seen[-1], source=file, name=name)
    return align(seen, replace(MADE, vehicle=vehicle, inputs={file: "sha256:1"}))


def lost(status: str = "no-target", reason: str = "two planes, none of its size") -> Measurement:
    """The same with a trial that was not measured."""
    seen = [scan(wheel, 1).observation for wheel in ANGLES]
    seen[-1] = replace(seen[-1], evidence=None, status=status, reason=reason)
    return align(seen, MADE)


def many(count: int) -> Measurement:
    """With so many trials, each the first once more."""
    seen = [scan(wheel, 1).observation for wheel in ANGLES]
    more = [replace(seen[-1], name=str(index + 2)) for index in range(count - 1)]
    return align([*seen, *more], MADE)


def off_m(points_m: np.ndarray, seen: TargetView) -> np.ndarray:
    """Points (N, 3) of the vehicle in the board's own axes."""
    return (points_m - seen.centre_m) @ seen.R_vehicle_board


assert side("RL") == 1.0  # the left wheel's y is positive
