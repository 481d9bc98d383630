"""Fit a target's edge to the mixed pixels around it: centre, beam direction, footprint, thickness.

The beams, not the points, are spread evenly across an edge. So every point is carried back along
its beam to the target's plane, where the beam's distance from the edge is known whatever depth it
returned; the depth it should have returned is `edge_profile`. Fitting the one to the other uses the
target, its wall, the mixed pixels and the background together, needs no threshold that erodes the
edge, and estimates the scanner's position from the points themselves.
"""

from __future__ import annotations

import numpy as np

from ...cloud import sample, sample_rows
from ...config import CentreConfig
from ...system import frozen
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
    CHAMFER,
    INVERSE,
    RING_M,
    ROTATION,
    SPOT,
    THICKNESS,
    Prior,
    mixed_share,
    mixed_share_of_few,
    outside_m,
    pointed,
)
from .clean_edge import target_depth_m
from .clean_fit import by_intensity, fit_clean
from .edge_residuals import FEW, OUTER_M, EdgeProblem
from .mixed_fit import explained_at_first, fit_mixed
from .mixed_pixel import EITHER
from .solution import MISFIT, EdgeFit

MIN_MIXED, MOST_CLEAN = 0.15, 0.35  # shares of mixed pixels: none below, certainly some above
# Of few points: share of mixed pixels, certainly some above, none below; loss of a likely fit to
# them, 0.39 by Gaussian residuals.
MIXED_OF_FEW, SOME_OF_FEW, LOSS_BY_CHANCE = 0.15, 0.03, 0.5
# Slope of beams that nothing behind an edge shows, up to which their direction hardly counts; to
# intensities of steeper ones fits had other solutions.
MOST_UNSEEN = 0.12
NEAR_M = 0.025  # beams that can matter, once their direction is roughly known


@frozen(eq=False)
class EdgeToFit:
    """Edge of a target as stated: its outline; thickness_m and chamfer_m, None where unknown.

    roundness: of the edge, see `rounded`. sigma_m: standard deviation of the points' depths.
    """

    outline: Outline
    thickness_m: float | None
    sigma_m: float
    config: CentreConfig
    chamfer_m: float | None = None
    roundness: float = EITHER


@frozen(eq=False)
class Aim:
    """Start of a fit: state (16,); station (3,) that its beams come from, if one is known."""

    state: Array
    station: Array | None = None


def fit_edge(uvw_m: Array, edge: EdgeToFit, begin: Aim | EdgeFit) -> EdgeFit | None:
    """Fit an edge to points uvw_m (N, 3) in plane coordinates, w towards the scanner.

    (N, 5) with intensities over that of the face, NaN where unknown: of points on the target, and
    of all, by which the background's brightness is known; (N, 4) without the latter.

    Where there are no mixed pixels, to the points on both sides of it (clean_edge.py).
    begin: where to start, as `aimed` returns it, or the fit of another edge of the same target,
    whose beams are the same.
    None where less than a quarter of the edge has a background, or where beams at the edge were
    filtered out and leave no gap.
    """
    problem, state = _problem(uvw_m, edge, begin)
    stated = edge.thickness_m, edge.config
    if problem.few:
        fitted = fit_mixed(problem, state, *stated)
        share = _mixed_share_of_few(problem, fitted.state if fitted else state)
        mixed = share > MIXED_OF_FEW
        likely = fitted is not None and fitted.loss < LOSS_BY_CHANCE and share > SOME_OF_FEW
    else:
        beams = problem.beams(state)
        background = problem.background(state)
        share = mixed_share(beams, problem.depth, background)
        if share < MOST_CLEAN:
            share = mixed_share(beams, problem.depth, background, besides_surfaces=True)
        mixed = share > MOST_CLEAN
        fitted = None if share < MIN_MIXED else fit_mixed(problem, state, *stated)
        likely = fitted is not None and fitted.converged and fitted.misfit < MISFIT
    shown, certain = mixed or likely, mixed and likely and not problem.few
    if certain or (shown and problem.intensity is None):
        return fitted
    clean = fit_clean(problem, state, edge.config)
    if shown and not (clean and clean.exponent):
        return fitted
    return clean or fitted


def _mixed_share_of_few(problem: EdgeProblem, state: Array) -> float:
    """Return the share of the points next to the edge that a state (16,) leaves to mixed pixels."""
    beams = problem.beams(state)
    background = problem.background(state)
    deepest_m = target_depth_m(state, problem.sigma_m)
    return mixed_share_of_few(beams, problem.depth, background, deepest_m)


def first_explained(uvw_m: Array, edge: EdgeToFit, begin: Aim | EdgeFit) -> float:
    """Return how many of some points a rough fit to mixed pixels explains, as of an EdgeFit.

    Points as in `fit_edge`.
    """
    problem, state = _problem(uvw_m, edge, begin)
    return explained_at_first(problem, state, edge.config.max_iterations)


def fit_intensities(uvw_m: Array, edge: EdgeToFit, begin: Aim) -> EdgeFit | None:
    """Fit an edge to the intensities of points uvw_m, as of `fit_edge`, and not to what is behind.

    None where those of the target are unknown. Nothing but the returns of a wall shows the beams'
    direction: None where that counts.
    """
    problem, state = _problem(uvw_m, edge, begin)
    if problem.intensity is None:
        return None
    found = by_intensity(problem, state, edge.config.max_iterations)
    if found is None or float(np.hypot(*found.beam)) > MOST_UNSEEN:
        return None
    return found


def _problem(uvw_m: Array, edge: EdgeToFit, begin: Aim | EdgeFit) -> tuple[EdgeProblem, Array]:
    """Return the points near the edge with their prior, and the state (16,) to start from."""
    if isinstance(begin, EdgeFit):
        prior, station = Prior.beside(begin.state, begin.chamfer_u_m, begin.modulation_u), None
        state = prior.mean
    else:
        prior, station, state = Prior.of(edge.thickness_m, edge.config), begin.station, begin.state
        prior = prior.from_afar(state)
    prior, state = prior.of_chamfer(edge.chamfer_m), state.copy()
    state[CHAMFER] = prior.mean[CHAMFER]
    beside = outside_m(uvw_m[:, :2], -uvw_m[:, 2], state, edge.outline)
    near = uvw_m[np.abs(beside) < _reach_m(state)]
    near = near[sample_rows(near[:, :3], edge.config.max_points)]
    few = int(np.count_nonzero(np.abs(beside) < OUTER_M)) < FEW
    plane = np.asfortranarray(near[:, :2])
    intensity, light = (near[:, k] if near.shape[1] > k else None for k in (3, 4))
    if intensity is not None and not np.isfinite(intensity).any():
        intensity = None  # of a face that is not of one brightness
    problem = EdgeProblem(
        plane,
        -near[:, 2],
        prior,
        edge.outline,
        edge.sigma_m,
        few,
        station,
        intensity,
        light,
        roundness=edge.roundness,
    )
    return problem.about(state), state


def _reach_m(state: Array) -> float:
    """Return how far from the edge beams matter: farther where wall and footprint are slanted."""
    square = float(state[BEAM] @ state[BEAM])
    wall = np.sqrt(square) * np.exp(state[THICKNESS]) + np.exp(state[SPOT]) * np.sqrt(1.0 + square)
    return max(NEAR_M, float(wall) + RING_M[1] + OUTER_M)


def aimed(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    config: CentreConfig,
    start: tuple[Array, float] = (np.zeros(2), 0.0),
    station: Array | None = None,
    inverse: float | None = None,
) -> Aim | None:
    """Return where to start, with the beams' direction, or None where nothing shows it.

    From the station, unless the background contradicts it, else from the background.
    start: centre and rotation, near 0. station: (3,) position of the scanner, if known. inverse:
    1/m, of its distance, the first that is tried.
    """
    begin = square_on(thickness_m, config, start).state
    if inverse is not None:
        begin[INVERSE] = inverse
    look = sample(uvw_m[:, :3], config.max_points)
    plane, depth = look[:, :2], -look[:, 2]
    if station is not None:
        given = pointed(begin, station, begin[CENTRE])
        if not is_contradicted(plane, depth, given, outline):
            return Aim(given, station)
    found = first_beam(plane, depth, begin, outline, known=inverse is not None)
    return None if found is None else Aim(found)


def square_on(thickness_m: float | None, config: CentreConfig, start: tuple[Array, float]) -> Aim:
    """Return a start with beams square to the target."""
    begin = Prior.of(thickness_m, config).mean
    begin[CENTRE], begin[ROTATION] = start
    return Aim(begin)


@frozen(eq=False)
class Behind:
    """Background behind an outline: seen, whether there is any; beam, slope that explains it.

    beam: (2,) in the plane per depth, roughly; None where nothing shows it.
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
    """Return what lies behind an outline at a start, by the points uvw_m (N, 3) about it.

    state: (16,) with the beams' direction, by `aimed` or another edge's fit; None if unknown.
    """
    plane, depth = uvw_m[:, :2], -uvw_m[:, 2]
    begin = Prior.of(None, config).mean
    begin[CENTRE], begin[ROTATION] = start
    seen = has_background(plane, depth, begin, outline)
    if not seen or state is None or not np.isfinite(seen_through(plane, depth, state, outline)):
        return Behind(seen, None)
    return Behind(seen, np.asarray(state[BEAM]))
