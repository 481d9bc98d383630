"""Poses of a rigid target, as observed and as a rotation about an axis predicts them.

Each pose has a normal and a centre; some also show the target's in-plane rotation, by its edges or
its print.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import NotMeasuredError
from ..system import frozen
from ..vectors import Array

DOUBTFUL = 0.25  # of the period: an in-plane rotation farther from the prediction is ambiguous


@frozen
class Poses:
    """Observed poses of a target, n of them.

    normals: (n, 3) unit, all to the same side. centres_m: (n, 3). covariance: (6 n + k, 6 n + k) of
    each pose's normal, then its centre, then of the k observed in-plane rotations. with_face: (k,)
    indices of the poses that show one; faces: (k, 3) an in-plane axis of each, unit, equivalent to
    any that a rotation by periods_rad (k,) makes of it.
    """

    normals: Array
    centres_m: Array
    covariance: Array
    with_face: tuple[int, ...]
    faces: Array
    periods_rad: Array


@frozen
class State:
    """An axis with a point on it, the target at rotation 0, and the rotations.

    point and centre: relative to the mean of the centres. face: in-plane axis (3,) unit, across
    `normal`; None where no in-plane rotation is observed.
    """

    axis: Array
    point: Array
    normal: Array
    centre: Array
    turns: Array
    face: Array | None

    def moved(self, step: Array) -> State:
        """Return the state after a step of the unknowns of `residual`."""
        axis = self.axis + step[:2] @ across(self.axis)
        point = self.point + step[2:4] @ across(self.axis)
        normal = self.normal + step[4:6] @ across(self.normal)
        face, count = self.face, len(self.turns)
        if face is not None:
            face = _upon(face + step[9 + count] * np.cross(self.normal, face), normal)
        return State(
            axis / np.linalg.norm(axis),
            point,
            normal / np.linalg.norm(normal),
            self.centre + step[6:9],
            self.turns + step[9 : 9 + count],
            face,
        )


def start(seen: Poses, turns: Array, axis: Array) -> tuple[State, Poses]:
    """Return start values: the target rotated back; the point by linear least squares.

    In-plane axes come back as those equivalent ones that lie nearest to the first pose's.
    Raises NotMeasuredError 'not-one-axis' where two are about as near.
    """
    centres = seen.centres_m - seen.centres_m.mean(axis=0)
    R = np.stack([turn_about(axis, turn) for turn in turns])
    normal = np.einsum("nij,ni->j", R, seen.normals)
    rows = np.concatenate([np.tile(np.eye(3), (len(R), 1, 1)), R], axis=2).reshape(-1, 6)
    found = np.linalg.lstsq(rows, centres.reshape(-1), rcond=1e-9)[0]
    normal = normal / np.linalg.norm(normal)
    state = State(axis, found[:3], normal, found[:3] + found[3:], turns, None)
    if not seen.with_face:
        return state, seen
    first = seen.with_face[0]
    state = replace(state, face=_upon(R[first].T @ seen.faces[0], normal))
    return state, replace(seen, faces=_nearest(seen, state))


def residual(state: State, seen: Poses, sides: Array) -> tuple[Array, Array]:
    """Return observed less predicted (5 n + k,), and the slopes of the predicted (5 n + k, 9 + n).

    Unknowns: axis (2) and point (2) across it, normal (2) across itself, centre (3), rotations (n);
    where in-plane rotations are observed, the target's own as well (1). sides: (n, 2, 3) across
    each normal. With the axis tilted by w, a vector R v moves by w x (R v) - R (w x v).
    """
    a, arm, count = state.axis, state.centre - state.point, len(sides)
    centres = seen.centres_m - seen.centres_m.mean(axis=0)
    tilt = np.cross(a, across(a))  # (2, 3): w of the axis' two parts, so that w x a is the part
    left, slopes = [], np.zeros((count, 5, 9 + count))
    for i, (turn, T) in enumerate(zip(state.turns, sides, strict=True)):
        R = turn_about(a, turn)
        n, c = R @ state.normal, R @ arm
        left.append(np.concatenate([T @ (seen.normals[i] - n), centres[i] - state.point - c]))
        for vector, turned, rows, place in ((state.normal, n, slice(2), T),
                                            (arm, c, slice(2, 5), np.eye(3))):  # fmt: skip
            moved = np.cross(tilt, turned) - np.cross(tilt, vector) @ R.T
            slopes[i, rows, :2] = place @ moved.T
            slopes[i, rows, 9 + i] = place @ np.cross(a, turned)
        slopes[i, 2:, 2:4] = (np.eye(3) - R) @ across(a).T
        slopes[i, :2, 4:6] = T @ R @ across(state.normal).T
        slopes[i, 2:, 6:9] = R
    whole = slopes.reshape(-1, slopes.shape[2])
    if state.face is None:
        return np.concatenate(left), whole
    turns, by_turns = _of_faces(state, state.face, seen, tilt)
    whole = np.hstack([whole, np.zeros((len(whole), 1))])
    return np.concatenate([*left, turns]), np.vstack([whole, by_turns])


def whitening(sides: Array, seen: Poses) -> tuple[Array, Array]:
    """Return the root L of the covariance of the observations of `residual`, and their Jacobian.

    Of each pose two parts of the normal along `sides` (2, 3), three of the centre; then the
    in-plane rotations. The Jacobian is by the inputs of `Poses.covariance`.
    """
    count, faces = len(sides), len(seen.with_face)
    B = np.zeros((5 * count + faces, 6 * count + faces))
    for i in range(count):
        B[5 * i : 5 * i + 2, 6 * i : 6 * i + 3] = sides[i]
        B[5 * i + 2 : 5 * i + 5, 6 * i + 3 : 6 * i + 6] = np.eye(3)
    B[5 * count :, 6 * count :] = np.eye(faces)
    V = B @ seen.covariance @ B.T
    scale = np.sqrt(np.diag(V).clip(min=1e-20))
    # A trace of rounding keeps the matrix regular where components act on all poses alike.
    regular = V / np.outer(scale, scale) + 1e-10 * np.eye(len(V))
    return scale[:, None] * np.linalg.cholesky(regular), B


def across(unit: Array) -> Array:
    """Return (2, 3): two unit vectors perpendicular to `unit` and to each other."""
    helper = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = np.cross(unit, helper)
    first /= np.linalg.norm(first)
    both: Array = np.stack([first, np.cross(unit, first)])
    return both


def turn_about(axis: Array, angle_rad: float) -> Array:
    """Return the rotation (3, 3) about a unit axis; Rodrigues (1840)."""
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    whole: Array = np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * cross @ cross
    return whole


def _of_faces(state: State, face: Array, seen: Poses, tilt: Array) -> tuple[Array, Array]:
    """Return in-plane rotations, observed less predicted (k,), and the slopes of the predicted.

    A predicted in-plane axis e lies at atan2(v.e, u.e) from the observed u, with v = n x u; where
    its normal tilts by dm, it moves by -m (e.dm).
    """
    count = len(state.turns)
    left, slopes = np.zeros(len(seen.faces)), np.zeros((len(seen.faces), 10 + count))
    for row, (i, u) in enumerate(zip(seen.with_face, seen.faces, strict=True)):
        R = turn_about(state.axis, state.turns[i])
        e, v = R @ face, np.cross(seen.normals[i], u)
        x, y = u @ e, v @ e
        left[row] = -np.arctan2(y, x)
        by_e = (x * v - y * u) / (x * x + y * y)
        slopes[row, :2] = (np.cross(tilt, e) - np.cross(tilt, face) @ R.T) @ by_e
        slopes[row, 4:6] = -(by_e @ R @ state.normal) * (across(state.normal) @ face)
        slopes[row, 9 + i] = by_e @ np.cross(state.axis, e)
        slopes[row, 9 + count] = by_e @ R @ np.cross(state.normal, face)
    return left, slopes


def _nearest(seen: Poses, state: State) -> Array:
    """Return the equivalent in-plane axes (k, 3) nearest to the predicted ones."""
    assert state.face is not None
    off, _ = _of_faces(state, state.face, seen, np.zeros((2, 3)))
    periods = np.rint(off / seen.periods_rad)
    rest = np.abs(off - periods * seen.periods_rad)
    if np.any(rest > DOUBTFUL * seen.periods_rad):
        worst = float(np.degrees(rest.max()))
        raise NotMeasuredError(
            "not-one-axis",
            f"a target is rotated in its plane by {worst:.0f}° from the prediction of one axis: it "
            "slipped on the wheel, or the wheel rolled; fasten it, hold the brake and scan again",
        )
    turned = [
        turn_about(seen.normals[i], -count * period) @ face
        for i, face, count, period in zip(
            seen.with_face, seen.faces, periods, seen.periods_rad, strict=True
        )
    ]
    return np.stack(turned)


def _upon(vector: Array, normal: Array) -> Array:
    """Return the unit projection of a vector on the plane of a normal of any length."""
    flat = vector - normal * (normal @ vector) / (normal @ normal)
    return np.asarray(flat / np.linalg.norm(flat))
