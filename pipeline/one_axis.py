"""A rigid plate in several places that turns about one fixed axis bring about: axis, turns, fit.

The plate's normal m and centre c at no turn, the axis' unit vector a and a point p of it, and the
turns t_i give what is seen: n_i = R_i m and c_i = p + R_i (c - p), R_i the turn about a by t_i. The
normals lie on a cone about a, the centres on a circle about it. What belongs to the plate, its tilt
and its offset, goes into m and c, and leaves the axis alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.distributions import chi_square_beyond
from pipeline.errors import NotMeasuredError
from pipeline.kernels import Array

STEPS = 50
SETTLED = 1e-6  # of what is seen, in standard uncertainties
SINGULAR = 1e-11  # of the scaled normal equations: what no place tells


@dataclass(frozen=True)
class OneAxis:
    """An axis and the turns about it, in the coordinates of what was seen.

    axis: (3,) unit. point_m: (3,) of the axis, level with the plate's centre along it. normal: (3,)
    and centre_m: (3,) of the plate at no turn. turns_rad: (n,) about `axis`, right-handed.
    d_axis, d_point, d_normal, d_centre: (3, 7 n), d_turns: (n, 7 n): derivatives by each place's
    normal and centre (6 n), then by the given turns (n). chi_square: of what is left, with
    `freedom` degrees; probability: of as much or more.
    """

    axis: Array
    point_m: Array
    normal: Array
    centre_m: Array
    turns_rad: Array
    d_axis: Array
    d_point: Array
    d_normal: Array
    d_centre: Array
    d_turns: Array
    chi_square: float
    freedom: int
    probability: float


@dataclass(frozen=True)
class _State:
    """The unknowns; centre and point relative to the mean of the centres."""

    axis: Array
    point: Array
    normal: Array
    centre: Array
    turns: Array


def fit_one_axis(
    normals: Array, centres_m: Array, covariance: Array, turns_rad: Array, u_turns_rad: Array,
    start_axis: Array,
) -> OneAxis:  # fmt: skip
    """Fit the axis by generalised least squares.

    normals: (n, 3) unit, all to the same side. centres_m: (n, 3). covariance: (6 n, 6 n) of each
    place's normal, then its centre. turns_rad: (n,) about start_axis (3,), near the truth, known
    with u_turns_rad (n,), inf where not; at least one must be finite, for where the count begins.
    Raises NotMeasuredError 'no-axis' where the places do not tell an axis.
    Source: Gauss and Newton's method; Aitken (1935) for the covariance.
    """
    count, middle = len(normals), centres_m.mean(axis=0)
    centres = centres_m - middle
    across = np.stack([_across(normal) for normal in normals])
    known = np.isfinite(u_turns_rad)
    L, seen = _whitening(across, covariance)
    state = _start(normals, centres, turns_rad, start_axis / np.linalg.norm(start_axis))
    for _ in range(STEPS):
        left, slopes = _residual(state, normals, centres, across)
        weighed = np.vstack([np.linalg.solve(L, slopes), _of_turns(slopes, u_turns_rad)[known]])
        given = (turns_rad - state.turns)[known] / u_turns_rad[known]
        inverse = _inverse(weighed)
        step = inverse @ np.concatenate([np.linalg.solve(L, left), given])
        state = _moved(state, step)
        if float(np.linalg.norm(weighed @ step)) < SETTLED:
            break
    else:
        raise NotMeasuredError("no-axis", "the fit of an axis does not settle")
    left, _ = _residual(state, normals, centres, across)
    whole = np.concatenate([np.linalg.solve(L, left), (turns_rad - state.turns)[known]
                            / u_turns_rad[known]])  # fmt: skip
    by_turns = np.zeros((int(known.sum()), count))
    by_turns[np.arange(len(by_turns)), np.flatnonzero(known)] = 1.0 / u_turns_rad[known]
    size = 5 * count
    gain = np.hstack([inverse[:, :size] @ np.linalg.solve(L, seen), inverse[:, size:] @ by_turns])
    freedom = len(whole) - weighed.shape[1]
    chi_square = float(whole @ whole)
    return _result(state, middle, gain, chi_square, freedom)


def _whitening(across: Array, covariance: Array) -> tuple[Array, Array]:
    """Root L (5 n, 5 n) of the covariance of what is seen, and what is seen of (6 n), (5 n, 6 n).

    Of each place two parts of the normal along `across` (2, 3), three of the centre.
    """
    count = len(across)
    seen = np.zeros((count, 5, count, 6))
    for i in range(count):
        seen[i, :2, i, :3], seen[i, 2:, i, 3:] = across[i], np.eye(3)
    B = seen.reshape(5 * count, 6 * count)
    V = B @ covariance @ B.T
    scale = np.sqrt(np.diag(V).clip(min=1e-20))
    # A trace of rounding keeps the matrix regular where causes act on all places alike.
    regular = V / np.outer(scale, scale) + 1e-10 * np.eye(len(V))
    return scale[:, None] * np.linalg.cholesky(regular), B


def _start(normals: Array, centres: Array, turns: Array, axis: Array) -> _State:
    """First values: the plate turned back by the turns; the point by linear least squares."""
    R = np.stack([_turn(axis, turn) for turn in turns])
    normal = np.einsum("nij,ni->j", R, normals)
    rows = np.concatenate([np.tile(np.eye(3), (len(R), 1, 1)), R], axis=2).reshape(-1, 6)
    found = np.linalg.lstsq(rows, centres.reshape(-1), rcond=1e-9)[0]
    return _State(axis, found[:3], normal / np.linalg.norm(normal), found[:3] + found[3:], turns)


def _residual(state: _State, normals: Array, centres: Array, across: Array) -> tuple[Array, Array]:
    """Seen less expected (5 n,), and the slopes of the expected (5 n, 9 + n).

    Unknowns: axis (2) and point (2) across it, normal (2) across itself, centre (3), turns (n).
    With the axis leaning by w, a vector R v moves by w x (R v) - R (w x v).
    """
    a, arm = state.axis, state.centre - state.point
    lean = np.cross(a, _across(a))  # (2, 3): w of the axis' two parts, so that w x a is the part
    left, slopes = [], np.zeros((len(normals), 5, 9 + len(normals)))
    for i, (turn, T) in enumerate(zip(state.turns, across, strict=True)):
        R = _turn(a, turn)
        n, c = R @ state.normal, R @ arm
        left.append(np.concatenate([T @ (normals[i] - n), centres[i] - state.point - c]))
        for vector, turned, rows, place in ((state.normal, n, slice(2), T),
                                            (arm, c, slice(2, 5), np.eye(3))):  # fmt: skip
            moved = np.cross(lean, turned) - np.cross(lean, vector) @ R.T
            slopes[i, rows, :2] = place @ moved.T
            slopes[i, rows, 9 + i] = place @ np.cross(a, turned)
        slopes[i, 2:, 2:4] = (np.eye(3) - R) @ _across(a).T
        slopes[i, :2, 4:6] = T @ R @ _across(state.normal).T
        slopes[i, 2:, 6:9] = R
    return np.concatenate(left), slopes.reshape(-1, slopes.shape[2])


def _of_turns(slopes: Array, u_turns: Array) -> Array:
    """Slopes (n, 9 + n) of the given turns over their uncertainty."""
    return np.hstack([np.zeros((len(u_turns), 9)), np.diag(1.0 / u_turns)])


def _inverse(weighed: Array) -> Array:
    """The pseudo-inverse of regular slopes, each unknown scaled by what tells it."""
    scale = np.linalg.norm(weighed, axis=0)
    if not scale.all():
        raise NotMeasuredError("no-axis", "the places do not tell an axis")
    u, s, vt = np.linalg.svd(weighed / scale, full_matrices=False)
    if s[-1] < SINGULAR * s[0]:
        raise NotMeasuredError("no-axis", "the places do not tell an axis")
    return np.asarray((vt.T / s) @ u.T / scale[:, None])


def _moved(state: _State, step: Array) -> _State:
    axis = state.axis + step[:2] @ _across(state.axis)
    point = state.point + step[2:4] @ _across(state.axis)
    normal = state.normal + step[4:6] @ _across(state.normal)
    return _State(
        axis / np.linalg.norm(axis),
        point,
        normal / np.linalg.norm(normal),
        state.centre + step[6:9],
        state.turns + step[9:],
    )


def _result(state: _State, middle: Array, gain: Array, chi_square: float, freedom: int) -> OneAxis:
    """The fit with its point moved along the axis to be level with the centre."""
    a, arm = state.axis, state.centre - state.point
    d_axis, d_centre = _across(a).T @ gain[:2], gain[6:9]
    d_point = _across(a).T @ gain[2:4]
    level = float(a @ arm)
    d_level = arm @ d_axis + a @ (d_centre - d_point)
    return OneAxis(
        axis=a,
        point_m=middle + state.point + level * a,
        normal=state.normal,
        centre_m=middle + state.centre,
        turns_rad=state.turns,
        d_axis=d_axis,
        d_point=d_point + level * d_axis + np.outer(a, d_level),
        d_normal=_across(state.normal).T @ gain[4:6],
        d_centre=d_centre,
        d_turns=gain[9:],
        chi_square=chi_square,
        freedom=freedom,
        probability=chi_square_beyond(chi_square, freedom) if freedom > 0 else 1.0,
    )


def _across(unit: Array) -> Array:
    """(2, 3): two unit vectors across `unit` and each other."""
    helper = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = np.cross(unit, helper)
    first /= np.linalg.norm(first)
    both: Array = np.stack([first, np.cross(unit, first)])
    return both


def _turn(axis: Array, angle_rad: float) -> Array:
    """(3, 3) about a unit axis; Rodrigues (1840)."""
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    whole: Array = np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * cross @ cross
    return whole
