"""Why two methods differ: the shape that their centres make, apart from the leaning of planes.

Both methods have coordinates of their own, so only what no rigid motion changes can be compared.
Four centres have six such numbers: those of `SHAPE`. The frame's share of an angle's difference is
what remains of it when the second method's planes are brought into the first one's frame, by the
rigid motion that brings its four centres nearest to the first one's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..vectors import Array
from ..vehicle import VehicleFrame, build_reference_frame, wheel_angles

# Unit and words of each; signs as of a walk round the car: forwards, left, up.
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
    """The numbers of SHAPE of the centres (4, 3) of RR, RL, FR, FL: (6,)."""
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
    """Rotation (3, 3) that brings the points from_m (N, 3) nearest to to_m, after a shift.

    Source: Kabsch, Acta Cryst. A32 (1976) 922.
    """
    inward, outward = from_m - from_m.mean(axis=0), to_m - to_m.mean(axis=0)
    left, _, right = np.linalg.svd(outward.T @ inward)
    proper = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    return np.asarray(left @ proper @ right)


def angles_in(frame: VehicleFrame, normals: Array, wheels: Sequence[str]) -> Array:
    """Toes, then cambers, of planes with normals (n, 3): (2 n,), radians."""
    found = [wheel_angles(frame, n, wheel) for n, wheel in zip(normals, wheels, strict=True)]
    return np.array([a.toe_rad for a in found] + [a.camber_rad for a in found])


def frame_share(state: Array, wheels: Sequence[str]) -> Array:
    """What the frames add to first less second angle (2 n,), radians.

    state: (2, n, 6) of both methods: normals and centres, each in its own coordinates.
    """
    first, second = state
    frame = build_reference_frame(first[:4, 3:])
    turned = second[:, :3] @ rigid_rotation(second[:4, 3:], first[:4, 3:]).T
    own = build_reference_frame(second[:4, 3:])
    return angles_in(frame, turned, wheels) - angles_in(own, second[:, :3], wheels)


def shape_difference(state: Array) -> Array:
    """First less second of the numbers of SHAPE (6,)."""
    return shape_of(state[0, :4, 3:]) - shape_of(state[1, :4, 3:])


def slopes(function: Callable[[Array], Array], state: Array) -> Array:
    """Derivatives (q, state.size) of function(state) by central differences."""
    columns = []
    for index in np.ndindex(state.shape):
        moved = np.zeros_like(state)
        moved[index] = STEP
        columns.append((function(state + moved) - function(state - moved)) / (2.0 * STEP))
    return np.stack(columns, axis=1)
