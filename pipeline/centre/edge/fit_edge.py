"""Fit a target's edge to the mixed pixels around it: centre, beam direction, footprint, thickness.

The beams, not the points, are spread evenly across an edge. So every point is carried back along
its beam to the target's plane, where the beam's distance from the edge is known whatever depth it
returned; the depth it should have returned is `edge_profile`. Fitting the one to the other uses the
target, its wall, the mixed pixels and the background together, needs no threshold that erodes the
edge, and estimates the scanner's position from the points themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...cloud import sample, sample_rows
from ...config import CentreConfig
from ...targets import Outline, sector
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
    GROWTH,
    INVERSE,
    RATIO,
    RING_M,
    ROTATION,
    SHAPE,
    SPOT,
    STATED_THICKNESS,
    THICKNESS,
    WALL,
    Background,
    Prior,
    look_up,
    mixed_share,
    mixed_share_of_few,
    outside_m,
    pointed,
)
from .clean_edge import between_rows_m, by_backgrounds_m, clean_equations, shift_m, target_depth_m
from .edge_intensity import fading, intensity_equations, speckle
from .edge_residuals import (
    FEW,
    OUTER_M,
    SECTORS,
    EdgeProblem,
    Equations,
    Zones,
    equations,
    spread,
    step,
    zone_scatter,
)

ERODED = 0.4  # of the stated footprint: a clean edge that lies as far inside the target's is none
DIFFERENT = 0.18  # scatter of the zones' reflectances, in logs: 0 to 0.17 where they are alike
LOOKS = (2, 3, 5, 8)  # iterations at which the background is looked up again
LEAST, LEAST_CLEAN = 24, 24  # points about an edge
MIN_MIXED, MOST_CLEAN = 0.15, 0.35  # shares of mixed pixels: none below, certainly some above
# Of few points: share of mixed pixels, certainly some above; loss of a likely fit to them, 0.39 by
# Gaussian residuals.
MIXED_OF_FEW, LOSS_BY_CHANCE = 0.2, 0.5
CONTRADICTED = 0.35  # share of outliers beside a clean edge: a background that says nothing
# Squared distance of the centres with and without a background, of the latter's covariance: 0.01 by
# chance.
APART_BY_BACKGROUND = 9.2
# Thickness of a target whose wall returns nothing; what that leaves of the places of an edge, of
# what a wall leaves: up to 1.25 where beams were filtered out.
NO_WALL_M, SHOWS_WALL = 1e-4, 1.3
# Slope of beams that nothing behind an edge shows, up to which their direction hardly counts; to
# intensities of steeper ones fits had other solutions.
MOST_UNSEEN = 0.12
# How far unlike backgrounds move parts of a clean edge: at most, of where it lies; all of it, of
# that of its parts.
MOST_UNLIKE, ALL_ROUND = 0.5, 0.5
UNEVEN = 5  # of the sectors: at most so many have a background that leaves outliers
MISFIT = 0.09  # share of outliers beyond which a fit to mixed pixels is none, between these
STEP_M, CONVERGED_M = (
    2e-7,
    1e-5,
)  # a step of the centre that ends the fit; one that counts as converged
NEAR_M = 0.025  # beams that can matter, once their direction is roughly known
STEEP = 1.0  # slope of beams from which a thick wall hides so much that a fit may diverge
ALONE = np.log(10.0)  # reflectance ratio, or its inverse, of first or last returns: not by power
UNDAMPED, SETTLED = 10, 0.2  # steps of full length; share of u that a step may still be, then
SHORTER, SHORTEST = 0.7, 0.1  # of a step's length, after one that went back; its least
NOTICED_GROWTH_M = 1e-4  # as SIZE_M: from here on, a solution with less is looked for
# Of a fit to intensities: least share of the sectors in which they fade, and of how they differ
# that it explains; least log of its footprint's radius, of the configured one.
FADING, FADING_OF_FEW, EXPLAINED, NO_FOOTPRINT = 0.4, 0.15, 0.8, math.log(0.3)
AS_MUCH = 1.03  # of what a solution leaves unexplained, what another may leave; 1.02 by alike noise
BY_CHANCE = 9.0  # of a sum of squares over their variances, that one parameter explains by chance
# Standard deviations off the prior from which the stated thickness is doubted; up to which it may
# be right where no other explains as much.
TENSE, MOST_TENSE = 2.0, 6.0
CONTRADICTED_THICKNESS = 2.0  # standard deviations off the stated one by the data alone
EDGE = [SPOT, THICKNESS, RATIO, WALL, SHAPE, GROWTH]  # what a wrong thickness pulls
# Relative standard uncertainty of one by the data alone, besides noise; how much more it is by the
# square of footprint over the wall's width as seen: square on to a face, it is seen narrow.
THICKNESS_MODEL, SQUARE_ON = 0.05, 5.0
LEAST_SHOWN = 0.01  # of the variance of a prior, that the data show
RIDGE = 0.3  # of log footprint, thickness, reflectance ratio: largest change by consistent slopes


@dataclass(frozen=True)
class Aim:
    """Start of a fit: state (12,); station (3,) that its beams come from, if one is known."""

    state: Array
    station: Array | None = None


@dataclass(frozen=True)
class EdgeFit:
    """Centre of an outline in the plane, and the other estimates of its fit.

    centre_m: (2,). rotation_rad: of the target's axes against the plane's; rotation_noise: (3,) its
    covariances with the centre and its variance, rotation_by_plane: (3,) as by_plane.
    covariance_m2: (2, 2), given the plane, with dof degrees of freedom: fewer than the sectors,
    since not each counts along an axis. by_plane: (2, 3) derivatives of the centre by the plane's
    height at the centre, and by its slopes along u and v: the beams fix a direction, so a plane
    that is too high moves the centre along the beam. beam: (2,) in-plane slope of the beams at the
    centre, per metre of depth: tan of the incidence and its direction. inverse_distance: 1 /
    scanner's distance from the plane, 1/m. spot_m: radius of the footprint; thickness_m;
    reflectance_ratio: of the background over the target. wall: 0 of a wall as bright as the face, 1
    of Lambert's law. spot_shape: 0 of a uniform footprint, 1 of a Gaussian. growth_m: how
    much farther out the edge lies than stated, all round, with its standard uncertainty
    growth_u_m: both from SIZE_M as a prior. covered: share of the outline that was used. misfit:
    share of outliers near the edge. loss: mean of Cauchy's loss, of few mixed pixels. converged:
    whether the last step was small. thickness_u: relative. stated_thickness_m: one that the data
    contradict, and that was not used; by_thickness_m: (2,) by which the centre would move if it
    were not, where that is in doubt.
    clean_shift_m: how far outside the target's edge a clean one lies; None of mixed pixels.
    by_size_m: (2,) by which its centre would move if the size were hardly known; size_chance: the
    probability of that. rows_m: standard uncertainty of each straight edge by rows of points that
    run along it. exponent: by which intensities follow power, of a clean edge that is fitted to
    them; it has no clean_shift_m. unlike_m: how far backgrounds of unlike brightness move parts of
    a clean edge (k = 1).
    """

    centre_m: Array
    rotation_rad: float
    covariance_m2: Array
    by_plane: Array
    dof: float
    beam: Array
    inverse_distance: float
    spot_m: float
    thickness_m: float
    reflectance_ratio: float
    wall: float
    spot_shape: float
    growth_m: float
    growth_u_m: float
    covered: float
    misfit: float
    loss: float
    points: int
    iterations: int
    converged: bool
    rotation_noise: Array
    rotation_by_plane: Array
    thickness_u: float
    stated_thickness_m: float | None = None
    by_thickness_m: Array | None = None
    clean_shift_m: float | None = None
    by_size_m: Array | None = None
    size_chance: float = 0.0
    rows_m: float = 0.0
    exponent: float | None = None
    unlike_m: float = 0.0

    @property
    def is_clean(self) -> bool:
        """Whether beams at the edge returned one surface each."""
        return self.clean_shift_m is not None or self.exponent is not None

    @property
    def state(self) -> Array:
        """State (12,), see beams.py."""
        logs = np.log([self.spot_m, self.thickness_m, self.reflectance_ratio])
        return np.array(
            [
                *self.centre_m,
                *self.beam,
                self.inverse_distance,
                *logs,
                self.rotation_rad,
                self.wall,
                self.spot_shape,
                self.growth_m,
            ]
        )


def fit_edge(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    sigma_m: float,
    config: CentreConfig,
    begin: Aim | EdgeFit,
) -> EdgeFit | None:
    """Fit an outline to points uvw_m (N, 3) in plane coordinates, w towards the scanner.

    (N, 4) with their intensities, of that of the face, NaN where unknown.

    Where there are no mixed pixels, to the points on both sides of it (clean_edge.py).
    thickness_m: of the target, where known. begin: where to start, as `aimed` returns it, or the
    fit of another edge of the same target, whose beams are the same.
    None where less than a quarter of the edge has a background, or the scanner has filtered out the
    beams at the edge.
    """
    problem, state = _problem(uvw_m, outline, thickness_m, sigma_m, config, begin)
    few, beams = problem.few, problem.beams(state)
    background = look_up(beams, problem.depth, state)
    if few:
        deepest_m = target_depth_m(state, sigma_m)
        mixed = mixed_share_of_few(beams, problem.depth, background, deepest_m) > MIXED_OF_FEW
        fitted = _mixed(problem, state, thickness_m, config)
        likely = fitted is not None and fitted.loss < LOSS_BY_CHANCE
    else:
        share = mixed_share(beams, problem.depth, background)
        if share < MOST_CLEAN:
            share = mixed_share(beams, problem.depth, background, besides_surfaces=True)
        mixed = share > MOST_CLEAN
        fitted = None if share < MIN_MIXED else _mixed(problem, state, thickness_m, config)
        likely = fitted is not None and fitted.converged and fitted.misfit < MISFIT
    shown, certain = mixed or likely, mixed and likely and not few
    if certain or (shown and problem.intensity is None):
        return fitted
    clean = _clean(problem, state, config)
    if shown and not (clean and clean.exponent):
        return fitted
    return clean or fitted


def fit_intensities(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    sigma_m: float,
    config: CentreConfig,
    begin: Aim,
) -> EdgeFit | None:
    """Fit an outline to the intensities of points uvw_m (N, 4), and not to what is behind.

    Nothing but the returns of a wall shows the beams' direction: None where that counts.
    """
    problem, state = _problem(uvw_m, outline, thickness_m, sigma_m, config, begin)
    found = _by_intensity(problem, state, config.max_iterations)
    if found is None or float(np.hypot(*found.beam)) > MOST_UNSEEN:
        return None
    return found


def _problem(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    sigma_m: float,
    config: CentreConfig,
    begin: Aim | EdgeFit,
) -> tuple[EdgeProblem, Array]:
    """Return the points near the edge with their prior, and the state (12,) to start from."""
    if isinstance(begin, EdgeFit):
        prior, station = Prior.beside(begin.state), None
        state = prior.mean
    else:
        prior, station, state = Prior.of(thickness_m, config), begin.station, begin.state
    beside = outside_m(uvw_m[:, :2], -uvw_m[:, 2], state, outline)
    near = uvw_m[np.abs(beside) < _reach_m(state)]
    near = near[sample_rows(near[:, :3], config.max_points)]
    few = int(np.count_nonzero(np.abs(beside) < OUTER_M)) < FEW
    plane, intensity = np.asfortranarray(near[:, :2]), near[:, 3] if near.shape[1] > 3 else None
    problem = EdgeProblem(plane, -near[:, 2], prior, outline, sigma_m, few, station, intensity)
    return problem.about(state), state


def _mixed(
    problem: EdgeProblem, state: Array, thickness_m: float | None, config: CentreConfig
) -> EdgeFit | None:
    """Fit an edge to its mixed pixels; None where a quarter of it has no background.

    Without the stated thickness where the data pull it or the size, another one explains as much,
    and the data contradict the stated one then.
    """
    steep = float(np.hypot(*state[BEAM])) > STEEP
    if steep:  # footprint and beams would diverge with the wall
        problem = replace(problem, prior=problem.prior.plain())
    found = _best(problem, state, config.max_iterations)
    if steep and thickness_m is not None and _is_strange(found, problem.prior):
        held = replace(problem, prior=problem.prior.held(state))
        found = _best(held, state, config.max_iterations)
    fitted = _recorded(found, problem)
    if fitted is None or thickness_m is None:
        return fitted
    tension = _tension(fitted, problem.prior)
    if not problem.few and tension < TENSE:
        return fitted
    doubted = replace(problem, prior=problem.prior.doubted())
    other = _best(doubted, state, config.max_iterations)
    free, worse = _recorded(other, doubted), _explains_less(other, found)
    if free is None or (worse and tension < MOST_TENSE):
        return fitted
    return _by_thickness(fitted, free, thickness_m, worse)


def _by_thickness(fitted: EdgeFit, free: EdgeFit, thickness_m: float, worse: bool) -> EdgeFit:
    """Return the fit with the stated thickness, or the one without where that contradicts it.

    worse: whether the one without explains the points less, as a wall that is none does.
    """
    seen_m = max(thickness_m, free.thickness_m) * float(np.hypot(*free.beam))
    by_model = THICKNESS_MODEL * (1.0 + SQUARE_ON * (free.spot_m / max(seen_m, 1e-9)) ** 2)
    u = math.hypot(free.thickness_u, STATED_THICKNESS, by_model)
    off = abs(math.log(free.thickness_m / thickness_m)) / u
    if free.converged and not worse and off > CONTRADICTED_THICKNESS:
        return replace(free, stated_thickness_m=thickness_m)
    return replace(fitted, by_thickness_m=free.centre_m - fitted.centre_m)


def _recorded(found: _Converged, problem: EdgeProblem) -> EdgeFit | None:
    """Return the fit of a solution; None where a quarter of the edge has no background."""
    covered = float(np.mean(found.background.usable))
    if covered < 0.25 or len(found.equations.residual_m) < LEAST:
        return None
    fitted = _record(found, problem, covered)
    return _settled(fitted, found) if problem.few else fitted


def _tension(fitted: EdgeFit, prior: Prior) -> float:
    """Return how far the edge's parameters lie from their prior, in standard deviations.

    A posterior mean has the variance of its prior less that of the posterior.
    """
    variance, u = 1.0 / prior.weight[EDGE], np.zeros(len(EDGE))
    u[EDGE.index(THICKNESS)], u[EDGE.index(GROWTH)] = fitted.thickness_u, fitted.growth_u_m
    shown = np.maximum(variance - u**2, LEAST_SHOWN * variance)
    return float(np.sqrt(np.sum((fitted.state - prior.mean)[EDGE] ** 2 / shown)))


def _clean(problem: EdgeProblem, state: Array, config: CentreConfig) -> EdgeFit | None:
    """Fit an edge without mixed pixels; None where a quarter of it has no background."""
    if not has_background(problem.plane, problem.depth, state, problem.outline):
        return None
    given, problem = problem, replace(problem, prior=problem.prior.by_power())
    state = state.copy()
    state[WALL] = problem.prior.mean[WALL]
    parted = _by_returns(problem, state, config.max_iterations)
    by_intensity = _by_intensity(given, parted.state, config.max_iterations)
    if by_intensity is not None:
        return by_intensity
    loose = replace(problem, prior=problem.prior.unsized())
    found, other = _by_size(problem, loose, state, parted, config.max_iterations)
    lies_m = shift_m(found.state)
    ends_inside = lies_m < -ERODED * config.spot_radius_m
    if ends_inside and not _shows_wall(problem, found, config.max_iterations):
        return None
    linear = found.equations
    beside = np.bincount(sector(linear.share[linear.depths :], SECTORS), minlength=SECTORS)
    covered = float(np.mean(beside > 0))
    if covered < 0.25 or len(linear.residual_m) < LEAST_CLEAN:
        return None
    fitted = _record(found, problem, covered)
    chance, grown = _chance(loose.prior, found, other), _record(other, loose, covered)
    shown = grown if grown.converged and chance > 0.5 else fitted
    likely = other if chance > 0.5 else found
    unlike_m = min(by_backgrounds_m(likely.equations), MOST_UNLIKE * abs(shift_m(likely.state)))
    fitted = replace(
        fitted,
        growth_m=shown.growth_m,
        growth_u_m=math.hypot(shown.growth_u_m, ALL_ROUND * unlike_m),
        clean_shift_m=lies_m,
        by_size_m=grown.centre_m - fitted.centre_m,
        size_chance=chance,
        rows_m=between_rows_m(problem, found.state),
        unlike_m=unlike_m,
    )
    return _settled(fitted, found)


def _by_intensity(problem: EdgeProblem, state: Array, most: int) -> EdgeFit | None:
    """Fit a clean edge to the intensities beside it, from a state (12,) of where its returns part.

    None where they do not fade over the edge as a footprint's power does, all round.
    """
    problem = replace(problem, prior=problem.prior.by_intensity())
    begin, ratio = problem.prior.mean.copy(), float(np.exp(state[RATIO]))
    pose = [*range(INVERSE + 1), ROTATION]
    begin[pose] = state[pose]
    scatter = speckle(problem, begin)
    if scatter is None:
        return None

    def linearise(at: Array, iteration: int) -> Equations:
        return intensity_equations(problem, at, scatter, robust=iteration > UNDAMPED)

    found = _iterated(linearise, problem, begin, most, damped=False)
    covered, explained = fading(problem, found.state)
    least = FADING_OF_FEW if problem.few else FADING
    if covered < least or explained < EXPLAINED or _misfit(found.equations) > MISFIT:
        return None
    if found.state[SPOT] - problem.prior.mean[SPOT] < NO_FOOTPRINT:
        return None
    fitted = _settled(_record(found, problem, covered), found)
    if not fitted.converged:
        return None
    return replace(fitted, reflectance_ratio=ratio, exponent=fitted.reflectance_ratio)


def _shows_wall(problem: EdgeProblem, found: _Converged, most: int) -> bool:
    """Return whether a target that ends inside its edge does so less where a wall is seen.

    Last returns are of the target where no part of a footprint meets the background: inside the
    edge, and inside that of the wall. Where beams at an edge were filtered out, it ends inside the
    edge all round. Without the background, which other beams might explain.
    """
    held, places = problem.prior.held(found.state), []
    for thickness_m in (None, NO_WALL_M):
        other = replace(problem, prior=held.of_thickness(thickness_m))
        ended = _converge_clean(other, found.state, most, by_power=True, by_background=False)
        rows = slice(ended.equations.depths, None)
        places.append((ended.equations.residual_m[rows], ended.equations.weight[rows]))
    (seen_m, weight), (hidden_m, _) = places
    seen, hidden = float(np.sum(seen_m**2)), float(np.sum(hidden_m**2))
    more = (hidden - seen) * float(np.max(weight, initial=0.0))
    return hidden > SHOWS_WALL * seen and more > BY_CHANCE


def _by_size(
    problem: EdgeProblem, loose: EdgeProblem, state: Array, found: _Converged, most: int
) -> tuple[_Converged, _Converged]:
    """Return the solutions of the stated size, which was found, and of one that is hardly known.

    Where the former explains less, first and last returns may explain more than those by power.
    """
    grown = _grown(loose, found.state, most)
    if not _explains_less(found, grown, AS_MUCH):
        return found, grown
    alone = _explained(problem, state, most, by_power=False)
    if not _explains_less(found, alone, AS_MUCH):
        return found, grown
    return alone, _grown(loose, alone.state, most)


def _grown(problem: EdgeProblem, state: Array, most: int) -> _Converged:
    """Return the solution with a size that is hardly known, from a state (12,) of the stated one.

    A clean edge lies elsewhere all round by what the scanner reports, or by the target's size: this
    fit begins with the latter.
    """
    state = state.copy()
    state[GROWTH] += shift_m(state)
    state[RATIO] = 0.0
    return _by_returns(problem, state, most)


def _chance(prior: Prior, stated: _Converged, grown: _Converged) -> float:
    """Return the probability of a solution of another size beside one of the stated size.

    Where beams are square to a target, what the scanner reports may undo any growth: where the
    stated size explains as much, their priors decide.
    """
    if _explains_less(stated, grown, AS_MUCH):
        return 1.0
    return 0.5 - 0.5 * math.tanh((prior.off(grown.state) - prior.off(stated.state)) / 4.0)


def _by_returns(problem: EdgeProblem, state: Array, most: int) -> _Converged:
    """Return the solution for a scanner that parts returns by power, or reports first or last."""
    found = _explained(problem, state, most, by_power=True)
    if abs(found.state[RATIO]) < ALONE:
        return found
    return _explained(problem, state, most, by_power=False)


def _settled(fitted: EdgeFit, found: _Converged) -> EdgeFit:
    """Return a fit that counts as converged where its last step was small against its u."""
    return replace(fitted, converged=_is_settled(found, fitted.covariance_m2))


def _is_settled(found: _Converged, covariance_m2: Array) -> bool:
    u_m = float(np.sqrt(np.trace(covariance_m2)))
    return found.last_m < max(CONVERGED_M, SETTLED * u_m)


def _explained(problem: EdgeProblem, state: Array, most: int, by_power: bool) -> _Converged:
    """Return the solution with the background, or without one that contradicts it.

    The latter was seen from elsewhere, or hidden by something else, as a projector's shadow is: it
    says nothing of the beams.
    """
    found = _converge_clean(problem, state, most, by_power, by_background=True)
    behind = found.equations.weight[len(found.equations.weight) - found.equations.behind :]
    if len(behind) == 0:
        return found
    alone = _converge_clean(problem, found.state, most, by_power, by_background=False)
    if float(np.mean(behind <= 0.0)) > CONTRADICTED:
        return alone
    apart_m = (alone.state - found.state)[CENTRE]
    covariance, *_ = spread(alone.equations, problem.outline, problem.prior, problem.few)
    covariance_m2 = covariance[CENTRE, CENTRE]
    square = float(apart_m @ np.linalg.solve(covariance_m2, apart_m))
    moved = square > APART_BY_BACKGROUND and _is_settled(alone, covariance_m2)
    return alone if moved else found


def _converge_clean(
    problem: EdgeProblem, state: Array, most: int, by_power: bool, by_background: bool
) -> _Converged:
    """Iterate damped Gauss-Newton steps: the nearest points change from step to step."""

    def linearise(at: Array, iteration: int) -> Equations:
        how = iteration > 9, iteration <= 6, by_power, by_background
        return clean_equations(problem, at, *how)

    return _iterated(linearise, problem, state, most, damped=True)


def _iterated(
    linearise: Callable[[Array, int], Equations],
    problem: EdgeProblem,
    state: Array,
    most: int,
    damped: bool,
) -> _Converged:
    """Iterate Gauss-Newton steps of a clean edge; damped: shorter ones in the end.

    linearise: equations at a state (12,), in an iteration from 1.
    """
    for iteration in range(1, most + 1):
        linear = linearise(state, iteration)
        length = min(1.0, UNDAMPED / iteration) if damped else 1.0
        moved = step(linear, state, problem.prior)[0] * length
        state = state + moved
        last_m = float(np.abs(moved[CENTRE]).max())
        if last_m < STEP_M and iteration > UNDAMPED:
            break
    background = look_up(problem.beams(state), problem.depth, state)
    return _Converged(state, linear.zones, background, linear, iteration, last_m)


def aimed(
    uvw_m: Array,
    outline: Outline,
    thickness_m: float | None,
    config: CentreConfig,
    start: tuple[Array, float] = (np.zeros(2), 0.0),
    station: Array | None = None,
) -> Aim | None:
    """Return where to start, with the beams' direction, or None where nothing shows it.

    From the station, unless the background contradicts it, else from the background.
    start: centre and rotation, near 0. station: (3,) position of the scanner, if known.
    """
    begin = square_on(thickness_m, config, start).state
    look = sample(uvw_m[:, :3], config.max_points)
    plane, depth = look[:, :2], -look[:, 2]
    if station is not None:
        given = pointed(begin, station, begin[CENTRE])
        if not is_contradicted(plane, depth, given, outline):
            return Aim(given, station)
    found = first_beam(plane, depth, begin, outline)
    return None if found is None else Aim(found)


def square_on(thickness_m: float | None, config: CentreConfig, start: tuple[Array, float]) -> Aim:
    """Return a start with beams square to the target."""
    begin = Prior.of(thickness_m, config).mean
    begin[CENTRE], begin[ROTATION] = start
    return Aim(begin)


@dataclass(frozen=True)
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

    state: (12,) with the beams' direction, by `aimed` or another edge's fit; None if unknown.
    """
    plane, depth = uvw_m[:, :2], -uvw_m[:, 2]
    begin = Prior.of(None, config).mean
    begin[CENTRE], begin[ROTATION] = start
    seen = has_background(plane, depth, begin, outline)
    if not seen or state is None or not np.isfinite(seen_through(plane, depth, state, outline)):
        return Behind(seen, None)
    return Behind(seen, np.asarray(state[BEAM]))


@dataclass(frozen=True)
class _Converged:
    """Final state of the fit; last_m: its last step of the centre."""

    state: Array
    zones: Zones
    background: Background
    equations: Equations
    iterations: int
    last_m: float


def _reach_m(state: Array) -> float:
    """Return how far from the edge beams matter: farther where wall and footprint are slanted."""
    square = float(state[BEAM] @ state[BEAM])
    wall = np.sqrt(square) * np.exp(state[THICKNESS]) + np.exp(state[SPOT]) * np.sqrt(1.0 + square)
    return max(NEAR_M, float(wall) + RING_M[1] + OUTER_M)


def _best(problem: EdgeProblem, state: Array, most: int) -> _Converged:
    """Return the solution of a fit to mixed pixels.

    A wide footprint and a growth explain an edge nearly as well as neither: a solution with
    growth gives way to one without that is reached from the stated size and explains as much.
    """
    found = _by_backgrounds(problem, state, most)
    if abs(found.state[GROWTH]) < NOTICED_GROWTH_M:
        return found
    stated = _by_backgrounds(replace(problem, prior=problem.prior.sized()), state, most)
    again = _converge(problem.about(stated.state), stated.state, stated.zones, most, True)
    less = abs(again.state[GROWTH]) < abs(found.state[GROWTH])
    likely = less and again.state[INVERSE] > 0.0
    return again if likely and _unexplained(again) < AS_MUCH * _unexplained(found) else found


def _misfit(linear: Equations) -> float:
    """Return the share of points near the edge that a solution leaves out.

    Without the UNEVEN sectors where it is largest: the background there has steps of its own.
    """
    part = sector(linear.share, SECTORS)
    count = np.bincount(part, minlength=SECTORS)
    out = np.bincount(part, linear.weight <= 0.0, SECTORS)
    kept = np.argsort(out / np.maximum(count, 1), kind="stable")[: SECTORS - UNEVEN]
    return float(out[kept].sum() / max(count[kept].sum(), 1))


def _unexplained(found: _Converged) -> float:
    """Return the mean square of residuals over their standard uncertainties, outliers as of two."""
    weight, residual_m = found.equations.weight, found.equations.residual_m
    return float(np.mean(np.where(weight > 0.0, weight * residual_m**2, 4.0)))


def _explains_less(found: _Converged, other: _Converged, ratio: float = 1.0) -> bool:
    """Return whether a solution leaves more than `ratio` of what another does, not by chance."""
    left, least = _unexplained(found), _unexplained(other)
    count = min(len(found.equations.residual_m), len(other.equations.residual_m))
    return left > ratio * least and count * (left - least) > BY_CHANCE


def _by_backgrounds(problem: EdgeProblem, state: Array, most: int) -> _Converged:
    """Return the solution with one reflectance of the background, or by zones where these differ.

    By zones also where beams are steep: there zones keep a rough fit from diverging.
    """
    steep = float(np.hypot(*state[BEAM])) > STEEP
    found = _solved(problem, state, Zones.free() if steep else Zones.alike(), most)
    if not (steep or problem.few) and zone_scatter(found.equations, problem.prior) > DIFFERENT:
        found = _solved(problem, found.state, Zones.free(), most)
    return found


def _solved(problem: EdgeProblem, state: Array, zones: Zones, most: int) -> _Converged:
    """Return the solution with consistent slopes, or the first one where that diverged."""
    first = _converge(problem, state, zones, most, consistent=False)
    found = _converge(problem.about(first.state), first.state, first.zones, most, consistent=True)
    return first if _diverged(found.state, first.state, problem.prior) else found


def _is_strange(found: _Converged, prior: Prior) -> bool:
    """Return whether a fit did not converge, or its thickness is far from the known one."""
    off = abs(float(found.state[THICKNESS] - prior.mean[THICKNESS]))
    return found.last_m > CONVERGED_M or off > RIDGE


def _diverged(state: Array, first: Array, prior: Prior) -> bool:
    """Return whether a state is far from the first one, and farther from the prior."""
    far = float(np.abs(state[SPOT:ROTATION] - first[SPOT:ROTATION]).max()) > RIDGE
    logs = slice(SPOT, ROTATION)
    return far and prior.off(state, logs) > prior.off(first, logs)


def _converge(
    problem: EdgeProblem, state: Array, zones: Zones, most: int, consistent: bool
) -> _Converged:
    """Iterate Gauss-Newton steps until the centre converges; first look up the background."""
    background = look_up(problem.beams(state), problem.depth, state)
    length, before = 1.0, np.zeros(2)
    for iteration in range(1, most + 1):
        if not consistent and iteration in LOOKS:
            background = look_up(problem.beams(state), problem.depth, state)
        robust = (consistent or iteration > 6) and not problem.few
        linear = equations(problem, background, state, zones, robust, consistent)
        moved, zones = step(linear, state, problem.prior)
        if consistent and float(moved[CENTRE] @ before) < 0.0:
            length = max(length * SHORTER, SHORTEST)
        before = moved[CENTRE]
        state = state + length * moved
        state[INVERSE] = max(state[INVERSE], 0.0)  # the scanner is before the plane
        last_m = float(np.abs(moved[CENTRE]).max())
        if last_m < STEP_M and (consistent or iteration > 8):
            break
    return _Converged(state, zones, background, linear, iteration, last_m)


def _record(found: _Converged, problem: EdgeProblem, covered: float) -> EdgeFit:
    state = found.state
    covariance, by_plane, dof = spread(found.equations, problem.outline, problem.prior, problem.few)
    return EdgeFit(
        centre_m=state[CENTRE],
        rotation_rad=float(state[ROTATION]),
        covariance_m2=covariance[CENTRE, CENTRE],
        by_plane=by_plane[CENTRE],
        dof=dof,
        beam=state[BEAM],
        inverse_distance=float(state[INVERSE]),
        spot_m=float(np.exp(state[SPOT])),
        thickness_m=float(np.exp(state[THICKNESS])),
        reflectance_ratio=float(np.exp(state[RATIO])),
        wall=float(state[WALL]),
        spot_shape=float(state[SHAPE]),
        growth_m=float(state[GROWTH]),
        growth_u_m=float(np.sqrt(covariance[GROWTH, GROWTH])),
        covered=covered,
        misfit=_misfit(found.equations),
        loss=found.equations.loss if problem.few else 0.0,
        points=len(found.equations.residual_m),
        iterations=found.iterations,
        converged=found.last_m < CONVERGED_M,
        rotation_noise=covariance[ROTATION, [0, 1, ROTATION]],
        rotation_by_plane=by_plane[ROTATION],
        thickness_u=float(np.sqrt(covariance[THICKNESS, THICKNESS])),
    )
