"""Voxel lattice on which a scan was thinned, found from the points of a face themselves.

Programs that thin by a voxel grid keep one point of each cell: the mean of its points (Open3D,
PCL), or the one nearest to its middle (the octree of CloudCompare). Such points crowd about the
middles of the cells, so that both axes along a face show a wave of the same length; and where the
face crosses from one layer of cells to the next, two points share a column and never a cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Rows, in_axes
from .steps import scattered

EDGES_M = (1e-3, 2e-2)  # of cells that are looked for
BIN_M = 1e-4
SPAN_M = 1.0  # of the histogram: one over it is the step of the waves' frequencies
CLEAR = 12.0  # power of a wave by that of points at random, of which one in e^12 exceeds this
TRIED = 4  # waves
HALVINGS = 4  # steps of the search for a wave's frequency
ROWS = 20_000  # points in which waves are looked for
SQUARE = 0.9  # cosine of the normal to an axis, from which a face lies along a layer of cells
MOST_LAYERS = 4.0  # points a column; in more layers no boundary matters
MIN_PAIRS = 15  # neighbours in a column
MIN_SHARE = 0.01  # of the points that are such; fewer hardly pull
PHASES = 200  # positions of a boundary that are compared
PARTED = 0.9  # share of the pairs that one boundary has to part
AS_MANY = 0.03  # of that share: boundaries that part nearly as many are as likely
FEWER = 0.25  # of that share: how far it falls says how near the boundary is
U_OF_FALL = 0.5  # standard uncertainty of the boundary by the length of that fall


@dataclass(frozen=True)
class VoxelLattice:
    """Layers of cubic cells along a face, one point a cell.

    edge_m: of a cell. axis: (3,) unit vector across the layers. boundary_m: where one boundary
    between two layers lies along it, from the origin of the points; boundary_u_m: its standard
    uncertainty. apart_m: median distance along the axis of two points in one column.
    """

    edge_m: float
    axis: Array
    boundary_m: float
    boundary_u_m: float
    apart_m: float


def find_lattice(
    points_m: Array, axes: Array, normal: Array, rows: Rows | None = None
) -> VoxelLattice | None:
    """Find the lattice on which points_m (N, 3) of a face with that normal (3,) were thinned.

    axes: (3, 3) rows along which a lattice would lie. rows: of the points that count, all by
    default. None where there is no lattice, where the face lies along none of its layers, or where
    it hardly crosses from one to the next.
    """
    across = int(np.argmax(np.abs(axes @ normal)))
    rows = np.arange(len(points_m)) if rows is None else rows
    if abs(float(axes[across] @ normal)) < SQUARE or len(rows) < 2 * MIN_PAIRS:
        return None
    along = np.delete(axes, across, axis=0)
    some = in_axes(along, points_m[rows[scattered(len(rows), ROWS)]])
    waves = _waves(some)
    if not waves:
        return None
    points_m = points_m[rows]
    uv_m, depth_m = in_axes(along, points_m), points_m @ axes[across]
    most = MOST_LAYERS * float(np.prod(np.ptp(uv_m, axis=0)))
    for wave in [one for one in waves if len(points_m) < most * one**2][:TRIED]:
        frequency = _refined(some, wave)
        found = _layers(uv_m, depth_m, frequency)
        if found is not None:
            boundary, u, apart = (float(x) / frequency for x in found)
            return VoxelLattice(1.0 / frequency, axes[across], boundary, u, apart)
    return None


def _layers(uv_m: Array, depth_m: Array, frequency: float) -> tuple[float, float, float] | None:
    """Return boundary, its standard uncertainty, and distance of two points in a column, in cells.

    uv_m: (N, 2) along the face; depth_m: (N,). None where no boundary parts the points.
    """
    some = scattered(len(uv_m), ROWS)
    phase = np.angle(_wave(uv_m[some], frequency)) / (2.0 * np.pi)
    column = np.rint(uv_m * frequency - phase).astype(np.int64)
    order = np.lexsort([depth_m, *column.T])
    pair = (column[order[:-1]] == column[order[1:]]).all(axis=1)
    low, high = depth_m[order[:-1][pair]] * frequency, depth_m[order[1:][pair]] * frequency
    near = high - low < 1.0
    if np.count_nonzero(near) < max(MIN_PAIRS, MIN_SHARE * len(uv_m)):
        return None
    boundary = np.arange(PHASES) / PHASES
    share = np.zeros(PHASES)
    for row, at in enumerate(boundary):
        share[row] = np.mean(np.floor(high[near] - at) > np.floor(low[near] - at))
    if share.max() < PARTED:
        return None
    return *_boundary(share), float(np.median(high - low))


def _boundary(share: Array) -> tuple[float, float]:
    """Return the likely position of a boundary and its standard uncertainty, in cells.

    share: (PHASES,) of the pairs that are parted there. Points crowd on the side of a boundary on
    which few of the noise reach over it: the more steeply the share falls, the nearer it is.
    """
    likely = np.flatnonzero(share > share.max() - AS_MANY)
    middle = int(np.rint(np.angle(np.exp(2j * np.pi * likely / PHASES).sum()) * PHASES / np.pi / 2))
    ends, falls = [], []
    for side in (-1, 1):
        outwards = share[(middle + side * np.arange(PHASES // 2)) % PHASES]
        end = int(np.argmax(outwards <= share.max() - AS_MANY))
        ends.append(middle + side * end)
        falls.append(max(1, int(np.argmax(outwards <= share.max() - FEWER)) - end))
    weight = 1.0 / np.square(falls, dtype=np.float64)
    at = float(weight @ ends) / float(weight.sum())
    return at / PHASES, U_OF_FALL / float(np.sqrt(weight.sum())) / PHASES


def _waves(some: Array) -> list[float]:
    """Return frequencies, 1/m, of clear waves that both axes of some points (N, 2) show.

    The clearest first.
    """
    bins = int(SPAN_M / BIN_M)
    power = np.full(bins // 2 + 1, np.inf)
    for values in some.T:
        place = ((values - values.min()) / BIN_M).astype(np.int64) % bins
        count = np.bincount(place, minlength=bins)
        power = np.minimum(power, np.abs(np.fft.rfft(count)) ** 2 / len(values))
    first, last = (int(SPAN_M / edge_m) for edge_m in EDGES_M[::-1])
    inner = power[first : last + 1]
    peak = (inner >= power[first - 1 : last]) & (inner >= power[first + 1 : last + 2])
    found = np.flatnonzero(peak & (inner > CLEAR))
    found = found[np.argsort(-inner[found], kind="stable")]
    return [(first + int(one)) / SPAN_M for one in found]


def _refined(uv_m: Array, frequency: float) -> float:
    """Return the frequency, 1/m, of the greatest power of both axes near one."""
    step = 0.5 / SPAN_M
    for _ in range(HALVINGS):
        tried = frequency + step * np.arange(-1.0, 1.5, 0.5)
        power = [float(np.sum(np.abs(_wave(uv_m, one)) ** 2)) for one in tried]
        frequency, step = float(tried[int(np.argmax(power))]), step / 2.0
    return frequency


def _wave(uv_m: Array, frequency: float) -> Array:
    """Return the sums (2,) of the phases of uv_m (N, 2) in waves of a frequency, 1/m."""
    return np.asarray(np.exp(2j * np.pi * frequency * uv_m).sum(axis=0))
