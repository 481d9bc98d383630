"""A small sample of a cloud for the picture of a vehicle: scattered over it, reproducible."""

from __future__ import annotations

import numpy as np

from ..system import frozen
from ..vectors import Array, Array32
from .selection import sample

OF_A_SCAN, OF_A_VEHICLE = 8_000, 40_000
LOOKED_AT = 16  # a regular subset of at most so many times the sample's size is sampled
CLOSE_M, VEHICLE_M = 0.25, 6.0  # from a target: its surroundings; what may be of its vehicle
AROUND = 0.75  # beyond the wheels, relative to their distance from the middle: overhangs


@frozen(eq=False)
class CloudSample:
    """Scanned points: origin_m (3,), scanner frame, and offsets_m (N, 3) float32 from it."""

    origin_m: Array
    offsets_m: Array32

    @property
    def points_m(self) -> Array:
        """Points (N, 3), scanner frame."""
        return self.origin_m + self.offsets_m


def cloud_sample(
    points_m: Array, count: int = OF_A_SCAN, target_m: Array | None = None
) -> CloudSample:
    """Return about `count` of points_m (N, 3), or all if they are fewer.

    target_m: (3,) centre of the target, if it is known: points that cannot be the vehicle's are
    left out, and up to half are close to the target. Any prefix is a sample of both.
    """
    step = max(1, len(points_m) // (LOOKED_AT * count))
    looked_at = points_m[::step]
    if target_m is None:
        return _about(sample(looked_at, count))
    x, y, z = (column - at for column, at in zip(looked_at.T, target_m, strict=True))
    apart_m = np.sqrt(x * x + y * y + z * z)
    close = looked_at[apart_m < CLOSE_M]
    others = looked_at[(apart_m >= CLOSE_M) & (apart_m < VEHICLE_M)]
    of_target = min(len(close), max(count // 2, count - len(others)))
    kept = [sample(close, of_target), sample(others, count - of_target)]
    rank = [(np.arange(len(part)) + 0.5) / max(1, len(part)) for part in kept]
    return _about(np.concatenate(kept)[np.argsort(np.concatenate(rank), kind="stable")])


def by_wheel(points_m: Array, centres_m: Array, count: int = OF_A_VEHICLE) -> list[CloudSample]:
    """Return the first `count` of points_m (N, 3) around a vehicle, grouped by nearest wheel.

    centres_m: (4, 3) of its wheels; one sample for each.
    """
    middle = centres_m.mean(axis=0)
    reach_m = float(np.linalg.norm(centres_m - middle, axis=1).max())
    near = np.linalg.norm(points_m - middle, axis=1) < (1.0 + AROUND) * reach_m
    kept = points_m[near][:count]
    wheel = np.argmin([np.linalg.norm(kept - centre, axis=1) for centre in centres_m], axis=0)
    return [_about(kept[wheel == index]) for index in range(len(centres_m))]


def _about(points_m: Array) -> CloudSample:
    origin = points_m.mean(axis=0) if len(points_m) else np.zeros(3)
    return CloudSample(origin, (points_m - origin).astype(np.float32))
