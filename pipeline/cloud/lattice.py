"""Voxel lattice on which a scan was thinned, found from the points of a face themselves.

Programs that thin by a voxel grid keep one point of each cell: the mean of its points (Open3D,
PCL), or the one nearest to its middle (the octree of CloudCompare). Such points crowd about the
middles of the cells, so that both axes along a face show a wave of the same length; where the face
crosses from one layer of cells to the next, two points share a column and never a cell; and where
it lies in one layer, each column has its point, at a place that tells nothing of the next one's.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..system import frozen
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
APART = 1.55  # distance of two points in a column by the noise before thinning, at a boundary
MOST_KEPT = 1.5  # noise of the points kept by that before thinning, at most
BESIDE = 0.8  # share of the points that have a neighbour in the next column along each axis
JUMPS = 0.3  # least change from column to column, by that of points which know nothing of the next
LEAST_SPREAD = 0.03  # of points about the middles of their columns, in cells: else a grid of beams
TO_MIDDLE_LIMITS = (0.02, 1.2)  # less hardly pulls; with more noise, no point was chosen by it
MOST_TO_MIDDLE = 0.8  # that is believed
TO_MIDDLE = 1.5  # 2 pi N s^2 by s^2 / r^2: of points at random 2, of a grid of beams 1.05
INSIDE = (0.5, 99.5)  # percentiles of the depths of a face
LEAST_SLACK = 0.05  # of a layer, by which a face may lie higher or lower in it


@frozen(eq=False)
class VoxelLattice:
    """Layers of cubic cells along a face, one point a cell.

    edge_m: of a cell. axis: (3,) unit vector across the layers. boundary_m: where one boundary
    between two layers lies along it, from the origin of the points; boundary_u_m: its standard
    uncertainty. noise_m: of the depths before thinning, roughly. to_middle: part of its distance to
    the middle of its layer by which a point lies nearer, if each cell kept the one nearest to its
    middle. layers: 1 if the face lies in one, else 2, for any number.
    """

    edge_m: float
    axis: Array
    boundary_m: float
    boundary_u_m: float
    noise_m: float
    to_middle: float
    layers: int = 2


def find_lattice(
    points_m: Array, axes: Array, normal: Array, rows: Rows | None = None
) -> VoxelLattice | None:
    """Find the lattice on which points_m (N, 3) of a face with that normal (3,) were thinned.

    axes: (3, 3) rows along which a lattice would lie. rows: of the points that count, all by
    default. None where there is no lattice, or where the face lies along none of its layers.
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
    frequencies = [
        _refined(some, wave) for wave in [w for w in waves if len(points_m) < most * w**2][:TRIED]
    ]
    for layers, look in ((2, _layers), (1, _one_layer)):
        for frequency in frequencies:
            found = look(uv_m, depth_m, frequency)
            if found is not None:
                boundary_m, u_m, noise_m = (length / frequency for length in found[:3])
                return VoxelLattice(
                    1.0 / frequency, axes[across], boundary_m, u_m, noise_m, found[3], layers
                )
    return None


_Found = tuple[float, float, float, float]  # boundary, its u, noise, to the middle; in cells


def _layers(uv_m: Array, depth_m: Array, frequency: float) -> _Found | None:
    """Return what is found of a face in more than one layer; None where no boundary parts it.

    uv_m: (N, 2) along the face; depth_m: (N,).
    """
    column, beside = _columns(uv_m, frequency)
    order = np.lexsort([depth_m, *column.T])
    pair = (column[order[:-1]] == column[order[1:]]).all(axis=1)
    low, high = depth_m[order[:-1][pair]] * frequency, depth_m[order[1:][pair]] * frequency
    near = high - low < 1.0
    if np.count_nonzero(near) < max(MIN_PAIRS, MIN_SHARE * len(uv_m)):
        return None
    share = np.zeros(PHASES)
    for row, at in enumerate(np.arange(PHASES) / PHASES):
        share[row] = np.mean(np.floor(high[near] - at) > np.floor(low[near] - at))
    if share.max() < PARTED:
        return None
    boundary, u = _boundary(share)
    face = _on_plane(uv_m, depth_m)
    away = face[order[:-1][pair]] * frequency - boundary
    away -= np.rint(away)  # of the face from a boundary; one of both points lies beyond it
    noise = float(np.sqrt(max(np.median((high - low) ** 2 - away**2), 0.0))) / APART
    noise = max(noise, float(np.std(depth_m - face)) * frequency / MOST_KEPT)
    selected = TO_MIDDLE * noise**2 / float(np.mean(beside**2) * 2.0)
    return boundary, u, noise, selected / (1.0 + selected)


def _one_layer(uv_m: Array, depth_m: Array, frequency: float) -> _Found | None:
    """Return what is found of a face in one layer; None where its points were not chosen.

    Of the points in a cell that lie nearest to its middle, many are kept for their place along the
    face, others for their depth: how far they lie from the middles along the face says how much
    their depths were drawn to the middle of the layer. Where that is not shown, as of the beams of
    a regular grid, nothing was thinned.
    """
    column, beside = _columns(uv_m, frequency)
    row = column - column.min(axis=0)
    wide = int(row[:, 1].max()) + 2
    keys = row[:, 0] * wide + row[:, 1]
    _, first = np.unique(keys, return_index=True)
    if len(keys) - len(first) > max(MIN_PAIRS, MIN_SHARE * len(keys)):
        return None
    keys, beside = keys[first], beside[first]
    for axis, step in enumerate((wide, 1)):
        place = np.searchsorted(keys, keys + step).clip(max=len(keys) - 1)
        next_to = keys[place] == keys + step
        if np.mean(next_to) < BESIDE:
            return None
        jump = beside[place[next_to], axis] - beside[next_to, axis]
        if np.mean(jump**2) < JUMPS * 2.0 * np.var(beside[:, axis]):
            return None
    rest = (depth_m - _on_plane(uv_m, depth_m)) * frequency
    kept = float(np.mean(rest**2))
    spread = float(np.mean(beside**2))
    to_middle = TO_MIDDLE * kept / (2.0 * spread)
    least, most = TO_MIDDLE_LIMITS
    if spread < LEAST_SPREAD**2 or not least < to_middle < most:
        return None
    to_middle = min(to_middle, MOST_TO_MIDDLE)
    low, high = np.percentile(depth_m, INSIDE) * frequency
    slack = max(LEAST_SLACK, 1.0 - float(high - low))
    noise = float(np.sqrt(kept / (1.0 - to_middle)))
    return float(low + high) / 2.0 - 0.5, slack / float(np.sqrt(12.0)), noise, to_middle


def _on_plane(uv_m: Array, depth_m: Array) -> Array:
    """Return the depths (N,) of the plane of least squares at the points."""
    terms = np.column_stack([np.ones(len(uv_m)), uv_m])
    return np.asarray(terms @ np.linalg.lstsq(terms, depth_m, rcond=None)[0])


def _columns(uv_m: Array, frequency: float) -> tuple[NDArray[np.int64], Array]:
    """Return columns of cells (N, 2) of points uv_m (N, 2), and their places in them, in cells."""
    some = scattered(len(uv_m), ROWS)
    phase = np.angle(_wave(uv_m[some], frequency)) / (2.0 * np.pi)
    place = uv_m * frequency - phase
    column = np.rint(place).astype(np.int64)
    return column, place - column


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
    power = cache(lambda one: float(np.sum(np.abs(_wave(uv_m, one)) ** 2)))
    step = 0.5 / SPAN_M
    for _ in range(HALVINGS):
        tried = frequency + step * np.arange(-1.0, 1.5, 0.5)
        frequency, step = max(tried.tolist(), key=power), step / 2.0
    return frequency


def _wave(uv_m: Array, frequency: float) -> Array:
    """Return the sums (2,) of the phases of uv_m (N, 2) in waves of a frequency, 1/m."""
    phase = 2.0 * np.pi * frequency * uv_m.T  # cosine and sine: faster than a complex exponential
    return np.asarray(np.cos(phase).sum(axis=1) + 1j * np.sin(phase).sum(axis=1))
