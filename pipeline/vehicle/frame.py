"""The vehicle frame from the centres of the four reference wheels, as the paper defines it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..vectors import Array, cross

REFERENCE_WHEELS = ("RR", "RL", "FR", "FL")

# A centre that is off by s tilts the frame by s/height, height being that of the flattest triangle
# of three centres. Vehicles keep height > 0.15 of the largest distance between two centres (a long
# lorry); at 0.05 of 3 m, 0.1 mm in a centre is already 2' in every angle.
MIN_HEIGHT_TO_SPREAD = 0.05
# Front axle 84 degrees off the rear one: t = u_R.(c_R - c_F)/(u_F.u_R) grows tenfold.
MIN_AXLE_COSINE = 0.1
# float64 still resolves 2 um here.
MAX_COORDINATE_M = 1e10


@dataclass(frozen=True)
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
        """Give points (..., 3) of the scanner as (left, forward, up), metres from the origin."""
        local: Array = np.asarray(points_m, dtype=np.float64) - self.origin_m
        return local @ self.R_vehicle_scanner.T


def build_reference_frame(centres_m: npt.ArrayLike) -> VehicleFrame:
    """Build the vehicle frame from four wheel centres.

    centres_m: (4, 3) in scanner coordinates, metres, in the order RR, RL, FR, FL.
    Raises InputError where the centres do not define a frame well.
    Source: the paper, section 2; `forward` is its thrust axis v and `up` is -w.
    """
    centres = np.asarray(centres_m, dtype=np.float64)
    _check_numbers(centres)
    local = centres - centres[0]
    spread_m = _check_triangles(local)
    rear_right, rear_left, front_right, front_left = local
    c_R, c_F = (rear_left + rear_right) / 2, (front_left + front_right) / 2
    rear_track_m = float(np.linalg.norm(rear_left - rear_right))
    front_track_m = float(np.linalg.norm(front_left - front_right))
    u_R, u_F = (rear_left - rear_right) / rear_track_m, (front_left - front_right) / front_track_m
    _check_axles(u_R, u_F)
    t = u_R @ (c_R - c_F) / (u_F @ u_R)
    to_front = c_F + t * u_F - c_R  # e - c_R
    to_front = to_front - (to_front @ u_R) * u_R  # rounding only: t makes it perpendicular
    wheelbase_m = float(np.linalg.norm(to_front))
    _check_wheelbase(wheelbase_m, spread_m)
    v = to_front / wheelbase_m
    origin_m = centres[0] + c_R
    return VehicleFrame(origin_m, u_R, v, cross(v, u_R), rear_track_m, front_track_m, wheelbase_m)


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
    """Return the largest distance between two centres, after refusing equal or collinear ones."""
    distance_m = {
        (i, j): float(np.linalg.norm(local[i] - local[j])) for i, j in combinations(range(4), 2)
    }
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
        area_twice = np.linalg.norm(cross(local[b] - local[a], local[c] - local[a]))
        height_m = float(area_twice) / longest_m
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
            f"the front axle (FR to FL) stands {angle_deg:.2f}° to the rear axle (RR to RL), so "
            f"the thrust axis is undefined: check the order {', '.join(REFERENCE_WHEELS)}"
        )


def _check_wheelbase(wheelbase_m: float, spread_m: float) -> None:
    if wheelbase_m <= MIN_HEIGHT_TO_SPREAD * spread_m:
        raise InputError(
            f"the line of the front axle (FR to FL) passes {wheelbase_m:.4f} m from the middle of "
            f"the rear axle: check the order {', '.join(REFERENCE_WHEELS)}"
        )


def rotation_by_basis(frame: VehicleFrame) -> Array:
    """Turn scanner coordinates to the paper's axes u_R, v, w by a change of basis.

    Returns the proper rotation R_paper_scanner (3, 3); w = u_R x v points down (w = -up).
    Source: the paper, section 3, `Mt = M/[uxv,uyv,uzv]'`.
    """
    return np.array([frame.left, frame.forward, -frame.up])


def rotation_by_rodrigues(frame: VehicleFrame) -> Array:
    """Give the rotation of `rotation_by_basis` by Rodrigues' formula, then a turn about x.

    The formula about k = i x u_R by omega takes i to u_R; its transpose takes u_R to i.
    Source: the paper, equations (2, 3), with k normalised in every term.
    """
    k, omega = _axis_and_angle(frame.left)
    k_cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    M = np.cos(omega) * np.eye(3) + np.sin(omega) * k_cross
    M += (1 - np.cos(omega)) * np.outer(k, k)
    return _with_front_axle_on_y(M.T, frame)


def rotation_by_quaternion(frame: VehicleFrame) -> Array:
    """Give the rotation of `rotation_by_basis` by the quaternion matrix, then a turn about x.

    Source: the paper, equation (5), with a = cos(omega/2) where it prints a sine.
    """
    k, omega = _axis_and_angle(frame.left)
    a, (b, c, d) = np.cos(omega / 2), k * np.sin(omega / 2)
    M = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ]
    )
    return _with_front_axle_on_y(M.T, frame)


def _axis_and_angle(u_R: Array) -> tuple[Array, float]:
    """Return k = i x u_R normalised, and omega; where they are parallel any k across i serves."""
    sine = float(np.hypot(u_R[1], u_R[2]))
    k = np.array([0.0, -u_R[2] / sine, u_R[1] / sine]) if sine > 0 else np.array([0.0, 1.0, 0.0])
    return k, float(np.arctan2(sine, u_R[0]))


def _with_front_axle_on_y(R: Array, frame: VehicleFrame) -> Array:
    """Follow R with the paper's last rotation, about x, which brings the thrust axis to y."""
    _, y, z = R @ frame.forward
    cosine, sine = np.array([y, z]) / np.hypot(y, z)
    about_x: Array = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])
    return about_x @ R
