"""Layers of a face: stations that disagree along its normal show so, whatever the order of points.

Of one scan the heights of a face's points over its plane have one mode. Of stations whose heights
differ by more than some three times their noise they have several, with valleys between; and where
the stations see the same parts of the face, points of all layers lie beside each other. A label or
another surface in front is a layer beside the face, not within it.
"""

from __future__ import annotations

import math

import numpy as np

from ..system import frozen
from ..vectors import Array, Rows

BINS, MOST_BINS = 50, 5000  # between the outer twentieths of the heights; between all
TAIL = 0.05
WINDOW = 5  # bins that are counted together
DEEP, BEYOND = 0.6, 5.0  # of the lower mode beside it, a valley at most; in standard deviations
# Standard deviations between mean and median of a layer: boundaries of voxels cut one mode in parts
# that are lopsided.
LOPSIDED = 0.12
LEAST_POINTS = 100
LEAST_SHARE = 0.05  # of the points: fewer are no layer
A_CELL = (3.0, 40.0)  # points, of which pairs are compared: neighbours, and others
MIXED = 0.15  # how far points beside each other are of one layer: 0 at random, 1 of parts of a face


@frozen(eq=False)
class Layers:
    """Layers of a face. plane: (3,) height and slopes; cuts_m: (K - 1,) between them, above it."""

    plane: Array
    cuts_m: Array

    def of(self, uvw_m: Array) -> Rows:
        """Return the index of the layer that each of points uvw_m (N, 3) belongs to."""
        return np.asarray(np.searchsorted(self.cuts_m, _above(self.plane, uvw_m)))


def find_layers(uvw_m: Array, finest_m: float) -> Layers | None:
    """Find the layers of points uvw_m (N, 3) of a face, clear of its edges; None of one alone.

    finest_m: what rounding spans.
    """
    if len(uvw_m) < LEAST_POINTS:
        return None
    terms = np.column_stack([np.ones(len(uvw_m)), uvw_m[:, :2]])
    plane = np.linalg.solve(terms.T @ terms, terms.T @ uvw_m[:, 2])
    found = Layers(plane, _valleys(_above(plane, uvw_m), finest_m))
    if len(found.cuts_m) == 0:
        return None
    of, count = found.of(uvw_m), len(found.cuts_m) + 1
    share = np.bincount(of, minlength=count) / len(of)
    if share.min() < LEAST_SHARE or alike(uvw_m[:, :2], of) > MIXED:
        return None
    height_m = _above(plane, uvw_m)
    each = [height_m[of == k] for k in range(count)]
    lopsided = [abs(np.mean(one) - np.median(one)) > LOPSIDED * np.std(one) for one in each]
    return None if any(lopsided) else found


def _above(plane: Array, uvw_m: Array) -> Array:
    return np.asarray(uvw_m[:, 2] - plane[0] - uvw_m[:, :2] @ plane[1:])


def _valleys(height_m: Array, finest_m: float) -> Array:
    """Return the heights of the valleys between the modes of heights (N,)."""
    low, high = np.quantile(height_m, [TAIL, 1.0 - TAIL])
    width = max((high - low) / BINS, np.ptp(height_m) / MOST_BINS, finest_m, 1e-12)
    place = np.floor((height_m - height_m.min()) / width).astype(np.int64)
    count = np.convolve(np.bincount(place), np.ones(WINDOW), "same")
    beside = np.minimum(np.maximum.accumulate(count), np.maximum.accumulate(count[::-1])[::-1])
    deep = count < DEEP * beside
    deep &= beside - count > BEYOND * np.sqrt(beside + count)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], deep, [False]])))
    bins = [(a + b) / 2 for a, b in zip(ends[::2], ends[1::2], strict=True)]
    return np.asarray(height_m.min() + width * np.array(bins))


def alike(uv_m: Array, of: Rows) -> float:
    """Return how far neighbours among points uv_m (N, 2) are of one layer, or grid, `of` (N,).

    1 where its points lie together, 0 where they lie at random among those somewhat farther away,
    less where they keep apart, as on a grid.
    """
    near, far = (_same(uv_m, of, points) for points in A_CELL)
    return (near - far) / (1.0 - far) if far < 1.0 else 1.0


def _same(uv_m: Array, of: Rows, a_cell: float) -> float:
    """Return the share of pairs of one kind among those in cells of so many points."""
    low, high = uv_m.min(axis=0), uv_m.max(axis=0)
    side_m = math.sqrt(a_cell * float(np.prod(high - low)) / len(uv_m))
    column, row = np.floor((uv_m - low) / side_m).astype(np.int64).T
    _, cell = np.unique(column * (row.max() + 1) + row, return_inverse=True)
    kinds = int(of.max()) + 1
    count = np.bincount(cell * kinds + of, minlength=(int(cell.max()) + 1) * kinds)
    count = count.reshape(-1, kinds).astype(np.float64)
    number = count.sum(axis=1)
    return float(np.sum(count * (count - 1.0)) / np.sum(number * (number - 1.0)))
