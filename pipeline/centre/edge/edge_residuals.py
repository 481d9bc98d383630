"""Residuals of the points about an edge from the mixed-pixel profile, linearised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ...targets import Outline, sector
from ...vectors import Array, Mask, Rows
from .beams import (
    BEAM,
    CHAMFER,
    ELLIPSE,
    GROWTH,
    INVERSE,
    MODULATION,
    RATIO,
    SHAPE,
    SIZE_M,
    SPOT,
    THICKNESS,
    WALL,
    Background,
    Beams,
    Prior,
    across_beam,
    bevel_reflectance,
    bevel_slopes,
    carry,
    carry_near,
    footprint_m,
    look_up,
    wall_reflectance,
)
from .mixed_pixel import END, EdgeProfile, edge_profile, rounded

INNER_M, OUTER_M = 0.006, 0.006  # how far inside and outside the edge the profile is compared
# Standard uncertainty of x by beam pointing and scan grid, at most, and at least. Number of those
# tried, and how often; share of the variance, and points, from which it shows; outliers' square.
POINTING_M, LEAST_POINTING_M = 1.5e-4, 7e-5
POINTINGS, POINTED_TIMES, POINTED, LEAST_POINTED, OUTLYING = 12, 3, 0.5, 100, 16.0
DEPTH_SHARE = 0.02  # of the background's depth: its change between look-up and beam
# Of its depth: by how much a background may curve behind the edge (k = 1), and from how far beyond
# the footprint on it is as it was looked up; what keeps zones without points from division by 0.
CURVED, CURVED_M, TINY = 0.1, 0.001, 1e-300
SECTORS = 24  # of the outline, taken as independent of each other
ZONES = 48  # of the outline, each with a reflectance of its background; within one sector each
# Longest step of each parameter.
LIMIT = np.array(
    [0.002, 0.002, 0.1, 0.1, 0.2, 0.3, 0.5, 0.5, 0.02, 0.3, 0.3, 5e-4, 5e-4, 50.0, 0.1, 0.1]
)
# Scatter of their logs: where they may differ, where these are as bright as their light, and where
# they may not.
ZONE_LOG, LIT_LOG, ALIKE_LOG = 1.0, 0.3, 1e-4
CHANCE = 1.5  # standard deviations of what zones explain by chance
LEAST_SHOWN = 0.01  # of the information of the best zone: others do not count
LEAST_CHANGE = 0.3  # 0.77 of Gaussian residuals
LEAST_LEFT = 0.05  # of a sector's share of the information, taken from 1
# Sectors whose points contradict the background: their number; share of outliers, and mean of the
# others over their standard uncertainties, from which they do; points that show it.
UNEVEN_SECTORS, UNEVEN_SHARE, UNEVEN_MEAN, LEAST_UNEVEN = 90, 0.2, 0.6, 8
FEW = 120  # points in the band of the edge: fewer count as few
LEAST_DOF = 3.0  # of their scatter, of which a variance is finite
MOST_QUARTER = 1.0 - 1e-9  # of Cauchy's influence, which tends to 1
SCATTERS, NODES = np.geomspace(1.0, 20.0, 200), 40  # of Gaussian residuals of few points
GAMMA_SIGMA = 3.0  # of the power of intensities by which backgrounds are bright (k = 1)
SINGULAR = 1e-9  # of each parameter's information, added where rounding has left none
RANK = 1e-3  # of zones' information: what the other parameters leave of it, if anything


@frozen(eq=False)
class EdgeProblem:
    """Points near the edge, (N, 2) in the plane and (N,) deep, in random order; the state's prior.

    few: too few of them to tell outliers, zones' reflectances, or the scatter of sectors.
    station: (3,) that all beams come from, if known. intensity, light: (N,) of that of the face,
    NaN where unknown, or None: of points on the target, and of all. gamma: power of the light with
    which the background's reflectance goes. roundness: of the target's edge, 0 of a chamfer, 1 of a
    radius, see `rounded`. pointing_m: standard uncertainty of where beams meet the plane. left_out:
    (UNEVEN_SECTORS,) sectors of the outline that are not used. curved: whether its background may
    curve behind the edge.
    """

    plane: Array
    depth: Array
    prior: Prior
    outline: Outline
    sigma_m: float
    few: bool = False
    station: Array | None = None
    intensity: Array | None = None
    light: Array | None = None
    gamma: float = 0.0
    roundness: float = 0.0
    pointing_m: float = POINTING_M
    left_out: Mask = field(default_factory=lambda: np.zeros(UNEVEN_SECTORS, bool))
    curved: bool = False
    _kept: dict[bytes, Beams] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def bend(self) -> float:
        """Roundness of an edge that may have a chamfer; 0 of one that counts as sharp."""
        return 0.0 if self.prior.is_sharp else self.roundness

    def about(self, state: Array) -> EdgeProblem:
        """Return the problem whose prior has beams from the station to the centre of a state."""
        if self.station is None:
            return self
        return replace(self, prior=self.prior.seen_from(self.station, state))

    def near_edge(self, state: Array, band_m: tuple[float, float]) -> tuple[EdgeProblem, Beams]:
        """Return the points in a band about the edge, as `carry_near` does, and their beams."""
        rows, beams = carry_near(self.plane, self.depth, state, self.outline, band_m)
        plane = self.plane.T.take(rows, axis=1).T
        return self._of(rows, plane), beams

    def of_some(self, most: int) -> EdgeProblem:
        """Return the problem of so many of the points, as of a scan with a wider spacing."""
        if len(self.depth) <= most and (self.light is None or self.gamma != 0.0):
            return self
        return self._of(slice(0, most), np.asfortranarray(self.plane[:most]))

    def _of(self, rows: Rows | slice, plane: Array) -> EdgeProblem:
        """Return the problem of some points, with their light where it is used."""
        intensity = None if self.intensity is None else self.intensity[rows]
        light = None if self.light is None or self.gamma == 0.0 else self.light[rows]
        return replace(self, plane=plane, depth=self.depth[rows], intensity=intensity, light=light)

    def background(self, state: Array) -> Background:
        """Return the background by sector at a state, and the points that are compared with it.

        Its sectors may be wider than those that are left out: one is not used whose middle is.
        """
        found = look_up(self.beams(state), self.depth, state, self.light)
        return self.compared(replace(found, usable=without(found.usable, self.left_out)), state)

    def compared(self, background: Background, state: Array) -> Background:
        """Return a background with the points that are compared with it at a state.

        Of sectors that are not left out. They do not change with the state while a fit converges:
        one that came or went, or fell into another sector, would move its solution. Few points do,
        and those of an edge whose size changes much: a fit may begin far off.
        """
        beams = self.beams(state)
        outer = OUTER_M + np.maximum(beams.tau, 0.0) * np.exp(state[THICKNESS])
        band = (beams.x_m > -INNER_M) & (beams.x_m < outer) & beams.clear
        part = background.sector(beams)
        near = band & (self.depth > -5.0 * self.sigma_m - 1e-4)
        rows = np.flatnonzero(near & background.usable[part])
        rows = rows[~self.left_out[sector(beams.share[rows], UNEVEN_SECTORS)]]
        return replace(background, rows=rows, part=part[rows])

    def beams(self, state: Array) -> Beams:
        """Return the points' beams, carried to the plane; those of the last state are kept."""
        key = state.tobytes()
        if key not in self._kept:
            self._kept.clear()
            self._kept[key] = carry(self.plane, self.depth, state, self.outline)
        return self._kept[key]


def without(usable: Mask, left_out: Mask) -> Mask:
    """Return the sectors (K,) that are usable, without those whose middle is left out.

    left_out: (UNEVEN_SECTORS,), of which coarse backgrounds have fewer.
    """
    middle = (np.arange(len(usable)) + 0.5) / len(usable)
    return np.asarray(usable & ~left_out[sector(middle, UNEVEN_SECTORS)])


@frozen(eq=False)
class Zones:
    """Logs (ZONES,) of each zone's reflectance ratio over that of all; sigma, their scatter."""

    log: Array
    sigma: float

    @classmethod
    def alike(cls) -> Zones:
        """Return zones of one reflectance."""
        return cls(np.zeros(ZONES), ALIKE_LOG)

    @classmethod
    def free(cls, lit: bool = False) -> Zones:
        """Return zones that may differ; less where a background is as bright as its light."""
        return cls(np.zeros(ZONES), LIT_LOG if lit else ZONE_LOG)

    @property
    def weight(self) -> float:
        """One over the variance."""
        return self.sigma**-2


@frozen(eq=False)
class Equations:
    """Points near the edge, linearised: residual = slopes @ step.

    q_m: (N, 2) where their beams met the plane, relative to the centre; share: (N,) of the outline.
    residual_m: (N,). slopes: (N, 16). weight: (N,) robust, over the variance. change: (N,)
    derivative of weight * residual by the residual. by_height: (N,) derivative of the residual
    by the plane's height. depths: number of first rows that are
    depths; the others are places of the edge, the last `behind` of them on the background.
    half_gap_m: how far on both sides of the edge beams are missing, beyond what the spacing leaves.
    rows: (N,) of the points of the problem, of mixed pixels; None of others.
    """

    q_m: Array
    share: Array
    residual_m: Array
    slopes: Array
    weight: Array
    change: Array
    by_height: Array
    zones: Zones
    depths: int
    behind: int = 0
    half_gap_m: float = 0.0
    rows: Rows | None = None

    @classmethod
    def stacked(
        cls, parts: Sequence[tuple[Array, ...]], behind: int = 0, half_gap_m: float = 0.0
    ) -> Equations:
        """Return rows q to by_height of several parts, the first of which are depths."""
        q_m, share, residual_m, slopes, weight, change, by_height = (
            np.concatenate(values) for values in zip(*parts, strict=True)
        )
        return cls(
            q_m=q_m,
            share=share,
            residual_m=residual_m,
            slopes=slopes,
            weight=weight,
            change=change,
            by_height=by_height,
            zones=Zones.alike(),
            depths=len(parts[0][0]),
            behind=behind,
            half_gap_m=half_gap_m,
        )

    @cached_property
    def zone(self) -> npt.NDArray[np.int64]:
        """Zone (N,) of each point."""
        return sector(self.share, ZONES)

    @property
    def loss(self) -> float:
        """Mean of Cauchy's loss, 2 log(1 + z^2 / 4), where the weights are 1 / (1 + z^2 / 4)."""
        quarter = self.weight * self.residual_m**2 / 4.0
        total = float(np.sum(np.log1p(-np.minimum(quarter, MOST_QUARTER))))
        return -2.0 * total / max(int(np.count_nonzero(self.weight)), 1)

    def uneven(self, mean: float = UNEVEN_MEAN) -> Mask:
        """Return the sectors (UNEVEN_SECTORS,) whose points contradict the background.

        mean: of residuals over their standard uncertainties, from which they do. With q = z^2 / 16
        of residuals z over their standard uncertainties, Tukey's influence has the slope
        (1 - 5 q) / (1 - q) of its weight, which gives q again.
        """
        shown, count = self.shown, UNEVEN_SECTORS
        kept = shown.weight > 0.0
        ratio = np.divide(shown.change, shown.weight, out=np.ones_like(kept, float), where=kept)
        z = 4.0 * np.sign(shown.residual_m) * np.sqrt((1.0 - ratio).clip(min=0.0) / (5.0 - ratio))
        part = sector(shown.share, count)
        points, left = np.bincount(part, minlength=count), np.bincount(part, kept, count)
        aside = np.abs(np.bincount(part, z, count)) > mean * left
        outside = points - left > UNEVEN_SHARE * points
        return np.asarray((points >= LEAST_UNEVEN) & (aside | outside))

    @property
    def shown(self) -> Equations:
        """Equations of the rows that depend on the state, unlike those of the face alone."""
        rows = np.flatnonzero(self.slopes.any(axis=1))
        return self if len(rows) == len(self.residual_m) else self._of(rows)

    @property
    def explained(self) -> Equations:
        """Equations of the rows that are no outliers."""
        rows = np.flatnonzero(self.weight > 0.0)
        depths = int(np.count_nonzero(rows < self.depths))
        behind = int(np.count_nonzero(rows >= len(self.weight) - self.behind))
        return replace(self._of(rows), depths=depths, behind=behind)

    def _of(self, rows: Rows) -> Equations:
        names = ["q_m", "share", "residual_m", "slopes", "weight", "change", "by_height"]
        names += [] if self.rows is None else ["rows"]
        return replace(self, **{name: getattr(self, name).T.take(rows, -1).T for name in names})

    def by_zone(self, weight: Array) -> tuple[Array, Array]:
        """Return the products of slopes by zones' ratios and by the state, weighted (N,).

        (ZONES,) with each zone itself and its prior, (16, ZONES) with the state.
        """
        products = weight * self.slopes[:, RATIO] * self.slopes.T
        cross = np.stack([self.zone_sum(one) for one in products])
        return cross[RATIO] + self.zones.weight, cross

    def eliminated(self, own: Array, cross: Array, prior: Prior) -> tuple[Array, Array]:
        """Return slopes (N, 16) without what the zones' ratios take, and what is known before.

        own, cross: as of `by_zone`. (16, 16) of the prior, and of that of the zones.
        """
        taken = (cross / own).take(self.zone, axis=1) * self.slopes[:, RATIO]
        slopes = (self.slopes.T - taken).T
        return slopes, np.diag(prior.weight) + cross / own**2 * self.zones.weight @ cross.T

    def zone_sum(self, values: Array) -> Array:
        """Return sums of (N,) by zone."""
        return np.bincount(self.zone, values, ZONES).astype(np.float64)


def equations(
    problem: EdgeProblem,
    background: Background,
    state: Array,
    zones: Zones,
    converged: bool,
    consistent: bool,
) -> Equations:
    """Linearise the residuals of the points compared with a background from the profile at `state`.

    converged: weigh by Tukey's function, near the solution, else by Cauchy's. consistent: slopes at
    the profile's depth; at the measured one they correlate with its noise, which biases the centre
    by some 20 um but avoids divergence along the ridge of footprint and reflectance ratio.
    """
    beams, z = _compared(problem, background, state)
    profile, variance = predicted(problem, beams, background.part, background, state, zones)
    if problem.prior.is_sharp:
        profile = replace(profile, d_chamfer=0.0)
    residual = z - profile.depth_m
    weight, change = robust_weight(residual**2 / variance, converged)
    slopes = profile_slopes(profile, beams, profile.depth_m if consistent else z, state)
    by_height = 1.0 - profile.by_background - profile.d_x * beams.tau * beams.shrink
    if problem.curved:
        curve = _curve(beams, background, profile, state)
        zone = sector(beams.share, ZONES)
        beside = residual - curve * _curved(curve, weight / variance, zone, residual)[zone]
        weight, change = robust_weight(beside**2 / variance, converged)
        rows = np.vstack([residual, by_height, slopes.T])
        left = _without_curve(curve, weight / variance, zone, rows)
        residual, by_height, slopes = left[0], left[1], left[2:].T
    return Equations(
        q_m=beams.q_m,
        share=beams.share,
        residual_m=residual,
        slopes=slopes,
        weight=weight / variance,
        change=change / variance,
        by_height=by_height,
        zones=zones,
        depths=len(residual),
        rows=background.rows,
    )


def _curve(beams: Beams, background: Background, profile: EdgeProfile, state: Array) -> Array:
    """Return how depths (N,) grow with a curve of the background, over its depth.

    It is looked up beyond the footprint. Nearer, behind the edge itself, it may curve away from
    that line, as a rim does: by all of the curve where beams meet the target, by none of it from
    CURVED_M beyond a Gaussian footprint on.
    """
    reach_m = CURVED_M + END * float(np.exp(state[SPOT]))
    near = np.clip(1.0 - beams.x_m.clip(min=0.0) / reach_m, 0.0, 1.0) ** 2
    return np.asarray(profile.by_background * background.at(background.part, beams.x_m)[0] * near)


def _curved(curve: Array, weight: Array, zone: Rows, residual: Array) -> Array:
    """Return the curve (ZONES,) of each zone that residuals (N,) ask for, known to CURVED."""
    asked = np.bincount(zone, weight * curve * residual, ZONES)
    return np.asarray(asked / (np.bincount(zone, weight * curve**2, ZONES) + CURVED**-2))


def _without_curve(curve: Array, weight: Array, zone: Rows, rows: Array) -> Array:
    """Return rows (K, N) of equations without what unknown curves of the zones would explain.

    So that the squares of these rows, weighted (N,), are those of all by the inverse covariance of
    residuals that noise and the zones' curves c make: V = W^-1 + s^2 c c', V^-1 = W - W c c' W g,
    g = 1 / (c' W c + 1 / s^2). With y - a c c' W y for each row y: 2 a - a^2 c' W c = g.
    """
    by = weight * curve
    own = np.bincount(zone, by * curve, ZONES)
    share = (1.0 - 1.0 / np.sqrt(1.0 + CURVED**2 * own)) / np.maximum(own, TINY)
    taken = curve * share[zone]
    return np.stack([row - taken * np.bincount(zone, by * row, ZONES)[zone] for row in rows])


def _compared(problem: EdgeProblem, background: Background, state: Array) -> tuple[Beams, Array]:
    """Return the beams, and the depths (N,), of the points that are compared with a background."""
    depth = problem.depth[background.rows]
    plane = problem.plane.T.take(background.rows, axis=1).T
    return carry(plane, depth, state, problem.outline), depth


def predicted(
    problem: EdgeProblem,
    beams: Beams,
    part: npt.NDArray[np.int64],
    background: Background,
    state: Array,
    zones: Zones,
) -> tuple[EdgeProfile, Array]:
    """Return the profile that beams before sectors (N,) of a background show, and the variance.

    (N,) of a depth about it: by noise, pointing, and what the background is unsure by.
    """
    facing = np.maximum(beams.tau, 0.0)
    behind, behind_slope = background.at(part, beams.x_m)
    log_ratio = state[RATIO] + zones.log[sector(beams.share, ZONES)]
    over_face: Array | float = 1.0  # by which the wall is brighter where the face is darker
    if problem.gamma != 0.0:
        log_ratio += problem.gamma * background.lighter(part)
        if background.log_face is not None:
            over_face = np.exp(-problem.gamma * background.face(part))
    slant = 1.0 + float(state[BEAM] @ state[BEAM])
    width, lean, lean_by_tau = rounded(beams.tau, problem.bend)
    profile = edge_profile(
        beams.x_m,
        beams.tau,
        behind,
        footprint_m(beams, state),
        float(np.exp(state[THICKNESS])),
        np.exp(log_ratio),
        over_face * wall_reflectance(facing, state)[0],
        float(state[SHAPE]),
        beams.tau / slant,
        width * float(state[CHAMFER]),
        over_face * bevel_reflectance(beams.tau, float(state[WALL])),
        None if problem.prior.is_of_means else float(state[MODULATION]) * slant,
        lean,
    )
    profile = replace(
        profile,
        d_x=profile.d_x + profile.by_background * behind_slope,
        d_wall=over_face * profile.d_wall,
        d_chamfer=profile.d_chamfer * width,
        d_lean=profile.d_lean * lean_by_tau,
        d_bevel=over_face * profile.d_bevel,
    )
    rough = profile.background_share * (background.spread_m[part] + DEPTH_SHARE * behind)
    by_pointing = (profile.d_x * problem.pointing_m) ** 2
    return profile, (problem.sigma_m + 1e-6) ** 2 + by_pointing + rough**2


def pointing_m(problem: EdgeProblem, background: Background, state: Array, zones: Zones) -> float:
    """Return the standard uncertainty of where beams meet the plane that mixed pixels show.

    With it, the mean square of their residuals over their standard uncertainties is 1: of points
    that are no outliers, and at whose depth it counts for POINTED or more. That of the problem at
    most, and where they are fewer than LEAST_POINTED.
    """
    beams, depth = _compared(problem, background, state)
    profile, variance = predicted(problem, beams, background.part, background, state, zones)
    by_pointing = (profile.d_x * problem.pointing_m) ** 2
    rows = np.flatnonzero(by_pointing > POINTED * variance)
    square, other = (depth - profile.depth_m)[rows] ** 2, (variance - by_pointing)[rows]
    slopes, shown_m = profile.d_x[rows] ** 2, problem.pointing_m
    tried_m = np.geomspace(shown_m, LEAST_POINTING_M, POINTINGS)
    for _ in range(POINTED_TIMES):
        near = square < OUTLYING * (other + slopes * shown_m**2)
        if np.count_nonzero(near) < LEAST_POINTED:
            return problem.pointing_m
        means = [np.mean((square / (other + slopes * one**2))[near]) for one in tried_m]
        shown_m = float(np.interp(1.0, means, tried_m))
    return shown_m


def step(
    linear: Equations, state: Array, prior: Prior, newton: bool = False, ahead: bool = False
) -> tuple[Array, Zones]:
    """Return one robust Gauss-Newton step (16,) of limited length, and the zones after it.

    The zones' ratios are eliminated (Schur complement). newton: near a solution, with the
    derivative of the estimating equations instead of the information. ahead: the scanner stays
    before the plane; a step beyond ends at parallel beams, where all else goes with these.
    """
    linear = linear.shown
    own, cross = linear.by_zone(linear.weight)
    slopes, known = linear.eliminated(own, cross, prior)
    information = (slopes.T * linear.weight) @ slopes + known
    pull = (
        linear.zone_sum(linear.weight * linear.slopes[:, RATIO] * linear.residual_m)
        - linear.zones.log * linear.zones.weight
    )
    drawn = prior.weight * (state - prior.mean) + cross / own @ pull
    gradient = linear.slopes.T @ (linear.weight * linear.residual_m) - drawn
    change = (slopes.T * linear.change) @ slopes + known if newton else information
    inverse = _inverse(change, information)
    found = inverse @ gradient
    behind = float(state[INVERSE] + found[INVERSE])
    if ahead and behind < 0.0:
        found -= behind / inverse[INVERSE, INVERSE] * inverse[INVERSE]
    found *= min(1.0, float((LIMIT / np.maximum(np.abs(found), 1e-12)).min()))
    log = linear.zones.log + np.clip((pull - found @ cross) / own, -0.5, 0.5)
    return np.asarray(found), Zones(log, linear.zones.sigma)


def zone_scatter(linear: Equations, prior: Prior) -> float:
    """Return the scatter of the zones' reflectances, in logs, at a solution without them.

    What they would explain, all else fitted too, beyond the residuals' own variance and CHANCE
    standard deviations of that; without what all share, which is the reflectance ratio. The method
    of moments for random effects: with the information A of K zones,
    E(pull' A^-1 pull) = K s^2 + sigma^2 tr A.
    0 without a point, or where no zone shows any. Source: DerSimonian and Laird, Controlled
    Clinical Trials 7 (1986) 177.
    """
    used = float(np.count_nonzero(linear.weight))
    if used == 0.0:
        return 0.0
    weighted = linear.slopes.T * linear.weight
    own, cross = linear.by_zone(linear.weight)
    pull = linear.zone_sum(weighted[RATIO] * linear.residual_m)
    shown = own - linear.zones.weight
    seen = shown > LEAST_SHOWN * shown.max()
    information = weighted @ linear.slopes + np.diag(prior.weight)
    cross = cross[:, seen]
    own_seen = np.diag(shown[seen]) - cross.T @ np.linalg.solve(information, cross)
    if not np.trace(own_seen) > 0.0:
        return 0.0
    scale = np.sqrt(shown[seen])
    left, axes = np.linalg.eigh(own_seen / np.outer(scale, scale))
    kept = left > RANK
    explained = np.sum((axes.T @ (pull[seen] / scale))[kept] ** 2 / left[kept])
    variance = float(np.sum(linear.weight * linear.residual_m**2)) / used
    count = np.count_nonzero(kept)
    beyond = float(explained) - (count + CHANCE * np.sqrt(2.0 * count)) * variance
    return float(np.sqrt(max(beyond, 0.0) / np.trace(own_seen)))


def spread(
    linear: Equations, outline: Outline, prior: Prior, few: bool = False
) -> tuple[Array, Array, float]:
    """Return covariance (16, 16) of the state, derivatives (16, 3) by the plane, and dof.

    A^-1 B A^-1, A the derivative of the estimating equations, B the sum of their squares by sectors
    of the outline: the variances in the weights need not be right, nor the points of a sector
    independent, so that model errors count as well. Of few points B = s^2 A, s^2 by all residuals.
    Source: Huber, Robust Statistics (1981) 6.3; Liang and Zeger, Biometrika 73 (1986) 13.
    """
    weight = linear.weight
    slopes, known, information, inverse = _normal_equations(linear, prior)
    lift = np.column_stack([np.ones(len(weight)), linear.q_m]) * linear.by_height[:, None]
    by_plane = inverse @ ((slopes.T * linear.change) @ lift)
    part = sector(linear.share, SECTORS)
    taken = 3.0 if outline.shows_rotation else 2.0  # parameters: centre, and rotation
    free = max(float(np.count_nonzero(np.bincount(part, minlength=SECTORS))) - taken, 1.0)
    dof = outline.axis_share * free
    if few:
        squares = known + _variance(linear, dof) * (information - known)
    else:
        squares = known + _squares(linear, slopes, part, information)
    return inverse @ squares @ inverse, by_plane, dof


def along(linear: Equations, prior: Prior, which: int) -> Array:
    """Return by how much the state (16,) moves where one parameter is held, per its distance."""
    column = _normal_equations(linear, prior)[3][which]
    return np.asarray(column / column[which])


def _normal_equations(linear: Equations, prior: Prior) -> tuple[Array, Array, Array, Array]:
    """Return slopes without the zones' ratios, what is known before, information and A^-1."""
    slopes, known = linear.eliminated(*linear.by_zone(linear.weight), prior)
    information = (slopes.T * linear.weight) @ slopes + known
    inverse = _inverse((slopes.T * linear.change) @ slopes + known, information)
    return slopes, known, information, inverse


def moved(linear: Equations, by_m: Array, prior: Prior) -> Array:
    """Return by how much the state (16,) moves where the residuals grow by so much (N,)."""
    slopes, _, _, inverse = _normal_equations(linear, prior)
    return np.asarray(inverse @ ((slopes.T * linear.change) @ by_m))


def stretched(
    linear: Equations, outline: Outline, prior: Prior, state: Array
) -> tuple[Equations, Prior, Array] | None:
    """Return equations and prior with one more parameter, and the state (16,) after a step.

    By how much the sides across u lie farther out than stated, and those across v farther in: a
    wrong width moves them as a thicker wall and another centre do. Its score at the solution
    without it shows what it explains of that. Half the width and half the height are known to
    SIZE_M each: their mean, the growth, and half of what they differ by to SIZE_M over sqrt(2).
    None of a round outline.
    """
    way = outline.stretch(linear.share)
    if way is None:
        return None
    known = 2.0 / SIZE_M**2
    more = max(known - prior.weight[GROWTH], 0.0) if prior.weight[GROWTH] > 0.5 / SIZE_M**2 else 0.0
    linear, prior = _with_one_more(linear, prior, way * linear.slopes[:, GROWTH], known)
    prior.weight[GROWTH] += more
    left, _, _, inverse = _normal_equations(linear, prior)
    score = np.zeros(len(prior.weight))
    score[GROWTH] = -more * state[GROWTH]
    score[-1] = _scores(linear, left)[-1]
    return linear, prior, np.append(state, 0.0) + inverse @ score


def power_of_light(
    linear: Equations, background: Background, prior: Prior, state: Array, gamma: float
) -> tuple[float, float]:
    """Return gamma after one step of it as one more parameter, and its standard uncertainty.

    By the scatter of the sectors, as of `spread`. linear: at a state (16,) with that gamma, before
    a background whose light is known.
    """
    linear, known = linear.shown, GAMMA_SIGMA**-2
    lighter = background.lighter(sector(linear.share, len(background.usable)))
    linear, prior = _with_one_more(linear, prior, lighter * linear.slopes[:, RATIO], known)
    left, before, information, inverse = _normal_equations(linear, prior)
    score = _scores(linear, left) - prior.weight * (np.append(state, gamma) - prior.mean)
    squares = before + _squares(linear, left, sector(linear.share, SECTORS), information)
    variance = float(inverse[-1] @ squares @ inverse[-1])
    return gamma + float(inverse[-1] @ score), float(np.sqrt(variance))


def _scores(linear: Equations, slopes: Array) -> Array:
    """Return the scores (16,) of the rows, with slopes (N, 16) without the zones' ratios."""
    own, cross = linear.by_zone(linear.weight)
    by_zones = cross / own @ (linear.zones.log * linear.zones.weight)
    return np.asarray(slopes.T @ (linear.weight * linear.residual_m) + by_zones)


def _with_one_more(
    linear: Equations, prior: Prior, column: Array, weight: float
) -> tuple[Equations, Prior]:
    """Return equations and prior with one more parameter, of those slopes (N,), 0 beforehand."""
    slopes = np.column_stack([linear.slopes, column])
    prior = Prior(np.append(prior.mean, 0.0), np.append(prior.weight, weight))
    return replace(linear, slopes=slopes), prior


def _variance(linear: Equations, dof: float) -> float:
    """Return the variance s^2 of few weighted residuals, at least 1, as that of Student's t.

    Mixed pixels: that of Gaussian residuals of the same loss, as outliers hardly count in squares
    that Cauchy's function weighs. Of 40 targets of 300 points, those with a loss above 0.5 were off
    by 2.5 to 8.6 times the variance without it. That of t is infinite up to 2 degrees of freedom:
    fewer than 3 count as so many.
    """
    dof = max(dof, LEAST_DOF)
    if linear.depths == len(linear.residual_m):
        places, chances = np.polynomial.hermite_e.hermegauss(NODES)
        losses = 2.0 * np.log1p(SCATTERS[:, None] ** 2 * places**2 / 4.0) @ chances
        square = float(np.interp(linear.loss, losses / chances.sum(), SCATTERS)) ** 2
    else:
        used = max(float(np.count_nonzero(linear.weight)) - linear.slopes.shape[1], 1.0)
        square = float(np.sum(linear.weight * linear.residual_m**2)) / used
    return float(max(square, 1.0) * dof / (dof - 2.0))


def _squares(
    linear: Equations, slopes: Array, part: npt.NDArray[np.int64], information: Array
) -> Array:
    """Return the sum of the squared estimating equations by sectors (16, 16).

    Residuals are smaller than errors, since each sector pulls the solution to itself: with the
    share H of a sector in the information, its equations are taken over sqrt(1 - H).
    Source: Bell and McCaffrey, Survey Methodology 28 (2002) 169.
    """
    factor = _cholesky(information)
    order = np.argsort(part, kind="stable")
    starts = np.searchsorted(part[order], np.arange(1, SECTORS))
    scaled = np.linalg.inv(factor) @ slopes.T.take(order, axis=1)
    weighted, residual_m = scaled * linear.weight[order], linear.residual_m[order]
    sectors = [np.split(values, starts, axis=-1) for values in (weighted, scaled, residual_m)]
    shares = np.array([w @ x.T for w, x, _ in zip(*sectors, strict=True)])
    pulls = np.array([w @ r for w, _, r in zip(*sectors, strict=True)])
    left, axes = np.linalg.eigh(np.eye(len(factor)) - shares)
    pulls = np.einsum("kji,kj->ki", axes, pulls) / np.sqrt(np.maximum(left, LEAST_LEFT))
    scores = np.einsum("kij,kj->ki", axes, pulls) @ factor.T
    return np.asarray(scores.T @ scores)


def _inverse(change: Array, information: Array) -> Array:
    """Return the inverse of the derivative of the estimating equations, (16, 16) each.

    By chance residuals where Tukey's influence falls may take almost all of the information in one
    direction, of which LEAST_CHANGE is kept.
    """
    factor = np.linalg.inv(_cholesky(information))
    values, vectors = np.linalg.eigh(factor @ change @ factor.T)
    turned = vectors.T @ factor
    return np.asarray(turned.T / np.maximum(values, LEAST_CHANGE) @ turned)


def _cholesky(information: Array) -> Array:
    """Return the factor of an information, which rounding may leave singular far from a fit."""
    try:
        factor = np.linalg.cholesky(information)
    except np.linalg.LinAlgError:
        factor = np.linalg.cholesky(information + SINGULAR * np.diag(np.diag(information)))
    return np.asarray(factor)


def robust_weight(square: Array, converged: bool) -> tuple[Array, Array]:
    """Return weight and slope of the influence: Cauchy's far from convergence, else Tukey's."""
    if converged:
        left = np.clip(1.0 - square / 16.0, 0.0, None)
        return left**2, left * (1.0 - 5.0 * square / 16.0)
    left = 1.0 / (1.0 + square / 4.0)
    return left, left**2 * (1.0 - square / 4.0)


def profile_slopes(profile: EdgeProfile, beams: Beams, depth: Array, state: Array) -> Array:
    """Return derivatives of the depth by the state, (N, 16), by the chain rule over x and tau.

    With J a rotation by 90 degrees: d rho = curve (1 - rho rho') dq, and by the in-plane rotation,
    J rho - that of J q.
    """
    beam, rho, q = state[BEAM], beams.rho.T, beams.q_m.T
    wall = np.maximum(beams.tau, 0.0)
    d_wall = profile.d_wall * wall_reflectance(wall, state)[1]
    bevel_by_tau, by_lambert = bevel_slopes(beams.tau, state)
    facing = np.where(beams.tau > 0.0, profile.d_tau + state[WALL] * d_wall, 0.0)
    facing = facing + profile.d_lean + profile.d_bevel * bevel_by_tau
    across = beam[:, None] - (beam @ rho) * rho
    d_x = profile.d_x
    by_centre = across * (beams.shrink * beams.curve * facing) - rho * (d_x * beams.shrink)
    J_q, J_rho = _quarter(q), _quarter(rho)
    double = across_beam(beams, state)
    by_direction = 2.0 * profile.d_log_spot * _dot(state[ELLIPSE], _quarter(double))
    by_centre = by_centre - J_rho * (by_direction * beams.curve * beams.shrink)
    tau_by_rotation = beams.curve * _dot(across, J_q) - beam @ J_rho
    support = _dot(rho, q)
    return np.stack(
        [
            *by_centre,
            *(by_centre * depth - rho * facing),
            -d_x * depth * beams.shrink * support - facing * (support - beams.x_m),
            profile.d_log_spot,
            profile.d_thickness * np.exp(state[THICKNESS]),
            profile.d_log_ratio,
            -d_x * _dot(rho, J_q) + facing * tau_by_rotation,
            d_wall * (wall - 1.0) + profile.d_bevel * by_lambert,
            profile.d_shape,
            -d_x,
            profile.d_chamfer + 0.0 * d_x,
            profile.d_modulation * (1.0 + beam @ beam) + 0.0 * d_x,
            *(profile.d_log_spot * double),
        ]
    ).T


def _quarter(vectors: Array) -> Array:
    """Rotate vectors (2, N) by 90 degrees."""
    return np.stack([-vectors[1], vectors[0]])


def _dot(a: Array, b: Array) -> Array:
    """Return the scalar products (N,) of vectors (2, N)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1])
