"""Fit a plate's edge to the mixed ranges around it: centre, beam direction, spot, thickness.

The beams, not the points, are spread evenly across an edge. So every point is carried back along
its beam to the plane of the face, where the beam's distance from the edge is known whatever depth
it returned; what depth it should have returned is `edge_profile`. Fitting the one to the other uses
the face, its wall, the mixed ranges and the background together, needs no threshold that erodes the
edge, and finds where the scanner stood from the points themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...cloud import sample
from ...config import CentreConfig
from ...targets import Outline
from ...vectors import Array
from .beam_direction import (
    first_beam,
    has_background,
    is_contradicted,
    seen_through,
)
from .beams import (
    BEAM,
    CENTRE,
    INVERSE,
    RATIO,
    RING_M,
    SPOT,
    THICKNESS,
    TURN,
    Background,
    Prior,
    carry,
    look_up,
    mixed_share,
)
from .edge_residuals import OUTER_M, Equations, Problem, equations, spread, step

MIN_MIXED = 0.04  # of mixed ranges, below which the scanner has left them out
STILL_M, SETTLED_M = 2e-7, 1e-5  # a step that ends the fit; one that makes it trustworthy
NEAR_M = 0.025  # beams that can matter, once their direction is roughly known
STEEP = 1.0  # slope of beams, from which a thick wall hides so much that a fit may run away
RIDGE = 0.3  # of log spot, thickness, echo: how far the consistent answer may leave the first


@dataclass(frozen=True)
class EdgeFit:
    """Centre of an outline in the plane and what came with it.

    centre_m: (2,). turn_rad: of the target's axes against the plane's; turn_noise: (3,) its
    covariances with the centre and its variance, turn_by_plane: (3,) as by_plane.
    covariance_m2: (2, 2), of a plane without error, and freedom, its degrees: fewer than the
    sectors, since not each counts along an axis. by_plane: (2, 3) how the centre
    moves with the plane's height at the centre, and with its slopes along u and v: it is seen in a
    direction, so that a plane that is too high takes it along the beam. beam: (2,) in-plane run of
    the beams at the centre, per metre of depth: tan of the incidence and its direction.
    inverse_distance: 1 / scanner's distance from the plane, 1/m. spot_m, thickness_m, and echo, the
    background's brightness of the plate's: as fitted. covered: share of the outline that was used.
    misfit: share of the points near the edge that no single viewpoint and background explains.
    settled: whether the fit stood still.
    """

    centre_m: Array
    turn_rad: float
    covariance_m2: Array
    by_plane: Array
    dof: float
    beam: Array
    inverse_distance: float
    spot_m: float
    thickness_m: float
    reflectance_ratio: float
    covered: float
    misfit: float
    points: int
    iterations: int
    settled: bool
    turn_noise: Array
    turn_by_plane: Array

    @property
    def state(self) -> Array:
        """As rim_beams has it, (9,)."""
        logs = np.log([self.spot_m, self.thickness_m, self.reflectance_ratio])
        return np.array([*self.centre_m, *self.beam, self.inverse_distance, *logs, self.turn_rad])


def fit_edge(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    sigma_m: float,
    config: CentreConfig,
    begin: Array | EdgeFit,
) -> EdgeFit | None:
    """Place of an outline in plane coordinates uvw_m (N, 3), w towards the scanner.

    thickness_m: of the plate, where known. begin: the state (9,) to start from, as `aimed` gives
    it, or the fit of another edge of the same plate, which tells how the beams run.
    None where less than a quarter of the edge has a background to compare with, or the scanner has
    left out the mixed ranges.
    """
    if isinstance(begin, EdgeFit):
        prior = Prior.beside(begin.state)
        state = prior.mean
    else:
        prior, state = Prior.of(thickness_m, config), begin
    beside = carry(uvw_m[:, :2], -uvw_m[:, 2], state, outline).x_m
    near = sample(uvw_m[np.abs(beside) < _reach_m(state)], config.max_points)
    problem = Problem(near[:, :2], -near[:, 2], prior, outline, sigma_m)
    beams = problem.beams(state)
    if mixed_share(beams, problem.depth, look_up(beams, problem.depth, state)) < MIN_MIXED:
        return None
    found = _best(problem, state, config.max_iterations)
    steep = float(np.hypot(*state[BEAM])) > STEEP
    if steep and thickness_m is not None and _is_strange(found, prior):
        found = _best(replace(problem, prior=prior.held(state)), state, config.max_iterations)
    covered = float(np.mean(found.background.usable))
    if covered < 0.25 or len(found.equations.residual_m) < 50:
        return None
    return _record(found, problem, covered)


def aimed(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    config: CentreConfig,
    start: tuple[Array, float] = (np.zeros(2), 0.0),
    station: Array | None = None,
) -> Array | None:
    """A state (9,) with the beams' direction: from the station, unless the background contradicts
    it, else from the background; None where that tells none.

    start: centre and turn, near 0. station: (3,) where the scanner stood, as far as it is known.
    """
    begin = Prior.of(thickness_m, config).mean
    begin[CENTRE], begin[TURN] = start
    look = sample(uvw_m, config.max_points)
    plane, depth = look[:, :2], -look[:, 2]
    if station is not None:
        told = begin.copy()
        told[BEAM] = (begin[CENTRE] - station[:2]) / station[2]
        told[INVERSE] = 1.0 / station[2]
        if not is_contradicted(plane, depth, told, outline):
            return told
    return first_beam(plane, depth, begin, outline)


@dataclass(frozen=True)
class Behind:
    """What lies behind an outline: whether anything does, and the beams' run that explains it.

    beam: (2,) in the plane per depth, roughly; None where nothing tells it.
    """

    seen: bool
    beam: Array | None


def look_behind(
    uvw_m: Array,
    outline: Outline,
    config: CentreConfig,
    start: tuple[Array, float],
    state: Array | None,
) -> Behind:
    """Of points uvw_m (N, 3) about an outline at a start.

    state: (9,) how the beams run, by `aimed`, or by another edge's fit; None where nothing tells.
    """
    plane, depth = uvw_m[:, :2], -uvw_m[:, 2]
    begin = Prior.of(None, config).mean
    begin[CENTRE], begin[TURN] = start
    seen = has_background(plane, depth, begin, outline)
    if not seen or state is None or not np.isfinite(seen_through(plane, depth, state, outline)):
        return Behind(seen, None)
    return Behind(seen, np.asarray(state[BEAM]))


@dataclass(frozen=True)
class _Converged:
    """A state at which the fit stood still, or its last; last_m: its last step of the centre."""

    state: Array
    background: Background
    equations: Equations
    iterations: int
    last_m: float


def _reach_m(state: Array) -> float:
    """How far from the edge beams can matter: where they graze, the wall and the spot reach far."""
    square = float(state[BEAM] @ state[BEAM])
    wall = np.sqrt(square) * np.exp(state[THICKNESS]) + np.exp(state[SPOT]) * np.sqrt(1.0 + square)
    return max(NEAR_M, float(wall) + RING_M[1] + OUTER_M)


def _best(problem: Problem, state: Array, most: int) -> _Converged:
    """The consistent answer from the first one, unless it ran away."""
    near_it = _converge(problem, state, most, consistent=False)
    found = _converge(problem, near_it.state, most, consistent=True)
    return near_it if _ran_away(found.state, near_it.state, problem.prior) else found


def _is_strange(found: _Converged, prior: Prior) -> bool:
    """Whether a fit did not stand still, or needs a thickness far from the plate's known one."""
    off = abs(float(found.state[THICKNESS] - prior.mean[THICKNESS]))
    return found.last_m > SETTLED_M or off > RIDGE


def _ran_away(state: Array, first: Array, prior: Prior) -> bool:
    """Whether the consistent answer left the first one, and what is known of the plate as well."""
    left = float(np.abs(state[SPOT:TURN] - first[SPOT:TURN]).max()) > RIDGE
    off, first_off = (
        float(np.sum(prior.weight[SPOT:TURN] * (s - prior.mean)[SPOT:TURN] ** 2))
        for s in (state, first)
    )
    return left and off > first_off


def _converge(problem: Problem, state: Array, most: int, consistent: bool) -> _Converged:
    """Gauss-Newton steps until the centre stands still; the background is looked up at first."""
    background = look_up(problem.beams(state), problem.depth, state)
    for iteration in range(1, most + 1):
        if not consistent and 1 < iteration <= 8:
            background = look_up(problem.beams(state), problem.depth, state)
        robust = consistent or iteration > 6
        linear = equations(problem, background, state, robust, consistent)
        moved = step(linear, state, problem.prior)
        state = state + moved
        last_m = float(np.abs(moved[CENTRE]).max())
        if last_m < STILL_M and (consistent or iteration > 8):
            break
    return _Converged(state, background, linear, iteration, last_m)


def _record(found: _Converged, problem: Problem, covered: float) -> EdgeFit:
    state = found.state
    covariance, by_plane, dof = spread(found.equations, problem.outline, problem.prior)
    return EdgeFit(
        centre_m=state[CENTRE],
        turn_rad=float(state[TURN]),
        covariance_m2=covariance[CENTRE, CENTRE],
        by_plane=by_plane[CENTRE],
        dof=dof,
        beam=state[BEAM],
        inverse_distance=float(state[INVERSE]),
        spot_m=float(np.exp(state[SPOT])),
        thickness_m=float(np.exp(state[THICKNESS])),
        reflectance_ratio=float(np.exp(state[RATIO])),
        covered=covered,
        misfit=float(np.mean(found.equations.weight <= 0.0)),
        points=len(found.equations.residual_m),
        iterations=found.iterations,
        settled=found.last_m < SETTLED_M,
        turn_noise=covariance[TURN, [0, 1, TURN]],
        turn_by_plane=by_plane[TURN],
    )
