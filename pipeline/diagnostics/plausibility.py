"""Plausibility checks of a cloud: its size in its unit, its resolution at its coordinates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..cloud import box
from ..errors import InputError, Wording
from ..readers import Part
from ..units import LENGTH_UNITS, in_metres
from ..vectors import Array

# A laser resolves nothing within the smaller, and no single cloud is wider than the larger.
CLOUD_SIZES_M = (1e-3, 20e3)
RIGID = 3e-4  # of a pose, off a rotation: one of four decimals is off by 2e-4
FEW = 0.01  # of the points, that may be wrong without the unit being wrong
COMMON_UNITS = ("m", "mm", "in")  # of scanners
WHEEL_SCAN_M = 2.0  # a typical scan of a wheel
VEHICLE_SCAN_M = 10.0  # and of a vehicle
VEHICLE_SIZES_M = (1.5, 100.0)  # the shortest wheelbase; a hall
# Of two wheel centres: a child's kart has 1 m, the longest road train 25 m. Between any two units
# lies a factor of 25 or more, so that a vehicle of 1.2 to 12.7 m whose unit is wrong is outside.
WHEELS_APART_M = (0.5, 30.0)
# Usual tracks and wheelbases: karts, and lorries of the longest wheelbases, lie outside.
TRACKS_M, WHEELBASES_M = (1.0, 3.0), (1.2, 8.0)
MIDDLE = 0.98  # of the points, whose spread counts: a few lie far outside
WIDE_SCAN_M = 200.0  # above it the points must be dense enough, somewhere, for a target
MIN_ON_TARGET = 8
COARSE_STEP = 0.02  # of the target's diameter
SAMPLED = 10_000
LONE = "{far} of {points} points lies {distance} from the others"
LONE_ONES = "{far} of {points} points lie up to {distance} from the others"

_CHUNK, _COUNTERS = 1 << 20, 1 << 22
_PRIMES = np.array([73856093, 19349669, 83492791])  # of Teschner's hash of a grid, VMV 2003


def check_cloud(points_m: Array, unit: str, source: str) -> None:
    """Raise InputError for points_m (N, 3) of a size that no laser scan has: a wrong unit."""
    size = _size(points_m)
    if size and not CLOUD_SIZES_M[0] <= size <= CLOUD_SIZES_M[1]:
        raise InputError(
            f"{source}: the cloud is {length(size)} wide in {unit}, but scans are 1 mm to 20 km "
            f"wide: {better_unit(size, unit, '--length-unit {}')}"
        )


def check_wheel_scan(points_m: Array, diameter_m: float, unit: str, source: str) -> None:
    """Raise InputError for points_m (N, 3) that cannot contain a target of that diameter.

    The cloud is smaller than half of it, or so sparse that no region of its size holds enough
    points, or its float32 coordinates lie in steps that are coarse compared with it.
    """
    size = _size(_some(points_m))
    if 0.0 < size < 0.5 * diameter_m and (size := _size(points_m)) < 0.5 * diameter_m:
        fact = f"the scan is {length(size)} wide in {unit}, its target {length(diameter_m)}"
    elif size > WIDE_SCAN_M and _densest(points_m, diameter_m) < MIN_ON_TARGET:
        fact = (
            f"the scan is {length(size)} wide in {unit}, and nowhere do {MIN_ON_TARGET} points "
            f"lie within {length(diameter_m)}, the size of its target"
        )
    else:
        _check_step(points_m, diameter_m, unit, source)
        return
    fix = better_unit(size, unit, 'length_unit = "{}"')
    raise InputError(f"{source}: {fact}: {fix}")


def check_vehicle_cloud(points_m: Array, diameter_m: float, unit: str, source: str) -> None:
    """Raise InputError for points_m (N, 3) that cannot contain a vehicle with such targets.

    Nearly all of the cloud lies within less than a wheelbase, or is wider than a hall, or its
    float32 coordinates lie in steps that are coarse compared with a target's diameter.
    """
    tail = (1.0 - MIDDLE) / 2.0
    low, high = np.quantile(_some(points_m), (tail, 1.0 - tail), axis=0)
    size = float((high - low).max())
    smallest, largest = VEHICLE_SIZES_M
    if smallest <= size <= largest:
        _check_step(points_m, diameter_m, unit, source)
        return
    fact = f"the cloud is {length(size)} wide in {unit}, and a vehicle's at least {smallest:g} m"
    if size > largest:
        fact = f"the cloud is {length(size)} wide in {unit}, {largest:g} m at most: crop it, or"
    option = '--length-unit {0}, or length_unit = "{0}" in a capture.toml'
    raise InputError(f"{source}: {fact}: {better_unit(size, unit, option, VEHICLE_SCAN_M)}")


def check_wheels(centres_m: Array, names: Sequence[str], source: str) -> None:
    """Raise InputError for wheel centres (N, 3) nearer or farther apart than any vehicle's."""
    apart_m = np.linalg.norm(centres_m[:, None] - centres_m, axis=-1)
    pairs = [(apart_m[j, i], j, i) for i in range(len(names)) for j in range(i)]
    smallest, largest = WHEELS_APART_M
    for size, one, other in (min(pairs), max(pairs)):
        if not smallest <= size <= largest:
            raise InputError(
                f"{source}: the wheel centres of {names[one]} and {names[other]} lie "
                f"{length(size)} apart, a vehicle's {smallest:g} to {largest:g} m: put all scans "
                "in one coordinate system, and check their unit and the targets that were found"
            )


def check_poses(parts: Sequence[Part], source: str) -> None:
    """Raise InputError for a pose that changes angles; one scale of all axes does not."""
    for part in parts:
        if part.T_file_scan is None:
            continue
        R = part.T_file_scan[:3, :3]
        squares = R.T @ R
        if np.abs(squares / (np.trace(squares) / 3.0) - np.eye(3)).max() > RIGID:
            scales = ", ".join(f"{scale:.6g}" for scale in np.linalg.norm(R, axis=0))
            raise InputError(
                f"{source}: the pose of its scan {part.name} is no rotation: it scales the axes by "
                f"{scales}: export it again with rigid poses"
            )


def lone_points(points_m: Array) -> str:
    """Return a note on the few points of a cloud (N, 3) that lie further off than any scan reaches.

    Empty where there are none, or so many that the cloud is as wide: a wrong unit.
    """
    reach_m = CLOUD_SIZES_M[1]
    if not len(points_m) or _size(points_m) <= reach_m:
        return ""
    middle_m = np.median(_some(points_m), axis=0)
    far = np.zeros(len(points_m), bool)
    for column, middle in zip(points_m.T, middle_m, strict=True):
        far |= np.abs(column - middle) > reach_m
    farthest_m = float(np.linalg.norm(points_m[far] - middle_m, axis=1).max())
    return lone_fact(int(far.sum()), len(points_m), farthest_m)


def lone_fact(far: int, points: int, farthest_m: float) -> str:
    """Describe points far from the others; empty where they are none, or not few."""
    if not 0 < far <= FEW * points:
        return ""
    return Wording(
        LONE if far == 1 else LONE_ONES, far=far, points=points, distance=length(farthest_m)
    )


def float32_step(points_m: Array, unit: str) -> tuple[float, float]:
    """Return the largest step of float32 coordinates and the coordinate where; 0 for none; metres.

    unit: that of the file, in which the coordinates were rounded. Whole numbers of it are no sign
    of float32: text and integers hold them too.
    """
    step, distance = 0.0, 0.0
    for column in _some(points_m).T:
        nearest = float(np.abs(column).min()) / in_metres(1.0, unit)
        tick = in_metres(float(np.spacing(np.float32(nearest))), unit)
        ticks = column / tick
        if tick <= in_metres(1.0, unit) and _are_whole(column / in_metres(1.0, unit)):
            continue
        if np.ptp(column) > 0.0 and tick > step and _are_whole(ticks):
            step, distance = tick, float(np.abs(column).max())
    return step, distance


def _are_whole(numbers: Array) -> bool:
    return bool(np.abs(numbers - np.rint(numbers)).max() < 1e-3)


def better_unit(size_m: float, unit: str, option: str, usual_m: float = WHEEL_SCAN_M) -> str:
    """Suggest the unit in which the size of a cloud would be nearest to usual_m.

    One of COMMON_UNITS, unless that is ten times off.
    """
    number = size_m / in_metres(1.0, unit)
    sizes = {u: in_metres(number, u) for u in LENGTH_UNITS if u != unit}
    off = {u: abs(math.log(size / usual_m)) for u, size in sizes.items()}
    best = min((u for u in sizes if u in COMMON_UNITS), key=lambda u: off[u])
    if off[best] > math.log(10.0):
        best = min(sizes, key=lambda u: off[u])
    if off[best] > math.log(100.0):
        return "check the unit of the file, and whether points lie far outside"
    return f"if the file is in {best}, it is {length(sizes[best])} wide: give {option.format(best)}"


def vehicle_unit(tracks_m: Sequence[float], wheelbases_m: Sequence[float], unit: str) -> str:
    """Return the other unit in which tracks and wheelbases are usual ones; "" where none is."""
    for other in LENGTH_UNITS:
        scale = in_metres(1.0, other) / in_metres(1.0, unit)
        tracks, wheelbases = ([scale * one for one in sizes] for sizes in (tracks_m, wheelbases_m))
        if other != unit and is_usual(tracks, TRACKS_M) and is_usual(wheelbases, WHEELBASES_M):
            return other
    return ""


def is_usual(sizes_m: Sequence[float], usual_m: tuple[float, float]) -> bool:
    """Return whether all sizes lie within the usual ones."""
    return all(usual_m[0] <= size <= usual_m[1] for size in sizes_m)


def length(metres: float) -> str:
    """Format a length with a suitable unit."""
    for factor, unit in ((1e3, "km"), (1.0, "m"), (1e-3, "mm")):
        if metres >= factor:
            return f"{metres / factor:.4g} {unit}"
    return f"{metres * 1e3:.2g} mm"


def _size(points_m: Array) -> float:
    """Return the longest side of the box about points_m (N, 3)."""
    return float(np.ptp(box(points_m), axis=0).max())


def _some(points_m: Array) -> Array:
    return points_m[:: max(1, len(points_m) // SAMPLED)]


def _densest(points_m: Array, width_m: float) -> int:
    """Return the most points in a voxel of that width, or more: voxels share few counters."""
    counts = np.zeros(_COUNTERS, np.int64)
    for start in range(0, len(points_m), _CHUNK):
        cells = np.floor(points_m[start : start + _CHUNK] / width_m).astype(np.int64)
        counts += np.bincount((cells @ _PRIMES) % _COUNTERS, minlength=_COUNTERS)
    return int(counts.max())


def _check_step(points_m: Array, diameter_m: float, unit: str, source: str) -> None:
    step, distance = float32_step(points_m, unit)
    if step > COARSE_STEP * diameter_m:
        raise InputError(
            f"{source}: {float32_fact(step, distance)}, too coarse for a target of "
            f"{length(diameter_m)}: export it as double, or with an offset near the vehicle"
        )


def float32_fact(step_m: float, distance_m: float) -> str:
    """Describe the effect of float32 on coordinates."""
    return (
        f"its coordinates are float32, which at {length(distance_m)} from the origin "
        f"lie in steps of {length(step_m)}"
    )
