"""The fixed axis about which a rigid target was rotated into several poses.

The target's normal m and centre c at rotation 0, the axis' unit vector a, a point p on it and the
rotations t_i give the poses n_i = R_i m and c_i = p + R_i (c - p), R_i the rotation about a by t_i.
The normals lie on a cone about a, the centres on a circle about it. The tilt and the offset of the
target go into m and c and do not affect the axis. Where a target shows its in-plane rotation as
well, its whole rotation is observed, and the axis with it.
"""

from __future__ import annotations

import numpy as np

from ..errors import NotMeasuredError
from ..system import frozen
from ..uncertainty import chi_square_beyond
from ..vectors import Array
from .plate_pose import Poses, State, across, residual, start, whitening

STEPS = 50
CONVERGED = 1e-6  # step, in standard uncertainties of the observations
SINGULAR = 1e-11  # smallest relative singular value of the scaled equations


@frozen
class OneAxis:
    """An axis and the rotations about it, in the coordinates of the poses.

    axis: (3,) unit. point_m: (3,) on the axis, level with the target's centre along it. normal:
    (3,) and centre_m: (3,) of the target at rotation 0. turns_rad: (n,) about `axis`, right-handed.
    d_axis, d_point, d_normal, d_centre: (3, 7 n + k), d_turns: (n, 7 n + k): derivatives by each
    pose's normal and centre (6 n), by the stated rotations (n), by the observed in-plane rotations
    (k). chi_square: of the residuals, with `dof` degrees of freedom; probability: of as much or
    more.
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
    dof: int
    probability: float


def fit_one_axis(seen: Poses, turns_rad: Array, u_turns_rad: Array, start_axis: Array) -> OneAxis:
    """Fit the axis by generalised least squares to n poses.

    turns_rad: (n,) about start_axis (3,), near the truth, known with u_turns_rad (n,), inf where
    not; at least one must be finite, to fix the origin of the rotations.
    Raises NotMeasuredError 'no-axis' where the poses do not determine an axis, 'not-one-axis' where
    an in-plane rotation is ambiguous.
    Source: Gauss and Newton's method; Aitken (1935) for the covariance.
    """
    count = len(seen.normals)
    sides = np.stack([across(normal) for normal in seen.normals])
    known = np.isfinite(u_turns_rad)
    L, B = whitening(sides, seen)
    state, seen = start(seen, turns_rad, start_axis / np.linalg.norm(start_axis))
    for _ in range(STEPS):
        left, slopes = residual(state, seen, sides)
        weighed = np.vstack([np.linalg.solve(L, slopes), _of_turns(slopes, u_turns_rad)[known]])
        given = (turns_rad - state.turns)[known] / u_turns_rad[known]
        inverse = _inverse(weighed)
        step = inverse @ np.concatenate([np.linalg.solve(L, left), given])
        state = state.moved(step)
        if float(np.linalg.norm(weighed @ step)) < CONVERGED:
            break
    else:
        raise NotMeasuredError("no-axis", "the fit of an axis does not converge")
    left, _ = residual(state, seen, sides)
    whole = np.concatenate([np.linalg.solve(L, left), (turns_rad - state.turns)[known]
                            / u_turns_rad[known]])  # fmt: skip
    by_turns = np.zeros((int(known.sum()), count))
    by_turns[np.arange(len(by_turns)), np.flatnonzero(known)] = 1.0 / u_turns_rad[known]
    by_seen = inverse[:, : len(L)] @ np.linalg.solve(L, B)
    by_stated = inverse[:, len(L) :] @ by_turns
    gain = np.hstack([by_seen[:, : 6 * count], by_stated, by_seen[:, 6 * count :]])
    dof = len(whole) - weighed.shape[1]
    chi_square = float(whole @ whole)
    return _result(state, seen.centres_m.mean(axis=0), gain, chi_square, dof)


def _of_turns(slopes: Array, u_turns: Array) -> Array:
    """Return the slopes of the stated rotations (n,) over their uncertainty, by all unknowns."""
    count = len(u_turns)
    whole = np.zeros((count, slopes.shape[1]))
    whole[:, 9 : 9 + count] = np.diag(1.0 / u_turns)
    return whole


def _inverse(weighed: Array) -> Array:
    """Return the pseudo-inverse of regular slopes, with each unknown scaled."""
    scale = np.linalg.norm(weighed, axis=0)
    if not scale.all():
        raise NotMeasuredError("no-axis", "the poses do not determine an axis")
    u, s, vt = np.linalg.svd(weighed / scale, full_matrices=False)
    if s[-1] < SINGULAR * s[0]:
        raise NotMeasuredError("no-axis", "the poses do not determine an axis")
    return np.asarray((vt.T / s) @ u.T / scale[:, None])


def _result(state: State, middle: Array, gain: Array, chi_square: float, dof: int) -> OneAxis:
    """Return the fit with its point moved along the axis to be level with the centre."""
    a, arm = state.axis, state.centre - state.point
    d_axis, d_centre = across(a).T @ gain[:2], gain[6:9]
    d_point = across(a).T @ gain[2:4]
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
        d_normal=across(state.normal).T @ gain[4:6],
        d_centre=d_centre,
        d_turns=gain[9 : 9 + len(state.turns)],
        chi_square=chi_square,
        dof=dof,
        probability=chi_square_beyond(chi_square, dof) if dof > 0 else 1.0,
    )
