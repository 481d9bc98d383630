"""The floor that the wheels stand on, by the points of a scan around them.

It is the plane of the floor beside them. Where that is no plane, or a wheel stands on a turn plate
or a shim, it is the plane nearest to the four heights on which the wheels stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from ..system import frozen
from ..vectors import Array, Mask, Rows
from .contact import Contact, find_contact

BESIDE_M = 0.8  # from a wheel's centre, level: how far its floor is searched
DEPTH_M = (0.08, 1.0)  # of the floor below the wheel centres
CELL_M, MIN_IN_CELL, MIN_CELLS = 0.2, 4, 4  # MIN_CELLS: of each wheel
LOWEST = 0.05  # of a cell's points may lie beyond the floor: a glossy one mirrors what is above
NEAR_M = (0.05, 0.02, 0.01)  # points about the plane that the next fit uses
FLAT = 0.7  # least share of a cell's points beside its floor that are on it: a tyre rises from it
CHANCE = 10.0  # standard deviations by which squares exceed their mean by chance
TWISTED = 3.0  # standard deviations of a twist
LEAST_M = 1e-5  # below which heights are alike


@frozen
class Floor:
    """Plane of the floor: height in the vehicle frame = level + slopes . (left, forward).

    covariance: (2, 2) of the slopes to the left and forward, by the scatter of cells about the
    floor, with `dof` degrees of freedom. pads_m: (4,) heights of what the wheels stand on above the
    floor beside them; 0 where no step is seen. above_m: (4,) of their centres above these.
    twist_m: how far a wheel stands off the plane of the other three; 0 where the scatter explains
    it. twist_covariance: (2, 2) of the slopes, since no plane then holds all four heights: those of
    any three, or of one axle, have slopes that differ by its standard deviation.
    """

    slopes: Array
    covariance: Array
    dof: int
    depth_m: float
    pads_m: Array = field(default_factory=lambda: np.zeros(4))
    above_m: Array = field(default_factory=lambda: np.zeros(4))
    twist_m: float = 0.0
    twist_covariance: Array = field(default_factory=lambda: np.zeros((2, 2)))


def fit_floor(points_m: Array, wheels_m: Array) -> Floor | None:
    """Fit the floor around four wheels; None unless it lies beside each of them.

    A cell is the floor's where nearly all of its points about the plane lie in it, and none below:
    tyres and rims have points at every height.

    points_m: (N, 3) of the scan and wheels_m: (4, 3) centres, both left, forward, up in the vehicle
    frame.
    """
    depth = -points_m[:, 2]
    points = points_m[(depth > DEPTH_M[0]) & (depth < DEPTH_M[1])]
    apart = np.linalg.norm(points[:, None, :2] - wheels_m[None, :, :2], axis=2)
    points, wheel = points[apart.min(axis=1) < BESIDE_M], apart.argmin(axis=1)
    wheel = wheel[apart.min(axis=1) < BESIDE_M]
    cell = np.floor(points[:, :2] / CELL_M).astype(np.int64)
    key = (wheel << 48) + ((cell[:, 0] + (1 << 20)) << 24) + cell[:, 1] + (1 << 20)
    lowest = _lowest(points, key)
    if not len(lowest):
        return None
    plane: Array = np.array([np.median(lowest[:, 2]), 0.0, 0.0])
    for near_m in NEAR_M:
        seen = lowest if near_m == NEAR_M[0] else points
        seen = seen[np.abs(_above(seen, plane)) < near_m]
        plane = _fitted(seen)
    kept = _on_floor(_above(points, plane), key)
    cells = _cells(points[kept], _above(points[kept], plane), key[kept])
    if any(np.count_nonzero(cells.wheel == i) < MIN_CELLS for i in range(len(wheels_m))):
        return None
    plane, beside = _fitted(cells.means_m), _beside(cells)
    above = _above(cells.means_m, plane)
    offset_m = np.array([above[cells.wheel == i].mean() for i in range(len(wheels_m))])
    above = _above(points, plane) - offset_m[wheel]
    sigma_m = float(np.sqrt(cells.points_m2 + beside.hidden_m2)) + LEAST_M
    contacts = [find_contact(points, above, wheel_m, sigma_m) for wheel_m in wheels_m]
    if beside.alike and not any(one.pad_m for one in contacts):
        return _plane_of(cells, plane, beside.hidden_m2, wheels_m)
    middles_m = np.stack([one.middle_m for one in contacts])
    return _stood_on(beside, _terms(middles_m) @ plane + offset_m, contacts, wheels_m)


@frozen
class _Cells:
    """Means (C, 3) of the floor's points in cells, and the wheel (C,) that each is beside.

    points_m2: variance of the points in a cell about the floor's slopes; noise_m2: of the means,
    by it.
    """

    means_m: Array
    wheel: Rows
    points_m2: float
    noise_m2: float


@frozen
class _Beside:
    """Floor of its own height beside each wheel, with common slopes: values (6,), heights first.

    covariance: (6, 6), by the scatter of the cells, with `dof` degrees of freedom. hidden_m2:
    variance of its height where it is not seen. alike: whether one plane holds all heights.
    """

    values: Array
    covariance: Array
    dof: int
    hidden_m2: float
    alike: bool


def _beside(cells: _Cells) -> _Beside:
    """Fit the floor beside each wheel.

    It is uneven where its cells scatter more than the noise of their points: by as much where it is
    hidden. The lower half of them tells, since tyres are in some, and raise them.
    """
    terms = np.column_stack([cells.wheel[:, None] == np.arange(4), cells.means_m[:, :2]])
    inverse, z = np.linalg.pinv(terms), cells.means_m[:, 2]
    values = inverse @ z
    dof, common = len(z) - len(values), len(values) - 3
    off = z - terms @ values
    squares = float(off @ off)
    variance = squares / dof
    below = off - np.median(off)
    below = below[below < 0.0]
    uneven = float(np.sum(below**2))
    gained = float(np.sum(_above(cells.means_m, _fitted(cells.means_m)) ** 2)) - squares
    return _Beside(
        values,
        variance * inverse @ inverse.T,
        dof,
        uneven / len(below) if uneven > _by_chance(len(below)) * cells.noise_m2 else 0.0,
        alike=gained < _by_chance(common) * (variance + LEAST_M**2),
    )


def _by_chance(dof: int) -> float:
    """Return the sum of squares, in variances, that `dof` differences do not exceed by chance."""
    return dof + CHANCE * float(np.sqrt(2.0 * dof))


def _plane_of(cells: _Cells, plane: Array, hidden_m2: float, wheels_m: Array) -> Floor:
    """Return the plane of all cells; hidden_m2: variance of what is beneath a wheel."""
    terms, at_wheels, dof = _terms(cells.means_m), _terms(wheels_m), len(cells.means_m) - 3
    variance = float(np.sum(_above(cells.means_m, plane) ** 2)) / dof
    seen, hidden = (np.linalg.inv(each.T @ each) for each in (terms, at_wheels))
    covariance: Array = np.asarray(variance * seen + hidden_m2 * hidden, dtype=np.float64)
    above_m = _above(wheels_m, plane)
    return Floor(plane[1:], covariance[1:, 1:], dof, float(np.mean(above_m)), above_m=above_m)


def _stood_on(
    beside: _Beside, floors_m: Array, contacts: Sequence[Contact], wheels_m: Array
) -> Floor:
    """Return the plane nearest to the heights on which the wheels stand.

    floors_m: (4,) heights of the floor beside the pads, at the middles of the contact patches.
    """
    middles_m = np.stack([one.middle_m for one in contacts])
    pads_m, u_m = (np.array([getattr(one, name) for one in contacts]) for name in ("pad_m", "u_m"))
    by_patch = np.column_stack([np.eye(4), middles_m]) * (pads_m == 0.0)[:, None]
    heights_m = np.where(pads_m == 0.0, by_patch @ beside.values, floors_m + pads_m)
    covariance = by_patch @ beside.covariance @ by_patch.T
    covariance += np.diag(u_m**2 + beside.hidden_m2)
    terms = _terms(middles_m)
    fit = np.linalg.pinv(terms)
    plane: Array = np.asarray(fit @ heights_m, dtype=np.float64)
    off_m = heights_m - terms @ plane  # of one degree of freedom
    twist_m = float(np.linalg.norm(off_m))
    u_twist_m = np.sqrt(off_m @ covariance @ off_m) / max(twist_m, LEAST_M)
    twist_m *= twist_m > TWISTED * u_twist_m + LEAST_M
    return Floor(
        plane[1:],
        np.asarray((fit @ covariance @ fit.T)[1:, 1:]),
        beside.dof,
        float(np.mean(_above(wheels_m, plane))),
        pads_m,
        wheels_m[:, 2] - heights_m,
        2.0 * twist_m,
        np.asarray(twist_m**2 * (fit @ fit.T)[1:, 1:]),
    )


def _terms(points_m: Array) -> Array:
    return np.column_stack([np.ones(len(points_m)), points_m[:, :2]])


def _fitted(points_m: Array) -> Array:
    return np.asarray(np.linalg.lstsq(_terms(points_m), points_m[:, 2], rcond=None)[0])


def _above(points_m: Array, plane: Array) -> Array:
    return np.asarray(points_m[:, 2] - _terms(points_m) @ plane)


def _on_floor(above_m: Array, key: Rows) -> Mask:
    """Return which points (N,) lie in the plane and in a cell that is the floor's."""
    _, cell = np.unique(key, return_inverse=True)
    on = np.abs(above_m) < NEAR_M[-1]
    flat, beside, below = (
        np.bincount(cell, weights=chosen)
        for chosen in (on, np.abs(above_m) < NEAR_M[1], above_m < -NEAR_M[1])
    )
    floor = (flat >= FLAT * beside) & (below <= LOWEST * np.bincount(cell))
    return np.asarray(on & floor[cell])


def _lowest(points_m: Array, key: Rows) -> Array:
    """Return the lowest point but a few of each cell."""
    order = np.lexsort((points_m[:, 2], key))
    _, start, count = np.unique(key[order], return_index=True, return_counts=True)
    chosen = (start + np.floor((count - 1) * LOWEST).astype(np.int64))[count >= MIN_IN_CELL]
    return np.asarray(points_m[order[chosen]])


def _cells(points_m: Array, above_m: Array, key: Rows) -> _Cells:
    """Return the cells that have enough points; above_m: (N,) heights above a plane of them."""
    keys, index, count = np.unique(key, return_inverse=True, return_counts=True)
    full = count >= MIN_IN_CELL
    sums = np.stack([np.bincount(index, weights=column) for column in points_m.T], axis=1)
    means = sums / count[:, None]
    off_m = above_m - (np.bincount(index, weights=above_m) / count)[index]
    squares = np.bincount(index, weights=off_m**2)[full]
    points_m2 = float(squares.sum() / max(1, (count[full] - 1).sum()))
    noise_m2 = points_m2 * float(np.mean(1.0 / count[full])) if full.any() else 0.0
    return _Cells(means[full], keys[full] >> 48, points_m2, noise_m2)
