"""Pull on a plane of the least distance between points to which a scan was thinned.

Programs that thin so (CloudCompare by Space, PDAL's sample filter) pass over the points in the
order of the file, and leave out each that lies within the distance of one kept before. Noise along
slanted beams moves points sideways, too: those that it moves away from the points kept before are
kept more often, and a plane through what is kept is off along its normal. Which parts of a beam lie
within the distance of an earlier point is known; nothing was kept there. So the noise of a kept
point is normal but for these parts, and the plane is that of the greatest likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

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
USED = 3.0  # standard deviations off the plane, up to which points are moved back
REACH = 4.5  # standard deviations of noise that are looked at
STEPS, WITHIN = 181, 10_000  # of the noise of a point; points at once
ITERATIONS = 8
TILTED = 16.0  # chi-square of two tilts: 3e-4 by chance


def evened(patch: Patch, plane: PlaneFit, scanner_m: Array, radius_m: float) -> Patch:
    """Return the patch without the pull of a least distance; the very same one where none shows.

    Points of the face within radius_m are moved along their beams from scanner_m (3,), so that
    plane and noise of least squares are those of the greatest likelihood.
    """
    points = in_axes(plane.basis, patch.face_m + (patch.origin_m - plane.centroid_m))
    scanner = plane.basis @ (scanner_m - plane.centroid_m)
    near = np.abs(points[:, 2]) < USED * plane.sigma_m
    place_m = np.array([PLACE * radius_m, 0.0, 0.0])
    some = _Beams.of(nearest(points[near] - place_m, LOOKED_AT) + place_m, scanner)
    if not some.are_spaced():
        return patch
    rows = np.flatnonzero(near & (np.hypot(points[:, 0], points[:, 1]) < radius_m))
    beams = _Beams.of(points[rows], scanner)
    distance_m = _least_distance_m(beams.points)
    likely_m = _likely_m(beams, _hindrances(beams, distance_m), plane.sigma_m)
    if likely_m is None:
        return patch
    face = patch.face_m.copy()
    face[rows] += ((likely_m - beams.off_m)[:, None] * beams.along) @ plane.basis
    return replace(patch, face_m=face, spaced_m=distance_m)


@dataclass(frozen=True)
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

    def are_spaced(self) -> bool:
        """Return whether the points keep a distance that their beams on the plane do not.

        Where neither lie on a regular grid, as beams do, or points that something else places.
        """
        if len(self.points) < LOOKED_AT:
            return False
        own_m, met_m = _apart_m(self.points), _apart_m(self.met_m)
        least_m = float(own_m.min())
        nearer = np.mean(met_m.min(axis=1) < NEARER * least_m) > NEARER_SHARE
        if not nearer or least_m < EVEN * float(np.median(own_m.min(axis=1))):
            return False
        flat = self.points * [1.0, 1.0, 0.0]
        return not any(_is_grid(at, least_m) for at in (flat, self.met_m))

    def passing(self, later: Rows, earlier: Rows) -> tuple[Array, Array]:
        """Return where beams (K,) pass other points (K,): how far before the plane, and aside."""
        apart = self.points[earlier] - self.met_m[later]
        before_m = np.sum(apart * self.along[later], axis=1)
        return before_m, np.sqrt(np.maximum(np.sum(apart**2, axis=1) - before_m**2, 0.0))


@dataclass(frozen=True)
class _Hindrances:
    """Parts of beams (K,) from low_m to high_m before the plane, in which nothing was kept."""

    beam: Rows
    low_m: Array
    high_m: Array


def _apart_m(points: Array) -> Array:
    """Return the distances (N, N) of points from each other, infinite from themselves."""
    apart_m = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(apart_m, np.inf)
    return np.asarray(apart_m)


def _is_grid(points: Array, least_m: float) -> bool:
    """Return whether points (N, 3) on a plane have others opposite those nearest to them."""
    middle = np.linalg.norm(points - points.mean(axis=0), axis=1)
    inner = middle < np.quantile(middle, INNER)
    across = 2.0 * points - points[np.argmin(_apart_m(points), axis=1)]
    beside_m = np.linalg.norm(across[inner, None] - points, axis=2).min(axis=1)
    return bool(np.mean(beside_m < BESIDE * least_m) > OPPOSITE)


def _least_distance_m(points: Array) -> float:
    from scipy.spatial import KDTree

    apart_m, _ = KDTree(points).query(points, k=2)
    return float(np.asarray(apart_m)[:, 1].min())


def _hindrances(beams: _Beams, distance_m: float) -> _Hindrances:
    """Return the parts of beams within the distance of an earlier point."""
    from scipy.spatial import KDTree

    farthest_m = np.abs(beams.off_m * np.hypot(beams.along[:, 0], beams.along[:, 1])).max()
    pairs = KDTree(beams.met_m).query_pairs(distance_m / beams.along[:, 2].min() + farthest_m)
    both = np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
    later, earlier = both.max(axis=1), both.min(axis=1)
    before_m, aside_m = beams.passing(later, earlier)
    near = aside_m < distance_m
    half_m = np.sqrt(distance_m**2 - aside_m[near] ** 2)
    return _Hindrances(later[near], before_m[near] - half_m, before_m[near] + half_m)


def _likely_m(beams: _Beams, hindrances: _Hindrances, sigma_m: float) -> Array | None:
    """Return how far before the plane points (N,) lie, without the pull.

    With w the noise of a kept point, m its mean and v its variance in the parts where it is kept,
    the likelihood of a plane is greatest where sum x (w - m) = 0. The noise that is left scatters
    less; it is widened again, as planes are no nearer to the truth for it. None where the plane
    would tilt: a least distance pulls alike all over a face, unless noise is not along these beams.
    """
    slopes = np.column_stack([np.ones(len(beams.off_m)), beams.met_m[:, :2]]) / beams.along[:, 2:]
    pose = np.zeros(3)
    for _ in range(ITERATIONS):
        height_m = slopes @ pose
        noise_m = beams.off_m - height_m
        mean_m, square_m2 = _moments(hindrances, height_m, sigma_m)
        share = (square_m2 - mean_m**2) / sigma_m**2
        pose = pose + np.linalg.solve((slopes.T * share) @ slopes, slopes.T @ (noise_m - mean_m))
        sigma_m *= float(np.sqrt(np.mean(noise_m**2) / np.mean(square_m2)))
    tilt, information = pose[1:], (slopes.T @ slopes / sigma_m**2)
    if tilt @ np.linalg.solve(np.linalg.inv(information)[1:, 1:], tilt) > TILTED:
        return None
    wider = np.sqrt(np.mean(noise_m**2) / np.mean((noise_m - mean_m) ** 2))
    return np.asarray(height_m + (noise_m - mean_m) * float(wider))


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
