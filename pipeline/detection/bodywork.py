"""Bodywork between the axles of a vehicle: between those of two, there is a gap."""

from __future__ import annotations

import numpy as np

from ..vectors import Array

BIN_M = 0.1
GAP_M = 0.4  # without a point: between vehicles
WHEEL_M = 0.5  # from an axle, within which its wheels lie
BESIDE_M, ABOVE_M = 0.2, 0.15  # of the wheels' centres: how far the body is searched


def is_bodied(sample_m: Array, rear_m: Array, front_m: Array, across_m: Array) -> bool | None:
    """Return whether something is seen all the way between two axles, level with the wheels.

    None where nothing but the wheels is seen there, as in a cloud that was cropped to them.
    sample_m: (S, 3) points of the cloud. rear_m, front_m: (3,) middles of the axles. across_m: (3,)
    from end to end of one.
    """
    along, track_m = front_m - rear_m, float(np.linalg.norm(across_m))
    length_m = float(np.linalg.norm(along))
    upright = np.cross(along, across_m)
    local = sample_m - rear_m
    own = np.abs(local @ across_m) < (0.5 * track_m + BESIDE_M) * track_m
    own &= np.abs(local @ upright) < ABOVE_M * float(np.linalg.norm(upright))
    ahead_m = local[own] @ along / length_m
    bins = int(length_m / BIN_M)
    count, _ = np.histogram(ahead_m, bins, (0.0, length_m))
    wheels = round(WHEEL_M / BIN_M)
    if bins > 2 * wheels and not count[wheels:-wheels].any():
        return None
    empty = np.convolve(count == 0, np.ones(round(GAP_M / BIN_M)), "valid")
    return not bool(np.any(empty >= round(GAP_M / BIN_M)))
