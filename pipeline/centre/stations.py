"""Stations whose scans of one target are merged into one cloud, by the order of its points.

A scanner passes a target once, line after line, and programs that merge clouds put one scan behind
the other. Of one scan the place of a point in the order is nearly a slope over the target, across
the lines; of several it is not. Where the order breaks into few parts of which each has a slope of
its own, these are the stations; of points in any other order nothing is said.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..cloud import find_lattice, scattered
from ..plane import Patch
from ..targets import Region
from ..vectors import Array, Rows

BLOCKS = 64  # of points in their order, between which a break is looked for
POINTS = 100_000  # enough to see one
LEAST_POINTS = 100  # of a station
SCANNED_ONCE = 0.06  # share of the variance of the order that no slope explains; one scan: 0.01
MOST, MOST_PARTS = 6, 16  # stations; parts tried, of which some are joined again


def of_stations(patch: Patch, region: Region) -> list[Patch]:
    """Return the patch of each station that saw the target; of one, or where unknown, the patch.

    region: of the face, in the patch's axes.
    """
    if patch.around_after is None:
        return [patch]
    uv = patch.face_m @ patch.basis[:2].T
    rows = np.flatnonzero(region.holds(uv))
    if len(rows) > POINTS:
        rows = rows[np.sort(scattered(len(rows), POINTS))]
    breaks = _breaks(uv[rows] / region.radius_m)
    if not breaks or find_lattice(patch.face_m[rows], patch.steps.axes, patch.basis[2]):
        return [patch]  # voxels are sorted by layers, of which each is passed once
    face = [0, *(int(rows[at]) for at in breaks), len(patch.face_m)]
    # Behind a station's last point on the face, and before the first of the next, are both of them.
    last = [np.searchsorted(patch.around_after, rows[at - 1], side="right") for at in breaks]
    first = [np.searchsorted(patch.around_after, rows[at], side="right") for at in breaks]
    around = [0, *(int(a + b) // 2 for a, b in zip(last, first, strict=True)), len(patch.around_m)]
    pairs = zip(pairwise(face), pairwise(around), strict=True)
    return [_part(patch, slice(*on_face), slice(*beside)) for on_face, beside in pairs]


def _part(patch: Patch, face: slice, around: slice) -> Patch:
    """Return the patch with these rows of its face and of the points around."""
    intensity = patch.face_intensity
    return replace(
        patch,
        face_m=patch.face_m[face],
        face_intensity=None if intensity is None else intensity[face],
        around_m=patch.around_m[around],
        around_after=None,
    )


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
