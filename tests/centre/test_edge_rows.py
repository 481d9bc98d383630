"""Rows of the edge's equations, mixed and clean: by plain formulas, and slopes by differences."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

from wheelplane.centre.edge.beams import (
    BEAM,
    CENTRE,
    CHAMFER,
    ELLIPSE,
    INVERSE,
    MODULATION,
    RATIO,
    ROTATION,
    SHAPE,
    SPOT,
    STATE,
    THICKNESS,
    WALL,
    Prior,
    across_beam,
    bevel_reflectance,
    carry,
    carry_near,
    pointed,
    wall_reflectance,
)
from wheelplane.centre.edge.clean_edge import (
    BEYOND_M,
    FAR_M,
    LEAST_IN_SECTOR,
    LEAST_SCATTER_M,
    NONE,
    RING_M,
    RING_SKIP_M,
    ROUGH,
    SECTOR_COUNTS,
    _edge_table,
    band_m,
    clean_equations,
    first_state,
    shift_m,
    target_depth_m,
)
from wheelplane.centre.edge.edge_residuals import (
    DEPTH_SHARE,
    INNER_M,
    OUTER_M,
    POINTING_M,
    UNEVEN_SECTORS,
    ZONES,
    EdgeProblem,
    Zones,
    equations,
    profile_slopes,
    robust_weight,
)
from wheelplane.centre.edge.mixed_pixel import EdgeProfile, Profile, edge_profile
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, rectangle
from wheelplane.vectors import turned

CONFIG = CentreConfig()
DISC, PLATE = Circle(0.06), rectangle(0.28, 0.2)
SIGMA_M = 0.0006


def state_of(station=(-0.7, 0.4, 1.8), centre=(0.002, -0.003), rotation=0.05, thickness_m=0.012):
    station, centre = np.array(station), np.array(centre)
    state = pointed(Prior.of(thickness_m, CONFIG).mean, station, centre)
    state[CENTRE], state[ROTATION] = centre, rotation
    state[RATIO], state[WALL], state[SHAPE] = np.log(0.7), 0.6, 0.3
    return state


def scene(outline, state, count, mixed=True, seed=0):
    """Points where beams from the state's station meet target, background or both."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.0, 1.0, (count, 2)) * (1.7 * outline.size_m)
    closest = outline.closest(turned(q, -state[ROTATION]))
    far = 0.09 + 0.2 * closest.x_m + 0.02 * q[:, 0]
    depth = np.where(closest.x_m < 0.0, 0.0, far)
    if mixed:
        depth = far * np.clip(0.5 + closest.x_m / 0.006, 0.0, 1.0)
    depth = depth + SIGMA_M * rng.normal(size=count)
    near = np.flatnonzero(closest.clear & (np.abs(closest.x_m) < 0.003))[:3]
    depth[near] = -0.02, -5.0 * SIGMA_M - 1.2e-4, -5.0 * SIGMA_M - 0.8e-4  # before the target
    plane = state[CENTRE] + q * (1.0 + state[4] * depth)[:, None] + depth[:, None] * state[BEAM]
    prior = Prior.of(0.012, CONFIG)
    return EdgeProblem(np.asfortranarray(plane), depth, prior, outline, SIGMA_M)


NAMES = ("d_x", "d_tau", "d_log_spot", "d_thickness", "d_log_ratio", "d_wall", "d_shape")


@pytest.mark.parametrize("outline", [DISC, PLATE], ids=["disc", "plate"])
def test_slopes_by_the_state_are_those_of_any_profile(outline):
    """A depth linear in what a profile depends on, with x and tau from the beams themselves.

    Of a disc without thickness: how a wall's bend goes with the state is left out of the slopes.
    """
    state = state_of(centre=(0.0, 0.0) if outline is DISC else (0.002, -0.003))
    state[THICKNESS] = -18.0 if outline is DISC else state[THICKNESS]
    problem, rng = scene(outline, state, 400), np.random.default_rng(1)
    by = rng.normal(size=(11, 400))

    def value(at):
        beams = carry(problem.plane, problem.depth, at, outline)
        tau = np.maximum(beams.tau, 0.0)
        wall = wall_reflectance(tau, at)[0]
        return (
            by[0] * beams.x_m + by[1] * tau + by[2] * at[SPOT] + by[3] * np.exp(at[THICKNESS])
            + by[4] * at[RATIO] + by[5] * wall + by[6] * at[SHAPE] + by[7] * at[CHAMFER]
            + by[8] * beams.tau + by[9] * bevel_reflectance(beams.tau, at[WALL])
            + by[10] * at[MODULATION] * (1.0 + state[BEAM] @ state[BEAM])
            + by[2] * (at[ELLIPSE] @ across_beam(beams, state))
        )  # fmt: skip

    none = np.zeros(400)
    profile = EdgeProfile(none, *by[:7], none, none, *by[7:])
    beams = carry(problem.plane, problem.depth, state, outline)
    shown = profile_slopes(profile, beams, problem.depth, state)
    clear = beams.clear & (np.abs(beams.tau) > 1e-3) & (np.abs(beams.x_m) < 0.02)
    for index in range(STATE):
        step = np.zeros(STATE)
        step[index] = 1e-6
        seen = (value(state + step) - value(state - step)) / 2e-6
        moved = shown[:, index]
        np.testing.assert_allclose(
            moved[clear], seen[clear], atol=2e-6 * max(1.0, np.abs(seen[clear]).max()),
            err_msg=str(index),
        )  # fmt: skip
        assert np.abs(seen[clear]).max() > 1e-8 or (
            outline is DISC and index in (THICKNESS, ROTATION)
        )
    assert np.count_nonzero(clear) > 30
    assert np.ptp(np.sign(beams.tau[clear])) == 2.0


def test_a_wall_at_its_least_reflectance_has_no_slope():
    state = state_of((-9.0, 0.9, 180.0))
    state[WALL] = 1.0
    problem = scene(PLATE, state, 400)
    beams = carry(problem.plane, problem.depth, state, PLATE)
    one = np.ones(400)
    profile = EdgeProfile(*(one for _ in range(10)))
    slopes = profile_slopes(profile, beams, problem.depth, state)
    dark = wall_reflectance(np.maximum(beams.tau, 0.0), state)[1] == 0.0
    assert 0 < np.count_nonzero(dark) < 400
    assert not slopes[dark, WALL].any()
    assert slopes[~dark, WALL].all()


@pytest.mark.parametrize("converged", [False, True])
@pytest.mark.parametrize("outline", [DISC, PLATE], ids=["disc", "plate"])
def test_rows_of_mixed_pixels_are_those_of_their_formulas(outline, converged):
    state, rng = state_of(), np.random.default_rng(2)
    problem = scene(outline, state, 4000)
    all_round = problem.background(state).usable
    left_out = np.arange(UNEVEN_SECTORS) % 7 == 0
    problem = replace(problem, left_out=left_out)
    background, zones = problem.background(state), Zones(rng.normal(size=ZONES), 0.5)
    usable = background.usable
    assert 0 < np.count_nonzero(usable) < np.count_nonzero(all_round)
    linear = equations(problem, background, state, zones, converged, True)
    beams, z = carry(problem.plane, problem.depth, state, outline), problem.depth
    part = background.sector(beams)
    tau, thickness = np.maximum(beams.tau, 0.0), float(np.exp(state[THICKNESS]))
    kept = (beams.x_m > -INNER_M) & (beams.x_m < OUTER_M + thickness * tau) & beams.clear
    kept &= (z > -5.0 * SIGMA_M - 1e-4) & usable[part]
    of_left_out = left_out[np.floor(beams.share * UNEVEN_SECTORS).astype(int)]
    assert np.any(kept & of_left_out)  # of wider sectors
    kept &= ~of_left_out
    assert len(linear.residual_m) == linear.depths == np.count_nonzero(kept)
    spot = np.exp(state[SPOT]) * np.sqrt(1.0 + beams.tau**2)
    log = zones.log[np.floor(beams.share * ZONES).astype(int)]
    slant = beams.tau / (1.0 + state[BEAM] @ state[BEAM])

    def depth(x, by_echo=0.0, behind=None):
        far = background.at(part, x)[0] if behind is None else behind
        light = 1.0 + state[WALL] * (tau - 1.0)
        echo = np.exp(state[RATIO] + log + by_echo)
        return edge_profile(x, tau, far, spot, thickness, echo, light, state[SHAPE], slant)

    here, h = depth(beams.x_m), 1e-8
    by_x = (depth(beams.x_m + h).depth_m - depth(beams.x_m - h).depth_m) / (2.0 * h)
    behind = background.at(part, beams.x_m)[0]
    rough = here.background_share * (background.spread_m[part] + DEPTH_SHARE * behind)
    variance = (SIGMA_M + 1e-6) ** 2 + (by_x * POINTING_M) ** 2 + rough**2
    residual = z - here.depth_m
    np.testing.assert_allclose(linear.residual_m, residual[kept], atol=1e-12)
    weight, change = robust_weight(residual**2 / variance, converged)
    # The table's steps of 2 radii / 4000 lie between the slope of a line and of a difference.
    smooth = np.abs(linear.weight * variance[kept] - weight[kept])
    assert np.median(smooth) < 1e-4
    scale = linear.weight * variance[kept] / np.maximum(weight[kept], 1e-9)
    np.testing.assert_allclose(np.median(scale[weight[kept] > 0.1]), 1.0, rtol=1e-4)
    assert np.mean(np.abs(scale - 1.0)[weight[kept] > 0.1] < 0.05) > 0.97
    assert np.median(np.abs(linear.change * variance[kept] - change[kept])) < 1e-4
    deeper = (depth(beams.x_m, behind=behind + s * 1e-7).depth_m for s in (1.0, -1.0))
    by_depth = np.subtract(*deeper) / 2e-7
    lifted = 1.0 - by_depth - by_x * beams.tau * beams.shrink
    assert np.median(np.abs(linear.by_height - lifted[kept])) < 1e-5
    assert np.mean(np.abs(linear.by_height - lifted[kept]) < 0.05) > 0.9
    np.testing.assert_allclose(linear.q_m, beams.q_m[kept], atol=1e-13)
    np.testing.assert_allclose(linear.share, beams.share[kept], atol=1e-12)
    by_echo = (depth(beams.x_m, s * 1e-6).depth_m for s in (1.0, -1.0))
    seen = (np.subtract(*by_echo) / 2e-6)[kept]
    np.testing.assert_allclose(linear.slopes[:, RATIO], seen, atol=1e-7)
    assert linear.zones is zones
    assert linear.behind == 0
    assert np.ptp(np.sign(beams.tau[kept])) == 2.0


@pytest.mark.parametrize("outline", [DISC, PLATE], ids=["disc", "plate"])
def test_residuals_go_with_the_state_without_steps(outline):
    """As smoothly as the profile does: no point comes or goes, or falls into another sector."""
    state = state_of()
    problem = scene(outline, state, 20000)
    background, way = problem.background(state), np.zeros(STATE)
    way[CENTRE], way[SPOT] = (3e-4, -2e-4), 0.02

    def residual_m(share):
        linear = equations(problem, background, state + share * way, Zones.alike(), True, True)
        return linear.residual_m

    shares = np.linspace(0.0, 1.0, 41)
    steps = np.abs(np.diff([residual_m(share) for share in shares], axis=0))
    most = 0.12 * np.hypot(*way[CENTRE]) / 5e-4 / 40.0  # the background's depth over the footprint
    assert steps.max() < 2.0 * most
    assert steps.max() > 0.1 * most


def test_consistent_slopes_are_those_at_the_profile_s_depth():
    state = state_of()
    problem = scene(PLATE, state, 3000)
    background = problem.background(state)
    rows = [equations(problem, background, state, Zones.alike(), True, c) for c in (True, False)]
    z = rows[0].residual_m
    apart = rows[1].slopes - rows[0].slopes
    # By the beams' slope along an edge's normal: d_x times how much deeper the point is.
    across = rows[0].slopes[:, CENTRE]
    np.testing.assert_allclose(apart[:, BEAM], across * z[:, None], atol=1e-12)
    assert not apart[:, CENTRE].any()


# Clean edges: where target and background return the same power.


def excess(x, tau, state):
    """Power of face and wall less that of the background, of a beam x outside the edge."""
    spot, profile = _across_m(tau, state), Profile(float(state[SHAPE]))
    wall = max(1.0 + state[WALL] * (tau - 1.0), 0.02)
    a, b = (
        profile.share(np.array([v / spot]))[0]
        for v in (x, x - max(tau, 0.0) * np.exp(state[THICKNESS]))
    )
    return (1.0 - a) + wall * (a - b) - np.exp(state[RATIO]) * b


def _across_m(tau, state):
    """Radius of a slanted footprint across the edge."""
    return np.exp(state[SPOT]) * math.hypot(1.0, tau)


def parted(tau, state):
    reach = 2.0 * _across_m(tau, state)
    return brentq(
        excess, -reach, reach + max(tau, 0.0) * np.exp(state[THICKNESS]), (tau, state), xtol=1e-15
    )


@pytest.mark.parametrize("ratio", [0.2, 1.0, 6.0])
def test_a_clean_edge_lies_where_the_powers_are_alike(ratio):
    state = state_of()
    state[RATIO] = np.log(ratio)
    tau = np.array([-0.6, -0.2, 0.0, 0.05, 0.13, 0.4, 1.1])
    table = _edge_table(tau, state)
    np.testing.assert_allclose(table[0], [parted(t, state) for t in tau], atol=1e-9)
    assert shift_m(state) == pytest.approx(parted(0.0, state), abs=1e-9)
    assert shift_m(state) * (1.0 - ratio) > 1e-4 or ratio == 1.0
    h, shown = 2e-5, np.array([0.13, 0.4, 1.1])
    table = _edge_table(shown, state)

    def by(change):
        ahead, behind = ([parted(*change(t, s * h)) for t in shown] for s in (1.0, -1.0))
        return np.subtract(ahead, behind) / (2.0 * h)

    def along(index):
        return lambda t, d: (t, state + d * (np.arange(STATE) == index))

    close = {"atol": 3e-6, "rtol": 0.01}
    np.testing.assert_allclose(table[1], by(lambda t, d: (t + d, state)), **close)
    for row, index in ((2, SPOT), (4, RATIO), (6, SHAPE), (7, WALL)):
        np.testing.assert_allclose(table[row], by(along(index)), err_msg=str(row), **close)
    np.testing.assert_allclose(table[3] * np.exp(state[THICKNESS]), by(along(THICKNESS)), **close)
    np.testing.assert_allclose(table[5] * (shown - 1.0), table[7], atol=3e-6, rtol=0.01)


@pytest.mark.parametrize("ratio", [1e-3, 1e3])
def test_first_and_last_returns_part_at_a_footprint_s_rim_at_any_slope(ratio):
    state = state_of()
    state[RATIO] = np.log(ratio)
    tau = np.array([-2.5, -1.1, -0.6, 0.0, 0.4, 1.1, 2.5])
    found = _edge_table(tau, state)[0]
    np.testing.assert_allclose(found, [parted(t, state) for t in tau], atol=1e-9)
    aside = tau <= 0.0  # without a wall: outside by first returns, inside by last ones
    across_m = np.array([_across_m(t, state) for t in tau])
    rim = np.where(ratio < 1.0, 1.0, -1.0) * found / across_m
    assert np.all(rim[aside] > 0.8)


@pytest.mark.parametrize("incidence_deg", [0.0, 20.0, 45.0, 75.0])
def test_all_parts_of_a_slanted_footprint_are_the_target_s(incidence_deg):
    """They lie before its middle by the sine, along the normal; a Gaussian's end at two radii."""
    way = 2.0 * math.tan(math.radians(incidence_deg))
    state = state_of((-0.8 * way, 0.6 * way, 2.0), centre=(0.0, 0.0))
    part_m = 2.0 * np.exp(state[SPOT]) * math.sin(math.radians(incidence_deg))
    least_m = part_m + 5.0 * SIGMA_M + 1e-4
    for beyond_m, shown in ((-2e-5, True), (2e-5, False)):
        angle = np.linspace(0.0, 2.0 * np.pi, 200)
        q = (DISC.size_m - 0.004) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        depth = np.full(len(q), -least_m - beyond_m)
        plane = q * (1.0 + state[INVERSE] * depth)[:, None] + depth[:, None] * state[BEAM]
        problem = EdgeProblem(plane, depth, Prior.of(0.012, CONFIG), DISC, SIGMA_M)
        linear = clean_equations(problem, state, True, False, True)
        assert linear.depths == (len(q) if shown else 0)


def test_the_edge_of_beams_square_to_a_target_is_that_of_their_own_slopes():
    """To a nanometre, however little these differ."""
    state = state_of((-0.02, 0.03, 2.0))
    problem = scene(DISC, state, 4000, mixed=False)
    linear = clean_equations(problem, state, True, False, True)
    beams = carry(problem.plane, problem.depth, state, DISC)
    last = linear.q_m[linear.depths :]
    rows = [int(np.flatnonzero((beams.q_m == one).all(axis=1))[0]) for one in last]
    run = state[BEAM] + state[INVERSE] * beams.q_m[rows]
    lower = -np.sum(beams.rho[rows] * run, axis=1) - beams.bent[rows]
    beyond = beams.x_m[rows] - [parted(t, state) for t in lower]
    gap = np.abs(linear.residual_m[linear.depths :] - beyond)
    assert np.ptp(gap) < 1e-9
    assert 0.01 < np.ptp(lower) < 0.2


def test_the_state_of_first_returns_has_a_bright_wall_and_is_a_copy():
    state = state_of()
    first = first_state(state)
    assert first[WALL] == 0.0
    assert state[WALL] == 0.6
    np.testing.assert_array_equal(np.delete(first, WALL), np.delete(state, WALL))


def test_a_target_is_as_deep_as_its_wall_and_noise():
    thick, thin = state_of(thickness_m=0.02), state_of(thickness_m=0.001)
    assert target_depth_m(thick, 0.001) - target_depth_m(thick, 0.0) == pytest.approx(0.005)
    assert 0.02 < target_depth_m(thick, 0.0) < 0.04
    assert target_depth_m(thin, 0.0) == target_depth_m(state_of(thickness_m=0.002), 0.0)


CLEAN = [(400, False, True), (2500, True, True), (2500, False, False), (9000, False, True),
         (40_000, True, False)]  # fmt: skip


@pytest.mark.parametrize(("count", "rough", "by_power"), CLEAN)
@pytest.mark.parametrize("outline", [DISC, PLATE], ids=["disc", "plate"])
def test_rows_of_a_clean_edge_are_those_of_its_nearest_points(outline, count, rough, by_power):
    state = state_of()
    problem = scene(outline, state, count, mixed=False)
    if count == 9000:  # less than half of the edge is in the scan
        shown = carry(problem.plane, problem.depth, state, outline).share > 0.55
        plane = np.asfortranarray(problem.plane[shown])
        problem = replace(problem, plane=plane, depth=problem.depth[shown])
    linear = clean_equations(problem, state, True, rough, by_power)
    beams, z = carry(problem.plane, problem.depth, state, outline), problem.depth
    run = state[BEAM] + state[INVERSE] * beams.q_m  # of each beam, per depth
    slope, square = -np.sum(beams.rho * run, axis=1), np.sum(run**2, axis=1)
    lower, thickness = slope - beams.bent, np.exp(state[THICKNESS])
    near, _ = carry_near(problem.plane, z, state, outline, band_m(state, BEYOND_M[count < 2500]))
    steepest = np.abs(lower[near]).max()
    grid = np.linspace(-steepest, steepest, 97)
    at = state if by_power else first_state(state)
    beyond = beams.x_m - np.interp(lower, grid, [parted(t, at) for t in grid])
    incidence = np.arctan(np.hypot(*state[BEAM]))
    part_m = 2.0 * np.exp(state[SPOT]) * np.sin(incidence)
    seen = beams.clear & (z > -5.0 * SIGMA_M - 1e-4 - part_m)
    front = seen & (z < target_depth_m(state, SIGMA_M))
    face = np.flatnonzero(front & (beams.x_m > -INNER_M) & (beyond < 0.0))
    assert linear.depths == len(face)
    spot = np.exp(state[SPOT]) * np.sqrt(1.0 + lower**2)
    # A wall that bends by b, met at the depth d: x = s d - b d^2 / T.
    with np.errstate(invalid="ignore"):
        root = np.nan_to_num(np.sqrt(slope**2 - 4.0 * beams.bent / thickness * beams.x_m))
    deep = 2.0 * beams.x_m / np.maximum(slope + root, 1e-12)
    tau = np.maximum(slope - beams.bent * np.clip(deep / thickness, 0.0, 1.0), 0.0)
    light = 1.0 + state[WALL] * (tau - 1.0)
    mean = edge_profile(
        beams.x_m, tau, 0.0 * z, spot, thickness, NONE, light, state[SHAPE], slope / (1.0 + square)
    )  # fmt: skip
    residual = (z - mean.depth_m)[face]
    variance = ((SIGMA_M + 1e-6) ** 2 + (mean.d_x * POINTING_M) ** 2)[face]
    weight, change = robust_weight(residual**2 / variance, True)
    np.testing.assert_allclose(linear.residual_m[: len(face)], residual, atol=1e-12)
    np.testing.assert_allclose(linear.weight[: len(face)], weight / variance)
    np.testing.assert_allclose(linear.change[: len(face)], change / variance)
    lifted = (1.0 - mean.d_x * lower * beams.shrink)[face]
    np.testing.assert_allclose(linear.by_height[: len(face)], lifted)
    np.testing.assert_array_equal(linear.q_m[: len(face)], beams.q_m[face])
    ring = front & (beyond < -RING_SKIP_M) & (beyond > -RING_SKIP_M - RING_M)
    fit = [k for k in SECTOR_COUNTS if np.sum(ring) >= LEAST_IN_SECTOR * k]
    sectors = fit[0] if fit else SECTOR_COUNTS[-1]
    part = np.floor(beams.share * sectors).astype(int)
    filled = [n for k in range(sectors) if (n := np.sum(ring & (part == k)))]
    gap_m, rows, sides = RING_M / np.median(filled), [], []
    for side, sign in ((front, -1.0), (seen & ~front, 1.0)):
        for k in range(sectors):
            here = np.flatnonzero(side & (part == k) & (np.abs(beyond) < FAR_M + gap_m))
            if len(here):
                rows.append(here[np.argmin(sign * beyond[here])])
                sides.append(sign)
    rows, sides = np.array(rows), np.array(sides)
    assert len(linear.residual_m) == len(face) + len(rows)
    assert linear.behind == np.count_nonzero(sides > 0.0) > 0
    last = beyond[rows] - sides * gap_m
    np.testing.assert_allclose(linear.residual_m[len(face) :], last, atol=1e-8)
    inner = beyond[rows[sides < 0.0]]
    scatter = stats.median_abs_deviation(inner, scale="normal")
    variance = max(gap_m**2 + LEAST_SCATTER_M**2, scatter**2)
    weight, change = robust_weight(last**2 / variance / (ROUGH if rough else 1.0) ** 2, True)
    np.testing.assert_allclose(linear.weight[len(face) :], weight / variance, atol=1.0)
    np.testing.assert_allclose(linear.change[len(face) :], change / variance, atol=2.0)
    lifted = (lower * beams.shrink)[rows]
    np.testing.assert_allclose(linear.by_height[len(face) :], lifted)
    np.testing.assert_allclose(linear.share[len(face) :], beams.share[rows])
    alone = clean_equations(problem, state, True, rough, by_power, by_background=False)
    assert alone.behind == 0
    assert len(alone.residual_m) == len(linear.residual_m) - linear.behind
    np.testing.assert_array_equal(alone.residual_m, linear.residual_m[: len(alone.residual_m)])


def test_slopes_of_the_nearest_points_are_those_of_central_differences():
    """Seen from afar, x and tau depend on the state alone, as in the slopes."""
    state = state_of((-70.0, 40.0, 180.0), rotation=0.02)
    problem = scene(PLATE, state, 40_000, mixed=False)
    here = clean_equations(problem, state, True, False, True)
    last = slice(here.depths, None)
    for index in (0, 1, 2, 3, SPOT, THICKNESS, RATIO, ROTATION, WALL, SHAPE):
        step = np.zeros(STATE)
        step[index] = 1e-7 if index in (0, 1, 8) else 1e-5
        ahead, behind = (
            clean_equations(problem, state + s * step, True, False, True) for s in (1.0, -1.0)
        )
        moved = -(ahead.residual_m[ahead.depths :] - behind.residual_m[behind.depths :]) / (
            2.0 * step[index]
        )
        shown = here.slopes[last, index]
        size = np.linalg.norm(shown)
        assert np.linalg.norm(moved - shown) < 0.03 * size, index
        assert size > 1e-6


def test_without_points_about_the_edge_there_are_no_rows():
    state = state_of()
    problem = EdgeProblem(np.zeros((4, 2)), np.zeros(4), Prior.of(0.01, CONFIG), DISC, SIGMA_M)
    linear = clean_equations(problem, state, True, False, True)
    assert len(linear.residual_m) == linear.depths == linear.behind == 0
