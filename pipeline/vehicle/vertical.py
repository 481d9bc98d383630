"""The floor that the wheels stand on, by the points of a scan around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Mask, Rows

BESIDE_M = 0.8  # from a wheel's centre, level: how far its floor is searched
DEPTH_M = (0.08, 1.0)  # of the floor below the wheel centres
CELL_M, MIN_IN_CELL, MIN_CELLS = 0.2, 4, 4  # MIN_CELLS: of each wheel
LOWEST = 0.05  # of a cell's points may lie beyond the floor: a glossy one mirrors what is above
NEAR_M = (0.05, 0.02, 0.01)  # points about the plane that the next fit uses
FLAT = 0.7  # least share of a cell's points beside its floor that are on it: a tyre rises from it


@dataclass(frozen=True)
class Floor:
    """Plane of the floor: height in the vehicle frame = level + slopes . (left, forward).

    covariance: (2, 2) of the slopes to the left and forward, by the scatter of cells about the
    plane, with `dof` degrees of freedom.
    """

    slopes: Array
    covariance: Array
    dof: int
    depth_m: float


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
    cells = _lowest(points, key)
    if not len(cells):
        return None
    plane: Array = np.array([np.median(cells[:, 2]), 0.0, 0.0])
    for near_m in NEAR_M:
        seen = cells if near_m == NEAR_M[0] else points
        seen = seen[np.abs(_above(seen, plane)) < near_m]
        plane = _fitted(seen)
    kept = _on_floor(_above(points, plane), key)
    means, of = _means(points[kept], key[kept])
    if any(np.count_nonzero(of >> 48 == i) < MIN_CELLS for i in range(len(wheels_m))):
        return None
    terms, plane = _terms(means), _fitted(means)
    dof = len(means) - 3
    variance = float(np.sum(_above(means, plane) ** 2)) / dof
    covariance = np.asarray(variance * np.linalg.inv(terms.T @ terms), dtype=np.float64)
    depth_m = float(np.mean(wheels_m[:, 2] - _terms(wheels_m) @ plane))
    return Floor(plane[1:], covariance[1:, 1:], dof, depth_m)


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


def _means(points_m: Array, key: Rows) -> tuple[Array, Rows]:
    """Return the mean point (C, 3) of each cell that has enough of them, and its key."""
    keys, index, count = np.unique(key, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(index, weights=column) for column in points_m.T], axis=1)
    full = count >= MIN_IN_CELL
    return sums[full] / count[full, None], keys[full]
