"""Stations whose scans of one target are merged into one cloud, by the order of its points.

A scanner passes a target once, line after line, and programs that merge clouds put one scan behind
the other. Of one scan the place of a point in the order is nearly a slope over the target, across
the lines; of several it is not. Where the order breaks into few parts of which each has a slope of
its own, these are the stations. Points in any other order, as shuffled or sorted ones, show their
stations by the grids of their beams (see beam_grids.py), or not at all.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..cloud import find_lattice, scattered
from ..plane import Patch
from ..targets import Region
from ..vectors import Array, Rows, in_axes
from .beam_grids import beam_grids, nearest_grid
from .layers import find_layers

BLOCKS = 64  # of points in their order, between which a break is looked for
POINTS, FOLLOWING_POINTS = 100_000, 20_000  # enough to see one; and whether they follow each other
LEAST_POINTS = 100  # of a station
SCANNED_ONCE = 0.06  # share of the variance of the order that no slope explains; one scan: 0.01
ALIKE, FOLLOWING = 0.4, 0.8  # of a step to the next point: how alike they are; their share
HEADED = 8  # points on, by which a line's direction shows in spite of noise along it
FOLLOWED = 3.0  # steps: points farther from where the next one should be begin another line
CLEAR_OF_EDGES = 0.1  # of the radius
MOST, MOST_PARTS = 6, 16  # stations; parts tried, of which some are joined again


def of_stations(patch: Patch, region: Region) -> list[Patch]:
    """Return the patch of each station that saw the target; of one, or where unknown, the patch.

    region: of the face, in the patch's axes.
    """
    after = patch.around_after
    if after is None:
        return [patch]
    uvw = in_axes(patch.basis, patch.face_m)
    rows = _some_of(np.flatnonzero(region.holds(uvw[:, :2])), POINTS)
    ordered = uvw[rows, :2] / region.radius_m
    one = _is_one_scan(ordered)
    if one and _follow_each_other(uvw, _some_of(rows, FOLLOWING_POINTS)):
        return [patch]
    if find_lattice(patch.face_m[rows], patch.steps.axes, patch.basis[2]):
        return [patch]  # voxels are sorted by layers, of which each is passed once
    breaks = [] if one else _breaks(ordered)
    parts = _by_order(patch, rows, after, breaks) if breaks else _by_grids(patch, rows)
    parts = parts or _by_layers(patch, rows, region)
    return [_at_its_height(part, region) for part in parts] or [patch]


def _some_of(rows: Rows, most: int) -> Rows:
    """Return about `most` of ascending rows, or all if they are fewer, in their order."""
    if len(rows) <= most:
        return rows
    chosen = np.zeros(len(rows), bool)
    chosen[scattered(len(rows), most)] = True
    return rows[chosen]


def _by_order(patch: Patch, rows: Rows, after: Rows, breaks: list[int]) -> list[Patch]:
    """Return the patch of each station, of these rows of the face parted at the breaks."""
    face = [0, *(int(rows[at]) for at in breaks), len(patch.face_m)]
    # Behind a station's last point on the face, and before the first of the next, are both of them.
    last = [np.searchsorted(after, rows[at - 1], side="right") for at in breaks]
    first = [np.searchsorted(after, rows[at], side="right") for at in breaks]
    around = [0, *(int(a + b) // 2 for a, b in zip(last, first, strict=True)), len(patch.around_m)]
    pairs = zip(pairwise(face), pairwise(around), strict=True)
    return [patch.kept(slice(*on_face), slice(*beside)) for on_face, beside in pairs]


def _follow_each_other(uvw: Array, rows: Rows) -> bool:
    """Return whether most beams of points uvw (N, 3) meet the plane one step before the next.

    As along the lines of one scanner; not of scans that were sorted together. A height over the
    plane moves a point along its beam, whose slope is that of the steps over those of the heights.
    """
    here = uvw.T.take(rows, axis=1)
    ahead, headed = (
        uvw.T.take(np.minimum(rows + k, len(uvw) - 1), axis=1) - here for k in (1, HEADED)
    )
    along = np.linalg.eigh(headed[:2] @ headed[:2].T)[1][:, 1]
    ahead *= np.where(along @ headed[:2] < 0.0, -1.0, 1.0)
    uv, height = ahead[:2], ahead[2]
    step = np.median(uv, axis=1)[:, None]
    length = np.hypot(*step)
    near = np.hypot(*(uv - step)) < FOLLOWED * length
    slope = (uv - step)[:, near] @ height[near] / max(height[near] @ height[near], 1e-30)
    alike = np.hypot(*(uv - step - np.outer(slope, height))) < ALIKE * length
    return bool(np.mean(alike) > FOLLOWING)


def _by_grids(patch: Patch, rows: Rows) -> list[Patch]:
    """Return the patch of each station by the grids that these rows of the face show; else none."""
    around = patch.around_m @ patch.basis.T
    grids = beam_grids(patch.face_m[rows] @ patch.basis.T, around)
    if not grids:
        return []
    of_face = nearest_grid(grids, patch.face_m @ patch.basis.T)
    of_around = nearest_grid(grids, around)
    return [patch.kept(of_face == k, of_around == k) for k in range(len(grids))]


def _by_layers(patch: Patch, rows: Rows, region: Region) -> list[Patch]:
    """Return the patch of each layer that these rows of the face show; none of one layer.

    No layer shows which of the points around are its own: the one with the most points has them.
    """
    face = patch.face_m[rows] @ patch.basis.T
    clear = region.shrunk(CLEAR_OF_EDGES * region.radius_m).holds(face[:, :2])
    found = find_layers(face[clear], float(patch.steps.across(patch.basis[2])))
    if found is None:
        return []
    of = found.of(patch.face_m @ patch.basis.T)
    count = np.bincount(of)
    around = np.ones(len(patch.around_m), bool)
    most = int(np.argmax(count))
    return [patch.kept(of == k, around & (k == most)) for k in range(len(count))]


def _at_its_height(patch: Patch, region: Region) -> Patch:
    """Return the patch at the height of its own points: clipping starts from the layer there."""
    uvw = patch.face_m @ patch.basis.T
    height_m = float(np.median(uvw[region.holds(uvw[:, :2]), 2]))
    if abs(height_m) < patch.sigma_m:
        return patch
    placed = patch.placed(patch.origin_m + height_m * patch.basis[2], 0.0)
    return replace(placed, elsewhere=patch.elsewhere)


def _breaks(uv: Array) -> list[int]:
    """Return where the order of points uv (N, 2) breaks into few scans; nowhere if it does not."""
    parted = _parted(uv, MOST_PARTS)
    if parted is None:
        return []
    ends = [0, *parted, len(uv)]
    at = 1
    while at + 1 < len(ends):
        if _is_one_scan(uv[ends[at - 1] : ends[at + 1]]):
            del ends[at]
        else:
            at += 1
    return ends[1:-1] if len(ends) - 1 <= MOST else []


def _parted(uv: Array, most: int) -> list[int] | None:
    """Return breaks between parts of one scan each; None where that takes more than `most`."""
    if _is_one_scan(uv):
        return []
    if most < 2 or len(uv) < 2 * LEAST_POINTS:
        return None
    at = _best_break(uv)
    before = _parted(uv[:at], most - 1)
    behind = None if before is None else _parted(uv[at:], most - 1 - len(before))
    if before is None or behind is None:
        return None
    return [*before, at, *(at + row for row in behind)]


def _is_one_scan(uv: Array) -> bool:
    return bool(_unexplained(uv, np.zeros(0, np.int64))[0] < SCANNED_ONCE)


def _best_break(uv: Array) -> int:
    """Return the row at which two slopes leave the least."""
    first, last = LEAST_POINTS, len(uv) - LEAST_POINTS
    while True:
        edges = np.unique(np.linspace(first, last, BLOCKS).astype(np.int64))
        best = int(np.argmin(_unexplained(uv, edges)))
        if len(edges) > last - first:
            return int(edges[best])
        first, last = int(edges[max(best - 1, 0)]), int(edges[min(best + 1, len(edges) - 1)])


def _unexplained(uv: Array, edges: Rows) -> Array:
    """Return the share of the order's variance that slopes leave, uv (N, 2) parted at each edge.

    Mean of both parts by their points, of which each has places of its own. Without edges: (1,).
    """
    count = len(uv)
    place = np.arange(count) / count
    terms = np.column_stack([np.ones(count), uv, place]) / math.sqrt(count)
    starts = np.append(0, edges)
    sums = np.zeros((len(starts), 4, 4))
    for i, j in zip(*np.triu_indices(4), strict=True):
        summed = np.add.reduceat(terms[:, i] * terms[:, j], starts).cumsum()
        sums[:, i, j] = sums[:, j, i] = summed
    if not len(edges):
        return _left(sums)
    return _left(sums[:-1]) + _left(sums[-1] - sums[:-1])


def _left(sums: Array) -> Array:
    """Return what a slope leaves of the variance of the places, by that of as many, times these.

    (K,); sums: (K, 4, 4) of the products of 1, u, v and the place, by the number of all points.
    """
    n, along = sums[:, 0, 0], sums[:, :3, 3]
    known = sums[:, :3, :3] + 1e-9 * n[:, None, None] * np.eye(3)  # points of one line
    slopes = np.linalg.solve(known, along[..., None])[..., 0]
    left = sums[:, 3, 3] - np.einsum("ki,ki->k", along, slopes)
    return np.asarray(12.0 * left / n**2)
