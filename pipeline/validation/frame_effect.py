"""Parts of a difference of two methods: shape of the four centres, and tilt of the planes.

Each method has its own coordinates, so only quantities that are invariant to rigid motion can be
compared. Four centres have six of them: those of `SHAPE`. The frame's share of an angle's
difference is the change of the second method's angle when its planes are moved into the first one's
frame, by the rigid motion that best fits its four centres to those of the first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..vectors import Array
from ..vehicle import VehicleFrame, build_reference_frame, wheel_angles

# Name and unit of each; positive: forwards, left, up.
SHAPE = {
    "rear track": "m",
    "front track": "m",
    "wheelbase": "m",
    "front axle's offset, + to the left": "m",
    "front axle's direction, + left wheel ahead": "rad",
    "twist of the axles, + front left up": "rad",
}
STEP = 1e-6  # rad of a normal, m of a centre: the central difference is exact to 1e-9


def shape_of(centres_m: Array) -> Array:
    """Return the quantities of SHAPE (6,) of the centres (4, 3) of RR, RL, FR, FL."""
    frame = build_reference_frame(centres_m)
    right, left = frame.to_vehicle(centres_m[2:])
    across = left - right
    return np.array(
        [
            frame.rear_track_m,
            frame.front_track_m,
            frame.wheelbase_m,
            (left[0] + right[0]) / 2.0,
            np.arctan2(across[1], across[0]),
            np.arctan2(across[2], np.hypot(across[0], across[1])),
        ]
    )


def rigid_rotation(from_m: Array, to_m: Array) -> Array:
    """Fit the rotation (3, 3) of points from_m (N, 3) to to_m, about their means.

    Source: Kabsch, Acta Cryst. A32 (1976) 922.
    """
    inward, outward = from_m - from_m.mean(axis=0), to_m - to_m.mean(axis=0)
    left, _, right = np.linalg.svd(outward.T @ inward)
    proper = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    return np.asarray(left @ proper @ right)


def angles_in(frame: VehicleFrame, normals: Array, wheels: Sequence[str]) -> Array:
    """Return toes, then cambers (2 n,) of planes with normals (n, 3), radians."""
    found = [wheel_angles(frame, n, wheel) for n, wheel in zip(normals, wheels, strict=True)]
    return np.array([a.toe_rad for a in found] + [a.camber_rad for a in found])


def frame_share(state: Array, wheels: Sequence[str]) -> Array:
    """Return the frames' share of first less second angle (2 n,), radians.

    state: (2, n, 6) of both methods: normals and centres, each in its own coordinates.
    """
    first, second = state
    frame = build_reference_frame(first[:4, 3:])
    rotated = second[:, :3] @ rigid_rotation(second[:4, 3:], first[:4, 3:]).T
    own = build_reference_frame(second[:4, 3:])
    return angles_in(frame, rotated, wheels) - angles_in(own, second[:, :3], wheels)


def shape_difference(state: Array) -> Array:
    """Return first less second quantities of SHAPE (6,)."""
    return shape_of(state[0, :4, 3:]) - shape_of(state[1, :4, 3:])


def slopes(function: Callable[[Array], Array], state: Array) -> Array:
    """Differentiate function(state) by central differences: (q, state.size)."""
    columns = []
    for index in np.ndindex(state.shape):
        moved = np.zeros_like(state)
        moved[index] = STEP
        columns.append((function(state + moved) - function(state - moved)) / (2.0 * STEP))
    return np.stack(columns, axis=1)
