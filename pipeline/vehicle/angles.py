"""Toe and camber of a wheel plane in the vehicle frame: this module owns the signs.

Axes: left, forward and up of `VehicleFrame`; outward = left on RL and FL, -left on RR and FR.
n is the unit normal of the wheel plane that points away from the car. On both sides of the car:
- toe > 0 is toe-in: atan2(n.forward, n.outward);
- camber > 0 is positive camber, top outward: -asin(n.up), the elevation, as in the paper;
- ISO camber has the same sign: -atan2(n.up, n.outward), the projection on the plane across the car
  (ISO 8855). tan(iso) = tan(camber)/cos(toe).
Quantities of the vehicle, and angles relative to its other axes: `axes.py`.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..system import frozen
from ..vectors import Array, norm
from .frame import REFERENCE_WHEELS, VehicleFrame

# The outer side of a normal more than 84 degrees off the outward direction is ambiguous.
MIN_OUTWARD_COSINE = 0.1
# Distances to the nearest and second nearest wheel within 10 %: the wheel is ambiguous.
MAX_NEAREST_RATIO = 0.9


@frozen
class WheelAngles:
    """Toe, camber (the paper's, elevation) and ISO 8855 camber of one wheel, radians."""

    toe_rad: float
    camber_rad: float
    camber_iso_rad: float


def wheel_angles(
    frame: VehicleFrame, normal: npt.ArrayLike, wheel: str, vertical: Array | None = None
) -> WheelAngles:
    """Return the angles of one wheel plane.

    normal: (3,) in scanner coordinates, either sense, any length. wheel: RR, RL, FR or FL.
    vertical: (3,) unit, from which camber is measured; None: the frame's up.
    Raises InputError as `outward_normal` does.
    """
    n = outward_normal(frame, normal, wheel)
    n_outward, n_forward, n_up = n @ _outward(frame, wheel), n @ frame.forward, n @ frame.up
    toe_rad = math.atan2(n_forward, n_outward)
    if vertical is not None:
        rise, level = float(n @ vertical), float(np.linalg.norm(np.cross(n, vertical)))
        iso_rad = -math.atan2(rise, level * math.cos(toe_rad))
        return WheelAngles(toe_rad, -math.atan2(rise, level), iso_rad)
    return WheelAngles(
        toe_rad=toe_rad,
        camber_rad=-math.atan2(n_up, math.hypot(n_outward, n_forward)),
        camber_iso_rad=-math.atan2(n_up, n_outward),
    )


def outward_normal(frame: VehicleFrame, normal: npt.ArrayLike, wheel: str) -> Array:
    """Return the unit normal (3,), in scanner coordinates, that points away from the car.

    Raises InputError for an unknown wheel, a zero normal, and a normal along the car.
    """
    n = np.asarray(normal, dtype=np.float64)
    largest = float(np.abs(n).max())
    if not (math.isfinite(largest) and largest > 0):
        raise InputError(
            f"wheel {wheel}: its plane has the normal {n.tolist()}: fit the plane again"
        )
    n = n / largest
    n = n / norm(n)
    n_outward = float(n @ _outward(frame, wheel))
    if abs(n_outward) < MIN_OUTWARD_COSINE:
        across = float(np.linalg.norm(np.cross(n, frame.left)))
        off_deg = math.degrees(math.atan2(across, abs(n_outward)))
        raise InputError(
            f"wheel {wheel}: the normal of its plane is at {off_deg:.1f}° to the rear axle, so "
            f"its outer side is undefined: check the order {', '.join(REFERENCE_WHEELS)}"
        )
    return n if n_outward > 0 else -n


def _outward(frame: VehicleFrame, wheel: str) -> Array:
    if wheel not in REFERENCE_WHEELS:
        raise InputError(f"unknown wheel {wheel!r}: name one of {', '.join(REFERENCE_WHEELS)}")
    return frame.left if wheel.endswith("L") else -frame.left


def nearest_wheel(centres_m: npt.ArrayLike, centre_m: npt.ArrayLike) -> str:
    """Return the name of the reference wheel that a trial was made on.

    centres_m: (4, 3) of RR, RL, FR, FL; centre_m: (3,) of the trial; same coordinates, metres.
    Raises InputError where two wheels are about equally near.
    """
    offsets = np.asarray(centres_m, dtype=np.float64) - np.asarray(centre_m, dtype=np.float64)
    distance_m = np.linalg.norm(offsets, axis=1)
    first, second = np.argsort(distance_m, kind="stable")[:2]
    if not distance_m[first] <= MAX_NEAREST_RATIO * distance_m[second]:
        raise InputError(
            f"a trial lies {distance_m[first]:.3f} m from wheel {REFERENCE_WHEELS[first]} and "
            f"{distance_m[second]:.3f} m from {REFERENCE_WHEELS[second]}: name its wheel"
        )
    return REFERENCE_WHEELS[first]


def deg_min_sec(angle_rad: float, decimals: int = 1) -> str:
    """Format an angle as +00°19'40.7"; the sign belongs to the whole angle, nan is 'undefined'."""
    if not math.isfinite(angle_rad):
        return "undefined"
    steps = round(abs(math.degrees(angle_rad)) * 3600 * 10**decimals)
    minutes, steps_of_minute = divmod(steps, 60 * 10**decimals)
    degrees, minutes = divmod(minutes, 60)
    width = 3 + decimals if decimals else 2
    seconds = f"{steps_of_minute / 10**decimals:0{width}.{decimals}f}"
    sign = "-" if angle_rad < 0 and steps else "+"
    return f"{sign}{degrees:02d}°{minutes:02d}'{seconds}\""
