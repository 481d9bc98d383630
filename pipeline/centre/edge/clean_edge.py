"""Points about an edge whose beams return one surface each: target or background, never between.

A scanner that reports the first, last or strongest of its returns, or a camera, shows no mixed
pixels of target and background. Where the beams meet the plane, the edge parts those that returned
the target from the others: at x*, where the powers of both are as 1 to 1. With the shares F of
mixed_pixel.py, 1 - F(a) + o (F(a) - F(b)) = e F(b) there; e stands for the detector's preference
as well, so that a small one is a first return's, a large one a last return's. Face and wall are one
return, whose mean depth is that of the mixed pixel without background.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ...targets import sector
from ...vectors import NORMAL_OF_MAD, Array, Mask
from .beams import (
    BEAM,
    CHAMFER,
    GROWTH,
    INVERSE,
    MIN_DEPTH_M,
    RATIO,
    SHAPE,
    SPOT,
    STATE,
    THICKNESS,
    WALL,
    Beams,
    bevel_reflectance,
    bevel_slopes,
    footprint_m,
    reaching,
    round_footprint_m,
    wall_reflectance,
)
from .edge_residuals import (
    INNER_M,
    POINTING_M,
    EdgeProblem,
    Equations,
    profile_slopes,
    robust_weight,
)
from .mixed_pixel import END, EdgeProfile, edge_profile, profile_of

SLOPES = np.arange(-48, 49) / 48.0  # of the wall against the beams, at which x* is solved
HALVINGS = 20
NONE = 1e-9  # reflectance of what is not in the return
LEAST_SLOPE = 1.0  # 1/m, of the powers at x*
SECTOR_COUNTS = (96, 48, 24, 12, 6)  # of the outline, in which the nearest points are looked up
LEAST_IN_SECTOR = 12  # points in its ring
RING_SKIP_M, RING_M = 0.001, 0.010  # inside the edge, where points are counted
BEYOND_M = 0.001, RING_M  # beyond FAR_M, where nearest points are sought: of dense beams, of any
LEAST_SCATTER_M = 3e-5  # of the points next to the edge, beside their own spacing
ROUGH, FAR_M = 8.0, 0.008  # factor on the scatter far from convergence, and reach beside the edge
FACE = 0.0  # of Lambert's law in a wall as bright as the face
FAR_OFF = 4.0  # standard deviations: of points beside an edge that have no background there
MOST_STRAIGHT = 12  # sides of an outline; more are parts of arcs
# Sectors that may have unlike backgrounds; points of each that show it; standard deviations of what
# they scatter by chance, that are not.
UNLIKE, LEAST_UNLIKE, NOT_BY_CHANCE = 24, 3, 2.5
IN_RING, FINER = 200, 4  # cells across the ring, 0.05 mm; steps of a wave in the ring
LEAST_ROWS, BESIDE = 2.0, 0.7  # in the ring, whose window hides fewer; least of the largest wave
BY_CHANCE = 4.0  # standard deviations of points in rows by chance
Wall = Literal["by power", "as face", "lost"]  # what a filter left of the beams on it
HELD = 1.5  # thicknesses up to which a point may be the wall's


def target_depth_m(state: Array, sigma_m: float) -> float:
    """Return the largest depth of a point on the target, its wall included."""
    return max(HELD * float(np.exp(state[THICKNESS])), MIN_DEPTH_M) + 5.0 * sigma_m


def clean_equations(
    problem: EdgeProblem,
    state: Array,
    robust: bool,
    rough: bool,
    by_power: bool,
    by_background: bool = True,
) -> Equations:
    """Linearise the depths of the target's points, and the points next to the edge, at `state`.

    rough: far from convergence, where points farther from the edge still count. by_power: whether
    returns part by power; else the least part of a footprint on face or wall decides, however dark.
    by_background: whether the points next to the edge on its outer side count.
    """
    known = state if by_power else first_state(state)

    def parted(tau: Array) -> _Parted:
        return _Parted(known, tau, (_edge_table(tau, known),))

    return _linearised(problem, state, robust, rough, parted, by_background)


def gapped_equations(
    problem: EdgeProblem, state: Array, robust: bool, rough: bool, wall: Wall
) -> Equations:
    """Linearise an edge whose beams were filtered out, at `state`: it is in the middle of the gap.

    A filter of beams that differ from their neighbours, or have few, leaves out as many inside the
    edge as outside it: where returns part by power, where the wall ends if its beams are as those
    of the face, or, where they were filtered out as well, from the face to the end of the wall.
    """

    def parted(tau: Array) -> _Parted:
        if wall == "by power":
            return _Parted(state, tau, (_edge_table(tau, state),), filtered=True)
        thickness, ends = float(np.exp(state[THICKNESS])), np.zeros((10, len(tau)))
        ends[1] = np.where(tau > 0.0, thickness, state[CHAMFER])
        ends[0] = ends[1] * tau
        ends[3], ends[8] = tau.clip(min=0.0), tau.clip(max=0.0)
        tables = (ends,) if wall == "as face" else (np.where(tau > 0.0, 0.0, ends), ends)
        return _Parted(first_state(state), tau, tables, filtered=True)

    return _linearised(problem, state, robust, rough, parted)


@frozen(eq=False)
class _Parted:
    """Where returns part by the slope of the wall against the beams: state (16,), slopes tau (K,).

    tau: evenly spaced. tables: x* and its derivatives (10, K), of points on the target and of those
    beside it; one of both. filtered: whether beams are missing on both sides of x*.
    """

    state: Array
    tau: Array
    tables: tuple[Array, ...]
    filtered: bool = False

    def beyond_m(self, beams: Beams) -> tuple[Array, Array]:
        """Return how far beyond x* beams lie, (N,) each, as on the target and as beside it."""
        off_m = [beams.x_m - self.between(beams.tau, table[0]) for table in self.tables]
        return off_m[0], off_m[-1]

    def between(self, tau: Array, row: Array) -> Array:
        """Return a row of a table (K,) at slopes tau (N,), linearly interpolated."""
        place = (tau - self.tau[0]) * ((len(self.tau) - 1) / (self.tau[-1] - self.tau[0]))
        at = np.clip(place.astype(np.intp), 0, len(self.tau) - 2)
        below = row.take(at)
        return np.asarray(below + (place - at) * (row.take(at + 1) - below))


def _linearised(
    problem: EdgeProblem,
    state: Array,
    robust: bool,
    rough: bool,
    parted_at: Callable[[Array], _Parted],
    by_background: bool = True,
) -> Equations:
    """Linearise depths and places at `state`; parted_at: where returns part at slopes tau (K,)."""
    everything = problem
    for outer_m in BEYOND_M[problem.few :]:
        problem, beams = everything.near_edge(state, band_m(state, outer_m))
        beams = fanned(beams, state)
        on_target, seen = seen_target(problem, beams, state)
        steepest = max(float(np.abs(beams.tau).max(initial=0.0)), 1e-3)
        parted = parted_at(steepest * SLOPES)
        beyond_m = parted.beyond_m(beams)
        spacing = _spacing(beams, on_target & _in_ring(beyond_m[0]))
        if spacing.gap_m < outer_m:
            break
    face = on_target & (beams.x_m + state[GROWTH] > -INNER_M) & (beyond_m[0] < 0.0)
    masks = on_target, seen & ~on_target
    sides, half_gap_m = _sides(problem, beams, beyond_m, masks, parted, spacing, robust, rough)
    depths, behind = mean_depths(problem, beams, face, state, robust, not rough), len(sides[1][0])
    if not by_background:
        return Equations.stacked([depths, sides[0]])
    return Equations.stacked([depths, *sides], behind, half_gap_m)


def band_m(state: Array, outer_m: float) -> tuple[float, float]:
    """Return how far inside and outside the edge points may count, wherever returns part.

    outer_m: how far beyond FAR_M the nearest points outside may lie.
    """
    parted_m = 2.0 * END * float(np.exp(state[SPOT]))
    inside_m = max(RING_SKIP_M + RING_M + parted_m, INNER_M + float(state[GROWTH]))
    return inside_m, FAR_M + outer_m + parted_m


def seen_target(problem: EdgeProblem, beams: Beams, state: Array) -> tuple[Mask, Mask]:
    """Return which points (N,) lie on the target, its wall included, and which on or behind it."""
    square = float(state[BEAM] @ state[BEAM])
    nearer_m = 2.0 * np.exp(state[SPOT]) * np.sqrt(square / (1.0 + square))  # parts of a footprint
    seen = beams.clear & (problem.depth > -5.0 * problem.sigma_m - 1e-4 - nearer_m)
    return seen & (problem.depth < target_depth_m(state, problem.sigma_m)), seen


def fanned(beams: Beams, state: Array) -> Beams:
    """Return beams whose tau is that of their own direction, not of one that meets the edge."""
    return replace(beams, tau=beams.tau - state[INVERSE] * beams.x_m)


def first_state(state: Array) -> Array:
    """Return a state (16,) whose wall parts from the background as the face does."""
    state = state.copy()
    state[WALL] = FACE
    return state


def shift_m(state: Array) -> float:
    """Return how far outside the edge, away from a wall, target and background part."""
    return float(_edge_m(*_edges(np.zeros(1), state), state)[0])


def between_rows_m(problem: EdgeProblem, state: Array) -> float:
    """Return the standard uncertainty of straight edges that rows of a grid run along, rms.

    Such an edge lies anywhere between two rows. How far its points, by their distance from it, lie
    in rows is a Fourier coefficient of these, in Hann's window: 1 along the edge, 0 where one row
    crosses. Rows have harmonics, of which the wave that leaves most between them counts. A strip
    that is not seen has its largest waves below those of rows up to 5 mm apart.
    """
    if not problem.outline.shows_rotation:
        return 0.0
    beams = problem.beams(state)
    on_target = beams.clear & (np.abs(problem.depth) < 5.0 * problem.sigma_m + 1e-4)
    ring = on_target & _in_ring(beams.x_m)
    sides, side = np.unique(np.round(beams.rho[ring], 6), axis=0, return_inverse=True)
    if not 0 < len(sides) <= MOST_STRAIGHT:
        return 0.0
    inside_m, square = -RING_SKIP_M - beams.x_m[ring], 0.0
    window = np.hanning(IN_RING)
    per_m = np.fft.rfftfreq(FINER * IN_RING, RING_M / IN_RING)
    for k in range(len(sides)):
        counts, _ = np.histogram(inside_m[side.ravel() == k], IN_RING, (0.0, RING_M))
        seen = float(counts @ window)
        waves = np.abs(np.fft.rfft(window * (counts - seen / window.sum()), FINER * IN_RING))
        least = max(BY_CHANCE * math.sqrt(counts @ window**2), BESIDE * float(waves.max()))
        shown = (per_m > LEAST_ROWS / RING_M) & (waves > least)
        shown[1:-1] &= (waves[1:-1] >= waves[:-2]) & (waves[1:-1] >= waves[2:])
        rows_m = waves[shown] / (seen * per_m[shown])
        square += float(rows_m.max(initial=0.0)) ** 2 / 12.0
    return math.sqrt(square / len(sides))


def by_backgrounds_m(linear: Equations) -> float:
    """Return how far backgrounds of unlike brightness move a clean edge (k = 1).

    As its residuals by sectors scatter, beyond what points there scatter from each other, and not
    by chance.
    """
    rows = slice(linear.depths, None)
    part, residual_m = sector(linear.share[rows], UNLIKE), linear.residual_m[rows]
    count = np.bincount(part, minlength=UNLIKE)
    seen = count >= LEAST_UNLIKE
    if not seen.any():
        return 0.0
    mean = np.bincount(part, residual_m, UNLIKE) / np.maximum(count, 1)
    within = np.bincount(part, (residual_m - mean[part]) ** 2, UNLIKE) / np.maximum(count - 1, 1)
    alone = float(np.mean(within[seen] / count[seen]))
    by_chance = 1.0 + NOT_BY_CHANCE * math.sqrt(2.0 / np.count_nonzero(seen))
    return math.sqrt(max(float(np.mean(mean[seen] ** 2)) - by_chance * alone, 0.0))


def _mean_depth(
    x_m: Array, tau: Array, slant: Array, spot_m: Array, state: Array, lean: Array, alone: bool
) -> EdgeProfile:
    """Return the mean depth of face, chamfer and wall alone."""
    return edge_profile(
        x_m,
        tau,
        np.zeros(len(x_m)),
        spot_m,
        float(np.exp(state[THICKNESS])),
        NONE,
        wall_reflectance(tau, state)[0],
        float(state[SHAPE]),
        slant,
        float(state[CHAMFER]),
        bevel_reflectance(lean, float(state[WALL])),
        lean=lean,
        alone=alone,
    )


def _edge_table(tau: Array, state: Array) -> Array:
    """Return x* and its derivatives (10, K) at slopes tau (K,).

    By tau, log spot, thickness, log ratio, reflectance of the wall, shape, Lambert's share, chamfer
    and its reflectance: those of the implicit function whose parts `_edges` returns.
    """
    ends_m, steps, spot_m = _edges(tau, state)
    x_m, facing = _edge_m(ends_m, steps, spot_m, state), np.heaviside(tau, 0.5)
    off_m = x_m - ends_m
    at = profile_of(float(state[SHAPE])).at(off_m / spot_m)
    F_0, F_1, F_2 = at.share
    by_ends = steps * at.density / spot_m
    per_m = np.maximum(by_ends.sum(axis=0), LEAST_SLOPE)
    bevel_by_tau, bevel_by_wall = bevel_slopes(tau, state)
    shown = wall_reflectance(tau, state)[1]
    wall_m = state[CHAMFER] + facing * (np.exp(state[THICKNESS]) - state[CHAMFER])
    grown = np.sum(by_ends * off_m, axis=0)  # with the footprint

    def darker(bevel: Array | float, wall: Array | float, behind: float = 0.0) -> Array:
        """Return how much power the target loses where these reflectances grow so much (K,)."""
        return np.asarray(bevel * (F_1 - F_0) + wall * (F_2 - F_1) + behind * F_2)

    by_tau = by_ends[1] * state[CHAMFER] + by_ends[2] * wall_m
    by_tau += grown * tau / (1.0 + tau**2)
    slopes = [
        by_tau - darker(bevel_by_tau, shown * state[WALL]),
        grown,
        by_ends[2] * facing * tau,
        -darker(0.0, 0.0, float(np.exp(state[RATIO]))),
        -darker(0.0, shown),
        -np.sum(steps * at.share_by_shape, axis=0),
        -darker(bevel_by_wall, shown * (tau - 1.0)),
        (by_ends[1] + by_ends[2] * (1.0 - facing)) * tau - by_ends[0],
        -darker(1.0, 0.0),
    ]
    return np.stack([x_m, *(np.array(slopes) / per_m)])


def _edge_m(ends_m: Array, steps: Array, spot_m: Array, state: Array) -> Array:
    """Return x* (K,) by what `_edges` returns: by bisection, and by the chord of what is left."""
    profile = profile_of(float(state[SHAPE]))

    def excess(x_m: Array) -> Array:
        """Return the target's power less the background's (K,)."""
        return np.asarray(1.0 - np.sum(steps * profile.share((x_m - ends_m) / spot_m), axis=0))

    low, high = ends_m.min(axis=0) - END * spot_m, ends_m.max(axis=0) + END * spot_m
    for _ in range(HALVINGS):
        x_m = (low + high) / 2.0
        nearer = excess(x_m) > 0.0
        low, high = np.where(nearer, x_m, low), np.where(nearer, high, x_m)
    left, right = excess(low), excess(high)
    share = np.clip(left / np.maximum(left - right, np.finfo(float).eps), 0.0, 1.0)
    return np.asarray(low + share * (high - low))


def _edges(tau: Array, state: Array) -> tuple[Array, Array, Array]:
    """Return where face, chamfer and wall end, and how much darker it is beyond each; (3, K) each.

    And the radius (K,) of the footprints, at slopes tau (K,). A beam meets the face, the chamfer,
    the wall if that is seen, and what lies behind: the power of the target less that of the
    background is 1 less the sum of those steps by the shares F there.
    """
    nothing, wall = np.zeros(len(tau)), wall_reflectance(tau, state)[0]
    bevel = bevel_reflectance(tau, float(state[WALL]))
    ends = np.where(tau > 0.0, np.exp(state[THICKNESS]), state[CHAMFER])
    ends_m = np.stack([nothing - state[CHAMFER], state[CHAMFER] * tau, ends * tau])
    steps = np.stack([1.0 - bevel, bevel - wall, wall + np.exp(state[RATIO])])
    return ends_m, steps, round_footprint_m(tau, state)


def mean_depths(
    problem: EdgeProblem,
    beams: Beams,
    chosen: Mask,
    state: Array,
    robust: bool,
    consistent: bool,
    alone: bool = True,
) -> tuple[Array, ...]:
    """Return the rows of Equations for depths of target points: q to by_height.

    Where the face holds a whole footprint, the depth is that of the face, whatever the state.
    alone: whether depths alone show the edge: slopes are those of `edge_profile` then. Beside
    intensities, which show it better, the others move centres less.
    """
    rows = np.flatnonzero(chosen)
    near = beams.taken(rows)
    parts = reaching(near, state)
    z, cut = problem.depth[rows], near.taken(parts)
    steep = state[BEAM, None] + state[INVERSE] * cut.q_m.T
    square = 1.0 + np.sum(steep**2, axis=0)
    slant = (cut.tau + cut.bent) / square
    wall = np.maximum(_wall_slope(cut, float(np.exp(state[THICKNESS]))), 0.0)
    spot_m = footprint_m(cut, state)
    profile = _mean_depth(cut.x_m, wall, slant, spot_m, state, cut.tau, alone)
    if alone:
        # Beams that run otherwise see another slant, and have footprints that grew otherwise.
        grown = profile.d_log_spot * cut.tau / (1.0 + cut.tau**2)
        profile = replace(profile, d_lean=profile.d_lean + profile.d_slant / square + grown)
    residual, variance = z.copy(), np.full(len(rows), (problem.sigma_m + 1e-6) ** 2)
    residual[parts] -= profile.depth_m
    variance[parts] += (profile.d_x * POINTING_M) ** 2
    weight, change = robust_weight(residual**2 / variance, robust)
    slopes, by_height = np.zeros((STATE, len(rows))).T, np.ones(len(rows))
    slopes[parts] = profile_slopes(profile, cut, profile.depth_m if consistent else z[parts], state)
    by_height[parts] -= profile.d_x * cut.tau * cut.shrink
    return (
        beams.q_m[rows],
        beams.share[rows],
        residual,
        slopes,
        weight / variance,
        change / variance,
        by_height,
    )


def _wall_slope(beams: Beams, thickness_m: float) -> Array:
    """Return tau down to the depth at which a beam meets a wall that bends, instead of all of it.

    x = s d - b d^2 / T at the depth d, with s = tau + b at the face, and b for `bent`.
    """
    slope, bend = beams.tau + beams.bent, beams.bent / thickness_m
    root = np.sqrt(np.maximum(slope**2 - 4.0 * bend * beams.x_m, 0.0))
    depth = 2.0 * beams.x_m / np.maximum(slope + root, 1e-12)
    return np.asarray(slope - bend * np.clip(depth, 0.0, thickness_m))


@frozen
class _Spacing:
    """Spacing of beams across the edge, gap_m, and number of sectors for the nearest on a side."""

    gap_m: float
    sectors: int


def _spacing(beams: Beams, inside: Mask) -> _Spacing:
    """Return the spacing of beams by those (N,) in the ring inside the edge.

    Beams meet the plane evenly, n of a sector's in a ring of width h: h / n apart.
    """
    share = beams.share[inside]
    sectors = next(
        (k for k in SECTOR_COUNTS if len(share) >= LEAST_IN_SECTOR * k), SECTOR_COUNTS[-1]
    )
    filled = np.bincount(sector(share, sectors), minlength=sectors)
    each = float(np.median(filled[filled > 0])) if len(share) else 1.0
    return _Spacing(RING_M / max(each, 1.0), sectors)


def _sides(
    problem: EdgeProblem,
    beams: Beams,
    beyond_m: tuple[Array, Array],
    masks: tuple[Mask, Mask],
    parted: _Parted,
    spacing: _Spacing,
    robust: bool,
    rough: bool,
) -> tuple[list[tuple[Array, ...]], float]:
    """Return the rows of Equations for the points next to the edge on its two sides.

    Of beams that meet the plane evenly, the nearest to the edge lies as far from it as they are
    apart, with a standard deviation as large (exponential distribution). They scatter more
    where rows of a grid run along straight edges, or backgrounds of other brightness move them.
    And half of the gap where beams were filtered out; else 0.
    """
    gap_m, count = spacing.gap_m, spacing.sectors
    part = sector(beams.share, count)
    rows = []
    for mask, off_m, sign in zip(masks, beyond_m, (-1.0, 1.0), strict=True):
        near = np.flatnonzero(mask & (np.abs(off_m) < FAR_M + gap_m))
        rows.append(near[_least(part[near], sign * off_m[near], count)])
    lies_m = [off_m[chosen] for off_m, chosen in zip(beyond_m, rows, strict=True)]
    half_m = 0.0
    if parted.filtered and len(lies_m[0]) and len(lies_m[1]):
        half_m = max((_middle(lies_m[1]) - _middle(lies_m[0])) / 2.0 - gap_m, 0.0)
    u_m = math.hypot(gap_m, LEAST_SCATTER_M)
    if len(lies_m[0]):
        u_m = max(u_m, _scatter(lies_m[0]))
    away_m = gap_m + half_m
    return [
        _nearest(problem, beams, chosen, at_m - off, u_m, parted, table, robust, rough)
        for chosen, at_m, off, table in zip(
            rows, lies_m, (-away_m, away_m), (parted.tables[0], parted.tables[-1]), strict=True
        )
    ], half_m


def _scatter(values: Array) -> float:
    """Return the standard deviation of values (N,) by their median absolute deviation."""
    return NORMAL_OF_MAD * float(np.median(np.abs(values - np.median(values))))


def _middle(values: Array) -> float:
    """Return the mean of values (N,) without those that are farther off than others scatter."""
    off = np.abs(values - np.median(values))
    return float(np.mean(values[off <= FAR_OFF * _scatter(values)]))


def _least(part: npt.NDArray[np.int64], values: Array, count: int) -> npt.NDArray[np.intp]:
    """Return the row of the least of values (N,) in each of `count` parts that has any."""
    least = np.full(count, np.inf)
    np.minimum.at(least, part, values)
    rows = np.flatnonzero(values == least[part])
    return rows[np.unique(part[rows], return_index=True)[1]]


def _in_ring(beyond_m: Array) -> Mask:
    """Return which points (N,) lie in the ring inside the edge, where points are counted."""
    return (beyond_m < -RING_SKIP_M) & (beyond_m > -RING_SKIP_M - RING_M)


def _nearest(
    problem: EdgeProblem,
    beams: Beams,
    chosen: npt.NDArray[np.intp],
    off_m: Array,
    u_m: float,
    parted: _Parted,
    table: Array,
    robust: bool,
    rough: bool,
) -> tuple[Array, ...]:
    """Return the rows of Equations for points (M,) that lie off_m outside where they should."""
    beams, state = Beams(*(values[chosen] for values in vars(beams).values())), parted.state
    _, by_tau, by_spot, by_thickness, by_ratio, by_wall, by_shape, _, by_chamfer, by_bevel = (
        parted.between(beams.tau, row) for row in table
    )
    nothing = np.zeros(len(chosen))
    # On the far side by the chamfer alone, without the footprint's growth.
    grown = by_spot * beams.tau / (1.0 + beams.tau**2)
    by_lean = np.where(beams.tau > 0.0, 0.0, by_tau - grown)
    profile = EdgeProfile(
        depth_m=nothing,
        d_x=nothing - 1.0,
        d_tau=by_tau - state[WALL] * by_wall,  # profile_slopes adds the latter
        d_log_spot=by_spot,
        d_thickness=by_thickness,
        d_log_ratio=by_ratio,
        d_wall=by_wall,
        d_shape=by_shape,
        background_share=nothing,
        by_background=nothing,
        d_chamfer=by_chamfer,
        d_lean=by_lean - by_bevel * bevel_slopes(beams.tau, state)[0],
        d_bevel=by_bevel,
    )
    residual, variance = off_m, u_m**2
    weight, change = robust_weight(residual**2 / variance / (ROUGH if rough else 1.0) ** 2, robust)
    slopes = profile_slopes(profile, beams, problem.depth[chosen], state)
    return (
        beams.q_m,
        beams.share,
        residual,
        slopes,
        weight / variance,
        change / variance,
        beams.tau * beams.shrink,
    )
