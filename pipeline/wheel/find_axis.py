"""Rough axis of the wheel in a scan, from the normals of small pieces of its surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..cloud import sample, voxels_without_strays
from ..detection import planes_of
from ..errors import NotMeasuredError
from ..system import frozen
from ..vectors import Array, plane_basis
from .normal_lines import Axis, axis_of_normals

SAMPLE = 150_000
EDGES_M = (0.016, 0.024, 0.036, 0.054)  # of the voxels: the first whose normals are good enough
LEAST_IN_VOXEL = 8
FLAT = 0.75  # spread across a piece of surface over that along it
ROUGH = 0.5  # of the pieces that are flat: fewer are no surface's, however many points there are
TILT_RAD, SHARE = 0.08, 0.6  # standard uncertainty of a normal; of the pieces that have it
LEAST_PIECES, LEAST_MET = 60, 12
MODES, MODE_RAD, APART_RAD = 8, np.radians(6.0), np.radians(11.0)
COMPARED = 700  # pieces by which the modes of the normals are found
SLANT = (np.cos(np.radians(75.0)), np.cos(np.radians(12.0)))
RADII_M = (0.10, 0.48)  # of a wheel's surfaces
GRID_M = 0.02
HALF_DEPTH_M = 0.2
SECTORS, LEAST_SECTORS = 16, 9
SAME_RAD, SAME_M = np.radians(0.5), 0.005  # of two axes that are one
APART_M, RIVAL = 0.35, 0.5  # from the best place, and of its score: another wheel


@frozen(eq=False)
class Pieces:
    """Small pieces of surface: centroid_m, normal (S, 3), count (S,) of points."""

    centroid_m: Array
    normal: Array
    count: Array


@frozen
class RoughAxis:
    """An axis, its score and the largest radius of surfaces that slope towards or away from it.

    circle: share of the sectors about it in which they are.
    """

    axis: Axis
    score: float
    radius_m: float
    circle: float

    def agrees(self, other: RoughAxis) -> bool:
        """Return whether another start has led to the same axis."""
        alike = abs(float(self.axis.direction @ other.axis.direction)) > np.cos(SAME_RAD)
        return alike and self.aside_m(other.axis.point_m) < SAME_M

    def aside_m(self, point_m: Array) -> float:
        """Return the distance of a point (3,) from the axis."""
        apart = point_m - self.axis.point_m
        return float(np.linalg.norm(apart - (apart @ self.axis.direction) * self.axis.direction))


def find_axis(points_m: Array, near_m: Array | None = None) -> RoughAxis:
    """Find the axis of the wheel in points_m (N, 3).

    near_m: (3,) a point on the wheel, chosen by the operator: of several, that about it.
    Its direction is near that of many normals: of the side wall, the spokes, the door. Lines of
    sloping normals, seen along it, meet in its centre. The best of these places is refined by the
    linear complex of the normals. Raises NotMeasuredError 'too-few-points', 'wheel-not-found' or
    'ambiguous-target'.
    """
    if len(points_m) < LEAST_IN_VOXEL * LEAST_PIECES:
        raise NotMeasuredError("too-few-points", f"{len(points_m)} points show no wheel's surface")
    points = sample(points_m, SAMPLE)
    if len(points) < LEAST_IN_VOXEL * LEAST_PIECES:
        raise NotMeasuredError(
            "too-few-points", f"its {len(points_m)} points lie at too few places for a wheel"
        )
    origin = np.median(points, axis=0)
    pieces = _pieces(points - origin)
    found: list[RoughAxis] = []
    for mode in _modes(pieces):
        new = _at_direction(pieces, mode)
        known = [any(one.agrees(other) for other in found) for one in new]
        found += [one for one, seen in zip(new, known, strict=True) if not seen]
        if any(known):
            break
    if near_m is not None:
        found = _about(near_m - origin, found)
    best = max(found, key=lambda one: one.score, default=None)
    if best is None:
        at = "" if near_m is None else " about the chosen point"
        raise NotMeasuredError(
            "wheel-not-found", f"no surface of revolution of a wheel's size is in it{at}"
        )
    _check_alone(best, found)
    axis = Axis(best.axis.point_m + origin, best.axis.direction)
    return replace(best, axis=axis)


def _pieces(points_m: Array) -> Pieces:
    """Return the pieces in the smallest voxels in which most normals are certain."""
    for edge in EDGES_M:
        voxels = voxels_without_strays(points_m, edge)
        row = np.nonzero(voxels.sums[:, 0] >= LEAST_IN_VOXEL)[0]
        if len(row) < LEAST_PIECES:
            continue
        count = voxels.sums[row, 0]
        centroid, normal, spread = planes_of(voxels.sums[row])
        flat = (spread[:, 0] < FLAT * spread[:, 1]) & (spread[:, 1] > 0.12 * edge)
        certain = flat & (spread[:, 0] < TILT_RAD * spread[:, 1] * np.sqrt(count))
        found = Pieces((centroid + voxels.middle_m[row])[certain], normal[certain], count[certain])
        if np.sum(found.count) > SHARE * len(points_m):
            break
    if len(row) < LEAST_PIECES or len(found.count) < LEAST_PIECES:
        if len(row) >= LEAST_PIECES and np.mean(flat) < ROUGH:
            raise NotMeasuredError(
                "wheel-not-found",
                f"its points lie on no smooth surface: of {len(row)} pieces of {edge * 1e3:.0f} mm "
                f"{np.count_nonzero(flat)} are flat",
            )
        raise NotMeasuredError("too-few-points", f"{len(points_m)} points show no wheel's surface")
    return found


def _modes(pieces: Pieces) -> list[Array]:
    """Return the directions (3,) that most normals are near, the commonest first."""
    normal = pieces.normal[:: max(1, len(pieces.normal) // COMPARED)]
    near = np.abs(normal @ normal.T) > np.cos(MODE_RAD)
    crowd = np.count_nonzero(near, axis=1)
    modes: list[Array] = []
    for index in np.argsort(-crowd, kind="stable"):
        if all(abs(float(normal[index] @ mode)) < np.cos(APART_RAD) for mode in modes):
            own = normal[near[index]]
            own = own * np.sign(own @ normal[index])[:, None]
            modes.append(own.sum(axis=0) / np.linalg.norm(own.sum(axis=0)))
        if len(modes) == MODES:
            break
    return modes


def _about(near_m: Array, found: list[RoughAxis]) -> list[RoughAxis]:
    """Return the best axis of the wheel nearest to a point (3,).

    It holds the point and is well seen; several of the axes found may be the same wheel's.
    """
    held = {index: one.aside_m(near_m) for index, one in enumerate(found)}
    held = {index: aside for index, aside in held.items() if aside < found[index].radius_m}
    seen = RIVAL * max((found[index].score for index in held), default=0.0)
    clear = [index for index in held if found[index].score > seen]
    if not clear:
        return []
    nearest = found[min(clear, key=held.__getitem__)]
    same = [found[i] for i in clear if nearest.aside_m(found[i].axis.point_m) < 0.5 * APART_M]
    return [max(same, key=lambda one: one.score)]


def _check_alone(best: RoughAxis, found: list[RoughAxis]) -> None:
    """Raise NotMeasuredError 'ambiguous-target' where another wheel is as well seen."""
    for other in found:
        aside = best.aside_m(other.axis.point_m)
        if aside > APART_M and other.score > RIVAL * best.score:
            raise NotMeasuredError(
                "ambiguous-target", f"two wheels are in the scan, {aside:.2f} m apart"
            )


def _at_direction(pieces: Pieces, direction: Array) -> list[RoughAxis]:
    """Return the two best axes of about that direction; fewer where nothing is round about them."""
    basis = plane_basis(direction)
    slope = np.abs(pieces.normal @ direction)
    own = (slope > SLANT[0]) & (slope < SLANT[1])
    if np.count_nonzero(own) < LEAST_MET:
        return []
    place, line = pieces.centroid_m[own] @ basis.T, pieces.normal[own] @ basis[:2].T
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    level = float(np.median(place[:, 2]))
    starts = (Axis(np.append(c, level) @ basis, direction) for c in _meetings(place[:, :2], line))
    found = (_refined(pieces, start) for start in starts)
    return [one for one in found if one is not None]


def _meetings(place: Array, line: Array) -> list[Array]:
    """Return the two places (2,) where most lines meet: a vote of each at a wheel's radii."""
    steps = np.arange(RADII_M[0], RADII_M[1], GRID_M)
    steps = np.concatenate([-steps, steps])
    votes = (place[:, None, :] + steps[:, None] * line[:, None, :]).reshape(-1, 2)
    low = votes.min(axis=0) - GRID_M
    cell = ((votes - low) / GRID_M).astype(np.int64)
    width, height = (cell.max(axis=0) + 2).tolist()
    count = np.bincount(cell[:, 0] * height + cell[:, 1], minlength=width * height)
    smooth = _blurred(count.reshape(width, height).astype(float))
    best: list[Array] = []
    for _ in range(2):
        cell = np.array(np.unravel_index(int(np.argmax(smooth)), smooth.shape))
        best.append(low + (cell + 0.5) * GRID_M)
        start, stop = np.maximum(cell - round(APART_M / GRID_M), 0), cell + round(APART_M / GRID_M)
        smooth[start[0] : stop[0] + 1, start[1] : stop[1] + 1] = 0.0
    return best


def _blurred(votes: Array) -> Array:
    padded = np.pad(votes, 1)
    along = padded[:-2] + padded[1:-1] + padded[2:]
    return np.asarray(along[:, :-2] + along[:, 1:-1] + along[:, 2:])


def _refined(pieces: Pieces, start: Axis) -> RoughAxis | None:
    axis, radius = start, RADII_M[1]
    for _ in range(3):
        across, along = axis.cylindrical(pieces.centroid_m)
        distance = np.hypot(*across.T)
        slope = np.abs(pieces.normal @ axis.direction)
        own = (distance > RADII_M[0]) & (distance < radius) & (slope > SLANT[0])
        sloping = own & (slope < SLANT[1])
        if np.count_nonzero(sloping) < LEAST_MET:
            return None
        level = float(np.median(along[sloping]))
        own &= np.abs(along - level) < HALF_DEPTH_M
        if np.count_nonzero(own) < LEAST_MET:
            return None
        axis = axis_of_normals(
            pieces.centroid_m[own], pieces.normal[own], np.sqrt(pieces.count[own]), axis
        )
        axis = Axis(axis.point_m + level * axis.direction, axis.direction)
        met = own & (slope < SLANT[1]) & (_miss(pieces, axis) < GRID_M)
        if np.count_nonzero(met) < LEAST_MET:
            return None
        radius = float(np.quantile(distance[met], 0.97)) + GRID_M
    across, along = axis.cylindrical(pieces.centroid_m[met])
    turn = np.arctan2(across[:, 1], across[:, 0])
    filled = len(np.unique(((turn / (2.0 * np.pi) % 1.0) * SECTORS).astype(int)))
    if filled < LEAST_SECTORS:
        return None
    circle = filled / SECTORS
    return RoughAxis(axis, float(np.count_nonzero(met)) * circle, radius, circle)


def _miss(pieces: Pieces, axis: Axis) -> Array:
    """Return by how much (S,) each normal's line misses the axis, seen along it."""
    across, _ = axis.cylindrical(pieces.centroid_m)
    line = pieces.normal @ axis.basis[:2].T
    size = np.maximum(np.linalg.norm(line, axis=1), 1e-9)
    return np.asarray(np.abs(across[:, 0] * line[:, 1] - across[:, 1] * line[:, 0]) / size)
