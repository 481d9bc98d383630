"""Values of every angle and length, and their derivatives by every normal and centre."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..system import frozen
from ..vectors import Array
from .angles import outward_normal
from .autodiff import Dual, length
from .axes import Position, Vehicle, Wheel, upright
from .definitions import VEHICLE, WHEEL
from .frame import REFERENCE_WHEELS, VehicleFrame, build_reference_frame


@frozen
class Linear:
    """All Q quantities of W targets: those of WHEEL, each for all targets, then those of VEHICLE.

    values: (Q,) radians and metres. slopes: (Q, 6 W) derivatives by each target's normal, then its
    centre.
    """

    values: Array
    slopes: Array


@frozen
class FrameSlopes:
    """Derivatives of the frame by the twelve coordinates of RR, RL, FR, FL.

    left, forward, up: (3, 12). lengths: (3, 12) of rear track, front track and wheelbase.
    """

    left: Array
    forward: Array
    up: Array
    lengths: Array


def linearise(
    centres_m: Array, normals: Array, wheels: Sequence[str], vertical: Array | None = None
) -> Linear:
    """Compute every quantity of W targets and its derivatives; the first four: RR, RL, FR, FL.

    centres_m: (4, 3) of these four; normals: (W, 3) unit, either sense; wheels: (W,) names.
    vertical: (3,) unit, upwards, from which camber is measured, an input like a target's normal,
    with six more derivatives; None: the frame's up.
    """
    vehicle = _dual_vehicle(centres_m, normals, wheels, vertical)
    rows = [entry.of(vehicle, i) for entry in WHEEL for i in range(len(normals))]
    rows += [entry.of(vehicle) for entry in VEHICLE]
    return Linear(np.array([row.value for row in rows]), np.stack([row.slope for row in rows]))


def jacobian(centres_m: Array, normals: Array, wheels: Sequence[str]) -> Array:
    """Return the derivatives (Q, 6 W) of `linearise`."""
    return linearise(centres_m, normals, wheels).slopes


def _dual_vehicle(
    centres_m: Array, normals: Array, wheels: Sequence[str], vertical: Array | None
) -> Vehicle:
    """Return the vehicle in its frame, with derivatives by scanner-frame normals and centres."""
    frame = build_reference_frame(centres_m)
    centres = centres_m - centres_m[0]
    slopes = frame_slopes(frame, centres)
    count = len(normals) + (vertical is not None)
    columns = np.eye(6 * count).reshape(count, 2, 3, -1)  # normal, centre
    above = None if vertical is None else _in_frame(frame, slopes, vertical, columns[-1, 0])
    origin, d_origin = centres[:2].mean(axis=0), columns[:2, 1].mean(axis=0)
    found = []
    for normal, wheel, own in zip(normals, wheels, columns[: len(normals), 0], strict=True):
        n = outward_normal(frame, normal, wheel)
        facing = 1.0 if n @ normal > 0.0 else -1.0
        left, forward, up = _in_frame(frame, slopes, n, facing * own)
        side = 1.0 if wheel.endswith("L") else -1.0
        rise = level = None
        if above is not None:
            aside, ahead, rise = upright((left, forward, up), above)
            level = length(aside, ahead)
        place = REFERENCE_WHEELS.index(wheel)
        found.append(Wheel(side, place, left * side, forward, up, rise, level))
    rear_right, rear_left, front_right, front_left = (
        Position(*_in_frame(frame, slopes, centre - origin, own - d_origin))
        for centre, own in zip(centres, columns[:4, 1], strict=True)
    )
    lengths = (frame.rear_track_m, frame.front_track_m, frame.wheelbase_m)
    return Vehicle(
        tuple(found),
        (rear_right, rear_left, front_right, front_left),
        *(
            Dual(value, _by_centres(slope, count))
            for value, slope in zip(lengths, slopes.lengths, strict=True)
        ),
    )


def _in_frame(
    frame: VehicleFrame, slopes: FrameSlopes, vector: Array, moved: Array
) -> tuple[Dual, Dual, Dual]:
    """Return the components of a vector (3,) with derivatives (3, 6 W): d(x.a) = dx.a + x.da."""
    count = moved.shape[1] // 6
    axes = ((frame.left, slopes.left), (frame.forward, slopes.forward), (frame.up, slopes.up))
    left, forward, up = (
        Dual(float(vector @ axis), axis @ moved + _by_centres(vector @ d_axis, count))
        for axis, d_axis in axes
    )
    return left, forward, up


def _by_centres(slope: Array, count: int) -> Array:
    """Return derivatives (6 W,) from those (12,) by the coordinates of the first four centres."""
    whole = np.zeros((count, 6))
    whole[:4, 3:] = slope.reshape(4, 3)
    return whole.reshape(-1)


def frame_slopes(frame: VehicleFrame, centres: Array) -> FrameSlopes:
    """Return the derivatives of `build_reference_frame`.

    f = FL - FR; E runs from the origin to the front axle's line.

    E = c_F - c_R + t f and u . E = 0 give dt = -(E . du + u . (dc_F - dc_R + t df)) / (u . f).
    """
    u, v, eye, none = frame.left, frame.forward, np.eye(3), np.zeros((3, 3))
    d_rear = np.hstack([-eye, eye, none, none])
    d_front = np.hstack([none, none, -eye, eye])
    d_between = np.hstack([-eye, -eye, eye, eye]) / 2.0  # of c_F - c_R
    f = centres[3] - centres[2]
    between = (centres[2] + centres[3] - centres[0] - centres[1]) / 2.0
    t = -(u @ between) / (u @ f)
    du = _across(u) @ d_rear / frame.rear_track_m
    fixed = d_between + t * d_front
    E = frame.wheelbase_m * v
    dE = fixed - np.outer(f, (E @ du + u @ fixed) / (u @ f))
    dv = _across(v) @ dE / frame.wheelbase_m
    dw = np.cross(dv, u, axisa=0).T + np.cross(v, du, axisb=0).T
    u_F = f / frame.front_track_m
    return FrameSlopes(du, dv, dw, np.stack([u @ d_rear, u_F @ d_front, v @ dE]))


def _across(unit: Array) -> Array:
    return np.asarray(np.eye(3) - np.outer(unit, unit))
