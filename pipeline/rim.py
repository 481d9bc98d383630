"""Fit the rim of a plate to the mixed ranges around it: centre, beam direction, spot, thickness.

The beams, not the points, are spread evenly across an edge. So every point is carried back along
its beam to the plane of the face, where the beam's distance from the rim is known whatever depth it
returned; what depth it should have returned is `edge_profile`. Fitting the one to the other uses
the face, its wall, the mixed ranges and the background together, needs no threshold that erodes the
edge, and finds where the scanner stood from the points themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.config import CentreConfig
from pipeline.edge_profile import EdgeProfile, edge_profile
from pipeline.kernels import Array, random_rows
from pipeline.targets import DiscTarget

MIN_DEPTH_M = 0.006  # what lies nearer behind the face is not taken for background
INNER_M, OUTER_M = 0.006, 0.006  # how far inside and outside the rim the profile is compared
RING_M = (0.001, 0.011)  # where the clean background is looked up, beyond the spot
MIN_MIXED = 0.08  # of mixed ranges, below which the scanner has left them out
STILL_M, SETTLED_M = 2e-7, 1e-5  # a step that ends the fit; one that makes it trustworthy
NEAR_M = 0.025  # beams that can matter, once their direction is roughly known
POINTING_M = 1.5e-4  # beam pointing and raster, as an uncertainty of x
DEPTH_SHARE = 0.02  # what the background's depth may differ between look-up and beam
SECTORS = 24  # of the rim, taken as independent of each other
RIDGE = 0.3  # of log spot, thickness, echo: how far the consistent answer may leave the first
MAX_SPREAD = 0.15  # sectors whose background is rougher than this share of its depth are left out


@dataclass(frozen=True)
class RimFit:
    """Centre of the rim in the plane and what came with it.

    centre_m: (2,). covariance_m2: (2, 2), of a plane without error, and freedom, its degrees: fewer
    than the sectors, since each counts by cos^2 along an axis. by_plane: (2, 3) how the centre
    moves with the plane's height at the centre, and with its slopes along u and v: it is seen in a
    direction, so that a plane that is too high takes it along the beam. beam: (2,) in-plane run of
    the beams at the centre, per metre of depth: tan of the incidence and its direction.
    inverse_distance: 1 / scanner's distance from the plane, 1/m. spot_m, thickness_m, and echo, the
    background's brightness of the plate's: as fitted. covered: share of the rim that was used.
    settled: whether the fit stood still.
    """

    centre_m: Array
    covariance_m2: Array
    by_plane: Array
    freedom: float
    beam: Array
    inverse_distance: float
    spot_m: float
    thickness_m: float
    echo: float
    covered: float
    points: int
    iterations: int
    settled: bool


# A state is (8,): centre u v, beam u v, 1/distance, log spot, log thickness, log echo.


def fit_rim(
    uvw_m: Array,
    target: DiscTarget,
    sigma_m: float,
    config: CentreConfig,
) -> RimFit | None:
    """Rim of a disc in plane coordinates uvw_m (N, 3), w towards the scanner, centre near 0, 0.

    None where less than a quarter of the rim has a background to compare with, or the scanner has
    left out the mixed ranges.
    """
    prior = _Prior.of(target, config)
    rng = np.random.default_rng(0)
    look = random_rows(uvw_m, config.max_points, rng)
    state = _first_beam(look[:, :2], -look[:, 2], prior.mean.copy(), target.radius_m)
    if state is None:
        return None
    beside = _carry(uvw_m[:, :2], -uvw_m[:, 2], state, target.radius_m).x_m
    near = random_rows(uvw_m[np.abs(beside) < NEAR_M], config.max_points, rng)
    plane, depth = near[:, :2], -near[:, 2]
    background = _background(plane, depth, state, target.radius_m)
    if _mixed_share(plane, depth, background, state, target.radius_m) < MIN_MIXED:
        return None
    problem = _Problem(plane, depth, prior, target.radius_m, sigma_m, config.max_iterations)
    near_it = _converge(problem, state, consistent=False)
    found = _converge(problem, near_it.state, consistent=True)
    if float(np.abs(found.state[5:] - near_it.state[5:]).max()) > RIDGE:
        found = near_it
    state, background, equations = found.state, found.background, found.equations
    covered = float(np.mean(background.usable))
    used = len(equations.residual_m)
    if covered < 0.25 or used < 50:
        return None
    covariance, by_plane, freedom = _spread(equations, prior)
    return RimFit(
        centre_m=state[:2],
        covariance_m2=covariance[:2, :2],
        by_plane=by_plane[:2],
        freedom=freedom,
        beam=state[2:4],
        inverse_distance=float(state[4]),
        spot_m=float(np.exp(state[5])),
        thickness_m=float(np.exp(state[6])),
        echo=float(np.exp(state[7])),
        covered=covered,
        points=used,
        iterations=found.iterations,
        settled=found.last_m < SETTLED_M,
    )


@dataclass(frozen=True)
class _Problem:
    """Points near the rim, (N, 2) in the plane and (N,) deep, and what is known before."""

    plane: Array
    depth: Array
    prior: _Prior
    radius_m: float
    sigma_m: float
    max_iterations: int


@dataclass(frozen=True)
class _Converged:
    """A state at which the fit stood still, or its last; last_m: its last step of the centre."""

    state: Array
    background: _Background
    equations: _Equations
    iterations: int
    last_m: float


def _converge(problem: _Problem, state: Array, consistent: bool) -> _Converged:
    """Gauss-Newton steps until the centre stands still; the background is looked up at first."""
    plane, depth, radius_m = problem.plane, problem.depth, problem.radius_m
    background = _background(plane, depth, state, radius_m)
    for iteration in range(1, problem.max_iterations + 1):
        if not consistent and 1 < iteration <= 8:
            background = _background(plane, depth, state, radius_m)
        robust = consistent or iteration > 6
        equations = _equations(
            plane, depth, background, state, radius_m, problem.sigma_m, robust, consistent
        )
        step = _step(equations, state, problem.prior)
        state = state + step
        last_m = float(np.abs(step[:2]).max())
        if last_m < STILL_M and (consistent or iteration > 8):
            break
    return _Converged(state, background, equations, iteration, last_m)


@dataclass(frozen=True)
class _Prior:
    """What is known before: mean (8,) and weight (8,), one over the variance."""

    mean: Array
    weight: Array

    @classmethod
    def of(cls, target: DiscTarget, config: CentreConfig) -> _Prior:
        known = target.thickness is not None
        thickness = target.thickness if target.thickness is not None else 0.008
        logs = np.log([config.spot_radius_m, max(thickness, 1e-4)])
        mean = np.array([0.0, 0.0, 0.0, 0.0, 0.4, *logs, 0.0])
        sigma = np.array([0.01, 0.01, 3.0, 3.0, 0.3, 0.7, 0.3 if known else 1.0, 1.5])
        return cls(mean, 1.0 / sigma**2)


@dataclass(frozen=True)
class _Beams:
    """Beams carried to the plane: x outside the rim, radial direction rho, tau, and x per depth."""

    x_m: Array
    rho: Array
    tau: Array
    shrink: Array
    reach_m: Array


def _carry(plane: Array, depth: Array, state: Array, radius_m: float) -> _Beams:
    """Where each point's beam met the plane: q = c + (p - c - z g) / (1 + z/D), seen from c.

    tau: at the depth z, a beam that met the plane x outside the rim is x - tau z outside the wall,
    less (z t)^2 / (2 R) by the wall's own curvature where the beam runs aside by t per depth; that
    is taken as a straight line down to the thickness.
    """
    shrink = 1.0 / (1.0 + state[4] * depth)
    offset = (plane - state[:2] - depth[:, None] * state[2:4]) * shrink[:, None]
    reach = np.hypot(offset[:, 0], offset[:, 1])
    rho = offset / np.maximum(reach, 1e-9)[:, None]
    outward = rho @ state[2:4]
    aside = state[2:4] @ state[2:4] - outward**2
    tau = -outward - state[4] * radius_m - np.exp(state[6]) * aside / (2.0 * radius_m)
    return _Beams(reach - radius_m, rho, tau, shrink, reach)


def _sector(rho: Array, count: int) -> npt.NDArray[np.int64]:
    turn = (np.arctan2(rho[:, 1], rho[:, 0]) / (2.0 * np.pi)) % 1.0
    return np.minimum((turn * count).astype(np.int64), count - 1)


def _first_beam(plane: Array, depth: Array, state: Array, radius_m: float) -> Array | None:
    """Beam direction from the hole that the plate leaves in the background.

    At depth z the hole's edge is shifted by z g against the rim: the innermost background points of
    36 sectors are fitted by r = a + z g . rho.
    """
    for _ in range(4):
        beams = _carry(plane, depth, state, radius_m)
        behind = np.nonzero((depth > 2.0 * MIN_DEPTH_M) & (np.abs(beams.x_m) < 0.03))[0]
        sector = _sector(beams.rho[behind], 36)
        rows = []
        for k in range(36):
            here = behind[sector == k]
            if len(here) < 20:
                continue
            middle = float(np.median(depth[here]))
            clean = here[depth[here] > 0.8 * middle]
            if len(clean) >= 10:
                inner = np.partition(beams.x_m[clean], 4)[4]
                angle = (k + 0.5) / 36 * 2.0 * np.pi
                rows.append((inner, 1.0, middle * np.cos(angle), middle * np.sin(angle)))
        if len(rows) < 9:
            return None
        table = np.array(rows)
        state[2:4] += np.linalg.lstsq(table[:, 1:], table[:, 0], rcond=None)[0][1:]
    return state


@dataclass(frozen=True)
class _Background:
    """Depth and spread of the clean background by sector, (K,) each, and where it can be used."""

    depth_m: Array
    spread_m: Array
    usable: npt.NDArray[np.bool_]


def _background(plane: Array, depth: Array, state: Array, radius_m: float) -> _Background:
    """Median depth of what lies just beyond the rim, sector by sector."""
    beams = _carry(plane, depth, state, radius_m)
    beyond = beams.x_m - np.exp(state[5]) - np.maximum(beams.tau, 0.0) * np.exp(state[6])
    ring = (beyond > RING_M[0]) & (beyond < RING_M[1]) & (depth > MIN_DEPTH_M)
    count = int(np.clip(np.count_nonzero(ring) // 10, 12, 90))
    sector, z = _sector(beams.rho[ring], count), depth[ring]
    order = np.lexsort((z, sector))
    z = np.append(z[order], np.nan)
    start = np.searchsorted(sector[order], np.arange(count + 1))
    size = np.diff(start)
    low, middle, high = (z[start[:-1] + (share * size).astype(int)] for share in (0.25, 0.5, 0.75))
    spread = (high - low) / 1.349
    with np.errstate(invalid="ignore"):
        usable = (size >= 5) & (spread < MAX_SPREAD * middle)
    return _Background(middle, spread, usable)


def _mixed_share(
    plane: Array, depth: Array, background: _Background, state: Array, radius_m: float
) -> float:
    """Points of mixed range about the rim, of those on the face in a ring of 2 mm just inside."""
    beams = _carry(plane, depth, state, radius_m)
    share = depth / background.depth_m[_sector(beams.rho, len(background.usable))]
    mixed = (np.abs(beams.x_m) < 0.004) & (share > 0.2) & (share < 0.8)
    ring = (beams.x_m > -0.005) & (beams.x_m < -0.003) & (np.abs(share) < 0.2)
    return float(np.count_nonzero(mixed) / max(int(np.count_nonzero(ring)), 1))


@dataclass(frozen=True)
class _Equations:
    """The points near the rim, linearised: residual = slopes @ step.

    uv_m: (N, 2) where their beams met the plane, seen from the centre. residual_m: (N,). slopes:
    (N, 8). weight: (N,) robust, over the variance. change: (N,) derivative of weight * residual by
    the residual. by_height: (N,) what a metre more of height of the plane adds to the residual.
    """

    uv_m: Array
    residual_m: Array
    slopes: Array
    weight: Array
    change: Array
    by_height: Array


def _equations(
    plane: Array,
    depth: Array,
    background: _Background,
    state: Array,
    radius_m: float,
    sigma_m: float,
    settled: bool,
    consistent: bool,
) -> _Equations:
    """Compare what the points near the rim show with the profile at `state`.

    consistent: slopes at the profile's depth; at the measured one they go with its noise, which
    biases the answer by some 20 um but keeps it from running along the ridge of spot and echo.
    """
    beams = _carry(plane, depth, state, radius_m)
    sector = _sector(beams.rho, len(background.usable))
    outer = OUTER_M + np.maximum(beams.tau, 0.0) * np.exp(state[6])
    band = (beams.x_m > -INNER_M) & (beams.x_m < outer) & (depth > -5.0 * sigma_m - 1e-4)
    band &= background.usable[sector]
    beams = _Beams(*(part[band] for part in vars(beams).values()))
    z, sector = depth[band], sector[band]
    spot = np.exp(state[5]) * np.sqrt(1.0 + beams.tau**2)
    profile = edge_profile(
        beams.x_m,
        np.maximum(beams.tau, 0.0),
        background.depth_m[sector],
        spot,
        float(np.exp(state[6])),
        float(np.exp(state[7])),
    )
    residual = z - profile.depth_m
    rough = profile.background_share * (
        background.spread_m[sector] + DEPTH_SHARE * background.depth_m[sector]
    )
    variance = (sigma_m + 1e-6) ** 2 + (profile.d_x * POINTING_M) ** 2 + rough**2
    weight, change = _robust(residual**2 / variance, settled)
    light = profile.background_share * float(np.exp(state[7]))
    light /= 1.0 - profile.background_share + light  # of what returns, that of the background
    return _Equations(
        uv_m=beams.rho * beams.reach_m[:, None],
        residual_m=residual,
        slopes=_slopes(profile, beams, profile.depth_m if consistent else z, state, radius_m),
        weight=weight / variance,
        change=change / variance,
        by_height=1.0 - light - profile.d_x * beams.tau * beams.shrink,
    )


def _step(equations: _Equations, state: Array, prior: _Prior) -> Array:
    """One robust Gauss-Newton step (8,), no longer than is safe."""
    weighted = equations.slopes.T * equations.weight
    information = weighted @ equations.slopes + np.diag(prior.weight)
    gradient = weighted @ equations.residual_m - prior.weight * (state - prior.mean)
    step = np.linalg.solve(information, gradient)
    limit = np.array([0.002, 0.002, 0.1, 0.1, 0.2, 0.3, 0.5, 0.5])
    return np.asarray(step * min(1.0, float((limit / np.maximum(np.abs(step), 1e-12)).min())))


def _robust(square: Array, settled: bool) -> tuple[Array, Array]:
    """Weight and influence's slope: Cauchy while far from the answer, then Tukey's at 4 sigma."""
    if settled:
        left = np.clip(1.0 - square / 16.0, 0.0, None)
        return left**2, left * (1.0 - 5.0 * square / 16.0)
    left = 1.0 / (1.0 + square / 4.0)
    return left, left**2 * (1.0 - square / 4.0)


def _spread(equations: _Equations, prior: _Prior) -> tuple[Array, Array, float]:
    """Covariance (8, 8) of the state from the residuals, its slopes (8, 3) by plane, and freedom.

    A^-1 B A^-1, A the derivative of the estimating equations, B the sum of their squares by sectors
    of the rim: neither the variances that set the weights need be right, nor the points of a sector
    independent, so that what the model leaves out there counts as well.
    Source: Huber, Robust Statistics (1981) 6.3; Liang and Zeger, Biometrika 73 (1986) 13; residuals
    over 1 - leverage, MacKinnon and White, J. Econometrics 29 (1985) 305.
    """
    slopes, weight, known = equations.slopes, equations.weight, np.diag(prior.weight)
    inverse = np.linalg.inv((slopes.T * equations.change) @ slopes + known)
    information = (slopes.T * weight) @ slopes + known
    leverage = weight * np.sum(slopes * np.linalg.solve(information, slopes.T).T, axis=1)
    score = slopes * (weight * equations.residual_m / (1.0 - leverage))[:, None]
    lift = np.column_stack([np.ones(len(weight)), equations.uv_m]) * equations.by_height[:, None]
    by_plane = inverse @ ((slopes.T * equations.change) @ lift)
    sector = _sector(equations.uv_m, SECTORS)
    total = np.stack([np.bincount(sector, column, SECTORS) for column in score.T], axis=1)
    free = max(float(np.count_nonzero(np.bincount(sector, minlength=SECTORS))) - 2.0, 1.0)
    squares = total.T @ total * ((free + 2.0) / free)  # the centre takes two
    return inverse @ (squares + known) @ inverse, by_plane, 2.0 / 3.0 * free


def _slopes(
    profile: EdgeProfile, beams: _Beams, depth: Array, state: Array, radius_m: float
) -> Array:
    """Derivatives of the depth by the state, (N, 8), by the chain rule over x and tau."""
    beam, rho = state[2:4], beams.rho
    facing = np.where(beams.tau > 0.0, profile.d_tau, 0.0)
    aside = (beam - (rho @ beam)[:, None] * rho) * (beams.shrink / beams.reach_m)[:, None]
    d_x = profile.d_x
    return np.column_stack(
        [
            -rho * (d_x * beams.shrink)[:, None] + aside * facing[:, None],
            (-rho * (d_x * beams.shrink)[:, None] + aside * facing[:, None]) * depth[:, None]
            - rho * facing[:, None],
            -d_x * depth * beams.shrink * beams.reach_m - facing * radius_m,
            profile.d_log_spot,
            profile.d_thickness * np.exp(state[6]),
            profile.d_log_echo,
        ]
    )
