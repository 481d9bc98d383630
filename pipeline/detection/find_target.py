"""Find the target in the scan of a wheel.

Surfels are joined to surfaces; at every candidate position on a surface a plane is fitted and the
outline scored. If no score is clear, planes are also searched by RANSAC, one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..cloud import (
    EXACT,
    Slab,
    Steps,
    VoxelGrid,
    coordinate_steps,
    sample,
    surroundings,
    voxels_without_strays,
)
from ..config import SegmentConfig
from ..errors import NotMeasuredError
from ..plane import Patch
from ..targets import Target
from ..vectors import Array, Array32
from .candidates import (
    MIN_POINTS,
    REACH,
    Candidate,
    ransac_candidates,
    score_candidate,
    threshold_m,
)
from .cut_patch import cut_patch
from .hypotheses import ALIGNED, EDGE_OF_RADIUS, SAME_DEPTH, Hypothesis, hypotheses, joined
from .surfels import Surfels, find_surfels

LIKELY = 0.6  # of the best match, or the least: a candidate that may prove better
MOST_SCORED = 12  # candidate positions of one scan that are scored
# Points whose cells are too coarse for the outline; how many times as many, and how many times less
# noise, a surface has beside what is none.
FEW, MANY_TIMES, SMOOTHER = 1200, 5, 5.0
NEXT_TO = 3.0  # radii within which a surface is scanned as densely as another
DOUBTED = 0.5  # of the match of such a one: what a surface needs to be its rival
BEHIND = 0.95  # of the best match: what a surface within a radius before or behind needs
SPARSE = 1500  # points on a target, below which all points of the scan are used, not a sample
SURE, RIVAL_SCORE = 0.8, 0.6  # match of the best, and score below which nothing rivals it
SEARCHED, LEAST_CHOSEN = 3.0, 0.1  # radii about a chosen point, and the match that is enough there
ALONG = 0.25  # what a chosen point's distance along a plane counts, of that across
CLEAR = 0.5  # match of the best candidate, below which RANSAC is used as well


def find_target(
    points_m: Array,
    target: Target,
    config: SegmentConfig,
    seed: int,
    intensity: Array32 | None = None,
    axes: Array | None = None,
    near_m: Array | None = None,
) -> Patch:
    """Find the target in points_m (N, 3) and cut its patch; intensity: (N,) or None.

    axes: (3, 3) rows along which the coordinates were rounded, where a pose was applied since.
    near_m: (3,) a point on the target, chosen by the operator (see `candidate_near`).
    Raises NotMeasuredError: 'too-few-points', 'no-plane', 'no-target' (with the best match) or
    'ambiguous-target'.
    """
    steps = coordinate_steps(points_m, axes=axes)
    if near_m is None:
        found = find_candidates(points_m, target, config, seed, steps)
        check_best(found, target, config)
        best = found[0]
    else:
        best = candidate_near(points_m, near_m, target, config, seed, steps)
    return patch_of(points_m, best, target, config, intensity, axes)


def patch_of(
    points_m: Array,
    candidate: Candidate,
    target: Target,
    config: SegmentConfig,
    intensity: Array32 | None = None,
    axes: Array | None = None,
) -> Patch:
    """Cut a candidate's patch out of the scan, each point once, with the steps of its coordinates.

    Raises NotMeasuredError 'too-few-points'.
    """
    patch = cut_patch(points_m, intensity, candidate, target, config.around_points)
    return replace(patch, steps=coordinate_steps(points_m, patch.origin_m, axes)).each_once


def candidate_near(
    points_m: Array,
    near_m: Array,
    target: Target,
    config: SegmentConfig,
    seed: int,
    steps: Steps = EXACT,
) -> Candidate:
    """Return the candidate of points_m (N, 3) that is meant by near_m, within a radius of it.

    Of each surface it is the best one, and of surfaces the nearest, unless it matches much worse:
    what hides a target may match as well as what is left of it. Others are no rivals, and a match
    of LEAST_CHOSEN is enough: a person has looked at it.
    Raises NotMeasuredError 'too-few-points', 'no-plane' or 'no-target'.
    """
    reach_m = SEARCHED * target.radius_m
    x, y, z = reach_m > np.abs(points_m - near_m).T
    around = points_m[x & y & z]
    place = ", ".join(f"{x:.3f}" for x in near_m + 0.0)
    if len(around) < MIN_POINTS:
        raise NotMeasuredError(
            "too-few-points",
            f"{len(around)} points within {reach_m:.2f} m of the chosen point ({place}) m, "
            f"{MIN_POINTS} needed",
        )
    found = [
        candidate
        for candidate in find_candidates(around, target, config, seed, steps)
        if float(np.linalg.norm(candidate.centre_m - near_m)) < target.radius_m
    ]
    match = found[0].match if found else 0.0
    if match < LEAST_CHOSEN:
        raise NotMeasuredError(
            "no-target",
            f"no plane within {target.radius_m * 1e3:.0f} mm of the chosen point ({place}) m has "
            f"the outline of {target.description} (best match {match:.2f}, {LEAST_CHOSEN} needed)",
        )
    likely = [one for one in found if one.match > DOUBTED * match]
    return min(best_of_surfaces(likely, target.radius_m), key=lambda one: _off(one, near_m))


def _off(one: Candidate, near_m: Array) -> float:
    """Return the distance of a point from a candidate: most of it across its plane.

    A point anywhere on the target lies in its plane, and of one that is half hidden, the centre is
    found to some centimetres only.
    """
    u, v, depth = one.basis @ (near_m - one.centre_m)
    return math.hypot(ALONG * u, ALONG * v, depth)


def best_of_surfaces(found: Sequence[Candidate], radius_m: float) -> list[Candidate]:
    """Return the first of the candidates, best match first, on each surface."""
    kept: list[Candidate] = []
    for one in found:
        if not any(on_one_surface(one, better, radius_m) for better in kept):
            kept.append(one)
    return kept


def on_one_surface(one: Candidate, other: Candidate, radius_m: float) -> bool:
    """Return whether two candidates lie in one plane."""
    aligned = abs(float(one.normal @ other.normal)) > ALIGNED
    depth_m = abs(float((one.centre_m - other.centre_m) @ other.normal))
    return aligned and depth_m < SAME_DEPTH * radius_m


def find_candidates(
    points_m: Array, target: Target, config: SegmentConfig, seed: int, steps: Steps = EXACT
) -> list[Candidate]:
    """Find all planes of points_m (N, 3) that may be the target, best match first.

    steps: of the coordinates.

    Raises NotMeasuredError 'too-few-points' or 'no-plane'.
    """
    if len(points_m) < MIN_POINTS:
        raise NotMeasuredError("too-few-points", f"{len(points_m)} points, {MIN_POINTS} needed")
    points = sample(points_m, config.subset_points)
    if len(points) < MIN_POINTS:
        raise NotMeasuredError(
            "too-few-points",
            f"its {len(points_m)} points lie at so few places that a sample of "
            f"{config.subset_points} holds {len(points)}, {MIN_POINTS} needed",
        )
    origin = np.median(points, axis=0)
    points -= origin
    found = _candidates(points, target, config, seed, steps)
    if not found:
        raise NotMeasuredError("no-plane", "no plane stands out among the points")
    found = [replace(c, centre_m=c.centre_m + origin) for c in found]
    if len(points_m) > len(points):
        found = _rescore_sparse(points_m, found, target, config, steps)
    return [one for one in found if not _is_scrap(one, found, target, config)]


def _is_scrap(
    one: Candidate, found: Sequence[Candidate], target: Target, config: SegmentConfig
) -> bool:
    """Return whether one of several likely candidates is no surface beside another.

    What is farther from it, as the next wheel's target, has fewer points for its distance: then the
    other has to match nearly as well.
    """

    def share(other: Candidate) -> float:
        apart_m = float(np.linalg.norm(other.centre_m - one.centre_m))
        return LIKELY if apart_m < NEXT_TO * target.radius_m else config.rival_match

    return any(other.match > share(other) * one.match and _is_thin(one, other) for other in found)


def _is_thin(one: Candidate, other: Candidate) -> bool:
    """Return whether a candidate has few points, or much noise, beside another.

    A target is scanned about as densely and smoothly as what is beside it. Few points match
    anything, and so does what lies about a plane without being one, as mixed pixels do along a
    straight edge before a target: in all planes through it and the scanner.
    """
    sparse = one.points < FEW and other.points > MANY_TIMES * one.points
    rough = other.points > one.points and one.sigma_m > SMOOTHER * other.sigma_m
    return sparse or rough


def voxels_of(points_m: Array, target: Target) -> VoxelGrid:
    """Return the sums of points_m (N, 3) over voxels of a quarter of the target's radius."""
    return voxels_without_strays(points_m, EDGE_OF_RADIUS * target.radius_m)


def _candidates(
    points: Array, target: Target, config: SegmentConfig, seed: int, steps: Steps
) -> list[Candidate]:
    """Return the planes that may be the target, best match first."""
    limit = threshold_m(target, config, steps)
    surfels = find_surfels(voxels_of(points, target), limit, steps)
    found: list[Candidate] = []
    best = 0.0
    for stage in _stages(surfels, target, limit):
        for position in stage[:MOST_SCORED]:
            if best > SURE and position.score < RIVAL_SCORE:
                break
            centre, normal = position.centre_m, position.normal
            found.append(score_candidate(points, centre, normal, target, limit, steps))
            best = max(best, found[-1].match)
        if best > SURE:
            break
    if best < CLEAR:
        found += ransac_candidates(points, target, config, np.random.default_rng(seed), steps)
    return sorted(found, key=lambda candidate: -candidate.match)


def _stages(surfels: Surfels, target: Target, limit_m: float) -> Iterator[list[Hypothesis]]:
    """Yield candidate positions: in clear view, then partly hidden ones, then ones in parts."""
    yield hypotheses(surfels, target, RIVAL_SCORE)
    positions = hypotheses(surfels, target)
    yield positions
    yield joined(positions, surfels, target, limit_m)


def _rescore_sparse(
    points_m: Array,
    found: list[Candidate],
    target: Target,
    config: SegmentConfig,
    steps: Steps,
) -> list[Candidate]:
    """Score the likely candidates of few points again, by all points of the scan."""
    bar = LIKELY * max(config.min_match, found[0].match)
    again = [
        _score_again(points_m, candidate, target, config, steps)
        if candidate.match > bar and candidate.points < SPARSE
        else candidate
        for candidate in found
    ]
    return sorted(again, key=lambda candidate: -candidate.match)


def _score_again(
    points_m: Array,
    at: Candidate | Hypothesis,
    target: Target,
    config: SegmentConfig,
    steps: Steps,
) -> Candidate:
    """Score the candidate at a position by all of points_m (N, 3) about it."""
    ball = Slab(REACH * target.radius_m, REACH * target.radius_m)
    near = surroundings(points_m, at.centre_m, at.normal, ball, ball, 0).face_m
    return score_near(near, at, target, config, steps)


def score_near(
    near: Array,
    at: Candidate | Hypothesis,
    target: Target,
    config: SegmentConfig,
    steps: Steps = EXACT,
) -> Candidate:
    """Score the candidate at a position by the points near (N, 3) relative to it."""
    near = sample(near, config.subset_points)
    limit = threshold_m(target, config, steps)
    found = score_candidate(near, np.zeros(3), at.normal, target, limit, steps)
    return replace(found, centre_m=found.centre_m + at.centre_m)


def check_best(found: Sequence[Candidate], target: Target, config: SegmentConfig) -> None:
    """Raise NotMeasuredError unless the first candidate, and no other, has the target's outline."""
    best = found[0]
    if best.match < config.min_match:
        raise NotMeasuredError(
            "no-target",
            f"no plane of those found ({len(found)}) has the outline of {target.description} "
            f"(best match {best.match:.2f}, {config.min_match} needed)",
        )
    for other in found[1:]:
        if rivals(best, other, target, config):
            apart = float(np.linalg.norm(other.centre_m - best.centre_m))
            raise NotMeasuredError(
                "ambiguous-target",
                f"two planes have the target's outline, {apart * 1e3:.0f} mm apart "
                f"(matches {best.match:.2f} and {other.match:.2f})",
            )


def rivals(best: Candidate, other: Candidate, target: Target, config: SegmentConfig) -> bool:
    """Return whether another candidate matches nearly as well as the best, elsewhere.

    Or half as well, where the best is hardly a surface beside it. As well, where it lies before or
    behind the best: what a target leaves of the background beside it has its outline in part.
    """
    apart_m = float(np.linalg.norm(other.centre_m - best.centre_m))
    if apart_m < target.radius_m and on_one_surface(other, best, target.radius_m):
        return False
    share = config.rival_match if apart_m > target.radius_m else BEHIND
    if _is_thin(best, other):
        share = DOUBTED
    return other.match > share * best.match
