"""Fit of an edge without mixed pixels, to where its returns part or to their intensities."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import numpy as np

from ...config import CentreConfig
from ...targets import sector
from ...vectors import Array
from .beam_direction import has_background
from .beams import (
    BEAM,
    CENTRE,
    CHAMFER,
    GROWTH,
    INVERSE,
    RATIO,
    ROTATION,
    SIZE_M,
    SPOT,
    U_CHAMFER_M,
    WALL,
    WRONG_SIZE,
    Prior,
)
from .clean_edge import (
    Wall,
    between_rows_m,
    by_backgrounds_m,
    clean_equations,
    gapped_equations,
    shift_m,
)
from .edge_intensity import fading, intensity_equations, is_mixed, seen_fading, speckle
from .edge_residuals import SECTORS, EdgeProblem, Equations, spread, step
from .solution import (
    AS_MUCH,
    BY_CHANCE,
    MISFIT,
    STEP_M,
    EdgeFit,
    Solution,
    as_stretched,
    explains_less,
    is_settled,
    misfit_of,
    record,
    settled,
    with_likely_chamfer,
)

ERODED = 0.4  # of the stated footprint: a clean edge that lies as far inside the target's is none
# Of depths that show a chamfer: its u, of that before anything was measured; widest footprint.
SHOWN, FINE_M = 0.5, 6e-4
# Slope of beams from which a clean edge that lies farther outside the target's, of the stated
# footprint, is none: mixed pixels pass for one of a wide footprint then.
STEEP, FARTHEST = 1.5, 1.0
LEAST_CLEAN = 24  # points about an edge
CONTRADICTED = 0.35  # share of outliers beside a clean edge: a background that says nothing
# Squared distance of the centres with and without a background, of the latter's covariance: 0.01 by
# chance.
APART_BY_BACKGROUND = 9.2
# Thickness of a target whose wall returns nothing; what that leaves of the places of an edge, of
# what a wall leaves: up to 1.25 where beams were filtered out.
NO_WALL_M, SHOWS_WALL = 1e-4, 1.3
# How far unlike backgrounds move parts of a clean edge: at most, of where it lies; all of it, of
# that of its parts.
MOST_UNLIKE, ALL_ROUND = 0.5, 0.5
AS_NEAR = 2.0  # of what one size leaves of the points beside an edge, what a likelier one may leave
# Of a gap: how far beside the stated edge its middle may lie, of half of it; farthest that a point
# beside it counts.
MOST_ASIDE, FARTHEST_M = 0.5, 2e-3
# Of what may be left of a wall: how likely each is before anything was measured (by power, as the
# face, lost); log of the likelihood, by the points' mean distances, at which one is out of the
# question; how far what is not may move the centre, in units of by_thickness_m, of its scatter.
LIKELY, BY_WALL, UNSURE, TINY_M = (1.0, 0.3, 1.0), 18.0, 2.5, 1e-9
ALONE = np.log(10.0)  # reflectance ratio, or its inverse, of first or last returns: not by power
# Iterations: with rough steps; after which the weights are Tukey's; with steps of full length.
ROUGHLY, ROBUST, UNDAMPED = 6, 9, 10
# Of a fit to intensities: least share of the sectors in which they fade, and of how they differ
# that it explains; least log of its footprint's radius, of the configured one.
FADING, FADING_OF_FEW, EXPLAINED, NO_FOOTPRINT = 0.4, 0.15, 0.8, math.log(0.3)
BY_MIXED = 0.1  # of the footprint: how far unlike backgrounds move parts of it by mixed pixels
SEEN = 0.5  # of that share of the sectors, that single intensities show before the fit


def fit_clean(problem: EdgeProblem, state: Array, config: CentreConfig) -> EdgeFit | None:
    """Fit an edge without mixed pixels; None where it has some, or for a quarter no background."""
    if not has_background(problem.plane, problem.depth, state, problem.outline):
        return None
    given, prior = problem, problem.prior.by_power()
    problem = replace(problem, prior=prior.bevelled() if prior.is_sharp else prior)
    state = state.copy()
    state[WALL] = problem.prior.mean[WALL]
    state[CHAMFER] = problem.prior.mean[CHAMFER]
    parted = _by_returns(problem, state, config.max_iterations)
    if not _shows_form(problem, parted):
        faded = by_intensity(given, parted.state, config.max_iterations)
        if faded is not None:
            return faded
    loose = replace(problem, prior=problem.prior.unsized())
    found, other = _by_size(problem, loose, state, parted, config.max_iterations)
    lies_m = shift_m(found.state)
    slope = float(np.hypot(*found.state[BEAM]))
    if slope > STEEP and lies_m > FARTHEST * config.spot_radius_m:
        return None
    ends_inside = lies_m < -ERODED * config.spot_radius_m
    if ends_inside:
        gapped = _filtered(problem, state, found.equations, config)
        if gapped is not None:
            return gapped
        if not _shows_wall(problem, found, config.max_iterations):
            return None
    covered = _covered(found.equations)
    if covered < 0.25:
        return None
    sized, grown = (
        settled(record(one, of, covered), one) for one, of in ((found, problem), (other, loose))
    )
    fitted = as_stretched(sized, found, problem)
    chance = _chance(loose.prior, found, other)
    shown = grown if grown.converged and chance > 0.5 else sized
    likely = other if chance > 0.5 else found
    unlike_m = min(by_backgrounds_m(likely.equations), MOST_UNLIKE * abs(shift_m(likely.state)))
    fitted = replace(
        fitted,
        growth_m=shown.growth_m,
        growth_u_m=math.hypot(shown.growth_u_m, ALL_ROUND * unlike_m),
        clean_shift_m=lies_m,
        by_size_m=grown.centre_m - sized.centre_m,
        size_chance=chance,
        rows_m=between_rows_m(problem, found.state),
        unlike_m=unlike_m,
    )
    return settled(fitted, found)


def _shows_form(problem: EdgeProblem, parted: Solution) -> bool:
    """Return whether depths show the form of an edge: its chamfer, as if none were stated.

    Footprints are about as fine as that, then, and intensities fade where the surface turns away.
    """
    if parted.state[SPOT] > math.log(FINE_M):
        return False
    unstated = problem.prior.bevelled()
    covariance, *_ = spread(parted.equations, problem.outline, unstated, problem.few)
    return float(covariance[CHAMFER, CHAMFER]) < (SHOWN * U_CHAMFER_M) ** 2


def _filtered(
    problem: EdgeProblem, state: Array, parted: Equations, config: CentreConfig
) -> EdgeFit | None:
    """Fit an edge whose beams were filtered out, from a state (16,); None where there is no gap.

    parted: of the likeliest edge where returns part, whose background may explain more. The centre
    is the mean over what may be left of the wall, by how likely that is. A wall that returns as the
    face does is less likely: walls are seen askew, and are darker.
    """
    problem, state = replace(problem, prior=problem.prior.known_size()), state.copy()
    state[RATIO] = 0.0
    fits = [_gapped(problem, state, config.max_iterations, wall) for wall in get_args(Wall)]
    left_m = np.array([_left_m(one.equations) for one in fits])
    share = _shares(left_m, len(fits[0].equations.residual_m) - fits[0].equations.depths)
    found = fits[int(np.argmax(share))]
    linear, lies_m = found.equations, abs(float(found.state[GROWTH]))
    covered = _covered(linear)
    least_m = max(ERODED * config.spot_radius_m, lies_m / MOST_ASIDE)
    if covered < 0.25 or linear.half_gap_m < least_m or misfit_of(linear) > MISFIT:
        return None
    if parted.behind and _left_m(parted) < left_m.min():
        return None
    centres_m = np.array([fit.state[CENTRE] for fit in fits])
    centre_m = share @ centres_m
    fitted = replace(
        record(found, problem, covered),
        centre_m=centre_m,
        clean_shift_m=-linear.half_gap_m,
        by_size_m=np.zeros(2),
        size_chance=1.0,
        by_thickness_m=UNSURE * np.sqrt(share @ (centres_m - centre_m) ** 2),
        rows_m=between_rows_m(problem, found.state),
        unlike_m=by_backgrounds_m(linear.explained),
    )
    return settled(fitted, found)


def _shares(left_m: Array, places: int) -> Array:
    """Return how likely each of some fits is (K,), in all 1, by what they leave of the places."""
    left_m = np.maximum(left_m, TINY_M)
    beyond = np.log(left_m / left_m.min()) * places / BY_WALL
    share = np.maximum(1.0 - beyond, 0.0) * LIKELY
    return np.asarray(share / share.sum())


def _left_m(linear: Equations) -> float:
    """Return the mean distance of the points beside an edge from where they should lie, 0 of none.

    Whatever their scatter, which a fit may take for larger where it explains less.
    """
    off_m = np.abs(linear.residual_m[linear.depths :])
    return float(np.mean(np.minimum(off_m, FARTHEST_M))) if len(off_m) else 0.0


def _gapped(problem: EdgeProblem, state: Array, most: int, wall: Wall) -> Solution:
    """Return the solution whose edge is in the middle of a gap, from a state (16,)."""

    def linearise(at: Array, iteration: int) -> Equations:
        return gapped_equations(problem, at, iteration > ROBUST, iteration <= ROUGHLY, wall)

    return _iterated(linearise, problem, state, most, damped=True)


def _covered(linear: Equations) -> float:
    """Return the share of the outline that points beside the edge show; 0 of too few."""
    if len(linear.residual_m) < LEAST_CLEAN:
        return 0.0
    beside = np.bincount(sector(linear.share[linear.depths :], SECTORS), minlength=SECTORS)
    return float(np.mean(beside > 0))


def by_intensity(problem: EdgeProblem, state: Array, most: int) -> EdgeFit | None:
    """Fit a clean edge to the intensities beside it, from a state (16,) of where its returns part.

    None where they do not fade over the edge as a footprint's power does, all round. Without a
    chamfer that is not stated: one would explain intensities that follow no power.
    """
    problem = replace(problem, prior=problem.prior.by_intensity())
    begin, ratio = problem.prior.mean.copy(), float(np.exp(state[RATIO]))
    pose = [*range(INVERSE + 1), ROTATION]
    begin[pose] = state[pose]
    scatter = speckle(problem, begin)
    least = FADING_OF_FEW if problem.few else FADING
    if scatter is None or seen_fading(problem, begin) < SEEN * least:
        return None

    def linearise(at: Array, iteration: int) -> Equations:
        return intensity_equations(problem, at, scatter, robust=iteration > UNDAMPED)

    found = _iterated(linearise, problem, begin, most, damped=problem.few)
    covered, explained = fading(problem, found.state)
    if covered < least or explained < EXPLAINED or misfit_of(found.equations) > MISFIT:
        return None
    if found.state[SPOT] - problem.prior.mean[SPOT] < NO_FOOTPRINT:
        return None
    fitted = settled(record(found, problem, covered), found)
    if not fitted.converged:
        return None
    fitted = replace(
        fitted,
        reflectance_ratio=ratio,
        exponent=fitted.reflectance_ratio,
        unlike_m=BY_MIXED * fitted.spot_m if is_mixed(problem, found.state) else 0.0,
    )
    return with_likely_chamfer(fitted, found.equations, problem.prior)


def _shows_wall(problem: EdgeProblem, found: Solution, most: int) -> bool:
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
    problem: EdgeProblem, loose: EdgeProblem, state: Array, found: Solution, most: int
) -> tuple[Solution, Solution]:
    """Return the solutions of the stated size, which was found, and of one that is hardly known.

    Where the former explains less, first and last returns may explain more than those by power.
    """
    grown = _grown(loose, found.state, most)
    found = _likelier(problem, found, grown.state, most)
    if not explains_less(found, grown, AS_MUCH):
        return found, grown
    alone = _explained(problem, state, most, by_power=False)
    if not explains_less(found, alone, AS_MUCH):
        return found, grown
    return alone, _grown(loose, alone.state, most)


def _likelier(problem: EdgeProblem, found: Solution, state: Array, most: int) -> Solution:
    """Return the likelier of a solution and the one to which a likelier state (16,) leads.

    The latter only where it explains no less. Depths of an edge have several solutions: a wide
    footprint passes for a narrow chamfer.
    """
    off = problem.prior.off
    if off(state) >= off(found.state):
        return found
    other = _by_returns(problem, state, most)
    likelier = off(other.state) < off(found.state) and not explains_less(other, found)
    return other if likelier else found


def _grown(problem: EdgeProblem, state: Array, most: int) -> Solution:
    """Return the solution with a size that is hardly known, from a state (16,) of the stated one.

    A clean edge lies elsewhere all round by what the scanner reports, or by the target's size: this
    fit begins with the latter.
    """
    state = state.copy()
    state[GROWTH] += shift_m(state)
    state[RATIO] = 0.0
    return _by_returns(problem, state, most)


def _chance(prior: Prior, stated: Solution, grown: Solution) -> float:
    """Return the probability of a solution of another size beside one of the stated size.

    Where beams are square to a target, what the scanner reports may undo any growth: where the
    stated size explains as much, or the points beside the edge far better, their priors decide:
    depths alone, of a rounded edge as those of a wide footprint, show no size. Another size that
    leaves those points far nearer, and the depths no worse, is not undone by a wide footprint; nor
    is one that the stated size itself asks for.
    """
    if abs(stated.state[GROWTH]) > WRONG_SIZE * SIZE_M:
        return 1.0
    beside_m, grown_m = _left_m(stated.equations), _left_m(grown.equations)
    if grown_m <= AS_NEAR * beside_m and explains_less(stated, grown, AS_MUCH):
        return 1.0
    if AS_NEAR * grown_m < beside_m and not explains_less(grown, stated, AS_MUCH):
        return 1.0
    off, off_grown = (prior.towards(one.state).off(one.state) for one in (stated, grown))
    return 0.5 - 0.5 * math.tanh((off_grown - off) / 4.0)


def _by_returns(problem: EdgeProblem, state: Array, most: int) -> Solution:
    """Return the solution for a scanner that parts returns by power, or reports first or last."""
    found = _explained(problem, state, most, by_power=True)
    if abs(found.state[RATIO]) < ALONE:
        return found
    return _explained(problem, state, most, by_power=False)


def _explained(problem: EdgeProblem, state: Array, most: int, by_power: bool) -> Solution:
    """Return the solution with the background, or without one that contradicts it.

    The latter was seen from elsewhere, or hidden by something else, as a projector's shadow is: it
    says nothing of the beams.
    """
    found = _converge_clean(problem, state, most, by_power, by_background=True)
    behind = found.equations.weight[len(found.equations.weight) - found.equations.behind :]
    if len(behind) == 0:
        return found
    contradicted = float(np.mean(behind <= 0.0)) > CONTRADICTED
    alone = _converge_clean(
        problem, found.state, most, by_power, by_background=False, near=not contradicted
    )
    if contradicted:
        return alone
    apart_m = (alone.state - found.state)[CENTRE]
    covariance, *_ = spread(alone.equations, problem.outline, problem.prior, problem.few)
    covariance_m2 = covariance[CENTRE, CENTRE]
    square = float(apart_m @ np.linalg.solve(covariance_m2, apart_m))
    moved = square > APART_BY_BACKGROUND and is_settled(alone, covariance_m2)
    return alone if moved else found


def _converge_clean(
    problem: EdgeProblem,
    state: Array,
    most: int,
    by_power: bool,
    by_background: bool,
    near: bool = False,
) -> Solution:
    """Iterate damped Gauss-Newton steps: the nearest points change from step to step.

    near: whether the state is near the solution, so that no rough steps are needed.
    """

    def linearise(at: Array, iteration: int) -> Equations:
        how = iteration > ROBUST, iteration <= ROUGHLY, by_power, by_background
        return clean_equations(problem, at, *how)

    return _iterated(linearise, problem, state, most, damped=True, first=ROUGHLY + 1 if near else 1)


def _iterated(
    linearise: Callable[[Array, int], Equations],
    problem: EdgeProblem,
    state: Array,
    most: int,
    damped: bool,
    first: int = 1,
) -> Solution:
    """Iterate Gauss-Newton steps of a clean edge; damped: shorter ones in the end.

    Damped ones begin roughly: far off, depths of an edge would pass for those of its chamfer.

    linearise: equations at a state (16,), in an iteration from `first`, up to `most`.
    """
    known = problem.prior.as_likely()
    for iteration in range(min(first, most), most + 1):
        linear = linearise(state, iteration)
        prior = known if damped and iteration <= ROUGHLY else problem.prior
        length = min(1.0, UNDAMPED / iteration) if damped else 1.0
        moved = step(linear, state, prior.towards(state))[0] * length
        state = state + moved
        last_m = float(np.abs(moved[CENTRE]).max())
        if last_m < STEP_M and iteration > UNDAMPED:
            break
    background = problem.background(state)
    return Solution(state, linear.zones, background, linear, iteration, last_m)
