"""Pull on a plane of the least distance between points to which a scan was thinned.

Programs that thin so (CloudCompare by Space, PDAL's sample filter) pass over the points in the
order of the file, and leave out each that lies within the distance of one kept before. Noise along
slanted beams moves points sideways, too: those that it moves away from the points kept before are
kept more often, and a plane through what is kept is off along its normal. Which parts of a beam lie
within the distance of an earlier point is known; nothing was kept there. So the noise of a kept
point is normal but for these parts, and by how much the plane is off follows. Points that do not
show the order in which they were thinned, nor that their noise is along these beams: what was
thinned otherwise looks the same, and is not off. So this is an uncertainty, not a correction.
"""

from __future__ import annotations

import math

import numpy as np

from ...system import frozen
from ...vectors import Array, Rows, in_axes
from ..fit_plane import PlaneFit
from ..patch import Patch
from ..scan_lines import nearest

LOOKED_AT = 200  # points by which a least distance is seen
# Least distance, of the middle one; by how much beams meet the plane nearer to each other; of them.
EVEN, NEARER, NEARER_SHARE = 0.7, 0.97, 0.1
# Points in the middle of these; how near others lie to where one opposite the nearest would be, of
# the least distance; share that has one: 0.67 and more on a grid, 0.1 to 0.4 elsewhere.
INNER, BESIDE, OPPOSITE = 0.6, 0.25, 0.5
PLACE = 0.75  # of the radius: where they lie, off the hole of a ring
WIDE = 1.5  # half of the width of a square that holds them, of the radius of as many
USED = 3.0  # standard deviations off the plane, up to which points are looked at
REACH = 4.5  # standard deviations of noise that are looked at
STEPS, WITHIN = 181, 10_000  # of the noise of a point; points at once
ITERATIONS = 8
STEPS_APART = 3.0  # steps of rounded coordinates, that a least distance is longer than
ENOUGH = 15_000  # points by which the pull is found


@frozen
class DistancePull:
    """Least distance between points, and by how much it may pull the plane along its normal.

    distance_m: between the points. pull_m: signed, towards the scanner, if they were thinned in the
    order of the file and their noise is along the beams.
    """

    distance_m: float
    pull_m: float


def distance_pull(
    patch: Patch, plane: PlaneFit, scanner_m: Array, radius_m: float
) -> DistancePull | None:
    """Return the pull on a plane of a least distance, by the points of its face within radius_m.

    scanner_m: (3,) where their beams come from. None where the points show no least distance.
    """
    scanner = plane.basis @ (scanner_m - plane.centroid_m)
    place_m = np.array([PLACE * radius_m, 0.0, 0.0])
    seen = plane.centroid_m + place_m @ plane.basis - patch.origin_m
    wide_m = WIDE * radius_m * math.sqrt(LOOKED_AT / max(len(patch.face_m), 1))
    beside = np.all([np.abs(patch.face_m[:, k] - seen[k]) < wide_m for k in range(3)], axis=0)
    points = _on_plane(patch.face_m[beside], patch, plane)
    if not _are_spaced(_Beams.of(nearest(points - place_m, LOOKED_AT) + place_m, scanner)):
        return None
    points = _on_plane(patch.face_m, patch, plane)
    points = points[np.hypot(points[:, 0], points[:, 1]) < radius_m]
    if len(points) > ENOUGH:  # a strip across the middle, in the order of the file
        points = points[np.sort(np.argpartition(np.abs(points[:, 1]), ENOUGH)[:ENOUGH])]
    beams = _Beams.of(points, scanner)
    distance_m = _least_distance_m(beams.points)
    if distance_m < STEPS_APART * float(patch.steps.step_m.max()):
        return None  # that of rounded coordinates
    height_m = _height_m(beams, _hindrances(beams, distance_m), plane.sigma_m)
    return DistancePull(distance_m, -height_m)


def _on_plane(face_m: Array, patch: Patch, plane: PlaneFit) -> Array:
    """Return points of a patch (N, 3) in the plane's coordinates, without those far off it."""
    points = in_axes(plane.basis, face_m) + plane.basis @ (patch.origin_m - plane.centroid_m)
    return np.asarray(points[np.abs(points[:, 2]) < USED * plane.sigma_m])


@frozen(eq=False)
class _Beams:
    """Beams of points (N, 3), in the plane's coordinates and the order of the file.

    along: (N, 3) unit vectors towards the scanner; off_m: (N,) of the points before the plane.
    """

    points: Array
    along: Array
    off_m: Array

    @classmethod
    def of(cls, points: Array, scanner: Array) -> _Beams:
        """Return the beams of points (N, 3) from a scanner (3,)."""
        along = scanner - points
        along /= np.linalg.norm(along, axis=1)[:, None]
        return cls(points, along, points[:, 2] / along[:, 2])

    @property
    def met_m(self) -> Array:
        """Where the beams meet the plane (N, 3)."""
        return self.points - self.off_m[:, None] * self.along

    def passing(self, later: Rows, earlier: Rows) -> tuple[Array, Array]:
        """Return where beams (K,) pass other points (K,): how far before the plane, and aside."""
        apart = self.points[earlier] - self.met_m[later]
        before_m = np.sum(apart * self.along[later], axis=1)
        return before_m, np.sqrt(np.maximum(np.sum(apart**2, axis=1) - before_m**2, 0.0))


@frozen(eq=False)
class _Hindrances:
    """Parts of beams (K,) from low_m to high_m before the plane, in which nothing was kept."""

    beam: Rows
    low_m: Array
    high_m: Array


def _are_spaced(beams: _Beams) -> bool:
    """Return whether the points keep a distance that they do not without their noise.

    Neither along the beams nor straight to the plane: what was laid out on the plane does. And
    where neither lie on a regular grid, as beams do, or points that something else places.
    """
    if len(beams.points) < LOOKED_AT:
        return False
    own_m = _apart_m(beams.points).min(axis=1)
    least_m = float(own_m.min())
    if least_m < EVEN * float(np.median(own_m)):
        return False
    for at in (beams.points * [1.0, 1.0, 0.0], beams.met_m):
        apart_m = _apart_m(at)
        nearer = np.mean(apart_m.min(axis=1) < NEARER * least_m)
        if nearer < NEARER_SHARE or _is_grid(at, apart_m, least_m):
            return False
    return True


def _apart_m(points: Array) -> Array:
    """Return the distances (N, N) of points from each other, infinite from themselves."""
    apart_m = _distances(points, points)
    np.fill_diagonal(apart_m, np.inf)
    return apart_m


def _distances(one: Array, other: Array) -> Array:
    """Return the distances (N, M) of points (N, 3) from others (M, 3)."""
    square = np.zeros((len(one), len(other)))
    for a, b in zip(one.T, other.T, strict=True):
        square += (a[:, None] - b) ** 2
    return np.sqrt(square)


def _is_grid(points: Array, apart_m: Array, least_m: float) -> bool:
    """Return whether points (N, 3) on a plane have others opposite those nearest to them."""
    middle = np.linalg.norm(points - points.mean(axis=0), axis=1)
    inner = middle < np.quantile(middle, INNER)
    across = 2.0 * points - points[np.argmin(apart_m, axis=1)]
    beside_m = _distances(across[inner], points).min(axis=1)
    return bool(np.mean(beside_m < BESIDE * least_m) > OPPOSITE)


def _least_distance_m(points: Array) -> float:
    from scipy.spatial import KDTree

    apart_m, _ = KDTree(points).query(points, k=2)
    return float(np.asarray(apart_m)[:, 1].min())


def _hindrances(beams: _Beams, distance_m: float) -> _Hindrances:
    """Return the parts of beams within the distance of an earlier point."""
    from scipy.spatial import KDTree

    farthest_m = np.abs(beams.off_m * np.hypot(beams.along[:, 0], beams.along[:, 1])).max()
    reach_m = distance_m / float(beams.along[:, 2].min()) + float(farthest_m)
    both = KDTree(beams.met_m).query_pairs(reach_m, output_type="ndarray")
    later, earlier = both.max(axis=1), both.min(axis=1)
    before_m, aside_m = beams.passing(later, earlier)
    near = aside_m < distance_m
    half_m = np.sqrt(distance_m**2 - aside_m[near] ** 2)
    return _Hindrances(later[near], before_m[near] - half_m, before_m[near] + half_m)


def _height_m(beams: _Beams, hindrances: _Hindrances, sigma_m: float) -> float:
    """Return the height of the plane of the greatest likelihood above that of least squares.

    With w the noise of a kept point and m its mean in the parts where it is kept, that is where
    sum (w - m) = 0.
    """
    slope = 1.0 / beams.along[:, 2]
    height_m = 0.0
    for _ in range(ITERATIONS):
        mean_m, square_m2 = _moments(hindrances, slope * height_m, sigma_m)
        share = (square_m2 - mean_m**2) / sigma_m**2
        off_m = beams.off_m - slope * height_m - mean_m
        height_m += float(slope @ off_m / (slope @ (share * slope)))
    return height_m


def _moments(hindrances: _Hindrances, height_m: Array, sigma_m: float) -> tuple[Array, Array]:
    """Return mean and mean square (N,) of the noise of kept points on a plane at height_m (N,)."""
    mean, square = np.zeros(len(height_m)), np.full(len(height_m), sigma_m**2)
    noise = np.linspace(-REACH, REACH, STEPS) * sigma_m
    chance = np.exp(-((noise / sigma_m) ** 2) / 2.0)
    hindered, row = np.unique(hindrances.beam, return_inverse=True)
    low, high = (at - height_m[hindrances.beam] for at in (hindrances.low_m, hindrances.high_m))
    order = np.argsort(row, kind="stable")
    for start in range(0, len(hindered), WITHIN):
        here = hindered[start : start + WITHIN]
        mine = order[
            np.searchsorted(row[order], start) : np.searchsorted(row[order], start + WITHIN)
        ]
        kept = np.ones((len(here), STEPS), bool)
        lost = (noise > low[mine, None]) & (noise < high[mine, None])
        np.logical_and.at(kept, row[mine] - start, ~lost)
        weight = kept * chance
        total = np.maximum(weight.sum(axis=1), chance[0])
        mean[here], square[here] = weight @ noise / total, weight @ noise**2 / total
    return mean, square
