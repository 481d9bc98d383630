"""Fit of an edge to its mixed pixels."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from ...config import CentreConfig
from ...vectors import Array
from .beams import (
    BEAM,
    CENTRE,
    CHAMFER,
    CHAMFER_M,
    GROWTH,
    INVERSE,
    MODULATION,
    PARALLEL,
    RATIO,
    ROTATION,
    SHAPE,
    SIZE_M,
    SPOT,
    STATED_THICKNESS,
    THICKNESS,
    WALL,
    Background,
    Prior,
)
from .edge_residuals import (
    ALIKE_LOG,
    UNEVEN_SECTORS,
    ZONES,
    EdgeProblem,
    Zones,
    along,
    equations,
    pointing_m,
    power_of_light,
    step,
    zone_scatter,
)
from .few_points import likeliest
from .mixed_pixel import EITHER
from .solution import (
    ANY_PART,
    AS_MUCH,
    BY_CHANCE,
    STEP_M,
    EdgeFit,
    Solution,
    as_stretched,
    by_round,
    explained,
    explains_less,
    lost_sides,
    record,
    settled,
    unexplained,
    unexplained_by_sector,
    unseen_chamfer_m,
)

# Scatter of the zones' reflectances, in logs, from which each has its own; in a first fit, and the
# points that show it there.
DIFFERENT, SURELY, CLEARLY = 0.1, 0.2, 4000
CLEARED, MOST_UNEVEN, MOVED_M = 2, 0.4, 1e-5  # times; share of sectors; a move that starts anew
EVENED, SLIGHTLY_UNEVEN = 5, 0.4  # times; mean residual, over u, of sectors that contradict it
LOOKS = (2, 3, 5, 8)  # iterations at which the background is looked up again
# First iterations of a fit from another solution, at which it is, too, while steps of the centre
# are longer; how far from it a fit has gone astray.
OWN_LOOKS, OWN_M, ASTRAY_M = 8, 2e-6, 5e-4
LEAST, LEAST_COVERED = 24, 0.25  # points about an edge; share of it with a background
MOST_OF_FEW = 20  # iterations of each fit to few points
NEAR_STEP_M = 1e-6  # of the centre, that ends a fit from another solution
FAR_M = 5e-5  # step of the growth, after which other points lie near the edge
NEAR_MODULATION = 1.0  # of the modulation, 1/m^2, that ends a fit
# A step of the centre that ends a first fit; its iterations; its points, inside and outside.
ROUGH_M, MOST_ROUGH, ROUGH_POINTS = 2e-6, 20, 8000
LOOKED_POINTS = 5000  # inside and outside, that tell sizes apart
# Slope of beams from which a thick wall hides so much that a fit may diverge; from which none is
# tried but with a plain wall.
STEEP, STEEPEST = 1.0, 1.3
SHORTER, SHORTEST = 0.7, 0.1  # of a step's length, after one that went back; its least
NOTICED_GROWTH_M = 1e-4  # as SIZE_M: from here on, a solution with less is looked for
# Of a side, whose points contradict its background, or that has none: it may lie elsewhere.
LOST, NO_SIDE = 0.25, 0.7
OTHER_SIZE_M = 5e-4  # growth from which a target may be of another size than stated
# Standard deviations off the prior from which the stated thickness is doubted; up to which it may
# be right where no other explains as much.
TENSE, MOST_TENSE = 2.0, 6.0
LIKELY = 3.0  # standard deviations of a size that may be so
CONTRADICTED_THICKNESS = 2.0  # standard deviations off the stated one by the data alone
LEAST_CHAMFER_M, MOST_CHAMFER_M = -3e-4, 3e-3  # that an edge may seem to have, and may have
LOW_CHAMFER_M = 5e-5  # by which a fitted chamfer is too narrow, with a wall as thin (k = 1)
LEAST_SHARP_M = -3e-5  # that a sharp edge may seem to have
BY_WIDTH_M = 1.5e-4  # change of a chamfer with the width from which that may pass for it
# Power of the background's light: over its u, from which on it is sought, and where zones differ;
# of its search, the number of steps, the one that ends it, and where zones differ, and the one from
# which on solutions are sought anew.
SURE_OF_GAMMA, PERHAPS_GAMMA = 3.0, 1.0
MOST_GAMMAS, NEAR_GAMMA, NEARER_GAMMA, FAR_GAMMA = 6, 0.05, 0.01, 0.25
EDGE = [SPOT, THICKNESS, RATIO, WALL, SHAPE, GROWTH]  # what a wrong thickness pulls
# Relative standard uncertainty of one by the data alone, besides noise; how much more it is by the
# square of footprint over the wall's width as seen: square on to a face, it is seen narrow.
THICKNESS_MODEL, SQUARE_ON = 0.05, 5.0
BY_ZONES = 3.0 * ZONES  # of a sum of squares over their variances, that zones explain by chance
NEAREST = 0.1  # quantile of the background's depth, from which on a wall is none
LEAST_SHOWN = 0.01  # of the variance of a prior, that the data show
# Of a sum of squares over their variances, that an ellipse explains by chance. Of an ellipse: 2.2
# times as long as wide, beyond which something else looks like one, as scans from two places do.
BY_ELLIPSE, MOST_ELLIPSE = 15.0, 0.4
RIDGE = 0.3  # of log footprint, thickness, reflectance ratio: largest change by consistent slopes


# What follows from a fit with curves, of an EdgeFit: not the footprint, which stands for some of
# what is left out.
BY_CURVES = (
    "centre_m",
    "rotation_rad",
    "covariance_m2",
    "by_plane",
    "dof",
    "beam",
    "inverse_distance",
    "reflectance_ratio",
    "wall",
    "spot_shape",
    "spot_ellipse",
    "chamfer_m",
    "chamfer_u_m",
    "rotation_noise",
    "rotation_by_plane",
    "covariance",
    "known",
)


def fit_mixed(
    problem: EdgeProblem, state: Array, thickness_m: float | None, config: CentreConfig
) -> EdgeFit | None:
    """Fit an edge to its mixed pixels; None where a quarter of it has no background."""
    fit = _fit_steep if _is_steep(state) else _fit_straight
    straight = fit(problem, state, thickness_m, config)
    if straight is None:
        return None
    most = config.max_iterations
    elliptic = _as_ellipse(problem, *straight, most)
    if elliptic is not None:
        problem = replace(problem, prior=problem.prior.elliptic())
        other = _fit_straight(problem, elliptic, thickness_m, config)
        if other is not None and _is_spot(other[0]) and _explains_as_much(other[2], straight[2]):
            straight = other
    return _with_curves(*straight, most)


def _as_ellipse(
    problem: EdgeProblem, fitted: EdgeFit, own: EdgeProblem, found: Solution, most: int
) -> Array | None:
    """Return a state (16,) of beams that are longer than wide; None where round ones explain more.

    Not of straight sides, as other lengths of these look the same; nor of few points, steep beams,
    or a fit that did not converge. own: the problem that was solved.
    """
    if problem.few or problem.outline.shows_rotation or not fitted.converged:
        return None
    if _is_steep(found.state) or own.prior.is_plain:
        return None
    elliptic = _again(replace(own, prior=problem.prior.elliptic()), found, most)
    if not explains_less(found, elliptic, by_chance=BY_ELLIPSE):
        return None
    state, unknown = elliptic.state.copy(), [CHAMFER, MODULATION]
    state[unknown] = problem.prior.mean[unknown]
    return state


def _is_spot(fitted: EdgeFit) -> bool:
    """Return whether a fit converged to a spot that is no longer than those of scanners are."""
    return fitted.converged and float(np.hypot(*fitted.spot_ellipse)) < MOST_ELLIPSE


def _fit_steep(
    problem: EdgeProblem, state: Array, thickness_m: float | None, config: CentreConfig
) -> tuple[EdgeFit, EdgeProblem, Solution] | None:
    """Fit an edge that steep beams meet, as `_fit_straight`.

    With the wall as bright as the face and the spot's shape held, where all else diverges or
    explains less; so of few points, and where beams are too steep for anything else.
    """
    plain = replace(problem, prior=problem.prior.plain())
    held = _fit_straight(plain, state, thickness_m, config)
    if problem.few or float(np.hypot(*state[BEAM])) > STEEPEST:
        return held
    free = _fit_straight(problem, state, thickness_m, config)
    if free is None or not free[0].converged:
        return held
    return free if held is None or not explains_less(free[2], held[2]) else held


def _with_curves(fitted: EdgeFit, problem: EdgeProblem, found: Solution, most: int) -> EdgeFit:
    """Return the fit with a background that may curve behind the edge, from a straight one.

    Its size, what is left out and what is in doubt stay as they are: curves all round would explain
    a wrong size. As it is where the size is in doubt, or the fit goes astray.
    """
    if problem.few or not fitted.converged or _is_steep(found.state):
        return fitted
    if _may_be_of_another_size(problem, found):
        return fitted
    problem = replace(problem.about(found.state), curved=True)
    curved = _converge(problem, found.state, found.zones, most, True, found.background)
    if not curved.converged or _is_astray(curved.state, found.state):
        return fitted
    shown = as_stretched(record(curved, problem, found.covered), curved, problem)
    return replace(fitted, **{name: getattr(shown, name) for name in BY_CURVES})


def _fit_straight(
    problem: EdgeProblem, state: Array, thickness_m: float | None, config: CentreConfig
) -> tuple[EdgeFit, EdgeProblem, Solution] | None:
    """Fit an edge before a background that goes on as it was looked up, as `fit_mixed`.

    With its problem and its solution. Without the stated thickness where the data pull it or the
    size, another one explains as much, and the data contradict the stated one then.
    """
    most = config.max_iterations
    plain = problem
    problem, found = _best(problem, state, most)
    shown_m = _pointing_m(problem, found)
    problem, plain = (replace(one, pointing_m=shown_m) for one in (problem, plain))
    problem, found = _with_light(*_freed(problem, found, config), plain, state, config)
    plain = replace(plain, gamma=problem.gamma)
    if plain.prior.is_plain and thickness_m is not None and _is_strange(found, problem.prior):
        held = replace(plain, prior=plain.prior.held(state))
        problem, found = _freed(*_best(held, state, most), config)
    fitted = _recorded(found, problem)
    if fitted is None:
        return None
    stretched = as_stretched(fitted, found, problem)
    if thickness_m is None:
        return stretched, problem, found
    pull = _pulls(fitted, problem.prior)[EDGE.index(THICKNESS)]
    fitted, stretched = (replace(one, thickness_pull=pull) for one in (fitted, stretched))
    tension = _tension(fitted, problem.prior)
    if not problem.few and (tension < TENSE or _is_wider(stretched, problem.prior)):
        return stretched, problem, found
    doubted = replace(plain, prior=plain.prior.doubted())
    if problem.few:
        other = _again(doubted, found, most)
    else:
        doubted, other = _freed(*_best(doubted, state, most), config)
        if _reaches_background(other):
            doubted = replace(problem, prior=problem.prior.doubted())
            other = _as_if_sharp(doubted, _again(doubted, found, most))
    free, worse = _recorded(other, doubted), explains_less(other, found)
    if free is None or (worse and tension < MOST_TENSE):
        return stretched, problem, found
    chosen = _by_thickness(fitted, free, thickness_m, worse)
    if chosen.by_thickness_m is None:
        return as_stretched(chosen, other, doubted), doubted, other
    return replace(stretched, by_thickness_m=chosen.by_thickness_m), problem, found


def explained_at_first(problem: EdgeProblem, state: Array, most: int) -> float:
    """Return how many of LOOKED_POINTS a rough fit explains, see `explained`."""
    some = problem.of_some(LOOKED_POINTS)
    return explained(_converge(some, state, Zones.alike(), most, consistent=False))


def _is_wider(fitted: EdgeFit, prior: Prior) -> bool:
    """Return whether a width that may be so explains what pulls at the stated thickness."""
    off_m = max(abs(fitted.stretch_m), abs(fitted.growth_m))
    thicker = abs(math.log(fitted.thickness_m) - prior.mean[THICKNESS]) / STATED_THICKNESS
    return fitted.stretch_m != 0.0 and off_m < LIKELY * SIZE_M and thicker < TENSE


def _by_thickness(fitted: EdgeFit, free: EdgeFit, thickness_m: float, worse: bool) -> EdgeFit:
    """Return the fit with the stated thickness, or the one without where that contradicts it.

    worse: whether the one without explains the points less, as a wall that is none does.
    """
    seen_m = max(thickness_m, free.thickness_m) * float(np.hypot(*free.beam))
    by_model = THICKNESS_MODEL * (1.0 + SQUARE_ON * (free.spot_m / max(seen_m, 1e-9)) ** 2)
    u = math.hypot(free.thickness_u, STATED_THICKNESS, by_model)
    off = abs(math.log(free.thickness_m / thickness_m)) / u
    if free.converged and not worse and off > CONTRADICTED_THICKNESS:
        pull = fitted.thickness_pull
        return replace(free, stated_thickness_m=thickness_m, thickness_pull=pull)
    return replace(fitted, by_thickness_m=free.centre_m - fitted.centre_m)


def _recorded(found: Solution, problem: EdgeProblem) -> EdgeFit | None:
    """Return the fit of a solution; None where a quarter of the edge has no background."""
    if found.covered < LEAST_COVERED or len(found.equations.residual_m) < LEAST:
        return None
    fitted = record(found, problem, found.covered)
    return settled(fitted, found) if problem.few else fitted


def _tension(fitted: EdgeFit, prior: Prior) -> float:
    """Return how far the edge's parameters lie from their prior, in standard deviations."""
    return float(np.sqrt(np.sum(np.square(_pulls(fitted, prior)))))


def _pulls(fitted: EdgeFit, prior: Prior) -> list[float]:
    """Return how far each of the edge's parameters lies from its prior, in standard deviations.

    A posterior mean has the variance of its prior less that of the posterior.
    """
    variance, u = 1.0 / prior.weight[EDGE], np.zeros(len(EDGE))
    u[EDGE.index(THICKNESS)], u[EDGE.index(GROWTH)] = fitted.thickness_u, fitted.growth_u_m
    shown = np.maximum(variance - u**2, LEAST_SHOWN * variance)
    pulls: list[float] = ((fitted.state - prior.mean)[EDGE] / np.sqrt(shown)).tolist()
    return pulls


def _best(problem: EdgeProblem, state: Array, most: int) -> tuple[EdgeProblem, Solution]:
    """Return the problem without uneven sectors, and its solution; of few points, the likeliest.

    A wide footprint and a growth explain an edge nearly as well as neither: a solution with growth
    gives way to one with less that is reached from the stated size and explains as much, or to one
    that explains more. Backgrounds that differ where they did not must explain more than by chance.
    """
    if problem.few:
        solve = partial(_by_backgrounds, problem, most=MOST_OF_FEW)
        return problem, likeliest(problem, state, solve)
    problem, found = _cleared(problem, state, most)
    if abs(found.state[GROWTH]) < NOTICED_GROWTH_M:
        return problem, found
    sized = replace(problem, prior=problem.prior.sized())
    stated = _by_backgrounds(sized, state, most)
    again = _again(problem, stated, most)
    if abs(again.state[GROWTH]) > OTHER_SIZE_M:  # before the background of that size
        again = _again(problem, again, most)
    less = abs(again.state[GROWTH]) < abs(found.state[GROWTH])
    if again.zones.sigma > found.zones.sigma:
        as_much = _is_worse(found, again)
    else:
        as_much = _explains_as_much(again, found)
    likely = as_much and (less or explains_less(found, again))
    if likely and again.state[INVERSE] > PARALLEL:
        found = again
    if abs(found.state[GROWTH]) < OTHER_SIZE_M:
        return problem, found
    return _where_stated(problem, stated, found, most)


def _explains_as_much(found: Solution, other: Solution) -> bool:
    """Return whether a solution leaves no more of its points unexplained than another."""
    return unexplained(found) < AS_MUCH * unexplained(other)


def _where_stated(
    problem: EdgeProblem, stated: Solution, found: Solution, most: int
) -> tuple[EdgeProblem, Solution]:
    """Return the problem without sectors that ask for another size, and its solution.

    stated: that of the stated size; found: of another one. The latter, with the problem as it is,
    where others do, too, or more sectors ask for it than contradict a background.
    """
    left, left_by_other = (unexplained_by_sector(one, UNEVEN_SECTORS) for one in (stated, found))
    asks = left - left_by_other
    left_out = asks > BY_CHANCE
    if asks[~left_out].sum() > BY_CHANCE:
        return problem, found
    left_out |= problem.left_out
    if np.mean(left_out) > MOST_UNEVEN:
        return problem, found
    without = replace(problem, left_out=left_out)
    again = _again(without, stated, most)
    return (problem, found) if abs(again.state[GROWTH]) > OTHER_SIZE_M else (without, again)


def _pointing_m(problem: EdgeProblem, found: Solution) -> float:
    """Return the standard uncertainty of where beams meet the plane, as a solution shows it.

    Not of an edge that is stated to be round: its model errs by 0.01 mm, which would count more.
    """
    if problem.few or problem.roundness > EITHER or not found.converged:
        return problem.pointing_m
    return pointing_m(problem, found.background, found.state, found.zones)


def _with_light(
    problem: EdgeProblem, found: Solution, plain: EdgeProblem, state: Array, config: CentreConfig
) -> tuple[EdgeProblem, Solution]:
    """Return the problem whose background is as bright as its intensities, with its solution.

    To a power of them, sought from 1 on, as of a scanner that weighs what returns by its power. As
    they are where its light explains nothing, or less than the zones' reflectances do: then with
    how far the centre would move by it, where it explains something.
    plain: the problem of sharp edges and mean ranges, to be solved from a state.
    """
    if problem.few or problem.light is None or not found.converged:
        return problem, found
    gamma, u = _power_of_light(problem, found)
    if gamma < (PERHAPS_GAMMA if _is_by_zones(found) else SURE_OF_GAMMA) * u:
        return problem, found
    most = config.max_iterations
    lit, first = _best(replace(plain, gamma=1.0), state, most)
    freed, other = _freed(lit, first, config)
    for _ in range(MOST_GAMMAS):
        change = float(np.clip(_power_of_light(freed, other)[0] - lit.gamma, -1.0, 1.0))
        by_zones = _is_by_zones(other)  # which may be alike once the power is right
        if not other.converged or abs(change) < (NEARER_GAMMA if by_zones else NEAR_GAMMA):
            break
        if abs(change) < FAR_GAMMA and not by_zones:
            lit = replace(lit, gamma=lit.gamma + change)
            first = _again(lit, first, most)
        else:
            lit, first = _best(replace(plain, gamma=lit.gamma + change), state, most)
        more, better = _freed(lit, first, config)
        if _is_worse(better, other):
            break
        freed, other = more, better
    if other.converged and not _is_worse(other, found):
        return freed, other
    if other.converged and gamma > SURE_OF_GAMMA * u:
        found = replace(found, by_light_m=(other.state - found.state)[CENTRE])
    return problem, found


def _is_by_zones(found: Solution) -> bool:
    """Return whether the zones of a background have reflectances of their own."""
    return found.zones.sigma > ALIKE_LOG


def _is_worse(found: Solution, other: Solution) -> bool:
    """Return whether another solution explains more, and more than its zones do by chance."""
    chance = BY_ZONES if found.zones.sigma < other.zones.sigma else BY_CHANCE
    return explains_less(found, other, by_chance=chance)


def _power_of_light(problem: EdgeProblem, found: Solution) -> tuple[float, float]:
    """Return by which power of its light the background is bright, if zones are alike, and its u.

    By one step from a solution: of Gauss-Newton where zones differ, as it is none of alike ones.
    Before a new background where that of the solution has no light: a first fit looks for none.
    """
    linear, state, background = found.equations, found.state, found.background
    if is_dark := background.log_light is None:
        background = problem.background(state)
    if _is_by_zones(found):
        linear = equations(problem, background, state, Zones.alike(), False, True)
        linear = replace(linear, change=linear.weight)
    elif is_dark:
        linear = equations(problem, background, state, found.zones, True, True)
    return power_of_light(linear, background, problem.prior, state, problem.gamma)


def _freed(
    problem: EdgeProblem, plain: Solution, config: CentreConfig
) -> tuple[EdgeProblem, Solution]:
    """Return the problem of a scanner that may add phases, and an edge that may have a chamfer.

    With its solution from one of means and a sharp edge, which steep beams keep. Without the
    chamfer where one is stated; where the plate may be of another size, which a chamfer would
    explain as well; or where the data ask for one that is none, below 0 or wide. Without phases
    where they do not explain such a size.
    """
    most = config.max_iterations
    if problem.few or not plain.converged or len(plain.background.rows) < LEAST:
        return problem, plain
    if _is_steep(plain.state):
        return problem, _as_if_sharp(problem, _near(problem, plain, most))
    phased = problem
    if problem.prior.is_of_means and config.ambiguity_m is None:
        phased = replace(problem, prior=problem.prior.by_phase())
    doubted, bevelled = _may_be_of_another_size(problem, plain), None
    if problem.prior.is_sharp and not doubted:
        may = replace(phased, prior=phased.prior.bevelled())
        bevelled = _bevelled(may, plain, most)
        if _has_chamfer(may, bevelled):
            low_m = LOW_CHAMFER_M * along(bevelled.equations, may.prior, CHAMFER)[CENTRE]
            return may, replace(bevelled, by_chamfer_m=low_m, by_round=by_round(bevelled, may))
    found = _near(phased, plain, most)
    if not found.converged or (doubted and _may_be_of_another_size(phased, found)):
        phased, found = problem, plain
    return phased, _as_if_sharp(phased, found, bevelled)


def _as_if_sharp(
    problem: EdgeProblem, found: Solution, bevelled: Solution | None = None
) -> Solution:
    """Return the solution of an edge that counts as sharp, with how far its chamfer may move it.

    As it is where the chamfer is stated. bevelled: solution with one that the data ask for, but
    which may be a wrong width: any part of it may be so, and where that is more than one of
    CHAMFER_M, it counts.
    """
    if not problem.prior.is_sharp:
        return found
    may = replace(problem, prior=problem.prior.bevelled())
    linear = equations(may, found.background, found.state, found.zones, True, True)
    by_chamfer_m = unseen_chamfer_m(linear, problem.prior)
    if bevelled is not None and bevelled.converged and bevelled.state[CHAMFER] > 0.0:
        asked_m = ANY_PART * (bevelled.state - found.state)[CENTRE]
        by_chamfer_m = max(by_chamfer_m, asked_m, key=lambda move: float(move @ move))
    return replace(found, by_chamfer_m=by_chamfer_m)


def _bevelled(problem: EdgeProblem, sharp: Solution, most: int) -> Solution:
    """Return the solution with a chamfer; from a wide one where it would be none.

    A narrower plate with a thicker wall explains an edge nearly as well as a chamfer, and where the
    background has a step close to the edge, the sectors that show it may lead there: a wide chamfer
    is held first, so that they are known by their contradiction.
    """
    found = _near(problem, sharp, most)
    if found.state[CHAMFER] > LEAST_SHARP_M:
        return found
    wide = sharp.state.copy()
    wide[CHAMFER] = CHAMFER_M
    held = replace(problem, prior=problem.prior.of_held_chamfer(CHAMFER_M))
    other = _near(problem, _again(held, replace(sharp, state=wide), most), most)
    return other if other.state[CHAMFER] > 0.0 and not explains_less(other, found) else found


def _near(problem: EdgeProblem, found: Solution, most: int) -> Solution:
    """Return the solution with consistent slopes from another one, before its own background.

    That of an edge taken for sharp would hold a chamfer near none: size and ratio make up for it.
    Before the other's where it goes astray.
    """
    about = problem.about(found.state)
    again = _converge(about, found.state, found.zones, most, True, own=True)
    if not again.converged:
        again = _converge(about, found.state, found.zones, most, True, found.background)
    return replace(again, iterations=max(again.iterations, found.iterations))


def _has_chamfer(problem: EdgeProblem, found: Solution) -> bool:
    """Return whether the chamfer of a solution may be one; nor where a wrong width would be one."""
    chamfer_m = float(found.state[CHAMFER])
    if not found.converged or not LEAST_CHAMFER_M < chamfer_m < MOST_CHAMFER_M:
        return False
    if not problem.outline.shows_rotation:
        return True
    fitted, stretched = _of_any_width(found, problem)
    return abs(stretched.chamfer_m - fitted.chamfer_m) < BY_WIDTH_M


def _may_be_of_another_size(problem: EdgeProblem, found: Solution) -> bool:
    """Return whether a plate may be larger or smaller than stated, or along one side."""
    if not problem.outline.shows_rotation:
        return abs(float(found.state[GROWTH])) > OTHER_SIZE_M
    fitted, stretched = _of_any_width(found, problem)
    off_m = max(abs(fitted.growth_m), abs(stretched.stretch_m))
    contradicted = max(lost_sides(~problem.left_out, problem.outline))
    return off_m > OTHER_SIZE_M or contradicted > LOST or max(fitted.lost) > NO_SIDE


def _of_any_width(found: Solution, problem: EdgeProblem) -> tuple[EdgeFit, EdgeFit]:
    """Return the fit of a solution, and the one with the width against the height unknown."""
    fitted = record(found, problem, found.covered)
    return fitted, as_stretched(fitted, found, problem)


def _cleared(problem: EdgeProblem, state: Array, most: int) -> tuple[EdgeProblem, Solution]:
    """Return the problem without sectors that contradict their background, and its solution.

    What lies near an edge there is none of one depth, and pulls beams and footprint. A solution
    that moves without them is sought anew: they may have led it astray.
    """
    found = _by_backgrounds(problem, state, most)
    if _is_by_zones(found) and not _is_steep(state):
        even, alike = _evened(problem, state, most)
        if unexplained(alike) < unexplained(found) and not _differ(alike, even, DIFFERENT):
            return even, alike
    for _ in range(CLEARED):
        uneven = found.equations.uneven()
        left_out = problem.left_out | uneven
        if not uneven.any() or np.mean(left_out) > MOST_UNEVEN:
            break
        problem = replace(problem, left_out=left_out)
        again = _again(problem, found, most)
        moved_m = float(np.abs(again.state[CENTRE] - found.state[CENTRE]).max())
        if moved_m > MOVED_M:
            again = min(again, _by_backgrounds(problem, state, most), key=unexplained)
        found = again
    return problem, found


def _evened(problem: EdgeProblem, state: Array, most: int) -> tuple[EdgeProblem, Solution]:
    """Return the problem without sectors that contradict one reflectance, and its solution.

    A background with a step close behind the edge seems to have others, and a footprint that is too
    small explains it. Its neighbours are left out as well, and every solution is sought anew, until
    none contradict it, or too many do.
    """
    found = _solved(problem, state, Zones.alike(), most)
    for _ in range(EVENED):
        uneven = found.equations.uneven(SLIGHTLY_UNEVEN)
        more = problem.left_out | uneven | np.roll(uneven, 1) | np.roll(uneven, -1)
        if np.array_equal(more, problem.left_out) or np.mean(more) > MOST_UNEVEN:
            break
        problem = replace(problem, left_out=more)
        found = _solved(problem, state, Zones.alike(), most)
    return problem, found


def _by_backgrounds(problem: EdgeProblem, state: Array, most: int) -> Solution:
    """Return the solution with one reflectance of the background, or by zones where these differ.

    By zones also where beams are steep: there zones keep a rough fit from diverging. At once where
    a first fit shows that they differ; not one of few points, or one that went astray.
    """
    free = Zones.free(lit=problem.gamma != 0.0)
    if _is_steep(state) and not problem.few:
        return _solved(problem, state, free, most)
    found = _converge(problem, state, Zones.alike(), most, consistent=False)
    clear = len(problem.depth) > CLEARLY and found.converged
    if not (clear and found.state[INVERSE] > PARALLEL and _differ(found, problem, SURELY)):
        found = _refined(problem, found, most)
        if not _differ(found, problem, DIFFERENT):
            return found
    return _solved(problem, found.state, free, most)


def _differ(found: Solution, problem: EdgeProblem, least: float) -> bool:
    """Return whether the zones' reflectances scatter by more than that, in logs."""
    return not problem.few and zone_scatter(found.equations, problem.prior) > least


def _solved(problem: EdgeProblem, state: Array, zones: Zones, most: int) -> Solution:
    """Return the solution of a first fit, and of one with consistent slopes from there."""
    return _refined(problem, _converge(problem, state, zones, most, consistent=False), most)


def _refined(problem: EdgeProblem, first: Solution, most: int) -> Solution:
    """Return the solution with consistent slopes, or the first one where that diverged."""
    found = _again(problem, first, most)
    return first if _diverged(found.state, first.state, problem.prior) else found


def _again(problem: EdgeProblem, found: Solution, most: int) -> Solution:
    """Return the solution with consistent slopes, from another one."""
    return _converge(problem.about(found.state), found.state, found.zones, most, consistent=True)


def _reaches_background(found: Solution) -> bool:
    """Return whether a wall is as deep as what lies beyond it, where that is nearest."""
    depth_m = found.background.depth_m[found.background.usable]
    thickness_m = float(np.exp(found.state[THICKNESS]))
    return len(depth_m) > 0 and thickness_m > float(np.quantile(depth_m, NEAREST))


def _is_steep(state: Array) -> bool:
    """Return whether beams are so steep that a thick wall hides what lies behind an edge."""
    return float(np.hypot(*state[BEAM])) > STEEP


def _is_strange(found: Solution, prior: Prior) -> bool:
    """Return whether a fit did not converge, or its thickness is far from the known one."""
    off = abs(float(found.state[THICKNESS] - prior.mean[THICKNESS]))
    return not found.converged or off > RIDGE


def _is_astray(state: Array, start: Array) -> bool:
    """Return whether a state is farther from where a fit began than one near it."""
    return float(np.abs((state - start)[CENTRE]).max()) > ASTRAY_M


def _diverged(state: Array, first: Array, prior: Prior) -> bool:
    """Return whether a state is far from the first one, and farther from the prior."""
    far = float(np.abs(state[SPOT:ROTATION] - first[SPOT:ROTATION]).max()) > RIDGE
    logs = slice(SPOT, ROTATION)
    return far and prior.off(state, logs) > prior.off(first, logs)


def _converge(
    problem: EdgeProblem,
    state: Array,
    zones: Zones,
    most: int,
    consistent: bool,
    background: Background | None = None,
    own: bool = False,
) -> Solution:
    """Iterate steps, Newton's near a solution, until the centre converges.

    consistent: with slopes at the profile's depth; a first fit has others, and ROUGH_POINTS.
    background: None: by a new look-up. own: before that of its solution, unless it goes astray.
    """
    ends_m = STEP_M if consistent else ROUGH_M
    if not consistent:
        most, problem = min(most, MOST_ROUGH), problem.of_some(ROUGH_POINTS)
    if own or background is not None:
        ends_m = NEAR_STEP_M
    if background is None:
        background = problem.background(state)
    length, before, follows, last_m, start = 1.0, np.zeros(2), False, math.inf, state
    for iteration in range(1, most + 1):
        looks = own and 1 < iteration <= OWN_LOOKS and last_m > OWN_M
        if looks or (not consistent and iteration in LOOKS):
            background = problem.background(state)
        elif follows:
            background = problem.compared(background, state)
        robust = (consistent or iteration > 6) and not problem.few
        linear = equations(problem, background, state, zones, robust, consistent)
        moved, zones = step(linear, state, problem.prior, newton=robust, ahead=True)
        if consistent and float(moved[CENTRE] @ before) < 0.0:
            length = max(length * SHORTER, SHORTEST)
        before = moved[CENTRE]
        follows = problem.few or abs(float(moved[GROWTH])) > FAR_M
        state = state + length * moved
        if own and _is_astray(state, start):
            return Solution(state, zones, background, linear, iteration, math.inf)
        last_m = float(np.abs(moved[CENTRE]).max())
        near = last_m < ends_m and abs(moved[MODULATION]) < NEAR_MODULATION
        if near and (consistent or iteration > max(LOOKS)):
            break
    return Solution(state, zones, background, linear, iteration, last_m)
