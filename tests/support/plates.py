"""Targets of every shape as scenes, and their faces cut out where they are known to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.support.scenes import Cloud
from wheelplane.centre.locate_centre import OtherCentre, TargetFit, locate_centre
from wheelplane.centre.target_view import TargetView
from wheelplane.config import CentreConfig, PlaneConfig
from wheelplane.detection.candidates import Candidate
from wheelplane.detection.cut_patch import cut_patch
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.plane.patch import Patch
from wheelplane.targets.registry import Target

Array = np.ndarray
CENTRE = CentreConfig()
OFF_M, OFF_RAD, TILTED_RAD = 0.003, 0.05, 0.005  # what a coarse look leaves, at most


@dataclass(frozen=True)
class Found:
    """A target's fit; in the target's own axes, its error_m (2,), covariance_m2 (2, 2)."""

    fitted: TargetFit | OtherCentre
    error_m: Array
    covariance_m2: Array

    @property
    def u_m(self) -> float:
        return float(np.sqrt(np.trace(self.covariance_m2) / 2))

    @property
    def nees(self) -> float:
        return float(self.error_m @ np.linalg.solve(self.covariance_m2, self.error_m))


def patch_of(cloud: Cloud, target: Target, seed: int = 0) -> Patch:
    """The face and its surroundings, off its true place and turn by as much as a coarse look is."""
    rng = np.random.default_rng(seed)
    off = cloud.R @ np.array([*rng.uniform(-OFF_M, OFF_M, 2), 0.0])
    turn = rng.uniform(-OFF_RAD, OFF_RAD)
    if not target.turn_period_rad:
        turn = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    basis = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    basis[:, 2] += basis[:, :2] @ rng.uniform(-TILTED_RAD, TILTED_RAD, 2)
    Q, upper = np.linalg.qr(basis[::-1].T)  # the normal first, then v, then u
    basis = (Q * np.sign(np.diag(upper))).T[::-1] @ cloud.R.T
    sigma = max(cloud.setup.noise_m, 1e-6)
    candidate = Candidate(
        centre_m=cloud.centre_m + off,
        basis=basis,
        match=1.0,
        sigma_m=sigma,
        band_m=max(6.0 * sigma, 0.04 * target.radius_m),
        points=len(cloud.points_m),
    )
    intensity = None if cloud.intensity is None else cloud.intensity.astype(np.float32)
    return cut_patch(cloud.points_m, intensity, candidate, target, 400_000)


def fit(cloud: Cloud, target: Target, seed: int = 0, config: CentreConfig = CENTRE) -> TargetFit:
    patch = patch_of(cloud, target, seed)
    plane = fit_plane(patch, target, PlaneConfig())
    return locate_centre(TargetView(patch, plane, target, config))


def found(cloud: Cloud, target: Target, seed: int = 0, config: CentreConfig = CENTRE) -> Found:
    return in_target(cloud, fit(cloud, target, seed, config))


def in_target(cloud: Cloud, fitted: TargetFit | OtherCentre) -> Found:
    return Found(
        fitted,
        cloud.in_target(fitted.centre_m)[:2],
        (cloud.R.T @ fitted.centre_covariance_m2 @ cloud.R)[:2, :2],
    )
