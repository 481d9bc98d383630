"""The likeliest of several solutions of few points about an edge.

A dozen mixed pixels are explained, by chance, by several states of beams, footprint and brightness:
where a fit ends depends on where it begins. So it begins at several states, and all points about
the edge, those on the face and on the background too, say which solution is the likeliest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...vectors import Array
from .beams import BEAM, CENTRE, CHAMFER, RATIO, SPOT, STATE, WALL, Background
from .edge_residuals import EdgeProblem, Zones, predicted
from .solution import Solution

STARTS, SEED = 16, 1  # besides the given one
APART, SCATTERED = np.zeros(STATE), slice(CHAMFER)  # scatter of the starts (k = 1); not chamfers
APART[CENTRE], APART[BEAM], APART[RATIO], APART[WALL] = 8e-4, 0.02, 0.3, 0.4
UNKNOWN = 4.0  # loss of a point before a background that is not known: of 5 standard deviations


def likeliest(problem: EdgeProblem, begin: Array, solve: Callable[[Array], Solution]) -> Solution:
    """Return the likeliest of the solutions from a state (16,), and from others about it.

    Every second start lies about the likeliest solution so far.
    """
    best, rng = solve(begin), np.random.default_rng(SEED)
    for number in range(STARTS):
        about = best.state if number % 2 else begin
        start = about.copy()
        start[SCATTERED] += APART[SCATTERED] * rng.standard_normal(CHAMFER)
        found = solve(start)
        if is_likelier(problem, found.state, best.state):
            best = found
    return best


def is_likelier(problem: EdgeProblem, state: Array, other: Array) -> bool:
    """Return whether a state (16,) is likelier than another before the background of either.

    Each finds a background of its own, with sectors of its own that show none: a loss before that
    alone would count for more than the edge.
    """
    for one in (state, other):
        background = problem.background(one)
        if total_loss(problem, state, background) >= total_loss(problem, other, background):
            return False
    return True


def total_loss(problem: EdgeProblem, state: Array, background: Background) -> float:
    """Return the sum of Cauchy's loss of all points about an edge, and of the prior, at a state.

    The set of points does not depend on the state, whichever of them it places beyond the edge.
    """
    beams, depth = problem.beams(state), problem.depth
    part = background.sector(beams)
    square = (depth / problem.sigma_m) ** 2  # as on the face
    rows = np.flatnonzero(background.usable[part])
    profile, variance = predicted(
        problem, beams.taken(rows), part[rows], background, state, Zones.alike()
    )
    square[rows] = (depth[rows] - profile.depth_m) ** 2 / variance
    loss = 2.0 * np.log1p(square / 4.0)
    unknown = ~background.usable[part] & (beams.x_m > -np.exp(state[SPOT]))
    loss[unknown] = UNKNOWN
    return float(loss.sum()) + problem.prior.off(state)
