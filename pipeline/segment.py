"""Find the target's face in a scan: planes by RANSAC on a subset, told apart by size and shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline import raster
from pipeline.config import DiscTarget, SegmentConfig
from pipeline.errors import NotMeasuredError
from pipeline.kernels import (
    Array,
    Slab,
    gather_ball,
    gather_face,
    plane_basis,
    random_rows,
    total_least_squares,
    within_slab,
)
from pipeline.ransac import RansacOptions, ransac

FACE_BAND = 0.04  # of the radius: what may be the face before its noise is known
MAX_DEPTH_M = 0.4  # background further behind the face tells nothing more
BEAM_SLOPE = 1.0  # beams up to 45 degrees carry the background this far sideways per depth


@dataclass(frozen=True)
class Candidate:
    """A plane that was looked at, and how well its outline fits the target.

    centre_m, normal: (3,) scanner frame, normal's sign free. match: 1 for a whole target standing
    alone, the visible share for a hidden one, about 0 for a larger surface.
    points: of the searched subset, within reach of the target's size.
    """

    centre_m: Array
    normal: Array
    match: float
    points: int


@dataclass(frozen=True)
class Patch:
    """The surroundings of the target's face, before anything is fitted to it.

    origin_m: (3,) scanner frame, near the target's centre.
    face_m: (N, 3) all points within reach of the face's plane, relative to origin_m, scanner axes.
    around_m: (M, 3) float32, the same of other points around, thinned where there are many.
    basis: (3, 3) rows: two directions in the plane, then the normal that points to the scanner.
    candidates: every plane that was looked at, best match first.
    """

    origin_m: Array
    face_m: Array
    around_m: npt.NDArray[np.float32]
    basis: Array
    candidates: tuple[Candidate, ...]


def find_target(points_m: Array, target: DiscTarget, config: SegmentConfig, seed: int) -> Patch:
    """Patch of points_m (N, 3) that shows the target.

    Raises NotMeasuredError: 'too-few-points', 'no-plane', 'no-target' (with what was found
    instead) or 'ambiguous-target'.
    """
    rng = np.random.default_rng(seed)
    subset = random_rows(points_m, config.subset_points, rng)
    origin = np.median(subset, axis=0)
    subset -= origin
    found = _candidates(subset, target.radius_m, config, rng)
    del subset
    best = _choose(found, target, config)
    near, around = gather_face(
        points_m,
        origin + best.centre_m,
        best.normal,
        Slab(1.25 * target.radius_m, FACE_BAND * target.radius_m),
        Slab(1.25 * target.radius_m, MAX_DEPTH_M, BEAM_SLOPE),
        config.around_points / len(points_m),
        rng,
    )
    return _patch(near, around, origin, best, found, target)


def _candidates(
    subset: Array, radius_m: float, config: SegmentConfig, rng: np.random.Generator
) -> tuple[Candidate, ...]:
    """Planes one after the other, each taken out before the next is sought; best match first."""
    options = RansacOptions(max_proposals=config.max_proposals)
    threshold = config.threshold_of_diameter * 2.0 * radius_m
    search = subset[:: max(1, len(subset) // config.search_points)]
    found = []
    for _ in range(config.max_planes):
        if len(search) < config.min_support:
            break
        result = ransac(_LocalPlanes(search, radius_m, threshold), options, rng)
        if result is None or result.score < config.min_support:
            break
        point, normal = result.model[:3], result.model[3:]
        found.append(_shape_match(subset, point, normal, radius_m, threshold))
        search = search[~within_slab(search, point, normal, threshold)]
    return tuple(sorted(found, key=lambda candidate: -candidate.match))


def _shape_match(
    subset: Array, point: Array, normal: Array, radius_m: float, threshold: float
) -> Candidate:
    """Judge a plane's points within reach of a target by the outline that they fill."""
    basis = plane_basis(normal)
    near = gather_ball(subset, point, 2.6 * radius_m)
    near = near[np.abs(near @ normal) < threshold]
    placed = raster.match_disc(near @ basis[:2].T, radius_m)
    centre = point + placed.centre_m @ basis[:2]
    return Candidate(centre, normal, placed.match, len(near))


def _choose(found: tuple[Candidate, ...], target: DiscTarget, config: SegmentConfig) -> Candidate:
    if not found:
        raise NotMeasuredError("no-plane", "no plane stands out among the points")
    best, *others = found
    if best.match < config.min_match:
        raise NotMeasuredError(
            "no-target",
            f"none of the {len(found)} planes found has the outline of a disc of "
            f"{target.diameter * 1e3:.0f} mm (best match {best.match:.2f}, "
            f"{config.min_match} needed)",
        )
    for other in others:
        apart = float(np.linalg.norm(other.centre_m - best.centre_m))
        if other.match > config.rival_match * best.match and apart > target.radius_m:
            raise NotMeasuredError(
                "ambiguous-target",
                f"two planes have the target's outline, {apart * 1e3:.0f} mm apart "
                f"(matches {best.match:.2f} and {other.match:.2f})",
            )
    return best


def _patch(
    face: Array,
    around: npt.NDArray[np.float32],
    origin: Array,
    best: Candidate,
    found: tuple[Candidate, ...],
    target: DiscTarget,
) -> Patch:
    """Centre once more, at the full density, and turn the normal away from what lies behind."""
    basis = plane_basis(best.normal)
    placed = raster.match_disc(face @ basis[:2].T, target.radius_m)
    if placed.points < 30:
        raise NotMeasuredError("too-few-points", f"{placed.points} points on the target, 30 needed")
    shift = placed.centre_m @ basis[:2]
    depth = around @ basis[2].astype(np.float32)
    if np.count_nonzero(depth > 0.0) > np.count_nonzero(depth < 0.0):
        basis = basis * np.array([[1.0], [-1.0], [-1.0]])
    face -= shift
    around -= shift.astype(np.float32)
    in_scanner = tuple(Candidate(c.centre_m + origin, c.normal, c.match, c.points) for c in found)
    return Patch(origin + best.centre_m + shift, face, around, basis, in_scanner)


class _LocalPlanes:
    """Planes through three neighbouring points, scored within a target's reach of the first.

    A model is a row (6,): a point on the plane, its unit normal.
    """

    def __init__(self, points: Array, radius_m: float, threshold: float) -> None:
        order, self._start, self._count = _cells(points, radius_m)
        self._points = points[order]
        self._single = self._points.astype(np.float32)
        self._squares = np.einsum("ij,ij->i", self._single, self._single)
        self._reach = 1.2 * radius_m
        self._threshold = threshold

    def propose(self, count: int, rng: np.random.Generator) -> Sequence[Array]:
        seeds = rng.integers(len(self._points), size=count)
        size, start = self._count[seeds], self._start[seeds]
        second, third = (self._points[start + (rng.random(count) * size).astype(int)] for _ in "bc")
        first = self._points[seeds]
        normal = np.cross(second - first, third - first)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
        return list(np.hstack([first, normal]))

    def score(self, models: Sequence[Array]) -> npt.NDArray[np.float64]:
        """Sum over the points in reach of 1 - (distance / threshold)^2, where positive (MSAC)."""
        rows = np.asarray(models, dtype=np.float32)
        point, normal = rows[:, :3], rows[:, 3:]
        score = self._single @ normal.T
        score -= np.einsum("ij,ij->i", point, normal)
        score *= score
        score *= np.float32(-1.0 / self._threshold**2)
        score += 1.0
        square = self._single @ (-2.0 * point.T)
        square += self._squares[:, None]
        reach = np.float32(self._reach**2) - np.einsum("ij,ij->i", point, point)
        score[(square > reach) | (score < 0.0)] = 0.0
        total = score.sum(axis=0, dtype=np.float64)
        return np.where(np.abs(normal).sum(axis=1) > 0.0, total, 0.0)

    def refine(self, model: Array) -> Array:
        for share in (1.0, 0.5):
            near = gather_ball(self._points, model[:3], self._reach)
            near = near[np.abs(near @ model[3:]) < share * self._threshold]
            if len(near) < 3:
                return model
            plane = total_least_squares(near)
            model = np.concatenate([model[:3] + plane.centroid_m, plane.normal])
        return model

    def success_rate(self, model: Array) -> float:
        """Share of the points on the plane, times the chance of two good neighbours (1/4)."""
        near = gather_ball(self._points, model[:3], self._reach)
        on_plane = np.count_nonzero(np.abs(near @ model[3:]) < self._threshold)
        return 0.25 * on_plane / len(self._points)


def _cells(
    points: Array, size: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Sort points (N, 3) into cubes of edge `size`: order; start and count of each row's cube."""
    index = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    key = (index[:, 0] << 42) + (index[:, 1] << 21) + index[:, 2]
    order = np.argsort(key, kind="stable")
    _, start, inverse, count = np.unique(
        key[order], return_index=True, return_inverse=True, return_counts=True
    )
    return order, start[inverse], count[inverse]
