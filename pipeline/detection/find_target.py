"""Find the target's face in the scan of a wheel.

Small flat pieces hang together to surfaces; wherever a surface could hold the face, a plane is
fitted and the outline compared. Where that finds nothing clear, planes are sought by RANSAC, one
after the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..cloud import Slab, VoxelGrid, lowest, sample, surroundings, voxel_moments
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
from .hypotheses import EDGE_OF_RADIUS, Hypothesis, hypotheses, joined
from .surfels import Surfels, find_surfels

LIKELY = 0.6  # of the best match, or the least: a candidate that may turn out better
MOST_LOOKED_AT = 12  # places in one scan that are looked at
SPARSE = 1500  # points on a face, below which all points of the scan are looked at, not a sample
SURE, RIVAL_SCORE = 0.8, 0.6  # match of the best, and score below which nothing is its rival
CLEAR = 0.5  # match of the best candidate, below which planes are sought by RANSAC as well


def find_target(
    points_m: Array,
    target: Target,
    config: SegmentConfig,
    seed: int,
    intensity: Array32 | None = None,
) -> Patch:
    """Patch of points_m (N, 3) that shows the target; intensity: (N,) or None.

    Raises NotMeasuredError: 'too-few-points', 'no-plane', 'no-target' (with what was found
    instead) or 'ambiguous-target'.
    """
    found = find_candidates(points_m, target, config, seed)
    _check_best(found, target, config)
    return cut_patch(points_m, intensity, found[0], target, config.around_points)


def find_candidates(
    points_m: Array, target: Target, config: SegmentConfig, seed: int
) -> list[Candidate]:
    """Find every plane of points_m (N, 3) that may be the target, best match first.

    Raises NotMeasuredError 'too-few-points' or 'no-plane'.
    """
    if len(points_m) < MIN_POINTS:
        raise NotMeasuredError("too-few-points", f"{len(points_m)} points, {MIN_POINTS} needed")
    points = sample(points_m, config.subset_points)
    origin = np.median(points, axis=0)
    points -= origin
    found = _candidates(points, target, config, seed)
    if not found:
        raise NotMeasuredError("no-plane", "no plane stands out among the points")
    found = [replace(c, centre_m=c.centre_m + origin) for c in found]
    if len(points_m) > len(points):
        found = _look_closer(points_m, found, target, config)
    return found


def voxels_of(points_m: Array, target: Target) -> VoxelGrid:
    """Sums of points_m (N, 3) over cubes of a size that the target's face fills many of."""
    edge = EDGE_OF_RADIUS * target.radius_m
    return voxel_moments(points_m, lowest(points_m) - edge, edge)


def _candidates(points: Array, target: Target, config: SegmentConfig, seed: int) -> list[Candidate]:
    """Planes that may be the face, best match first."""
    limit = threshold_m(target, config)
    surfels = find_surfels(voxels_of(points, target), limit)
    found: list[Candidate] = []
    best = 0.0
    for places in _more_and_more(surfels, target, limit):
        for place in places[:MOST_LOOKED_AT]:
            if best > SURE and place.score < RIVAL_SCORE:
                break
            found.append(score_candidate(points, place.centre_m, place.normal, target, limit))
            best = max(best, found[-1].match)
        if best > SURE:
            break
    if best < CLEAR:
        found += ransac_candidates(points, target, config, np.random.default_rng(seed))
    return sorted(found, key=lambda candidate: -candidate.match)


def _more_and_more(surfels: Surfels, target: Target, limit_m: float) -> Iterator[list[Hypothesis]]:
    """Places of the face: those in clear view, then half hidden ones, then ones cut in parts."""
    yield hypotheses(surfels, target, RIVAL_SCORE)
    places = hypotheses(surfels, target)
    yield places
    yield joined(places, surfels, target, limit_m)


def _look_closer(
    points_m: Array, found: list[Candidate], target: Target, config: SegmentConfig
) -> list[Candidate]:
    """The candidates, those likely ones of few points judged again by all points of the scan."""
    bar = LIKELY * max(config.min_match, found[0].match)
    again = [
        _score_again(points_m, candidate, target, config)
        if candidate.match > bar and candidate.points < SPARSE
        else candidate
        for candidate in found
    ]
    return sorted(again, key=lambda candidate: -candidate.match)


def _score_again(
    points_m: Array, place: Candidate | Hypothesis, target: Target, config: SegmentConfig
) -> Candidate:
    """The candidate at a place by all of points_m (N, 3) about it."""
    ball = Slab(REACH * target.radius_m, REACH * target.radius_m)
    near = surroundings(points_m, place.centre_m, place.normal, ball, ball, 0.0).face_m
    return scored_again(near, place, target, config)


def scored_again(
    near: Array, place: Candidate | Hypothesis, target: Target, config: SegmentConfig
) -> Candidate:
    """The candidate at a place by points near (N, 3) relative to it."""
    near = sample(near, config.subset_points)
    found = score_candidate(near, np.zeros(3), place.normal, target, threshold_m(target, config))
    return replace(found, centre_m=found.centre_m + place.centre_m)


def _check_best(found: Sequence[Candidate], target: Target, config: SegmentConfig) -> None:
    """Raise where the first candidate has not the target's outline, or another has it as well."""
    best = found[0]
    if best.match < config.min_match:
        raise NotMeasuredError(
            "no-target",
            f"no plane of those found ({len(found)}) has the outline of {target.description} "
            f"(best match {best.match:.2f}, {config.min_match} needed)",
        )
    for other in found[1:]:
        apart = float(np.linalg.norm(other.centre_m - best.centre_m))
        if other.match > config.rival_match * best.match and apart > target.radius_m:
            raise NotMeasuredError(
                "ambiguous-target",
                f"two planes have the target's outline, {apart * 1e3:.0f} mm apart "
                f"(matches {best.match:.2f} and {other.match:.2f})",
            )
