"""A rigid plate in several places that turns about one fixed axis bring about: axis, turns, fit.

The plate's normal m and centre c at no turn, the axis' unit vector a and a point p of it, and the
turns t_i give what is seen: n_i = R_i m and c_i = p + R_i (c - p), R_i the turn about a by t_i. The
normals lie on a cone about a, the centres on a circle about it. What belongs to the plate, its tilt
and its offset, goes into m and c, and leaves the axis alone. Where a face shows its turn about its
own normal as well, the whole rotation of the plate is seen, and its axis with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import NotMeasuredError
from ..uncertainty import chi_square_beyond
from ..vectors import Array
from .plate_pose import Poses, State, across, residual, start, whitening

STEPS = 50
SETTLED = 1e-6  # of what is seen, in standard uncertainties
SINGULAR = 1e-11  # of the scaled normal equations: what no place tells


@dataclass(frozen=True)
class OneAxis:
    """An axis and the turns about it, in the coordinates of what was seen.

    axis: (3,) unit. point_m: (3,) of the axis, level with the plate's centre along it. normal: (3,)
    and centre_m: (3,) of the plate at no turn. turns_rad: (n,) about `axis`, right-handed.
    d_axis, d_point, d_normal, d_centre: (3, 7 n + k), d_turns: (n, 7 n + k): derivatives by each
    place's normal and centre (6 n), by the given turns (n), by the seen ones (k). chi_square: of
    what is left, with `freedom` degrees; probability: of as much or more.
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
    """Fit the axis by generalised least squares to what is seen of n places.

    turns_rad: (n,) about start_axis (3,), near the truth, known with u_turns_rad (n,), inf where
    not; at least one must be finite, for where the count begins.
    Raises NotMeasuredError 'no-axis' where the places do not tell an axis, 'not-one-axis' where a
    face is seen at a turn that may be taken either way.
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
        if float(np.linalg.norm(weighed @ step)) < SETTLED:
            break
    else:
        raise NotMeasuredError("no-axis", "the fit of an axis does not settle")
    left, _ = residual(state, seen, sides)
    whole = np.concatenate([np.linalg.solve(L, left), (turns_rad - state.turns)[known]
                            / u_turns_rad[known]])  # fmt: skip
    by_turns = np.zeros((int(known.sum()), count))
    by_turns[np.arange(len(by_turns)), np.flatnonzero(known)] = 1.0 / u_turns_rad[known]
    by_seen = inverse[:, : len(L)] @ np.linalg.solve(L, B)
    told = inverse[:, len(L) :] @ by_turns
    gain = np.hstack([by_seen[:, : 6 * count], told, by_seen[:, 6 * count :]])
    dof = len(whole) - weighed.shape[1]
    chi_square = float(whole @ whole)
    return _result(state, seen.centres_m.mean(axis=0), gain, chi_square, dof)


def _of_turns(slopes: Array, u_turns: Array) -> Array:
    """Slopes, by as many unknowns, of the given turns (n,) over their uncertainty."""
    count = len(u_turns)
    whole = np.zeros((count, slopes.shape[1]))
    whole[:, 9 : 9 + count] = np.diag(1.0 / u_turns)
    return whole


def _inverse(weighed: Array) -> Array:
    """The pseudo-inverse of regular slopes, each unknown scaled by what tells it."""
    scale = np.linalg.norm(weighed, axis=0)
    if not scale.all():
        raise NotMeasuredError("no-axis", "the places do not tell an axis")
    u, s, vt = np.linalg.svd(weighed / scale, full_matrices=False)
    if s[-1] < SINGULAR * s[0]:
        raise NotMeasuredError("no-axis", "the places do not tell an axis")
    return np.asarray((vt.T / s) @ u.T / scale[:, None])


def _result(state: State, middle: Array, gain: Array, chi_square: float, dof: int) -> OneAxis:
    """The fit with its point moved along the axis to be level with the centre."""
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
