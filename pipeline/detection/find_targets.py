"""Find all faces of the target in the cloud of a whole vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..cloud import Slab, VoxelGrid, within_voxels
from ..config import SegmentConfig
from ..plane import Patch
from ..targets import Target
from ..vectors import Array, Array32, Rows
from .candidates import REACH, Candidate, threshold_m
from .cut_patch import around_slab, cut_patch
from .find_target import LIKELY, SURE, scored_again, voxels_of
from .hypotheses import Hypothesis, hypotheses, joined
from .surfels import find_surfels
from .vehicles import RIVAL, FoundTarget, vehicles

WHEELS = 4  # of a vehicle: where so many sure faces stand as one, no half hidden one is missing
FIFTH_SCORE = 0.8  # and only a place as clear as theirs could be another
MOST_IN_CLOUD = 160  # in the cloud of a vehicle
MOVED = 0.1  # of the radius: a place so far off is looked at again
ROUGHER = 3.0  # times the noise of sure faces
BESIDE, ROUGHER_BESIDE = 3.0, 1.4  # radii from a better face, and times its noise


def find_targets(
    points_m: Array,
    target: Target,
    config: SegmentConfig,
    intensity: Array32 | None = None,
    parts: Sequence[tuple[int, int]] = (),
    stations_m: Sequence[Array | None] = (),
) -> tuple[Patch, ...]:
    """Patches of all faces in points_m (N, 3), the cloud of a vehicle, best match first; or none.

    intensity: (N,) or None. parts: row ranges of the scans that the cloud is made of; each face is
    taken from the one that has most points on it, since every scan has its own place and noise.
    stations_m: (3,) each, where the parts were scanned from, None where that is not known.
    """
    voxels = voxels_of(points_m, target)
    surfels = find_surfels(voxels, threshold_m(target, config))
    places = hypotheses(surfels, target)[:MOST_IN_CLOUD]
    looked_at = _look(points_m, voxels, places, target, config)
    if not _are_a_vehicle(_sure(looked_at, target, config)):
        places = joined(places, surfels, target, threshold_m(target, config))
        looked_at += _look(points_m, voxels, places, target, config)
    found = _faces(looked_at, target, config)
    slab = around_slab(target)
    regions = [_voxels_within(voxels, c.centre_m, c.normal, slab) for c in found]
    rows = _rows(points_m, voxels, regions)
    near, shine = points_m[rows], None if intensity is None else intensity[rows]
    bounds = np.searchsorted(rows, np.array(parts or [(0, len(points_m))]))
    patches = []
    for candidate in found:
        part = _best_part(near, bounds, candidate, target)
        start, stop = bounds[part]
        patch = cut_patch(
            near[start:stop],
            None if shine is None else shine[start:stop],
            candidate,
            target,
            config.around_points,
        )
        station_m = stations_m[part] if stations_m else None
        patches.append(replace(patch, part=part, station_m=station_m))
    return tuple(patches)


def _look(
    points_m: Array,
    voxels: VoxelGrid,
    places: list[Hypothesis],
    target: Target,
    config: SegmentConfig,
) -> list[Candidate]:
    """The candidates at places of a cloud, until a vehicle's faces are sure and no rival left."""
    ball = Slab(REACH * target.radius_m, REACH * target.radius_m)
    balls = [_voxels_within(voxels, place.centre_m, place.normal, ball) for place in places]
    near = np.ascontiguousarray(points_m[_rows(points_m, voxels, balls)].T)
    found: list[Candidate] = []
    is_whole = False
    for place in places:
        if place.score < FIFTH_SCORE and is_whole:
            break
        found.append(_score_in_cloud(near, place, target, config))
        if found[-1].match > SURE:
            is_whole = _are_a_vehicle(_sure(found, target, config))
    return found


def _score_in_cloud(
    columns_m: Array, place: Candidate | Hypothesis, target: Target, config: SegmentConfig
) -> Candidate:
    """The candidate at a place by the points columns_m (3, N), and again where that has put it."""
    reach = REACH * target.radius_m
    found = scored_again(_ball(columns_m, place.centre_m, reach), place, target, config)
    moved = float(np.linalg.norm(found.centre_m - place.centre_m))
    if found.match < LIKELY * config.face_match or moved < MOVED * target.radius_m:
        return found
    again = scored_again(_ball(columns_m, found.centre_m, reach), found, target, config)
    return max(found, again, key=lambda candidate: candidate.match)


def _ball(columns_m: Array, centre_m: Array, reach_m: float) -> Array:
    """Points (M, 3) of columns_m (3, N) within reach_m of a centre along each axis, relative to it.

    One axis after the other, each over what the one before has left.
    """
    rows = np.nonzero(np.abs(columns_m[0] - centre_m[0]) < reach_m)[0]
    for axis in (1, 2):
        rows = rows[np.abs(columns_m[axis, rows] - centre_m[axis]) < reach_m]
    return np.asarray(columns_m[:, rows].T - centre_m)


def _faces(looked_at: list[Candidate], target: Target, config: SegmentConfig) -> list[Candidate]:
    """Those that have the target's outline; where a vehicle's four have it clearly, only such.

    Nor is a face, unless it is sure itself, what is much rougher than those that are sure.
    """
    sure = _sure(looked_at, target, config)
    if _are_a_vehicle(sure):
        return sure
    roughest = ROUGHER * float(np.median([c.sigma_m for c in sure])) if sure else np.inf
    faces = [
        c
        for c in looked_at
        if c.match > SURE or (c.match >= config.face_match and c.sigma_m <= roughest)
    ]
    return _apart(faces, target, config)


def _sure(looked_at: list[Candidate], target: Target, config: SegmentConfig) -> list[Candidate]:
    return _apart([c for c in looked_at if c.match > SURE], target, config)


def _are_a_vehicle(found: list[Candidate]) -> bool:
    """Whether any four stand as a vehicle's wheels, whichever way their normals point: other things
    may look like the target as well.
    """
    if len(found) < WHEELS:
        return False
    faces = [
        FoundTarget(c.centre_m, sign * c.normal, c.match) for c in found for sign in (1.0, -1.0)
    ]
    return bool(vehicles(faces, range(len(faces)), RIVAL))


def _apart(found: list[Candidate], target: Target, config: SegmentConfig) -> list[Candidate]:
    """The candidates, best match first, less those that lie over a better one, overlap one much
    better, or lie beside it and are rougher as well. One that overlaps another as good is kept:
    both cannot be, and that must be told.
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
    """Rows of points_m (N, 3) in any of the cubes chosen, each (K,) rows of the cubes."""
    if not chosen:
        return np.zeros(0, np.int64)
    return within_voxels(points_m, voxels, voxels.key[np.unique(np.concatenate(chosen))])


def _voxels_within(voxels: VoxelGrid, centre_m: Array, normal: Array, slab: Slab) -> Rows:
    """Cubes that may hold points of a slab about a centre, along a normal."""
    half = 0.9 * voxels.edge_m  # half the diagonal of a cube
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
    """The part, rows start:stop of near (N, 3), with most points on a face."""
    counts = []
    for start, stop in bounds:
        offset = near[start:stop] - candidate.centre_m
        depth = np.abs(offset @ candidate.normal) < candidate.band_m
        on_face = target.region.holds(offset[depth] @ candidate.basis[:2].T)
        counts.append(int(np.count_nonzero(on_face)))
    return int(np.argmax(counts))
