"""Wheels in the cloud of a whole vehicle: what is of revolution about a level axis on the floor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..cloud import voxels_without_strays
from ..detection import planes_of
from ..errors import NotMeasuredError
from ..plane import Patch
from ..system import frozen
from ..vectors import Array, Rows, plane_basis
from .find_axis import SLANT, RoughAxis, find_axis
from .find_patch import CHOSEN_M
from .find_wheel import cut_wheel
from .fit_wheel import fit_surface
from .normal_lines import Axis

EDGE_M, LEAST_IN_VOXEL, FLAT = 0.036, 8, 0.5  # of the pieces of surface
LEVEL = np.cos(np.radians(45.0))  # of a floor to z
FLOOR_BIN_M, FLOOR_SHARE, FLOOR_M = 0.05, 0.3, 0.03
BAND_M = (0.04, 1.0)  # heights of pieces that may be a wheel's
CENTRE_M = (0.2, 0.65)  # heights of wheels' centres
HEADINGS = 18  # of axes that are tried
RADII_M = np.arange(0.15, 0.43, 0.03)
CELL_M, DEPTH_M = 0.06, 0.2  # of the votes: across an axis, and along it
MOST, LEAST_VOTES = 40, 0.08  # positions that are looked at; of the votes of the best
APART_M = 0.3
BALL_M, ABOVE_M = 0.55, 0.015  # points about a position; above the floor
MOST_LEAN = np.sin(np.radians(10.0))  # of an axis against the floor
TWIN_M = (0.1, 0.6)  # aside and along: of the inner wheel of two on one hub
WHEELS = 4  # of a vehicle
STANDS_M = (-0.08, 0.10)  # height of the axis less the largest radius seen


@frozen(eq=False)
class Floor:
    """The floor: a point on it and its upward normal, each (3,)."""

    point_m: Array
    up: Array

    def height_m(self, points_m: Array) -> Array:
        """Return the heights (N,) of points (N, 3)."""
        return np.asarray((points_m - self.point_m) @ self.up)


@frozen(eq=False)
class _Cloud:
    """Points of a cloud, points_m (N, 3), that are looked up by places in it."""

    points_m: Array

    @cached_property
    def _x_m(self) -> Array:
        """First coordinates (N,), side by side: all are read at every place."""
        return np.ascontiguousarray(self.points_m[:, 0])

    def within(self, centre_m: Array, reach_m: float) -> Rows:
        """Return the rows of the points in a ball about a centre (3,)."""
        low, high = centre_m[0] - reach_m, centre_m[0] + reach_m
        rows = np.nonzero((self._x_m > low) & (self._x_m < high))[0]
        off = self.points_m[rows] - centre_m
        return np.asarray(rows[np.einsum("ij,ij->i", off, off) < reach_m**2])


def find_wheels(
    points_m: Array,
    rim_inch: float | None,
    parts: Sequence[tuple[int, int]] = (),
    stations_m: Sequence[Array | None] = (),
    near_m: Sequence[Array] = (),
) -> tuple[Patch, ...]:
    """Find all wheels in points_m (N, 3), the cloud of a vehicle; patches, best match first.

    rim_inch: nominal diameter of the rims, if it is stated. parts: row ranges of the scans that
    make up the cloud: each wheel is taken from the one with most points on it. stations_m: (3,)
    each, positions of the scanner. near_m: (3,) each, points chosen by the operator: then the wheel
    at each of them, in their order.
    Raises NotMeasuredError 'wheel-not-found' where there is no floor, or no wheel at a chosen
    point.
    """
    parts = parts or [(0, len(points_m))]
    found: list[tuple[RoughAxis, Rows, Array | None]]
    if near_m:
        found = [(*one, None) for one in _chosen(points_m, near_m)]
    else:
        found = [
            (rough, rows, rough.axis.direction) for rough, rows in _standing(points_m, rim_inch)
        ]
    return tuple(_of_best_part(points_m, *one, parts, stations_m) for one in found)


def _of_best_part(
    points_m: Array,
    rough: RoughAxis,
    rows: Rows,
    outward: Array | None,
    parts: Sequence[tuple[int, int]],
    stations_m: Sequence[Array | None],
) -> Patch:
    """Return the patch of a wheel from the part with most points on it.

    rows: near it. outward: (3,) about its normal, None where that is unknown.
    """
    bounds = np.searchsorted(rows, np.array(parts))
    seen = (index for index, (start, stop) in enumerate(bounds) if stop > start)
    patches = {
        index: cut_wheel(points_m[rows[slice(*bounds[index])]], rough, outward) for index in seen
    }
    part = max(patches, key=lambda index: len(patches[index].face_m))
    station_m = stations_m[part] if stations_m else None
    return replace(patches[part], match=rough.circle, part=part, station_m=station_m)


def _chosen(points_m: Array, near_m: Sequence[Array]) -> list[tuple[RoughAxis, Rows]]:
    """Return the wheels at points chosen by the operator, with the rows of points near each."""
    try:
        floor = _find_floor(*_pieces(points_m))
    except NotMeasuredError:
        floor = None
    cloud, found = _Cloud(points_m), []
    for one in near_m:
        rows = cloud.within(one, CHOSEN_M)
        if floor is not None and 0.0 < float(floor.height_m(one)) < CHOSEN_M:
            rows = rows[floor.height_m(points_m[rows]) > ABOVE_M]
        found.append((find_axis(points_m[rows], one), rows))
    return found


def _standing(points_m: Array, rim_inch: float | None) -> list[tuple[RoughAxis, Rows]]:
    """Return the wheels that stand on the floor, with the rows of points near each.

    Raises NotMeasuredError 'wheel-not-found' where all four of a vehicle stand on something higher.
    """
    centroid, normal = _pieces(points_m)
    floor = _find_floor(centroid, normal)
    cloud = _Cloud(points_m)
    found: list[tuple[RoughAxis, Rows]] = []
    raised: list[RoughAxis] = []
    for position in _positions(centroid, normal, floor):
        if _is_near(position, [rough for rough, _ in found]):
            continue
        rough = _level_axis(cloud, position, floor)
        if rough is None:
            continue
        if _over_m(rough, floor) > STANDS_M[1]:
            raised += [] if _is_near(rough.axis.point_m, raised) else [rough]
        elif _over_m(rough, floor) > STANDS_M[0]:
            wheel = _wheel_at(cloud, rough, floor, rim_inch)
            found += [] if wheel is None else [wheel]
    if not found and raised:
        _check_height([_over_m(rough, floor) for rough in raised])
    return _of_their_own(sorted(found, key=lambda one: (-one[0].circle, -one[0].score)))


def _pieces(points_m: Array) -> tuple[Array, Array]:
    """Return centroids and normals, each (S, 3), of the flat pieces of surface of a cloud."""
    voxels = voxels_without_strays(points_m, EDGE_M)
    full = np.nonzero(voxels.sums[:, 0] >= LEAST_IN_VOXEL)[0]
    centroid, normal, spread = planes_of(voxels.sums[full])
    flat = (spread[:, 0] < FLAT * spread[:, 1]) & (spread[:, 1] > 0.12 * EDGE_M)
    return (centroid + voxels.middle_m[full])[flat], normal[flat]


def _find_floor(centroid: Array, normal: Array) -> Floor:
    """Find the lowest large surface that is about level.

    Raises NotMeasuredError 'wheel-not-found'.
    """
    level = np.abs(normal[:, 2]) > LEVEL
    own, ways = centroid[level], normal[level] * np.sign(normal[level, 2])[:, None]
    up = np.array([0.0, 0.0, 1.0])
    for turn_rad in (0.2, 0.05):
        if not len(ways):
            break
        up = np.median(ways, axis=0)
        up /= np.linalg.norm(up)
        kept = ways @ up > np.cos(turn_rad)
        own, ways = own[kept], ways[kept]
    if len(own) < 100:
        raise NotMeasuredError(
            "wheel-not-found", "no floor, with z about up, is in it on which wheels could stand"
        )
    height = own @ up
    bins = np.floor(height / FLOOR_BIN_M).astype(int)
    count = np.bincount(bins - bins.min())
    lowest_bin = int(np.argmax(count > FLOOR_SHARE * count.max())) + int(bins.min())
    near = np.abs(height - np.median(height[bins == lowest_bin])) < FLOOR_BIN_M
    for _ in range(3):
        middle = own[near].mean(axis=0)
        up = np.linalg.svd(own[near] - middle, full_matrices=False)[2][2]
        up *= np.sign(up[2])
        near = np.abs((own - middle) @ up) < FLOOR_M
    return Floor(middle, up)


def _positions(centroid: Array, normal: Array, floor: Floor) -> Iterator[Array]:
    """Yield positions (3,) in which normals of a wheel's slopes may meet, most votes first."""
    height = floor.height_m(centroid)
    own = (height > BAND_M[0]) & (height < BAND_M[1])
    centroid, normal, height = centroid[own], normal[own], height[own]
    if not len(centroid):
        return
    peaks: list[tuple[float, Array]] = []
    across = plane_basis(floor.up)[:2]
    for turn in np.pi * np.arange(HEADINGS) / HEADINGS:
        along = np.cos(turn) * across[0] + np.sin(turn) * across[1]
        peaks += _peaks(centroid, normal, height, along, floor)
    peaks.sort(key=lambda peak: -peak[0])
    taken: list[Array] = []
    for votes, position in peaks:
        if len(taken) == MOST or votes < LEAST_VOTES * peaks[0][0]:
            return
        if all(_apart_m(position, other) > 0.5 * APART_M for other in taken):
            taken.append(position)
            yield position


def _peaks(
    centroid: Array, normal: Array, height: Array, along: Array, floor: Floor
) -> list[tuple[float, Array]]:
    """Return votes and positions for axes of one heading: of lines that meet, at wheels' radii."""
    slope = np.abs(normal @ along)
    own = (slope > SLANT[0]) & (slope < SLANT[1])
    ahead = np.cross(floor.up, along)
    local = centroid[own] - floor.point_m
    place = np.column_stack([local @ ahead, height[own]])
    line = np.column_stack([normal[own] @ ahead, normal[own] @ floor.up])
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    steps = np.concatenate([-RADII_M, RADII_M])
    votes = place[:, None, :] + steps[:, None] * line[:, None, :]
    depth = np.broadcast_to((local @ along)[:, None], votes.shape[:2])
    inside = (votes[..., 1] > CENTRE_M[0]) & (votes[..., 1] < CENTRE_M[1])
    if not inside.any():
        return []
    cells = np.column_stack([votes[inside] / CELL_M, depth[inside] / DEPTH_M])
    index = np.floor(cells).astype(np.int64)
    low = index.min(axis=0) - 1
    size = tuple((index.max(axis=0) - low + 2).tolist())
    count = np.bincount(np.ravel_multi_index((index - low).T, size), minlength=int(np.prod(size)))
    smooth = count.reshape(size).astype(float)
    for axis, reach in ((0, (-1, 0, 1)), (1, (-1, 0, 1)), (2, (0, 1))):
        smooth = np.sum([np.roll(smooth, -shift, axis=axis) for shift in reach], axis=0)
    best = np.argsort(-smooth, axis=None, kind="stable")[: 20 * MOST]
    cell = np.column_stack(np.unravel_index(best, size)) + low
    local = (cell + np.array([0.5, 0.5, 1.0])) * [CELL_M, CELL_M, DEPTH_M]
    positions = floor.point_m + local @ np.stack([ahead, floor.up, along])
    kept: list[tuple[float, Array]] = []
    free = np.ones(len(best), dtype=bool)
    while len(kept) < MOST and free.any():
        first = int(np.argmax(free))
        kept.append((float(smooth.flat[best[first]]), positions[first]))
        free &= np.linalg.norm(local - local[first], axis=1) > APART_M
    return kept


def _check_height(over_m: Sequence[float]) -> None:
    """Raise NotMeasuredError 'wheel-not-found' where a vehicle's wheels are alike above a floor."""
    middle_m = float(np.median(over_m))
    if np.count_nonzero(np.abs(np.array(over_m) - middle_m) < STANDS_M[1]) >= WHEELS:
        raise NotMeasuredError(
            "wheel-not-found",
            f"the wheels in it stand about {middle_m:.1f} m above its floor, as on a lift: choose "
            "a point on each of the four by --hint",
        )


def _is_near(position_m: Array, known: Sequence[RoughAxis]) -> bool:
    """Return whether a position (3,) lies at a wheel that is known."""
    return any(_apart_m(one.axis.point_m, position_m) < APART_M for one in known)


def _level_axis(cloud: _Cloud, position_m: Array, floor: Floor) -> RoughAxis | None:
    """Return the axis of the surface of revolution at a position (3,); None where it leans."""
    try:
        rough = find_axis(cloud.points_m[_above(cloud, position_m, floor)])
    except NotMeasuredError:
        return None
    leans = abs(float(rough.axis.direction @ floor.up)) > MOST_LEAN
    return None if leans else rough


def _over_m(rough: RoughAxis, floor: Floor) -> float:
    """Return how far above the floor the lowest point of a wheel is."""
    return float(floor.height_m(rough.axis.point_m)) - rough.radius_m


def _wheel_at(
    cloud: _Cloud, rough: RoughAxis, floor: Floor, rim_inch: float | None
) -> tuple[RoughAxis, Rows] | None:
    """Return the axis of a wheel, outwards, and the rows of points near it; None without a fit."""
    rows = _above(cloud, rough.axis.point_m, floor)
    try:
        outward = _outward(cut_wheel(cloud.points_m[rows], rough), rim_inch)
    except NotMeasuredError:
        return None
    return replace(rough, axis=rough.axis.towards(outward)), rows


def _outward(patch: Patch, rim_inch: float | None) -> Array:
    """Return the outward axis (3,) of the wheel in a patch.

    A rim that is not the stated one is a wheel all the same; it is refused when it is measured.
    """
    try:
        found = fit_surface(patch, rim_inch)
    except NotMeasuredError:
        if rim_inch is None:
            raise
        found = fit_surface(patch, None)
    return found.fit.axis.direction


def _above(cloud: _Cloud, centre_m: Array, floor: Floor) -> Rows:
    """Return the rows of the points about a centre (3,), without the floor."""
    rows = cloud.within(centre_m, BALL_M)
    return np.asarray(rows[floor.height_m(cloud.points_m[rows]) > ABOVE_M])


def _of_their_own(found: list[tuple[RoughAxis, Rows]]) -> list[tuple[RoughAxis, Rows]]:
    """Return the wheels, best first, without those found again, and without inner twin wheels."""
    kept: list[tuple[RoughAxis, Rows]] = []
    for one in found:
        if all(_apart_m(one[0].axis.point_m, other.axis.point_m) > APART_M for other, _ in kept):
            kept.append(one)
    return [
        one for one in kept if not any(_is_behind(one[0].axis, other.axis) for other, _ in kept)
    ]


def _is_behind(axis: Axis, other: Axis) -> bool:
    """Return whether a wheel is the inner one of two on the same hub."""
    off = other.point_m - axis.point_m
    ahead = float(off @ axis.direction)
    aside = float(np.linalg.norm(off - ahead * axis.direction))
    return aside < TWIN_M[0] and 0.0 < ahead < TWIN_M[1]


def _apart_m(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other))
