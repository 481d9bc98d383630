"""The vehicle frame from the centres of the four reference wheels, as the paper defines it."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..system import frozen
from ..vectors import Array, cross, norm

REFERENCE_WHEELS = ("RR", "RL", "FR", "FL")

# An error s of a centre tilts the frame by s/height, where height is that of the flattest triangle
# of three centres. Vehicles keep height > 0.15 of the largest distance between two centres (a long
# lorry); at 0.05 of 3 m, 0.1 mm in a centre is already 2' in every angle.
MIN_HEIGHT_TO_SPREAD = 0.05
# Front axle 84 degrees off the rear one: t = u_R.(c_R - c_F)/(u_F.u_R) grows tenfold.
MIN_AXLE_COSINE = 0.1
# float64 resolves 2 um at this distance.
MAX_COORDINATE_M = 1e10


@frozen
class VehicleFrame:
    """The frame of one vehicle, in scanner coordinates.

    origin_m: (3,) middle of the rear axle.
    left, forward, up: (3,) orthonormal, up = forward x left.
    wheelbase_m: from the origin, along forward, to the line of the front axle.
    """

    origin_m: Array
    left: Array
    forward: Array
    up: Array
    rear_track_m: float
    front_track_m: float
    wheelbase_m: float

    @property
    def R_vehicle_scanner(self) -> Array:
        """(3, 3) with rows left, forward, up: orthogonal, of determinant -1 (left-handed order)."""
        return np.array([self.left, self.forward, self.up])

    def to_vehicle(self, points_m: npt.ArrayLike) -> Array:
        """Return scanner points (..., 3) as (left, forward, up), metres from the origin."""
        local: Array = np.asarray(points_m, dtype=np.float64) - self.origin_m
        return local @ self.R_vehicle_scanner.T


def build_reference_frame(centres_m: npt.ArrayLike) -> VehicleFrame:
    """Build the vehicle frame from four wheel centres.

    centres_m: (4, 3) in scanner coordinates, metres, in the order RR, RL, FR, FL.
    Raises InputError where the centres do not determine a frame.
    Source: the paper, section 2; `forward` is its thrust axis v and `up` is -w.
    """
    centres = np.asarray(centres_m, dtype=np.float64)
    _check_numbers(centres)
    return _built(centres.tobytes())


@lru_cache(maxsize=16)  # every step of a measurement asks for the same frame
def _built(data: bytes) -> VehicleFrame:
    """Build the frame of centres (4, 3), bytes of float64; its arrays are read-only: shared."""
    centres = np.frombuffer(data).reshape(4, 3)
    local = centres - centres[0]
    spread_m = _check_triangles(local)
    rear_right, rear_left, front_right, front_left = local
    c_R, c_F = (rear_left + rear_right) / 2, (front_left + front_right) / 2
    rear_track_m = norm(rear_left - rear_right)
    front_track_m = norm(front_left - front_right)
    u_R, u_F = (rear_left - rear_right) / rear_track_m, (front_left - front_right) / front_track_m
    _check_axles(u_R, u_F)
    t = u_R @ (c_R - c_F) / (u_F @ u_R)
    to_front = c_F + t * u_F - c_R  # e - c_R
    to_front = to_front - (to_front @ u_R) * u_R  # removes rounding: t makes it perpendicular
    wheelbase_m = norm(to_front)
    _check_wheelbase(wheelbase_m, spread_m)
    v = to_front / wheelbase_m
    axes = centres[0] + c_R, u_R, v, cross(v, u_R)
    for array in axes:
        array.flags.writeable = False
    return VehicleFrame(*axes, rear_track_m, front_track_m, wheelbase_m)


def _check_numbers(centres: Array) -> None:
    if centres.shape != (4, 3):
        raise InputError(
            f"a frame needs 4 wheel centres of 3 coordinates, got an array of {centres.shape}: "
            f"give {', '.join(REFERENCE_WHEELS)} in this order"
        )
    for wheel, centre in zip(REFERENCE_WHEELS, centres, strict=True):
        if not bool(np.all(np.abs(centre) <= MAX_COORDINATE_M)):
            raise InputError(
                f"the centre of wheel {wheel} is ({', '.join(f'{x:g}' for x in centre)}) m: "
                f"give finite coordinates below {MAX_COORDINATE_M:g} m"
            )


def _check_triangles(local: Array) -> float:
    """Return the largest distance between two centres; raise for equal or collinear ones."""
    distance_m = {(i, j): norm(local[i] - local[j]) for i, j in combinations(range(4), 2)}
    spread_m = max(distance_m.values())
    limit_m = MIN_HEIGHT_TO_SPREAD * spread_m
    (i, j), closest_m = min(distance_m.items(), key=lambda item: item[1])
    if closest_m <= limit_m:
        raise InputError(
            f"the centres of wheels {REFERENCE_WHEELS[i]} and {REFERENCE_WHEELS[j]} are only "
            f"{closest_m:.4f} m apart (vehicle: {spread_m:.4f} m): give four different wheels, "
            f"in the order {', '.join(REFERENCE_WHEELS)}"
        )
    for a, b, c in combinations(range(4), 3):
        longest_m = max(distance_m[a, b], distance_m[a, c], distance_m[b, c])
        height_m = norm(cross(local[b] - local[a], local[c] - local[a])) / longest_m
        if height_m <= limit_m:
            wheels = ", ".join(REFERENCE_WHEELS[k] for k in (a, b, c))
            raise InputError(
                f"the centres of wheels {wheels} lie on one line within {height_m:.4f} m, where "
                f"more than {limit_m:.4f} m is needed: check these centres and their order"
            )
    return spread_m


def _check_axles(u_R: Array, u_F: Array) -> None:
    cosine = float(u_F @ u_R)
    if cosine < -MIN_AXLE_COSINE:
        raise InputError(
            "the front axle (FR to FL) runs against the rear axle (RR to RL), so one of them is "
            f"named from left to right: check the order {', '.join(REFERENCE_WHEELS)}"
        )
    if cosine < MIN_AXLE_COSINE:
        angle_deg = np.degrees(np.arctan2(np.linalg.norm(np.cross(u_R, u_F)), cosine))
        raise InputError(
            f"the front axle (FR to FL) is at {angle_deg:.2f}° to the rear axle (RR to RL), so "
            f"the thrust axis is undefined: check the order {', '.join(REFERENCE_WHEELS)}"
        )


def _check_wheelbase(wheelbase_m: float, spread_m: float) -> None:
    if wheelbase_m <= MIN_HEIGHT_TO_SPREAD * spread_m:
        raise InputError(
            f"the line of the front axle (FR to FL) passes {wheelbase_m:.4f} m from the middle of "
            f"the rear axle: check the order {', '.join(REFERENCE_WHEELS)}"
        )


def rotation_by_basis(frame: VehicleFrame) -> Array:
    """Return the proper rotation R_paper_scanner (3, 3) to the paper's axes u_R, v, w.

    w = u_R x v points down (w = -up).
    Source: the paper, section 3, `Mt = M/[uxv,uyv,uzv]'`.
    """
    return np.array([frame.left, frame.forward, -frame.up])
