"""Solutions of an edge's equations, and the fit that is kept of one."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...system import frozen
from ...targets import Outline, Polygon, sector
from ...vectors import Array, Mask
from .beams import (
    BEAM,
    CENTRE,
    CHAMFER,
    CHAMFER_M,
    ELLIPSE,
    GROWTH,
    INVERSE,
    LIKELY_CHAMFER_M,
    MODULATION,
    RATIO,
    ROTATION,
    SHAPE,
    SPOT,
    STATE,
    THICKNESS,
    U_CHAMFER_M,
    WALL,
    Background,
    Prior,
)
from .edge_residuals import (
    SECTORS,
    EdgeProblem,
    Equations,
    Zones,
    along,
    equations,
    moved,
    spread,
    stretched,
)

UNEVEN = 5  # of the sectors: at most so many have a background that leaves outliers
STEP_M, CONVERGED_M = 2e-7, 1e-5  # a step of the centre that ends a fit; that counts as converged
SETTLED = 0.2  # share of u that a step may still be, then
AS_MUCH = 1.03  # of what a solution leaves unexplained, what another may leave; 1.02 by alike noise
OUTLIER = 4.0  # square of an outlier, over its variance
MISFIT = 0.09  # share of outliers beyond which a fit explains no edge
SOME_POINTS = 600  # of those compared, that show how a round moves an edge
# What another edge of a plate takes over from the first: beams, footprint and plate.
INHERITED = (
    *range(STATE)[BEAM],
    *(INVERSE, SPOT, THICKNESS, RATIO, WALL, SHAPE, CHAMFER, MODULATION),
    *range(STATE)[ELLIPSE],
)
STRETCH = STATE  # place in a state that has one
ALONG = 0.999  # cosine of a normal with that of its side
FAR_BELOW = 30.0  # standard deviations; farther below 0 erfc is 0, too
# Of what something in doubt would move a centre, where any part of it may be so: 1 / sqrt(3).
ANY_PART = 0.58
BY_CHANCE = 9.0  # of a sum of squares over their variances, that one parameter explains by chance


@frozen
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
    of Lambert's law. spot_shape: 0 of a uniform footprint, 1 of a Gaussian. spot_ellipse: (2,) of
    it, see `footprint_m`. growth_m: how much farther out the edge lies than stated, all round, with
    its standard uncertainty growth_u_m: both from SIZE_M as a prior. chamfer_m: width of its
    chamfer, with chamfer_u_m. modulation: of the scanner, see `sum_of_phases`, 1/m^2, with
    modulation_u.
    stretch_m: how much farther out its sides across u lie, and farther in those across v, likewise,
    with stretch_u_m; 0 of a round one. covered: share of the outline that was used. misfit: share
    of outliers near the edge. unexplained: mean square
    of the residuals over their standard uncertainties, see `unexplained`. loss: mean of Cauchy's
    loss, of few mixed pixels. converged: whether the last step was small. thickness_u: relative.
    stated_thickness_m: one that the data contradict, and that was not used; by_thickness_m: (2,)
    by which the centre would move if it were not, where that is in doubt, or by what may be left of
    a wall whose beams were filtered out; thickness_pull: by how
    many standard deviations of what the data may move it they pull the stated one, None where
    none is stated.
    by_chamfer_m: (2,) by which the centre would move with a chamfer (k = 1), where the edge counts
    as sharp without being stated so, or with one that is fitted too narrow. by_round: (2,) by which
    it would move with a rounded edge instead of a chamfer, over its width, where neither is stated.
    by_light_m: (2,) by which it would move if its background were as bright as its intensities say
    of it, where reflectances of its own explain more.
    clean_shift_m: how far outside the target's edge a clean one lies; None of mixed pixels.
    by_size_m: (2,) by which its centre would move if the size were hardly known; size_chance: the
    probability of that. rows_m: standard uncertainty of each straight edge by rows of points that
    run along it. exponent: by which intensities follow power, of a clean edge that is fitted to
    them; it has no clean_shift_m. unlike_m: how far backgrounds of unlike brightness move parts of
    a clean edge (k = 1). lost: shares, see `lost_sides`.
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
    spot_ellipse: Array
    growth_m: float
    growth_u_m: float
    chamfer_m: float
    chamfer_u_m: float
    modulation: float
    modulation_u: float
    covered: float
    misfit: float
    unexplained: float
    loss: float
    points: int
    iterations: int
    converged: bool
    rotation_noise: Array
    rotation_by_plane: Array
    thickness_u: float
    covariance: Array
    known: Array
    stated_thickness_m: float | None = None
    by_thickness_m: Array | None = None
    thickness_pull: float | None = None
    by_chamfer_m: Array | None = None
    by_round: Array | None = None
    by_light_m: Array | None = None
    clean_shift_m: float | None = None
    by_size_m: Array | None = None
    size_chance: float = 0.0
    rows_m: float = 0.0
    exponent: float | None = None
    unlike_m: float = 0.0
    stretch_m: float = 0.0
    stretch_u_m: float = 0.0
    lost: tuple[float, float] = (0.0, 0.0)

    @property
    def is_clean(self) -> bool:
        """Whether beams at the edge returned one surface each."""
        return self.clean_shift_m is not None or self.exponent is not None

    @property
    def explained(self) -> float:
        """How many of its points it explains: the sum of 1 less these squares, as `unexplained`."""
        return self.points * (1.0 - self.unexplained)

    @property
    def state(self) -> Array:
        """State (16,), see beams.py."""
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
                self.chamfer_m,
                self.modulation,
                *self.spot_ellipse,
            ]
        )


@frozen(eq=False)
class Solution:
    """Last state (16,) of a fit, with the zones after its last step, which moved the centre last_m.

    equations: of the state before that step. by_chamfer_m, by_round, by_light_m: as of an
    EdgeFit.
    """

    state: Array
    zones: Zones
    background: Background
    equations: Equations
    iterations: int
    last_m: float
    by_chamfer_m: Array | None = None
    by_round: Array | None = None
    by_light_m: Array | None = None

    @property
    def converged(self) -> bool:
        """Whether the last step hardly moved the centre."""
        return self.last_m < CONVERGED_M

    @property
    def covered(self) -> float:
        """Share of the outline's sectors whose background is used."""
        return float(np.mean(self.background.usable))


def record(found: Solution, problem: EdgeProblem, covered: float) -> EdgeFit:
    """Return the fit of a solution with its covariance; covered: share of the outline used."""
    return EdgeFit(
        **_estimates(found.state, found.equations, problem, problem.prior),
        covered=covered,
        misfit=misfit_of(found.equations),
        unexplained=unexplained(found),
        loss=found.equations.loss if problem.few else 0.0,
        points=len(found.equations.residual_m),
        iterations=found.iterations,
        converged=found.converged,
        by_chamfer_m=found.by_chamfer_m,
        by_round=found.by_round,
        by_light_m=found.by_light_m,
        lost=lost_sides(found.background.usable, problem.outline),
    )


def common_m2(fitted: EdgeFit, first: EdgeFit) -> Array:
    """Return the covariance (2, 2) of a centre with that by the plate's first edge.

    What the first one shows of beams and plate is the prior of the other: its errors there move the
    other's estimate by the covariance of this times the weight of the prior.
    """
    inherited = np.array(INHERITED)
    follows = fitted.covariance[CENTRE, inherited] * fitted.known[inherited]
    return np.asarray(follows @ first.covariance[inherited, CENTRE])


def unseen_chamfer_m(linear: Equations, prior: Prior) -> Array:
    """Return by how far (2,) the chamfer of an edge that counts as sharp may move its centre.

    By one of CHAMFER_M; 0 where the chamfer is stated. linear: with slopes by the chamfer.
    """
    if not prior.is_sharp:
        return np.zeros(2)
    return CHAMFER_M * along(linear, prior.bevelled(), CHAMFER)[CENTRE]


def with_likely_chamfer(fitted: EdgeFit, linear: Equations, prior: Prior) -> EdgeFit:
    """Return the fit of an edge taken for sharp, moved as its likeliest chamfer moves it.

    As it is where the chamfer is stated. linear: with slopes by the chamfer, of points that show
    nothing else of it.
    """
    if not prior.is_sharp:
        return fitted
    way = along(linear, prior.bevelled(), CHAMFER)[CENTRE]
    centre_m = fitted.centre_m + LIKELY_CHAMFER_M * way
    return replace(fitted, centre_m=centre_m, by_chamfer_m=U_CHAMFER_M * way)


def by_round(found: Solution, problem: EdgeProblem) -> Array:
    """Return by how far (2,) a rounded edge instead of a chamfer moves the centre, over its width.

    By the residuals that a chamfer of CHAMFER_M leaves of such a round, at some of the points.
    """
    state, some = found.state.copy(), found.background.of_some(SOME_POINTS)
    state[CHAMFER] = CHAMFER_M
    cut, round_ = (
        equations(
            replace(problem, roundness=roundness),
            some,
            state,
            found.zones,
            converged=True,
            consistent=True,
        )
        for roundness in (0.0, 1.0)
    )
    each = len(found.background.rows) / max(len(some.rows), 1)
    cut = replace(cut, weight=each * cut.weight, change=each * cut.change)
    return moved(cut, round_.residual_m - cut.residual_m, problem.prior)[CENTRE] / CHAMFER_M


def as_stretched(fitted: EdgeFit, found: Solution, problem: EdgeProblem) -> EdgeFit:
    """Return the fit of a solution, `fitted`, with the width against the height unknown by SIZE_M.

    Itself where the outline is round, or the solution did not converge.
    """
    more = stretched(found.equations, problem.outline, problem.prior, found.state)
    if more is None or not fitted.converged:
        return fitted
    linear, prior, state = more
    return replace(fitted, **_estimates(state, linear, problem, prior))


def _estimates(
    state: Array, linear: Equations, problem: EdgeProblem, prior: Prior
) -> dict[str, Any]:
    """Return the fields of a fit that follow from its state (16,), or (17,) with the stretch."""
    covariance, by_plane, dof = spread(linear, problem.outline, prior, problem.few)
    held: dict[int, Array] = {}
    for which in (CHAMFER, MODULATION):
        if state[which] < 0.0:
            way = along(linear, prior, which)
            for other, before in held.items():
                way = way - way[other] * before
            held[which] = way / way[which]
            most = 1.0 / float(prior.weight[which])
            if which == MODULATION:  # it is of brightness that no zone shows: about as large
                most = min(most, float(state[which]) ** 2)
            state, covariance, by_plane = _without(
                which, held[which], most, state, covariance, by_plane
            )
    chamfer_m, modulation = np.maximum(state[[CHAMFER, MODULATION]], 0.0).tolist()
    u = np.sqrt(np.diag(covariance))
    known: dict[str, Any] = {
        "centre_m": state[CENTRE],
        "rotation_rad": float(state[ROTATION]),
        "covariance_m2": covariance[CENTRE, CENTRE],
        "by_plane": by_plane[CENTRE],
        "dof": dof,
        "beam": state[BEAM],
        "inverse_distance": float(state[INVERSE]),
        "spot_m": float(np.exp(state[SPOT])),
        "thickness_m": float(np.exp(state[THICKNESS])),
        "reflectance_ratio": float(np.exp(state[RATIO])),
        "wall": float(state[WALL]),
        "spot_shape": float(state[SHAPE]),
        "spot_ellipse": state[ELLIPSE],
        "growth_m": float(state[GROWTH]),
        "growth_u_m": float(u[GROWTH]),
        "chamfer_m": chamfer_m,
        "chamfer_u_m": float(u[CHAMFER]),
        "modulation": modulation,
        "modulation_u": float(u[MODULATION]),
        "rotation_noise": covariance[ROTATION, [0, 1, ROTATION]],
        "rotation_by_plane": by_plane[ROTATION],
        "thickness_u": float(u[THICKNESS]),
        "covariance": covariance[:STATE, :STATE],
        "known": prior.weight[:STATE],
    }
    if len(state) > STRETCH:
        known |= {"stretch_m": float(state[STRETCH]), "stretch_u_m": float(u[STRETCH])}
    return known


def _without(
    which: int, way: Array, most: float, state: Array, covariance: Array, by_plane: Array
) -> tuple[Array, Array, Array]:
    """Return what `_estimates` begins with for a parameter of 0, where the fit has one below 0.

    way: by how much the state moves where it is held, per its distance. None is below 0: of the
    probability, only that of values above 0 is left, whose mean square about 0 takes the place of
    the variance. A value that lies k u below 0 contradicts its u, which is k^2 times as large then,
    up to the variance `most`.
    """
    variance = float(covariance[which, which])
    wider = max(variance, min(float(state[which]) ** 4 / variance, most))
    below = -state[which] / math.sqrt(wider)
    if below < FAR_BELOW:
        tail = math.sqrt(math.pi / 2.0) * math.erfc(below / math.sqrt(2.0))
        left = 1.0 + below**2 - below * math.exp(-0.5 * below**2) / tail
    else:
        left = 2.0 / below**2
    held = np.eye(len(state))
    held[:, which] -= way
    covariance = held @ covariance @ held.T + left * wider * np.outer(way, way)
    return held @ state, covariance, held @ by_plane


def lost_sides(usable: Mask, outline: Outline) -> tuple[float, float]:
    """Return the share of its sectors that the worst side across u has lost, and across v.

    usable: (K,) sectors of the outline. Others have no background, or points that contradict it:
    as where the side lies elsewhere.
    """
    if not isinstance(outline, Polygon):
        return 0.0, 0.0
    sides, across_u = sides_at((np.arange(len(usable)) + 0.5) / len(usable), outline)
    share = (~usable).astype(float) @ sides / np.maximum(sides.sum(axis=0), 1)
    return float(share[across_u].max(initial=0.0)), float(share[~across_u].max(initial=0.0))


def sides_at(share: Array, outline: Polygon) -> tuple[Mask, Mask]:
    """Return on which sides positions share (N,) along the outline lie (N, K).

    And which of the sides (K,) lie across u, rather than across v.
    """
    sides = outline.normals(share) @ outline.sides_m[:, :2].T > ALONG
    return sides, np.abs(outline.sides_m[:, 0]) > np.abs(outline.sides_m[:, 1])


def misfit_of(linear: Equations) -> float:
    """Return the share of points near the edge that a solution leaves out.

    Without the UNEVEN sectors where it is largest: the background there has steps of its own.
    """
    part = sector(linear.share, SECTORS)
    count = np.bincount(part, minlength=SECTORS)
    out = np.bincount(part, linear.weight <= 0.0, SECTORS)
    kept = np.argsort(out / np.maximum(count, 1), kind="stable")[: SECTORS - UNEVEN]
    return float(out[kept].sum() / max(count[kept].sum(), 1))


def settled(fitted: EdgeFit, found: Solution) -> EdgeFit:
    """Return a fit that counts as converged where its last step was small against its u."""
    return replace(fitted, converged=is_settled(found, fitted.covariance_m2))


def is_settled(found: Solution, covariance_m2: Array) -> bool:
    """Return whether the last step of a solution was small against its covariance (2, 2)."""
    u_m = float(np.sqrt(np.trace(covariance_m2)))
    return found.last_m < max(CONVERGED_M, SETTLED * u_m)


def unexplained(found: Solution) -> float:
    """Return the mean square of residuals over their standard uncertainties, outliers as of two.

    Without any points as if all were outliers.
    """
    left = _squares(found.equations)
    return float(np.mean(left)) if len(left) > 0 else OUTLIER


def explained(found: Solution) -> float:
    """Return how many points a solution explains: the sum of 1 less these squares."""
    return len(found.equations.residual_m) * (1.0 - unexplained(found))


def unexplained_by_sector(found: Solution, count: int) -> Array:
    """Return the sums (count,) of the same squares by sector of the outline."""
    part = sector(found.equations.share, count)
    return np.asarray(np.bincount(part, _squares(found.equations), count), float)


def _squares(linear: Equations) -> Array:
    return np.where(linear.weight > 0.0, linear.weight * linear.residual_m**2, OUTLIER)


def explains_less(
    found: Solution, other: Solution, ratio: float = 1.0, by_chance: float = BY_CHANCE
) -> bool:
    """Return whether a solution leaves more than `ratio` of what another does, not by chance.

    Of mixed pixels by the points that both compare with a background: those of one alone, before a
    background that is easier or harder to explain, would count for more than the edge.
    """
    left, least = unexplained(found), unexplained(other)
    count = min(len(found.equations.residual_m), len(other.equations.residual_m))
    rows, others = found.equations.rows, other.equations.rows
    if rows is not None and others is not None:
        both, mine, its = np.intersect1d(rows, others, assume_unique=True, return_indices=True)
        if (count := len(both)) > 0:
            left = float(np.mean(_squares(found.equations)[mine]))
            least = float(np.mean(_squares(other.equations)[its]))
    return left > ratio * least and count * (left - least) > by_chance
