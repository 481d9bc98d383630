"""Find all targets in the cloud of a whole vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..cloud import (
    EXACT,
    Slab,
    Steps,
    VoxelGrid,
    coordinate_steps,
    over_chunks,
    within_voxels,
)
from ..config import SegmentConfig
from ..plane import Patch
from ..targets import Target
from ..vectors import Array, Array32, Rows
from .candidates import REACH, Candidate, threshold_m
from .cut_patch import around_slab, cut_patch
from .find_target import LIKELY, SURE, candidate_near, score_near, voxels_of
from .hypotheses import Hypothesis, hypotheses, joined
from .surfels import find_surfels
from .vehicles import RIVAL, FoundTarget, vehicles

WHEELS = 4  # of a vehicle: where four sure targets are arranged as one, none is missing
FIFTH_SCORE = 0.8  # and only a position of such a score could be another
MOST_IN_CLOUD = 160  # candidate positions in the cloud of a vehicle
MOVED = 0.1  # of the radius: a candidate moved so far is scored again
ROUGHER = 3.0  # times the noise of sure targets
BESIDE, ROUGHER_BESIDE = 3.0, 1.4  # radii from a better target, and times its noise


def find_targets(
    points_m: Array,
    target: Target,
    config: SegmentConfig,
    intensity: Array32 | None = None,
    parts: Sequence[tuple[int, int]] = (),
    stations_m: Sequence[Array | None] = (),
    axes: Sequence[Array | None] = (),
    near_m: Sequence[Array] = (),
    seed: int = 0,
) -> tuple[Patch, ...]:
    """Find all targets in points_m (N, 3), the cloud of a vehicle; patches, best match first.

    intensity: (N,) or None. parts: row ranges of the scans that make up the cloud; each target is
    taken from the one with most points on it, since every scan has its own pose and noise.
    stations_m: (3,) each, positions of the scanner for the parts, None where unknown; axes: (3, 3)
    each, rows along which their coordinates were rounded. near_m: (3,) each, points chosen by the
    operator: then the target of each of them, in their order, with `seed` as in `find_target`.
    Raises NotMeasuredError where there is none at a chosen point.
    """
    parts = parts or [(0, len(points_m))]
    axes = axes or [None] * len(parts)
    steps = _coarsest(points_m, parts, axes)
    voxels = voxels_of(points_m, target)
    found = (
        [candidate_near(points_m, one, target, config, seed, steps) for one in near_m]
        if near_m
        else _targets(_scored(points_m, voxels, target, config, steps), target, config)
    )
    slab = around_slab(target)
    regions = [_voxels_within(voxels, c.centre_m, c.normal, slab) for c in found]
    rows = _rows(points_m, voxels, regions)
    del voxels  # as large as what follows
    near = points_m[rows]
    near_intensity = None if intensity is None else intensity[rows]
    bounds = np.searchsorted(rows, np.array(parts))
    patches = []
    for candidate in found:
        part = _best_part(near, bounds, candidate, target)
        start, stop = bounds[part]
        patch = cut_patch(
            near[start:stop],
            None if near_intensity is None else near_intensity[start:stop],
            candidate,
            target,
            config.around_points,
        )
        station_m = stations_m[part] if stations_m else None
        local = coordinate_steps(near[start:stop], patch.origin_m, axes[part])
        patches.append(replace(patch, part=part, station_m=station_m, steps=local))
    return tuple(patches)


def candidates_of_cloud(
    points_m: Array,
    target: Target,
    config: SegmentConfig,
    axes: Sequence[Array | None] = (),
    parts: Sequence[tuple[int, int]] = (),
) -> list[Candidate]:
    """Return all scored candidates of the cloud of a vehicle, best match first."""
    parts = parts or [(0, len(points_m))]
    steps = _coarsest(points_m, parts, axes or [None] * len(parts))
    found = _scored(points_m, voxels_of(points_m, target), target, config, steps)
    return sorted(found, key=lambda candidate: -candidate.match)


def _scored(
    points_m: Array, voxels: VoxelGrid, target: Target, config: SegmentConfig, steps: Steps
) -> list[Candidate]:
    """Return the scored candidates of the cloud; of targets in parts as well, if four lack."""
    limit = threshold_m(target, config, steps)
    surfels = find_surfels(voxels, limit, steps)
    positions = hypotheses(surfels, target)[:MOST_IN_CLOUD]
    scored = _score_all(points_m, voxels, positions, target, config, steps)
    if not _are_a_vehicle(_sure(scored, target, config)):
        positions = joined(positions, surfels, target, limit)
        scored += _score_all(points_m, voxels, positions, target, config, steps)
    return scored


def _coarsest(
    points_m: Array, parts: Sequence[tuple[int, int]], axes: Sequence[Array | None]
) -> Steps:
    """Return the coarsest steps of the parts' coordinates."""
    found = [
        coordinate_steps(points_m[start:stop], axes=own)
        for (start, stop), own in zip(parts, axes, strict=True)
    ]
    return max(found, key=lambda steps: float(steps.step_m.max()), default=EXACT)


def _score_all(
    points_m: Array,
    voxels: VoxelGrid,
    positions: list[Hypothesis],
    target: Target,
    config: SegmentConfig,
    steps: Steps,
) -> list[Candidate]:
    """Score candidate positions until a vehicle's targets are sure and no rival remains."""
    ball = Slab(REACH * target.radius_m, REACH * target.radius_m)
    balls = [_voxels_within(voxels, at.centre_m, at.normal, ball) for at in positions]
    rows = _rows(points_m, voxels, balls)
    near = np.empty((3, len(rows)))

    def fill(chunk: slice) -> None:
        near[:, chunk] = points_m[rows[chunk]].T

    over_chunks(fill, len(rows))
    found: list[Candidate] = []
    is_whole = False
    for at in positions:
        if at.score < FIFTH_SCORE and is_whole:
            break
        found.append(_score_in_cloud(near, at, target, config, steps))
        if found[-1].match > SURE:
            is_whole = _are_a_vehicle(_sure(found, target, config))
    return found


def _score_in_cloud(
    columns_m: Array,
    at: Candidate | Hypothesis,
    target: Target,
    config: SegmentConfig,
    steps: Steps,
) -> Candidate:
    """Score a candidate position by the points columns_m (3, N); again where that has moved it."""
    reach = REACH * target.radius_m
    found = score_near(_ball(columns_m, at.centre_m, reach), at, target, config, steps)
    moved = float(np.linalg.norm(found.centre_m - at.centre_m))
    if found.match < LIKELY * config.face_match or moved < MOVED * target.radius_m:
        return found
    again = score_near(_ball(columns_m, found.centre_m, reach), found, target, config, steps)
    return max(found, again, key=lambda candidate: candidate.match)


def _ball(columns_m: Array, centre_m: Array, reach_m: float) -> Array:
    """Return points (M, 3) of columns_m (3, N) within reach_m of a centre along each axis.

    Relative to the centre; one axis after the other, each over what the one before has left.
    """
    rows = np.nonzero(np.abs(columns_m[0] - centre_m[0]) < reach_m)[0]
    for axis in (1, 2):
        rows = rows[np.abs(columns_m[axis, rows] - centre_m[axis]) < reach_m]
    return np.asarray(columns_m[:, rows].T - centre_m)


def _targets(scored: list[Candidate], target: Target, config: SegmentConfig) -> list[Candidate]:
    """Return the candidates with the target's outline; only sure ones if they make a vehicle.

    A candidate that is not sure, and much rougher than those that are, is no target.
    """
    sure = _sure(scored, target, config)
    if _are_a_vehicle(sure):
        return sure
    roughest = ROUGHER * float(np.median([c.sigma_m for c in sure])) if sure else np.inf
    found = [
        c
        for c in scored
        if c.match > SURE or (c.match >= config.face_match and c.sigma_m <= roughest)
    ]
    return _apart(found, target, config)


def _sure(scored: list[Candidate], target: Target, config: SegmentConfig) -> list[Candidate]:
    return _apart([c for c in scored if c.match > SURE], target, config)


def _are_a_vehicle(found: list[Candidate]) -> bool:
    """Return whether any four are arranged as a vehicle's wheels, whatever their normals' signs.

    Other things may look like the target as well.
    """
    if len(found) < WHEELS:
        return False
    targets = [
        FoundTarget(c.centre_m, sign * c.normal, c.match) for c in found for sign in (1.0, -1.0)
    ]
    return bool(vehicles(targets, range(len(targets)), RIVAL))


def _apart(found: list[Candidate], target: Target, config: SegmentConfig) -> list[Candidate]:
    """Remove duplicates, best match first.

    Removed is what lies over a better candidate, overlaps a much better one, or lies beside it and
    is rougher as well. One that overlaps another as good is kept: both cannot be targets, which
    must be reported.
    """
    radius = target.radius_m

    def is_part_of(one: Candidate, better: Candidate) -> bool:
        apart_m = _apart_m(one, better)
        if apart_m < radius:
            return True
        reach = BESIDE if one.sigma_m > ROUGHER_BESIDE * better.sigma_m else 2.0
        return apart_m < reach * radius and one.match < config.rival_match * better.match

    kept: list[Candidate] = []
    for one in sorted(found, key=lambda candidate: -candidate.match):
        if not any(is_part_of(one, k) for k in kept):
            kept.append(one)
    return kept


def _apart_m(one: Candidate, other: Candidate) -> float:
    return float(np.linalg.norm(one.centre_m - other.centre_m))


def _rows(points_m: Array, voxels: VoxelGrid, chosen: Sequence[Rows]) -> Rows:
    """Return the rows of points_m (N, 3) in any of the chosen voxels, each (K,) rows of voxels."""
    if not chosen:
        return np.zeros(0, np.int64)
    return within_voxels(points_m, voxels, voxels.key[np.unique(np.concatenate(chosen))])


def _voxels_within(voxels: VoxelGrid, centre_m: Array, normal: Array, slab: Slab) -> Rows:
    """Return the voxels that may hold points of a slab about a centre, along a normal."""
    half = 0.9 * voxels.edge_m  # half the diagonal of a voxel
    wider = Slab(
        slab.reach_m + half * (1.0 + slab.slope),
        slab.depth_m + half,
        slab.slope,
        slab.most_m + half,
    )
    furthest = wider.depth_m + min(wider.reach_m + wider.slope * wider.depth_m, wider.most_m)
    start, stop = voxels.between(centre_m[0] - furthest, centre_m[0] + furthest)
    offset = voxels.middle_m[start:stop] - centre_m
    depth = np.abs(offset @ normal)
    square = np.einsum("ij,ij->i", offset, offset) - depth * depth
    return start + np.nonzero(wider.holds(square, depth))[0]


def _best_part(near: Array, bounds: Rows, candidate: Candidate, target: Target) -> int:
    """Return the part, rows start:stop of near (N, 3), with most points on a target."""
    counts = []
    for start, stop in bounds:
        offset = near[start:stop] - candidate.centre_m
        depth = np.abs(offset @ candidate.normal) < candidate.band_m
        on_target = target.region.holds(offset[depth] @ candidate.basis[:2].T)
        counts.append(int(np.count_nonzero(on_target)))
    return int(np.argmax(counts))
