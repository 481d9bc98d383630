"""Candidate planes of the target: fitted at candidate positions, scored by their outline."""

from __future__ import annotations

import numpy as np

from ..cloud import EXACT, Steps, gather_ball
from ..config import SegmentConfig
from ..errors import NotMeasuredError
from ..plane import SPANNED, Clipping, RansacOptions, converge, first_sigma, ransac
from ..system import frozen
from ..targets import Target
from ..vectors import Array, Mask, plane_basis, turned
from . import template_match
from .local_planes import LocalPlanes

FACE_BAND = 0.04  # of the radius, at least: half the thickness of a target's points
WIDEST_BAND = 0.15  # of the radius, at most, however noisy
FACE_SIGMAS = 6.0  # of the noise: the same
THIN = 0.004  # of the radius, at least: half the thickness in which an outline is matched
CURVED_OF_RADIUS = (
    0.004  # rms depth of a paraboloid, of the radius, above which it is no bent target
)
BENT_OF_RADIUS = 0.0005  # the same where it explains nearly all residuals: one range of a wall
INNER = 0.7  # of the target's half width: where the plane is fitted first
FIRST_LIMITS = 3.0  # times the first distance limit: what may belong to the target there
MIN_POINTS = 30  # a scan or a target with fewer is not scored
FITTED_POINTS = 6000  # enough for a plane to a few micrometres
REACH = 2.0  # of the radius: the surroundings against which the outline is matched


@frozen(eq=False)
class Candidate:
    """Plane and the score of its outline as the target's.

    centre_m: (3,) scanner frame. basis: (3, 3) rows: the target's axes u, v in the plane, then the
    normal, its sign free. match: 1 for a whole target standing alone, the visible share for a
    partly hidden one, about 0 for a larger surface. sigma_m: noise across the plane; band_m: half
    the thickness of what may belong to the target. points: on the target, among those used.
    elsewhere: other placements in its axes u, v, as in Patch.
    """

    centre_m: Array
    basis: Array
    match: float
    sigma_m: float
    band_m: float
    points: int
    elsewhere: tuple[tuple[Array, float], ...] = ()

    @property
    def normal(self) -> Array:
        """Unit normal (3,)."""
        return np.asarray(self.basis[2])


def score_candidate(
    points_m: Array,
    point: Array,
    normal: Array,
    target: Target,
    limit_m: float,
    steps: Steps = EXACT,
) -> Candidate:
    """Fit the plane about `point`, match the target on it, and score the outline.

    points_m: (N, 3) in random order, so that any part of them covers the target.
    limit_m: distance from the first plane within which points count. steps: of the coordinates;
    points on steps beside that of the plane are its own.
    """
    radius = target.radius_m
    near = gather_ball(points_m, point, REACH * radius)
    axes = plane_basis(normal)
    rejected = Candidate(point, axes, 0.0, 0.0, FACE_BAND * radius, 0)
    inner = gather_ball(near, np.zeros(3), INNER * target.edge.size_m) @ axes.T
    inner = inner[np.abs(inner[:, 2]) < FIRST_LIMITS * limit_m]
    inner = inner[:: max(1, len(inner) // FITTED_POINTS)]
    spanned = SPANNED * float(steps.across(normal))
    try:
        sigma = first_sigma(inner[:, 2], WIDEST_BAND * radius)
        start = Clipping(np.eye(3), np.zeros(3), sigma, cap=WIDEST_BAND * radius)
        clipping, moments = converge(inner, start, max(1e-6 * radius, spanned))
    except NotMeasuredError:
        return rejected
    local = (inner - moments.centroid_m) @ moments.basis.T
    if _is_curved(local, clipping.sigma, radius, float(steps.across(normal))):
        return rejected
    normal, sigma = moments.normal @ axes, clipping.sigma
    centre = normal * ((moments.centroid_m @ axes) @ normal)
    band = float(np.clip(FACE_SIGMAS * sigma, FACE_BAND * radius, WIDEST_BAND * radius))
    thin = max(3.0 * sigma, THIN * radius, spanned)
    found, basis = _match(near - centre, normal, target, thin)
    centre = centre + found.centre_m @ basis[:2]
    basis = _rotated(basis, found.rotation_rad)
    local = (near - centre) @ basis.T
    on_target = target.region.holds(local[:, :2]) & (np.abs(local[:, 2]) < band)
    count = int(np.count_nonzero(on_target))
    elsewhere = tuple((turned(by, -found.rotation_rad), turn) for by, turn in found.elsewhere)
    return Candidate(point + centre, basis, found.match, sigma, band, count, elsewhere)


def _match(
    near: Array, normal: Array, target: Target, limit_m: float
) -> tuple[template_match.Placement, Array]:
    """Match the target to the points `near` (N, 3) close to the plane through the origin.

    Also return the basis of the placement.
    """
    basis = plane_basis(normal)
    depth, uv = np.abs(near @ normal), near @ basis[:2].T
    off = uv[(depth >= limit_m) & (depth < template_match.OFF_PLANE * limit_m)]
    region, period = target.region, target.turn_period_rad
    on_plane, radius = uv[depth < limit_m], target.radius_m
    return template_match.match_template(on_plane, region, period, radius, off), basis


def _rotated(basis: Array, rotation_rad: float) -> Array:
    """Return the basis with its first two axes rotated in their plane."""
    cos, sin = np.cos(rotation_rad), np.sin(rotation_rad)
    u, v, w = basis
    return np.stack([cos * u + sin * v, cos * v - sin * u, w])


def _is_curved(uvw: Array, sigma: float, radius_m: float, step_m: float) -> bool:
    """Return whether the points uvw (N, 3) lie on a curved surface rather than a bent target.

    step_m: of their coordinates across the target, which bends its points by half of it.
    A paraboloid explains a third of the variance of w and 0.4 % of the radius, or nearly all of it
    and 0.05 % of the radius: ranges in coarse steps cut such caps out of a wall.
    """
    u, v, w = (uvw[np.abs(uvw[:, 2]) < 3.0 * sigma] / radius_m).T
    if len(w) < MIN_POINTS:
        return False
    terms = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    fitted = terms @ np.linalg.lstsq(terms.T @ terms, terms.T @ w, rcond=None)[0]
    explained, variance = float(np.var(fitted)), float(np.var(w))
    return any(
        explained > max(share * variance, (bend + 0.5 * step_m / radius_m) ** 2)
        for share, bend in ((1.0 / 3.0, CURVED_OF_RADIUS), (0.9, BENT_OF_RADIUS))
    )


def ransac_candidates(
    points_m: Array,
    target: Target,
    config: SegmentConfig,
    rng: np.random.Generator,
    steps: Steps = EXACT,
) -> list[Candidate]:
    """Find planes of points_m (N, 3) by RANSAC, each removed before the next search."""
    options = RansacOptions(max_proposals=config.max_proposals)
    limit = threshold_m(target, config, steps)
    found = []
    for _ in range(config.max_planes):
        if len(points_m) < MIN_POINTS:
            break
        search = points_m[:: max(1, len(points_m) // config.search_points)]
        result = ransac(LocalPlanes(search, target.radius_m, limit), options, rng)
        if result is None or result.score < config.min_support:
            break
        point = result.model[:3]
        candidate = score_candidate(points_m, point, result.model[3:], target, limit, steps)
        found.append(candidate)
        points_m = points_m[~_surface(points_m, point, candidate, target.radius_m)]
    return found


def threshold_m(target: Target, config: SegmentConfig, steps: Steps = EXACT) -> float:
    """Return the distance within which points belong to a plane before the noise is known."""
    return max(config.threshold_of_diameter * 2.0 * target.radius_m, float(steps.step_m.max()))


def _surface(points_m: Array, point: Array, candidate: Candidate, radius_m: float) -> Mask:
    """Return which points (N,) lie on the candidate's plane, connected to those at `point`."""
    offset = points_m - point
    depth = np.abs((points_m - candidate.centre_m) @ candidate.normal)
    on_plane = np.nonzero((depth < candidate.band_m) & (np.abs(offset).max(axis=1) < 12 * radius_m))
    across = offset[on_plane] @ candidate.basis[:2].T
    surface = np.zeros(len(points_m), dtype=bool)
    surface[on_plane] = template_match.connected(across, radius_m)
    return surface
