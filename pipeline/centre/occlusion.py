"""Beams at a target beside what stands before it: there the footprint mixes the two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..cloud import load_opencv, sample
from ..plane import Patch
from ..system import frozen
from ..vectors import Array, Array32, Mask
from .edge.beam_direction import directions
from .target_view import TargetView

Points = npt.NDArray[Any]
Image = Array32

CLEAR_SIGMAS, CLEAR_M = 5.0, 0.002  # before the plane, from where a point lies on something else
CELL, UNSEEN = 2.5, 0.01  # of the spacing: cells of a target; share of them that may be empty
THINNED = 0.75  # of the target's points elsewhere: most where something hides some
PARTS = 3  # of the margin: cells in which beams are counted
FEW_BEAMS = 4  # one in so many of the target's own beams, by which strays before it are known
SHARE, LEAST = 0.15, 3  # of the beams within two margins, and points: fewer are strays
STEEPEST, LEAST_STEP = 1.2, 0.04  # slopes of the beams that are tried
TRIED, TRIED_M = 1000, 0.01  # points at first, and steps of their shadow
REFINED, FINEST_M = 20_000, 0.001  # the same at last
COVERED = 0.2  # of what is not seen: less is covered by chance
NEIGHBOURS = np.array([(a, b) for a in (0.0, -1.0, 1.0) for b in (0.0, -1.0, 1.0)])


@frozen
class Raster:
    """Square cells of a plane about its origin."""

    cell_m: float
    across: int

    @classmethod
    def of(cls, reach_m: float, cell_m: float) -> Raster:
        """Return the raster that reaches so far from the origin."""
        return cls(cell_m, 2 * math.ceil(reach_m / cell_m))

    @property
    def middles_m(self) -> Array:
        """Middles (cells, 2)."""
        ticks = (np.arange(self.across) + 0.5 - self.across / 2) * self.cell_m
        return np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)

    def counts(self, q_m: Points) -> Image:
        """Return the number of the points q_m (N, 2) in each cell (across, across)."""
        cells, within = self._cells(q_m)
        counts = np.bincount(cells[within], minlength=self.across**2)
        return counts.astype(np.float32).reshape(self.across, self.across)

    def weighted(self, sets_m: Sequence[Points], weights: tuple[float, ...]) -> Image:
        """Return the numbers of several sets of points in each cell, by their weights."""
        counts = [self.counts(q_m) for q_m in sets_m]
        return np.asarray(np.tensordot(np.array(weights, dtype=np.float32), counts, 1))

    def at(self, image: npt.NDArray[Any], q_m: Points) -> npt.NDArray[Any]:
        """Return the values (N,) of an image at q_m (N, 2), 0 outside."""
        cells, within = self._cells(q_m)
        return np.asarray(np.where(within, image.ravel()[cells], 0))

    def _cells(self, q_m: Points) -> tuple[npt.NDArray[np.int64], Mask]:
        places = q_m.T / self.cell_m
        places += self.across / 2
        column, row = np.floor(places, out=places)
        within = (np.minimum(column, row) >= 0) & (np.maximum(column, row) < self.across)
        return np.where(within, row * self.across + column, 0.0).astype(np.int64), within


@frozen(eq=False)
class Visibility:
    """Points of a target in cells of 2.5 times their spacing, counts (across, across).

    inside: (across, across) the cells on the target, clear of its edges. mean: of one with points.
    """

    raster: Raster
    counts: Image
    inside: Mask
    mean: float

    @classmethod
    def of(cls, view: TargetView, margin_m: float) -> Visibility:
        """Count the points of the target; margin_m: from its edges."""
        raster = Raster.of(view.target.radius_m, CELL * view.spacing_m)
        uvw, _ = view.parts
        on_plane = np.abs(uvw[:, 2]) < view.band_m
        counts = raster.counts(np.compress(on_plane, uvw[:, :2].T, axis=1).T)
        inside = view.target.region.shrunk(margin_m).holds(raster.middles_m).reshape(counts.shape)
        seen = counts[inside & (counts > 0)]
        return cls(raster, counts, inside, float(seen.mean()) if len(seen) else 1.0)

    @property
    def unseen(self) -> int:
        """Number of the target's cells without points; 0 where they are as few as by chance."""
        empty = int(np.count_nonzero(self.inside & (self.counts == 0)))
        return empty if empty > UNSEEN * np.count_nonzero(self.inside) else 0

    @property
    def gain(self) -> Array:
        """From 1 in cells of the target without points to -1 with as many as elsewhere; or 0."""
        return np.where(self.inside, 1.0 - 2.0 * np.minimum(self.counts / self.mean, 1.0), 0.0)

    def is_thinned(self, q_m: Points) -> bool:
        """Return whether the target is seen less at those of q_m (N, 2) on it than elsewhere."""
        on_target = q_m[self.raster.at(self.inside, q_m) > 0]
        at = self.raster.at(self.counts, on_target)
        return len(at) > 0 and float(at.mean()) < THINNED * self.mean


def scanner_by_shadow(view: TargetView, margin_m: float, distance_m: float) -> Array | None:
    """Return a position of the scanner (3,), scanner frame, from what hides a part of the target.

    From there, what lies on one side of the target covers what is not seen of it, and no more.
    None where all of it is in view, or where nothing covers the rest. distance_m: roughly.
    """
    target = Visibility.of(view, max(margin_m, view.spacing_m))
    most = COVERED * target.unseen * target.mean * view.patch.around_share
    beams = None
    for side in (1.0, -1.0) if most > 0.0 else ():
        before = np.concatenate(_before(view, side))
        covered, found = _shadowing(before, target, view.target.radius_m, side / distance_m)
        if covered > most:
            most, beams = covered, found
    if beams is None:
        return None
    basis = view.plane.basis
    return np.asarray(view.to_scanner(-beams[:2] / beams[2]) + basis[2] / beams[2])


def clear_of_occluders(view: TargetView, margin_m: float, scanner_m: Array) -> Patch:
    """Return the patch without the beams within a margin of those that met something before it.

    The very same patch where nothing hides a part of the target from scanner_m (3,); else the
    patch's normal points there.
    """
    patch, region = view.patch, view.target.region
    u, v, w = view.in_plane((scanner_m - patch.origin_m)[None])[0]
    beams, margin_m = np.array([-u, -v, 1.0]) / w, max(margin_m, view.spacing_m)
    front = [_carried(points, beams) for points in _before(view, np.sign(w))]
    touched = [q_m[region.shrunk(-margin_m).holds(q_m)] for q_m in front]
    if sum(len(q_m) for q_m in touched) < LEAST:
        return patch
    raster = Raster.of(view.target.radius_m + 3.0 * margin_m, margin_m / PARTS)
    face, around = view.parts
    weights, least = (patch.around_share, 1.0), LEAST * patch.around_share
    before = raster.weighted(front, weights)
    # Of what outnumbers strays already, all beams together leave no surface either.
    some = weights[0] * raster.counts(_carried(face[::FEW_BEAMS], beams))
    if not any(raster.at(_surface(before, some, least), q_m).any() for q_m in touched):
        return patch
    met = [_carried(uvw, beams) for uvw in (face, around)]
    surface = _surface(before, raster.weighted(met, weights), least)
    on_surface = np.concatenate([q_m[raster.at(surface, q_m) > 0] for q_m in front])
    if not Visibility.of(view, margin_m).is_thinned(on_surface):
        return patch
    beside = _dilated(surface)
    clear = patch.kept(*(raster.at(beside, q_m) == 0 for q_m in met))
    return clear if w > 0.0 else clear.turned_round()


def _before(view: TargetView, side: float) -> list[Points]:
    """Return the points of face and surroundings (N, 3) that lie clearly on one side, -1 or 1."""
    clear_m = max(CLEAR_SIGMAS * view.plane.sigma_m, CLEAR_M)
    return [np.compress(side * uvw[:, 2] > clear_m, uvw.T, axis=1).T for uvw in view.parts]


def _surface(before: Image, every: Image, least: float) -> Mask:
    """Return the cells where beams that met something before the target are no strays.

    before, every: number of such beams, and of all.
    """
    cv2 = load_opencv()
    side = (4 * PARTS + 1, 4 * PARTS + 1)
    about = [
        cv2.boxFilter(counts, -1, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
        for counts in (before, every)
    ]
    return np.asarray((before > 0.0) & (about[0] > SHARE * about[1]) & (about[0] >= least))


def _dilated(cells: Mask) -> Image:
    """Return the cells within a margin of some."""
    cv2 = load_opencv()
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * PARTS + 1, 2 * PARTS + 1))
    return np.asarray(cv2.dilate(cells.astype(np.float32), disc))


def _carried(uvw_m: Points, beams: Array) -> Points:
    """Return where the beams of points (N, 3) in plane coordinates meet the plane: (N, 2).

    beams: (3,) slopes per depth along u and v at the origin, and 1 / height of the scanner.
    """
    *uv, height = uvw_m.T
    left = np.maximum(1.0 - height * beams[2], 0.1)
    slopes = beams[:2]
    return np.stack([(at + height * slope) / left for at, slope in zip(uv, slopes, strict=True)]).T


def _shadowing(
    before: Points, target: Visibility, radius_m: float, inverse: float
) -> tuple[float, Array]:
    """Return the beams (3,) by which points before a target cover what is not seen, and no more.

    Also return how many do, less those where it is seen. inverse: 1 / height of the scanner.
    """
    reach_m = radius_m + STEEPEST * np.abs(before[:, 2])
    before = before[np.sum(before[:, :2] ** 2, axis=1) < reach_m**2]
    if len(before) == 0:
        return 0.0, np.array([0.0, 0.0, inverse])

    def most_covered(some: Points, tried: Array) -> tuple[float, Array]:
        beams = np.column_stack([tried, np.full(len(tried), inverse)])
        covered = [float(target.raster.at(gain, _carried(some, one)).sum()) for one in beams]
        best = int(np.argmax(covered))
        return covered[best] * len(before) / len(some), beams[best]

    height_m, gain = float(np.median(np.abs(before[:, 2]))), target.gain
    step = max(TRIED_M / height_m, LEAST_STEP)
    covered, beams = most_covered(sample(before, TRIED), directions(STEEPEST, step))
    some = sample(before, REFINED)
    while step * height_m > FINEST_M:
        step /= 2.0
        covered, beams = most_covered(some, beams[:2] + step * NEIGHBOURS)
    return covered, beams
