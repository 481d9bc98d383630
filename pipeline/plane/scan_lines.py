"""Cells along the scan lines of a target, in which noise that differs along and across them shows.

A rotating mirror, an encoder or a profile gives errors of its own to each scan line, and noise is
often correlated over a longer way along lines than across. Both are fields over the grid of the
beams. Its lines are found from the points, whatever their order in the file: a lattice has wave
vectors k, square to its lines, at which exp(i k.x) is the same at all points x. Noise w along the
beams moves points by w q in the plane, which a factor exp(-i c w), c = k.q, takes back. Along each
of the two kinds of lines, the target is divided into long narrow cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ..cloud import least_rows, over_chunks, raster_sums
from ..system import frozen
from ..vectors import Array, Array32
from .correlated_noise import POINTS_A_CELL, Cells, filled

Blocks = Callable[[Callable[[Array, Array | None], Any]], list[Any]]

NARROW, LONG = 40, 5  # cells across the lines, and along them
LEAST_NARROW = 16  # fewer are no narrower than the square cells
SAMPLED = 350  # points near the middle that show the grid
VOID = 0.3  # of the farthest of these: where none is nearer, they lie about a hole
LONGEST = 3.0  # wave, in mean distances of the points
SHORTEST = (0.6, 0.25)  # the second: thinned to a tenth, the points are far apart on their lattice
APART = math.radians(40.0)  # least angle between both kinds of lines
CLEAR = 0.1  # least |mean exp(i k.x)|^2 of a lattice's strongest wave; points on no grid: 0.05
ALIKE = 0.5  # of the strongest wave: those as strong are of the lattice
STEEPEST, MOST_SHIFTS = 1.2, 12  # q: 50 degrees of incidence; factors exp(-i c w) tried
ZOOM, ZOOMED = 0.4, 6
ROUNDED = 0.3  # of the points' mean distance: of longer steps, no lines are looked for
ONE_WAVE = 3.0  # steps of the waves tried, within which two are one


@frozen(eq=False)
class Grid:
    """Grid of the beams on a plane.

    directions: (2, 2) unit rows, along the lines of both kinds. beam: (2,) by how much noise of one
    off the plane moves a point in it.
    """

    directions: Array
    beam: Array


def cells_along_lines(blocks: Blocks, step_m: float = 0.0) -> Iterator[Cells]:
    """Yield the cells along the two kinds of scan lines; none of too few points or on no grid.

    blocks: calls a function on every block of the points and returns what it returns, in order;
    once for the middle that shows the grid, or beside a hole there again, once for how far points
    reach, once for the sums, so that no more than a block is held. Of a block uvw_m (M, 3), u and v
    about the centroid, w a residual, and (M,) a column that was fitted besides the plane, or None.
    step_m: the longest of rounded coordinates.
    """
    found = blocks(lambda uvw, _: (len(uvw), nearest(uvw)))
    narrow = min(NARROW, int(sum(count for count, _ in found) / (POINTS_A_CELL * LONG)))
    if narrow < LEAST_NARROW:
        return
    some = nearest(np.concatenate([near for _, near in found]))
    away = np.hypot(*some[:, :2].T)
    if away.min() > VOID * away.max():  # a ring has its middle in its hole
        edge = some[np.argmin(away)] * [1.0, 1.0, 0.0]
        some = nearest(np.concatenate(blocks(lambda uvw, _: nearest(uvw - edge))))
        some = some - some.mean(axis=0) * [1.0, 1.0, 0.0]
    grid = grid_of(some, step_m)
    if grid is None:
        return
    to_lines = np.linalg.inv(grid.directions).T
    # In place: noise would sort the points of a line between the cells on either side.
    to_lines = np.column_stack([to_lines, -to_lines @ grid.beam])
    reach = blocks(lambda uvw, _: np.abs(to_lines @ uvw.T).max(axis=1, initial=0.0))
    rasters = [
        (shape, 2.0 * np.max(reach, axis=0) / shape) for shape in ((narrow, LONG), (LONG, narrow))
    ]

    def sums_of(uvw: Array, extra: Array | None) -> list[Array]:
        along = to_lines @ uvw.T
        return [raster_sums(uvw, extra, along, shape, side_m) for shape, side_m in rasters]

    sums = blocks(sums_of)
    for k, (shape, side_m) in enumerate(rasters):
        cells = _cells(sum(block[k] for block in sums), shape, side_m)
        if cells is not None:
            yield cells


def nearest(uvw_m: Array, count: int = SAMPLED) -> Array:
    """Return the `count` points of (N, 3) nearest to the middle, or all."""
    if len(uvw_m) <= count:
        return uvw_m
    return uvw_m[least_rows(uvw_m[:, 0] ** 2 + uvw_m[:, 1] ** 2, count)]


def grid_of(uvw_m: Array, step_m: float = 0.0) -> Grid | None:
    """Return the grid of the beams that points uvw_m (N, 3), w off the plane, lie on, or None.

    From the two longest waves of the lattice; lines of one kind only have the other across. Points
    on no grid (thinned, or merged from several scans) have no clear wave: a beam fitted to them
    would sort their noise into the cells along invented lines. So would a lattice of the steps
    step_m of rounded coordinates, where these are not short compared with the points' distance.
    """
    x, scale_m, step = _scaled(uvw_m)
    if step_m > ROUNDED * scale_m[0]:
        return None
    for shortest in SHORTEST:
        axes, power = _tried(x, scale_m, step, shortest)
        if float(power.max()) >= CLEAR:
            break
    else:
        return None
    angle = np.arctan2(axes[1], axes[0][:, None])
    least = ALIKE * float(power.max())
    waves = [_zoomed(x, _longest_wave(axes, power, least), step)]
    apart = np.abs(np.sin(angle - math.atan2(waves[0][1], waves[0][0]))) > math.sin(APART)
    power *= apart[:, :, None]
    if float(power.max()) > least:
        waves.append(_zoomed(x, _longest_wave(axes, power, least), step))
    else:
        waves.append(np.array([-waves[0][1], waves[0][0], 0.0]))
    found = np.stack(waves)
    rows = np.stack([-found[:, 1], found[:, 0]], axis=1)
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    beam = np.asarray(np.linalg.solve(found[:, :2], found[:, 2]) * (scale_m[0] / scale_m[2]))
    return Grid(rows, beam)


def strong_waves(
    uvw_m: Array, least: float, shortest: float = SHORTEST[0], most: int = 14
) -> list[Array]:
    """Return the waves of all grids that the points uvw_m (N, 3) lie on, the strongest first.

    k, m and c (3,) in rad/m, of a power of at least `least`, and as long as `shortest`, in mean
    distances of the points; those as near to each other as few points can show are one.
    """
    x, scale_m, step = _scaled(uvw_m)
    axes, power = _tried(x, scale_m, step, shortest)
    found: list[Array] = []
    while len(found) < most and float(power.max()) >= least:
        place = np.unravel_index(np.argmax(power), power.shape)
        wave = np.array([axis[i] for axis, i in zip(axes, place, strict=True)])
        for side in (wave, -wave):
            near = np.hypot(axes[0][:, None] - side[0], axes[1] - side[1]) < ONE_WAVE * step
            power[near] = 0.0
        found.append(_zoomed(x, wave, step) / scale_m)
    return found


def _scaled(uvw_m: Array) -> tuple[Array, Array, float]:
    """Return the points nearest to the middle in units, these (3,), and the step of their waves.

    The units are the points' mean distance, in the plane, and their noise off it.
    """
    some = nearest(uvw_m)
    apart_m = float(np.hypot(*some[:, :2].T).max()) * math.sqrt(math.pi / len(some))
    noise_m = max(float(np.std(some[:, 2])), 1e-9 * apart_m)
    scale_m = np.array([apart_m, apart_m, noise_m])
    step = 1.4 / math.sqrt(len(some) / math.pi)
    return some / scale_m, scale_m, step


def _tried(
    x: Array, scale_m: Array, step: float, shortest: float
) -> tuple[tuple[Array, Array, Array], Array]:
    """Return the waves tried on scaled points x (N, 3), k, m and c, and their power (K, M, C)."""
    axes = _waves_to(shortest, step, float(scale_m[2] / scale_m[0]))
    length = np.hypot(axes[0][:, None], axes[1])
    seen = (length > 2.0 * math.pi / LONGEST) & (length < 2.0 * math.pi / shortest)
    return axes, _power(x, axes) * seen[:, :, None]


def _waves_to(shortest: float, step: float, noise: float) -> tuple[Array, Array, Array]:
    """Return the k, m and c tried, of waves down to the shortest; lengths in mean distances."""
    k = np.arange(-2.0 * math.pi / shortest, 2.0 * math.pi / shortest + step, step)
    shifts = STEEPEST * 2.0 * math.pi * noise * SHORTEST[0] / shortest
    reach = min(math.ceil(shifts), MOST_SHIFTS)
    return k, k[k >= 0.0], np.arange(-reach, reach + 1.0)


def _power(points: Array, waves: tuple[Array, Array, Array]) -> Array:
    """Return |mean exp(i (k u + m v - c w))|^2 (K, M, C) over points u, v, w (N, 3).

    k: evenly spaced. Those that lie a and -a from the middle share the products of cos(a u) and
    sin(a u) with the rest: the means are their sum and difference, by half the multiplications.
    """
    x, k, m, c = (one.astype(np.float32) for one in (points, *waves))  # twice as fast
    middle = (k[0] + k[-1]) / np.float32(2.0)
    aside = np.outer(k[len(k) // 2 :] - middle, x[:, 0])
    even_and_odd = np.vstack([np.cos(aside), np.sin(aside)])
    rest = _on_circle(np.outer(x[:, 1], m) + middle * x[:, :1])
    w = _on_circle(np.outer(-c, x[:, 2])) / np.float32(len(x))

    def power_of(one: slice) -> Array32:
        factors = rest * w[one.start][:, None]
        parts = np.hstack([factors.real, factors.imag])
        (a, b), (p, q) = (np.hsplit(both, 2) for both in np.vsplit(even_and_odd @ parts, 2))
        ahead, behind = (a - q) ** 2 + (b + p) ** 2, (a + q) ** 2 + (b - p) ** 2
        return np.vstack([behind[len(k) % 2 :][::-1], ahead])

    return np.moveaxis(np.stack(over_chunks(power_of, len(c), 1)), 0, 2)


def _on_circle(phase: Array32) -> npt.NDArray[np.complex64]:
    """Return exp(i phase), in a third of the time of the complex exponential."""
    found = np.empty(phase.shape, np.complex64)
    np.cos(phase, out=found.real)
    np.sin(phase, out=found.imag)
    return found


def _longest_wave(axes: tuple[Array, Array, Array], power: Array, least: float) -> Array:
    """Return k, m and c (3,) of the strongest of the longest waves of at least that power."""
    length = np.hypot(axes[0][:, None], axes[1])[:, :, None]
    strong = power >= least
    shortest = float(np.where(strong, length, np.inf).min())
    near = strong & (length < 1.06 * shortest)
    place = np.unravel_index(np.argmax(np.where(near, power, -1.0)), power.shape)
    return np.array([axis[i] for axis, i in zip(axes, place, strict=True)])


def _zoomed(x: Array, wave: Array, step: float) -> Array:
    """Return k, m and c (3,) of the greatest power near `wave`."""
    about, reach = np.linspace(-1.0, 1.0, 5), np.array([step, step, 1.0])
    for _ in range(ZOOMED):
        around = wave + reach * about[:, None]
        power = _power(x, (around[:, 0], around[:, 1], around[:, 2]))
        place = np.unravel_index(np.argmax(power), power.shape)
        wave, reach = around[place, range(3)], ZOOM * reach
    return wave


def _cells(sums: Array, shape: tuple[int, int], side_m: Array) -> Cells | None:
    """Return the cells of these sums; None where too few are filled."""
    count = sums[:, 0]
    full = filled(count)
    if full is None:
        return None
    n, (u, v, mean, square, *more) = count[full], sums[full, 1:].T / count[full]
    index = np.stack([np.flatnonzero(full) % shape[0], np.flatnonzero(full) // shape[0]], axis=1)
    return Cells(
        uv_m=np.stack([u, v], axis=1),
        mean_m=mean,
        count=n,
        index=index,
        side_m=side_m,
        white_variance=float(np.sum(n * (square - mean**2)) / np.sum(n - 1.0)),
        extra=np.stack(more, axis=1) if more else None,
    )
