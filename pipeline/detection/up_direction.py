"""Up direction of four wheels, from the floor that they stand on and from the z axis.

The floor is a surface parallel to the wheels' plane, close to it, with nothing beyond it. The z of
a levelled scanner is up. Where both are available, they must agree; neither is guessed. z far from
the wheels' upright is not used, which is said: then nothing shows that the cloud is no mirror
image, of which left and right would be exchanged.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError, Wording
from ..system import frozen
from ..vectors import Array

CELL_M, MIN_IN_CELL, MIN_CELLS = 0.25, 8, 20
BESIDE_M = 2.0  # from the wheels: how far about the vehicle the floor is searched
FLOOR_M = (0.08, 1.0)  # height of the wheels' centres above it
STRAY = 0.05  # of a cell's points may lie beyond the floor: a glossy one mirrors what is above
ROUGH_M, SLOPING_M = 0.05, 0.15  # a floor's cells about its plane, and that about the mean
MIN_SHARE = 0.3  # of the cells must lie on the floor, and twice as many as on the other side
MIN_UPRIGHT = 0.7  # cosine between z and the wheels' upright, below which z is not taken for up
BY_FLOOR = "the floor, {depth} m below the wheels' centres"
BY_FLOOR_ALONE = (
    "the floor, {depth} m below the wheels' centres; z, {off}° off, was not used, so that nothing "
    "shows whether the cloud is mirrored, which would exchange left and right"
)
BY_Z = "the z axis, {off}° off"
BY_BOTH = "the floor, {depth} m below the wheels' centres, and the z axis, {off}° off"


@frozen(eq=False)
class Up:
    """Up direction: (3,) unit, normal to the wheels' plane. by: its sources, in words."""

    direction: Array
    by: str


@frozen
class _Floor:
    """Floor. side: +1 or -1 along the upright. depth_m: from the wheels' centres."""

    side: float
    depth_m: float


def find_up(sample_m: Array, axles_m: Array, rule: str = "auto") -> Up:
    """Find up for wheels at axles_m (2, 2, 3): two axles, the ends of both in the same order.

    sample_m: (S, 3) points of the cloud. rule: 'auto', or 'floor' or 'z' alone.
    Raises InputError where floor and z contradict each other, or neither is available.
    """
    along, upright = _directions(axles_m)
    floor = _find_floor(sample_m, axles_m, along, upright) if rule != "z" else None
    tilt = float(upright[2])
    by_z = np.sign(tilt) if abs(tilt) > MIN_UPRIGHT and rule != "floor" else 0.0
    if floor is not None and floor.side == by_z:
        raise InputError(
            f"the floor, {floor.depth_m:.2f} m from the wheels' centres, lies on the side to which "
            "z points: give --up floor if z does not point up, or --up z if it is no floor"
        )
    if floor is None and not by_z:
        missing = {"floor": "no floor found below the wheels", "z": "the z axis is not upright"}
        facts = missing.get(rule, " and ".join(missing.values()))
        raise InputError(
            f"up is unknown: {facts}: export the cloud with its floor, or levelled with z up"
        )
    depth = "" if floor is None else f"{floor.depth_m:.2f}"
    side = by_z if floor is None else -floor.side
    off = f"{np.degrees(np.arccos(np.clip(side * tilt, -1.0, 1.0))):.1f}"
    unused = BY_FLOOR if rule == "floor" else BY_FLOOR_ALONE
    sentence = BY_Z if floor is None else BY_BOTH if by_z else unused
    return Up(side * upright, Wording(sentence, depth=depth, off=off))


def stand_on_a_floor(sample_m: Array, axles_m: Array) -> bool:
    """Return whether a floor lies close to wheels at axles_m (2, 2, 3), parallel to their plane."""
    return _find_floor(sample_m, axles_m, *_directions(axles_m)) is not None


def _directions(axles_m: Array) -> tuple[Array, Array]:
    """Return the vector from first to second axle, and the wheels' unit normal, of either sign."""
    middles = axles_m.mean(axis=1)
    along = middles[1] - middles[0]
    across = (axles_m[:, 0] - axles_m[:, 1]).sum(axis=0)
    upright = np.cross(along, across)
    return along, upright / np.linalg.norm(upright)


def _find_floor(sample_m: Array, axles_m: Array, along: Array, upright: Array) -> _Floor | None:
    """Return the floor, if the outermost points on exactly one side of the wheels form one."""
    centre, forth = axles_m.mean(axis=(0, 1)), along / np.linalg.norm(along)
    axes = np.stack([forth, np.cross(upright, forth), upright])
    reach = np.abs((axles_m - centre) @ axes.T).max(axis=(0, 1))[:2] + BESIDE_M
    local = (sample_m - centre) @ axes.T
    local = local[(np.abs(local[:, :2]) < reach).all(axis=1)]
    found = {}
    for side in (-1.0, 1.0):
        cells = _outermost(local * np.array([1.0, 1.0, side]))
        found[side] = _as_floor(cells) if len(cells) >= MIN_CELLS else (0.0, 0.0)
    side = max(found, key=lambda key: found[key][0])
    share, depth_m = found[side]
    if share < max(MIN_SHARE, 2.0 * found[-side][0]):
        return None
    return _Floor(side, depth_m)


def _outermost(local_m: Array) -> Array:
    """Return the highest point but a few (C, 3) of each cell of the first two axes."""
    cell = np.floor(local_m[:, :2] / CELL_M).astype(np.int64)
    key = (cell[:, 0] << 32) + cell[:, 1]
    order = np.lexsort((local_m[:, 2], key))
    _, start, count = np.unique(key[order], return_index=True, return_counts=True)
    chosen = (start + np.ceil((count - 1) * (1.0 - STRAY)).astype(np.int64))[count >= MIN_IN_CELL]
    return np.asarray(local_m[order[chosen]])


def _as_floor(cells_m: Array) -> tuple[float, float]:
    """Return the share of cells_m (C, 3) on one plane near that of the wheels, and its depth.

    The depth is that below the middle of the wheels, the origin of the cells.
    """
    low, high = FLOOR_M
    near = cells_m[(cells_m[:, 2] > low) & (cells_m[:, 2] < high)]
    if len(near) < MIN_CELLS:
        return 0.0, 0.0
    depth_m = float(np.median(near[:, 2]))
    near = near[np.abs(near[:, 2] - depth_m) < SLOPING_M]
    terms = np.column_stack([np.ones(len(near)), near[:, :2]])
    plane = np.linalg.lstsq(terms, near[:, 2], rcond=None)[0]
    flat = np.abs(near[:, 2] - terms @ plane) < ROUGH_M
    return float(np.count_nonzero(flat) / len(cells_m)), float(plane[0])
