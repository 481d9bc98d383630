"""The centre of a target's face from its outline; never the mean of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.config import CentreConfig, DiscTarget
from pipeline.errors import NotMeasuredError
from pipeline.fit_plane import PlaneFit
from pipeline.kernels import Array
from pipeline.rim import RimFit, fit_rim
from pipeline.segment import BEAM_SLOPE, Patch

OUTLINE_EDGE_M = 5e-4  # what an outline without background may be shifted by the spot (k = 1)
UNSETTLED_M = 3e-4  # the same of a rim whose fit did not stand still
SECTORS = 72  # of the rim, in which the outline is compared with the disc's
BEYOND_M, SHORT_M = 0.0015, 0.003  # how far a face may reach over its outline, or stop short of it


@dataclass(frozen=True)
class TargetFit:
    """A measured target: its plane and its centre, in scanner coordinates.

    centre_m: (3,). normal: (3,) unit, sign free. centre_covariance_m2: (3, 3).
    normal_covariance: (3, 3) rad^2. plane_rms_m: over the points of the plane.
    method: 'rim' from mixed ranges, 'outline' from the points alone, 'points' from five points.
    """

    centre_m: Array
    normal: Array
    centre_covariance_m2: Array
    normal_covariance: Array
    plane_rms_m: float
    points_on_target: int
    method: Literal["rim", "outline", "points"]
    rim: RimFit | None = None


def locate_centre(
    patch: Patch, plane: PlaneFit, target: DiscTarget, config: CentreConfig
) -> TargetFit:
    """Centre of the disc in `patch`, on the fitted plane.

    By the mixed ranges around the rim where there is a background (see rim.py); otherwise by the
    outermost points of the face. Raises NotMeasuredError 'no-outline' or 'wrong-outline'.
    """
    near_rim = _near_rim(patch, plane, target.radius_m)
    rim = fit_rim(near_rim, target, plane.sigma_m, config)
    face = near_rim[np.abs(near_rim[:, 2]) < max(3.0 * plane.sigma_m, 1e-6)][:, :2]
    if rim is not None:
        centre = rim.centre_m
        covariance = rim.covariance_m2 + _model_variance(rim, config) * np.eye(2)
    else:
        centre, covariance = _outline(face, target.radius_m)
    spacing = float(np.sqrt(np.pi * target.radius_m**2 / plane.count))
    slope = 1.0 if rim is None else float(np.hypot(*rim.beam))
    check_outline(face - centre, target.radius_m, spacing, plane.sigma_m * slope)
    return TargetFit(
        centre_m=patch.origin_m + _to_scanner(centre, patch, plane),
        normal=plane.normal,
        centre_covariance_m2=_centre_covariance(covariance, centre, patch, plane),
        normal_covariance=plane.normal_covariance,
        plane_rms_m=plane.rms_m,
        points_on_target=plane.count,
        method="rim" if rim is not None else "outline",
        rim=rim,
    )


def _model_variance(rim: RimFit, config: CentreConfig) -> float:
    """What the model of the rim may be wrong by, m^2: grows as the beams graze the face."""
    slant = 1.0 + 2.0 * float(rim.beam @ rim.beam)
    unsettled = 0.0 if rim.settled else UNSETTLED_M**2
    return (config.model_uncertainty_m * slant) ** 2 + unsettled


def check_outline(face: Array, radius_m: float, spacing_m: float, noise_m: float) -> None:
    """Raise NotMeasuredError unless the face (N, 2), about its centre, ends where the disc does.

    noise_m: of a point along the plane. Sectors whose points stop well inside are hidden, and tell
    nothing; half of the others must not reach beyond the outline, nor stop short of it.
    """
    reach = np.hypot(face[:, 0], face[:, 1])
    turn = (np.arctan2(face[:, 1], face[:, 0]) / (2.0 * np.pi)) % 1.0
    sector = np.minimum((turn * SECTORS).astype(int), SECTORS - 1)
    outermost = np.zeros(SECTORS)
    np.maximum.at(outermost, sector, reach)
    seen = outermost > 0.92 * radius_m
    if np.count_nonzero(seen) < SECTORS // 4:
        raise NotMeasuredError("no-outline", "less than a quarter of the disc's edge is seen")
    excess = outermost[seen] - radius_m
    beyond = BEYOND_M + spacing_m + 3.0 * noise_m
    over = float(np.mean(excess > beyond))
    if over > 0.3:
        raise NotMeasuredError(
            "wrong-outline",
            f"the face reaches {np.quantile(excess, 0.75) * 1e3:.1f} mm beyond a disc of "
            f"{radius_m * 2e3:.0f} mm on {over:.0%} of its rim",
        )
    middle = float(np.median(excess))
    if middle < -(SHORT_M + 1.5 * spacing_m):
        raise NotMeasuredError(
            "wrong-outline",
            f"the face ends {-middle * 1e3:.1f} mm inside a disc of {radius_m * 2e3:.0f} mm",
        )


def _near_rim(patch: Patch, plane: PlaneFit, radius_m: float) -> Array:
    """Points that may matter to the rim in plane coordinates (M, 3), origin below the patch's."""
    lift = (patch.origin_m - plane.centroid_m) @ plane.basis[2]
    kept = []
    for points in (patch.face_m, patch.around_m):
        uvw = points @ plane.basis.T.astype(points.dtype)
        uvw[:, 2] += lift
        reach = np.hypot(uvw[:, 0], uvw[:, 1])
        aside = BEAM_SLOPE * np.abs(uvw[:, 2])
        near = (reach > 0.9 * radius_m - aside) & (reach < radius_m + 0.03 + aside)
        kept.append(uvw[near])
    return np.concatenate(kept, dtype=np.float64)


def _to_scanner(centre: Array, patch: Patch, plane: PlaneFit) -> Array:
    """From the plane's coordinates (2,) to the scanner's axes, relative to the patch's origin."""
    lift = (plane.centroid_m - patch.origin_m) @ plane.basis[2]
    return np.asarray(centre @ plane.basis[:2] + lift * plane.basis[2])


def _centre_covariance(in_plane: Array, centre: Array, patch: Patch, plane: PlaneFit) -> Array:
    """(3, 3): the outline's in the plane; the plane's own across it, at the lever of the centre."""
    lever = patch.origin_m + _to_scanner(centre, patch, plane) - plane.centroid_m
    across = (
        plane.inflation * plane.sigma_m**2 / plane.count + lever @ plane.normal_covariance @ lever
    )
    return np.asarray(
        plane.basis[:2].T @ in_plane @ plane.basis[:2]
        + across * np.outer(plane.normal, plane.normal)
    )


def _outline(face: Array, radius_m: float) -> tuple[Array, Array]:
    """Circle of nearly known radius through the outermost points of the face (N, 2).

    r = R + a + c . rho over sectors, a free within 1.5 mm (spot and spacing erode the edge all
    round), Tukey weights.
    """
    centre = np.zeros(2)
    count = int(np.clip(len(face) // 40, 24, 180))
    for _ in range(20):
        offset = face - centre
        reach = np.hypot(offset[:, 0], offset[:, 1])
        turn = (np.arctan2(offset[:, 1], offset[:, 0]) / (2.0 * np.pi)) % 1.0
        sector = np.minimum((turn * count).astype(int), count - 1)
        outermost = np.full(count, -np.inf)
        np.maximum.at(outermost, sector, np.where(reach < 1.05 * radius_m, reach, -np.inf))
        angle = (np.arange(count) + 0.5) / count * 2.0 * np.pi
        rho = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        edge = np.isfinite(outermost) & (np.abs(outermost - radius_m) < 0.08 * radius_m)
        if np.count_nonzero(edge) < 8:
            raise NotMeasuredError(
                "no-outline", "less than a third of the disc's edge is in the scan"
            )
        step, covariance = _circle_step(outermost[edge] - radius_m, rho[edge])
        centre = centre + step
        if float(np.abs(step).max()) < 1e-9:
            break
    return centre, covariance + OUTLINE_EDGE_M**2 * np.eye(2)


def _circle_step(excess: Array, rho: Array) -> tuple[Array, Array]:
    """Shift (2,) that explains the excess over the radius, and its covariance (2, 2)."""
    slopes = np.column_stack([rho, np.ones(len(rho))])
    prior = np.diag([0.0, 0.0, 1.0 / 0.0015**2])
    residual = excess - np.median(excess)
    for _ in range(10):
        scale = max(1.4826 * float(np.median(np.abs(residual))), 2e-5)
        weight = np.clip(1.0 - (residual / (4.685 * scale)) ** 2, 0.0, None) ** 2
        information = (slopes.T * weight) @ slopes / scale**2 + prior
        solution = np.linalg.solve(information, slopes.T @ (weight * excess) / scale**2)
        residual = excess - slopes @ solution
    covariance: Array = np.linalg.inv(information).astype(np.float64)
    return np.asarray(solution[:2], dtype=np.float64), covariance[:2, :2]
