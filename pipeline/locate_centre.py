"""The centre of a target's face from its outline; never the mean of its points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.causes import Cause, centre_cause, plane_cause
from pipeline.circle import fit_circle
from pipeline.config import CentreConfig
from pipeline.errors import NotMeasuredError
from pipeline.fit_plane import PlaneFit
from pipeline.kernels import Array
from pipeline.rim import RimFit, fit_rim
from pipeline.segment import BEAM_SLOPE, Patch
from pipeline.targets import DiscTarget

OUTLINE_EDGE_M = 5e-4  # what an outline without background may be shifted by the spot (k = 1)
EROSION_M = 1.5e-3  # what spot and spacing may take from an outline's radius (k = 1)
UNSETTLED_M = 3e-4  # the same of a rim whose fit did not stand still
WALL_SHARE = 2e-3  # of the thickness, times tan^3 of the incidence: the wall's part of the model
MAX_ECHO = 50.0  # a background that many times brighter, or darker, than the plate is no answer
SECTORS = 72  # of the rim, in which the outline is compared with the disc's
BEYOND_M, SHORT_M = 0.0015, 0.003  # how far a face may reach over its outline, or stop short of it


@dataclass(frozen=True)
class TargetFit:
    """A measured target: its plane and its centre, in scanner coordinates.

    centre_m: (3,). normal: (3,) unit, sign free. causes: of the uncertainty of both.
    plane_rms_m: over the points of the plane.
    method: 'rim' from mixed ranges, 'outline' from the points alone, 'points' from five points.
    """

    centre_m: Array
    normal: Array
    causes: tuple[Cause, ...]
    plane_rms_m: float
    points_on_target: int
    method: Literal["rim", "outline", "points"]
    rim: RimFit | None = None

    @property
    def covariance(self) -> Array:
        """(6, 6) of the normal (rad), then the centre (m), by all causes."""
        return np.asarray(sum((cause.covariance for cause in self.causes), np.zeros((6, 6))))

    @property
    def normal_covariance(self) -> Array:
        """(3, 3), rad^2."""
        return self.covariance[:3, :3]

    @property
    def centre_covariance_m2(self) -> Array:
        """(3, 3)."""
        return self.covariance[3:, 3:]


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
        centre, noise = rim.centre_m, rim.covariance_m2
        model = _model_variance(rim, face, target.radius_m, config)
        freedom = rim.freedom
    else:
        centre, noise = _outline(face, target.radius_m)
        model, freedom = OUTLINE_EDGE_M**2, math.inf
    spacing = float(np.sqrt(np.pi * target.radius_m**2 / plane.count))
    slope = 1.0 if rim is None else float(np.hypot(*rim.beam))
    check_outline(face - centre, target.radius_m, spacing, plane.sigma_m * slope)
    centre_m = patch.origin_m + _to_scanner(centre, patch, plane)
    return TargetFit(
        centre_m=centre_m,
        normal=plane.normal,
        causes=(
            *_plane_causes(plane, centre_m - plane.centroid_m, rim),
            centre_cause("centre noise", noise, plane.basis, freedom),
            centre_cause("centre model", model * np.eye(2), plane.basis),
        ),
        plane_rms_m=plane.rms_m,
        points_on_target=plane.count,
        method="rim" if rim is not None else "outline",
        rim=rim,
    )


def _model_variance(rim: RimFit, face: Array, radius_m: float, config: CentreConfig) -> float:
    """What the model of the rim may be wrong by, m^2.

    It grows as the beams graze the face, by the cube of the tangent where they see the wall. A fit
    that did not stand still, or needs an absurd brightness, is off by what the outline says.
    """
    square = float(rim.beam @ rim.beam)
    spread: float = (config.model_uncertainty_m * (1.0 + 2.0 * square)) ** 2
    spread += (WALL_SHARE * rim.thickness_m) ** 2 * square**3
    if rim.settled and 1.0 / MAX_ECHO < rim.echo < MAX_ECHO:
        return spread
    apart = _outline(face, radius_m)[0] - rim.centre_m
    return spread + UNSETTLED_M**2 + float(apart @ apart)


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


def _plane_causes(plane: PlaneFit, lever_m: Array, rim: RimFit | None) -> list[Cause]:
    """Of the plane's own scatter: independent noise, correlated noise, waves of the face."""
    seen = plane.correlated
    by_plane = None if rim is None else rim.by_plane
    return [
        plane_cause(name, covariance, plane.basis, lever_m, by_plane, freedom)
        for name, covariance, freedom in (
            ("plane noise", plane.noise_covariance, math.inf),
            ("correlated noise", seen.covariance, seen.freedom),
            ("flatness", seen.form_covariance, seen.freedom),
        )
        if covariance.any() or name == "plane noise"
    ]


def _outline(face: Array, radius_m: float) -> tuple[Array, Array]:
    """Circle of nearly known radius through the outermost points of the face (N, 2).

    The radius is free within 1.5 mm, for spot and spacing erode the edge all round.
    """
    centre = np.zeros(2)
    count = int(np.clip(len(face) // 40, 24, 180))
    for _ in range(20):
        edge = _outermost(face, centre, radius_m, count)
        if len(edge) < 8:
            raise NotMeasuredError(
                "no-outline", "less than a third of the disc's edge is in the scan"
            )
        circle = fit_circle(edge, _tukey, (radius_m, EROSION_M))
        step, centre = circle.centre_m - centre, circle.centre_m
        if float(np.abs(step).max()) < 1e-9:
            break
    return centre, circle.covariance_m2


def _outermost(face: Array, centre: Array, radius_m: float, count: int) -> Array:
    """The point of each of `count` sectors about `centre` that is farthest out, near the radius."""
    offset = face - centre
    reach = np.hypot(offset[:, 0], offset[:, 1])
    turn = (np.arctan2(offset[:, 1], offset[:, 0]) / (2.0 * np.pi)) % 1.0
    sector = np.minimum((turn * count).astype(int), count - 1)
    order = np.lexsort((np.where(reach < 1.05 * radius_m, reach, -np.inf), sector))
    last = order[np.diff(sector[order], append=count) > 0]
    return np.asarray(face[last[np.abs(reach[last] - radius_m) < 0.08 * radius_m]])


def _tukey(excess: Array) -> Array:
    """Tukey's biweight at 4.685 sigma over the variance, sigma from the excesses themselves."""
    sigma = max(1.4826 * float(np.median(np.abs(excess))), 2e-5)
    return np.asarray(np.clip(1.0 - (excess / (4.685 * sigma)) ** 2, 0.0, None) ** 2 / sigma**2)
