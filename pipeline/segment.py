"""Find the target's face in a scan: planes by RANSAC on a subset, told apart by size and shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline import raster
from pipeline.config import SegmentConfig
from pipeline.errors import NotMeasuredError
from pipeline.kernels import Array, Slab, gather_ball, gather_face, plane_basis, random_rows
from pipeline.local_planes import LocalPlanes
from pipeline.ransac import RansacOptions, ransac
from pipeline.targets import DiscTarget
from pipeline.trimmed import Trim, converge, first_sigma

FACE_BAND = 0.04  # of the radius, at least: what may belong to the face
WIDEST_BAND = 0.15  # of the radius, at most, however noisy
FACE_SIGMAS = 6.0  # of the noise: half the thickness of what may belong to the face
MAX_DEPTH_M = 0.8  # background further behind the face tells nothing more
BEAM_SLOPE = 1.2  # beams up to 50 degrees carry the background this far sideways per depth
CURVED_OF_RADIUS = 0.004  # rms depth of a paraboloid, of the radius, above which no plate is bent
MIN_POINTS = 30  # a scan or a face with fewer is not judged
LIKELY = 0.6  # of the best match, or the least: a candidate that all points may prove
MAX_VERIFIED = 3  # candidates that are looked at with all points of the scan


@dataclass(frozen=True)
class Candidate:
    """A plane that was looked at, and how well its outline fits the target.

    centre_m, normal: (3,) scanner frame, normal's sign free. match: 1 for a whole target standing
    alone, the visible share for a hidden one, about 0 for a larger surface.
    band_m: half the thickness of what may belong to the face, from the noise.
    """

    centre_m: Array
    normal: Array
    match: float
    band_m: float


@dataclass(frozen=True)
class Patch:
    """The surroundings of the target's face, before anything is fitted to it.

    origin_m: (3,) scanner frame, near the target's centre.
    face_m: (N, 3) all points within reach of the face's plane, relative to origin_m, scanner axes.
    around_m: (M, 3) float32, the same of other points around, thinned where there are many.
    match: of the outline, with all points.
    basis: (3, 3) rows: two directions in the plane, then the normal that points to the scanner.
    candidates: every plane that was looked at, best match first.
    """

    origin_m: Array
    face_m: Array
    around_m: npt.NDArray[np.float32]
    match: float
    basis: Array
    candidates: tuple[Candidate, ...]


def find_target(points_m: Array, target: DiscTarget, config: SegmentConfig, seed: int) -> Patch:
    """Patch of points_m (N, 3) that shows the target.

    Raises NotMeasuredError: 'too-few-points', 'no-plane', 'no-target' (with what was found
    instead) or 'ambiguous-target'.
    """
    if len(points_m) < MIN_POINTS:
        raise NotMeasuredError("too-few-points", f"{len(points_m)} points, {MIN_POINTS} needed")
    rng = np.random.default_rng(seed)
    subset = random_rows(points_m, config.subset_points, rng)
    origin = np.median(subset, axis=0)
    subset -= origin
    found = _candidates(subset, target.radius_m, config, rng)
    del subset
    if not found:
        raise NotMeasuredError("no-plane", "no plane stands out among the points")
    likely = [c for c in found if c.match > LIKELY * max(config.min_match, found[0].match)]
    return _choose(
        [_patch(points_m, origin, c, found, target, config, rng) for c in likely[:MAX_VERIFIED]],
        found,
        target,
        config,
    )


def _candidates(
    subset: Array, radius_m: float, config: SegmentConfig, rng: np.random.Generator
) -> tuple[Candidate, ...]:
    """Planes one after the other, each taken out before the next is sought; best match first."""
    options = RansacOptions(max_proposals=config.max_proposals)
    threshold = config.threshold_of_diameter * 2.0 * radius_m
    found = []
    for _ in range(config.max_planes):
        if len(subset) < MIN_POINTS:
            break
        search = subset[:: max(1, len(subset) // config.search_points)]
        result = ransac(LocalPlanes(search, radius_m, threshold), options, rng)
        if result is None or result.score < config.min_support:
            break
        point, normal = result.model[:3], result.model[3:]
        candidate = _judge(subset, point, normal, radius_m, threshold)
        found.append(candidate)
        subset = subset[~_surface(subset, point, candidate, radius_m)]
    return tuple(sorted(found, key=lambda candidate: -candidate.match))


def _judge(
    subset: Array, point: Array, normal: Array, radius_m: float, threshold: float
) -> Candidate:
    """Place the target on a plane's points, refit the plane there, and judge the outline."""
    placed = _place(subset, point, normal, radius_m, threshold)
    centre = point + placed.centre_m @ plane_basis(normal)[:2]
    inner = gather_ball(subset, centre, 0.9 * radius_m)
    try:
        sigma = first_sigma(inner @ normal, WIDEST_BAND * radius_m)
        start = Trim(plane_basis(normal), np.zeros(3), sigma, cap=WIDEST_BAND * radius_m)
        trim, moments, _ = converge(inner, start, 1e-6 * radius_m)
    except NotMeasuredError:
        return Candidate(centre, normal, 0.0, FACE_BAND * radius_m)
    if _is_curved((inner - moments.centroid_m) @ moments.basis.T, trim.sigma, radius_m):
        return Candidate(centre, normal, 0.0, FACE_BAND * radius_m)
    normal, sigma = moments.normal, trim.sigma
    centre = centre + normal * (moments.centroid_m @ normal)
    band = float(np.clip(FACE_SIGMAS * sigma, FACE_BAND * radius_m, WIDEST_BAND * radius_m))
    placed = _place(subset, centre, normal, radius_m, max(threshold, 3.0 * sigma))
    centre = centre + placed.centre_m @ plane_basis(normal)[:2]
    return Candidate(centre, normal, placed.match, band)


def _is_curved(uvw: Array, sigma: float, radius_m: float) -> bool:
    """Whether a paraboloid explains a third of the residuals w of uvw (N, 3), and 0.4 % of R."""
    u, v, w = (uvw[np.abs(uvw[:, 2]) < 3.0 * sigma] / radius_m).T
    if len(w) < MIN_POINTS:
        return False
    terms = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    fitted = terms @ np.linalg.lstsq(terms, w, rcond=None)[0]
    return bool(np.var(fitted) > max(np.var(w) / 3.0, CURVED_OF_RADIUS**2))


def _place(
    subset: Array, point: Array, normal: Array, radius_m: float, threshold: float
) -> raster.DiscPlacement:
    near = gather_ball(subset, point, 2.6 * radius_m)
    near = near[np.abs(near @ normal) < threshold]
    return raster.match_disc(near @ plane_basis(normal)[:2].T, radius_m)


def _surface(
    subset: Array, point: Array, candidate: Candidate, radius_m: float
) -> npt.NDArray[np.bool_]:
    """Which points (N,) lie on the candidate's plane and hang together with those at `point`."""
    offset = subset - point
    depth = np.abs((subset - candidate.centre_m) @ candidate.normal)
    on_plane = np.nonzero((depth < candidate.band_m) & (np.abs(offset).max(axis=1) < 12 * radius_m))
    across = offset[on_plane] @ plane_basis(candidate.normal)[:2].T
    surface = np.zeros(len(subset), dtype=bool)
    surface[on_plane] = raster.connected(across, radius_m)
    return surface


def _patch(
    points_m: Array,
    origin: Array,
    candidate: Candidate,
    found: tuple[Candidate, ...],
    target: DiscTarget,
    config: SegmentConfig,
    rng: np.random.Generator,
) -> Patch:
    """A candidate's surroundings with all points; its normal turned away from what lies behind."""
    face, around = gather_face(
        points_m,
        origin + candidate.centre_m,
        candidate.normal,
        Slab(1.8 * target.radius_m, candidate.band_m),
        Slab(1.25 * target.radius_m, MAX_DEPTH_M, BEAM_SLOPE),
        config.around_points / len(points_m),
        rng,
    )
    basis = plane_basis(candidate.normal)
    placed = raster.match_disc(face @ basis[:2].T, target.radius_m)
    shift = placed.centre_m @ basis[:2]
    depth = around @ basis[2].astype(np.float32)
    if np.count_nonzero(depth > 0.0) > np.count_nonzero(depth < 0.0):
        basis = basis * np.array([[1.0], [-1.0], [-1.0]])
    face -= shift
    around -= shift.astype(np.float32)
    in_scanner = tuple(Candidate(c.centre_m + origin, c.normal, c.match, c.band_m) for c in found)
    centre = origin + candidate.centre_m + shift
    return Patch(centre, face, around, placed.match, basis, in_scanner)


def _choose(
    patches: list[Patch], found: tuple[Candidate, ...], target: DiscTarget, config: SegmentConfig
) -> Patch:
    """The patch with the target's outline; an error when there is none, or another as good."""
    patches = sorted(patches, key=lambda patch: -patch.match)
    if not patches or patches[0].match < config.min_match:
        match = patches[0].match if patches else found[0].match
        raise NotMeasuredError(
            "no-target",
            f"no plane of those found ({len(found)}) has the outline of a disc of "
            f"{target.diameter * 1e3:.0f} mm (best match {match:.2f}, {config.min_match} needed)",
        )
    best, *others = patches
    for other in others:
        apart = float(np.linalg.norm(other.origin_m - best.origin_m))
        if other.match > config.rival_match * best.match and apart > target.radius_m:
            raise NotMeasuredError(
                "ambiguous-target",
                f"two planes have the target's outline, {apart * 1e3:.0f} mm apart "
                f"(matches {best.match:.2f} and {other.match:.2f})",
            )
    if len(best.face_m) < MIN_POINTS:
        raise NotMeasuredError(
            "too-few-points", f"{len(best.face_m)} points on the target, {MIN_POINTS} needed"
        )
    return best
