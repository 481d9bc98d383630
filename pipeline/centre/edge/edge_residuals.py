"""Residuals of the points about an edge from the mixed-pixel profile, linearised."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...targets import Outline, sector
from ...vectors import Array
from .beams import BEAM, RATIO, SPOT, THICKNESS, Background, Beams, Prior, carry
from .mixed_pixel import EdgeProfile, edge_profile

INNER_M, OUTER_M = 0.006, 0.006  # how far inside and outside the edge the profile is compared
POINTING_M = 1.5e-4  # standard uncertainty of x by beam pointing and scan grid
DEPTH_SHARE = 0.02  # of the background's depth: its change between look-up and beam
SECTORS = 24  # of the outline, taken as independent of each other
LIMIT = np.array([0.002, 0.002, 0.1, 0.1, 0.2, 0.3, 0.5, 0.5, 0.02, 0.3, 0.3, 0.3])  # of a step


@dataclass(frozen=True)
class EdgeProblem:
    """Points near the edge, (N, 2) in the plane and (N,) deep, and the prior of the state."""

    plane: Array
    depth: Array
    prior: Prior
    outline: Outline
    sigma_m: float

    def beams(self, state: Array) -> Beams:
        """Return the points' beams, carried to the plane."""
        return carry(self.plane, self.depth, state, self.outline)


@dataclass(frozen=True)
class Equations:
    """Points near the edge, linearised: residual = slopes @ step.

    q_m: (N, 2) where their beams met the plane, relative to the centre; share: (N,) of the outline.
    residual_m: (N,). slopes: (N, 9), of a clean edge (N, 12). weight: (N,) robust, over the
    variance. change: (N,) derivative of weight * residual by the residual. by_height: (N,)
    derivative of the residual by the plane's height. depths: number of first rows that are depths;
    the others tell where a clean edge lies.
    """

    q_m: Array
    share: Array
    residual_m: Array
    slopes: Array
    weight: Array
    change: Array
    by_height: Array
    depths: int


def equations(
    problem: EdgeProblem, background: Background, state: Array, converged: bool, consistent: bool
) -> Equations:
    """Linearise the residuals of the points near the edge from the profile at `state`.

    converged: weigh by Tukey's function, near the solution, else by Cauchy's. consistent: slopes at
    the profile's depth; at the measured one they correlate with its noise, which biases the centre
    by some 20 um but avoids divergence along the ridge of footprint and reflectance ratio.
    """
    depth, sigma_m = problem.depth, problem.sigma_m
    beams = problem.beams(state)
    part = background.sector(beams)
    outer = OUTER_M + np.maximum(beams.tau, 0.0) * np.exp(state[THICKNESS])
    band = (beams.x_m > -INNER_M) & (beams.x_m < outer) & (depth > -5.0 * sigma_m - 1e-4)
    band &= background.usable[part] & beams.clear
    beams = Beams(*(values[band] for values in vars(beams).values()))
    z, part = depth[band], part[band]
    spot = np.exp(state[SPOT]) * np.sqrt(1.0 + beams.tau**2)
    profile = edge_profile(
        beams.x_m,
        np.maximum(beams.tau, 0.0),
        background.depth_m[part],
        spot,
        float(np.exp(state[THICKNESS])),
        float(np.exp(state[RATIO])),
    )
    residual = z - profile.depth_m
    rough = profile.background_share * (
        background.spread_m[part] + DEPTH_SHARE * background.depth_m[part]
    )
    variance = (sigma_m + 1e-6) ** 2 + (profile.d_x * POINTING_M) ** 2 + rough**2
    weight, change = robust_weight(residual**2 / variance, converged)
    return Equations(
        q_m=beams.q_m,
        share=beams.share,
        residual_m=residual,
        slopes=profile_slopes(profile, beams, profile.depth_m if consistent else z, state),
        weight=weight / variance,
        change=change / variance,
        by_height=1.0 - profile.background_light - profile.d_x * beams.tau * beams.shrink,
        depths=len(residual),
    )


def step(linear: Equations, state: Array, prior: Prior) -> Array:
    """Return one robust Gauss-Newton step (9,) or (12,) of limited length."""
    weighted = linear.slopes.T * linear.weight
    information = weighted @ linear.slopes + np.diag(prior.weight)
    gradient = weighted @ linear.residual_m - prior.weight * (state - prior.mean)
    found = np.linalg.solve(information, gradient)
    limit = LIMIT[: len(found)]
    return np.asarray(found * min(1.0, float((limit / np.maximum(np.abs(found), 1e-12)).min())))


def spread(linear: Equations, outline: Outline, prior: Prior) -> tuple[Array, Array, float]:
    """Return covariance (n, n) of the state, derivatives (n, 3) by the plane, and dof.

    A^-1 B A^-1, A the derivative of the estimating equations, B the sum of their squares by sectors
    of the outline: the variances in the weights need not be right, nor the points of a sector
    independent, so that model errors count as well.
    Source: Huber, Robust Statistics (1981) 6.3; Liang and Zeger, Biometrika 73 (1986) 13; residuals
    over 1 - leverage, MacKinnon and White, J. Econometrics 29 (1985) 305.
    """
    slopes, weight, known = linear.slopes, linear.weight, np.diag(prior.weight)
    inverse = np.linalg.inv((slopes.T * linear.change) @ slopes + known)
    information = (slopes.T * weight) @ slopes + known
    leverage = weight * np.sum(slopes * np.linalg.solve(information, slopes.T).T, axis=1)
    score = slopes * (weight * linear.residual_m / (1.0 - leverage))[:, None]
    lift = np.column_stack([np.ones(len(weight)), linear.q_m]) * linear.by_height[:, None]
    by_plane = inverse @ ((slopes.T * linear.change) @ lift)
    part = sector(linear.share, SECTORS)
    total = np.stack([np.bincount(part, column, SECTORS) for column in score.T], axis=1)
    taken = 3.0 if outline.shows_rotation else 2.0  # parameters: centre, and rotation
    free = max(float(np.count_nonzero(np.bincount(part, minlength=SECTORS))) - taken, 1.0)
    squares = total.T @ total * ((free + taken) / free)
    return inverse @ (squares + known) @ inverse, by_plane, outline.axis_share * free


def robust_weight(square: Array, converged: bool) -> tuple[Array, Array]:
    """Return weight and slope of the influence: Cauchy's far from convergence, else Tukey's."""
    if converged:
        left = np.clip(1.0 - square / 16.0, 0.0, None)
        return left**2, left * (1.0 - 5.0 * square / 16.0)
    left = 1.0 / (1.0 + square / 4.0)
    return left, left**2 * (1.0 - square / 4.0)


def profile_slopes(profile: EdgeProfile, beams: Beams, depth: Array, state: Array) -> Array:
    """Return derivatives of the depth by the state, (N, 9), by the chain rule over x and tau.

    With J a rotation by 90 degrees: d rho = curve (1 - rho rho') dq, and by the in-plane rotation,
    J rho - that of J q.
    """
    beam, rho = state[BEAM], beams.rho
    facing = np.where(beams.tau > 0.0, profile.d_tau, 0.0)
    across = beam - (rho @ beam)[:, None] * rho
    aside = across * (beams.shrink * beams.curve)[:, None]
    d_x = profile.d_x
    by_centre = -rho * (d_x * beams.shrink)[:, None] + aside * facing[:, None]
    J_q, J_rho = _quarter(beams.q_m), _quarter(rho)
    tau_by_rotation = beams.curve * np.sum(across * J_q, axis=1) - J_rho @ beam
    support = np.sum(rho * beams.q_m, axis=1)
    return np.column_stack(
        [
            by_centre,
            by_centre * depth[:, None] - rho * facing[:, None],
            -d_x * depth * beams.shrink * support - facing * (support - beams.x_m),
            profile.d_log_spot,
            profile.d_thickness * np.exp(state[THICKNESS]),
            profile.d_log_ratio,
            -d_x * np.sum(rho * J_q, axis=1) + facing * tau_by_rotation,
        ]
    )


def _quarter(vectors: Array) -> Array:
    return np.column_stack([-vectors[:, 1], vectors[:, 0]])
