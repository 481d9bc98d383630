"""Beams about an edge by geometry, their prior by propagation, the background by plain medians."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.centre.edge.beams import (
    ALIKE_CHAMFER_M,
    ALIKE_MODULATION,
    BEAM,
    CENTRE,
    CHAMFER,
    CLEAN_SPOT,
    ELLIPSE,
    GROWTH,
    HELD_BEAM,
    HELD_MODULATION,
    HELD_SIZE_M,
    HELD_THICKNESS,
    HELD_WALL,
    IN_SECTOR,
    IN_SECTOR_SPARSE,
    INVERSE,
    LAMBERT,
    LAMBERT_SIGMA,
    LEAST_IN_HALF,
    LEAST_IN_RING,
    LEAST_OTHER,
    LEAST_WALL,
    MAX_SPREAD,
    MAX_SPREAD_SPARSE,
    MIN_DEPTH_M,
    MODULATION,
    MOST_OTHER,
    NEXT_M,
    OFF_ROUGH,
    OFF_SHARE,
    RATIO,
    RING_M,
    ROTATION,
    ROTATION_RAD,
    SHAPE,
    SIZE_M,
    SPARSE,
    SPOT,
    SPOT_LOG,
    STATE,
    STATED_THICKNESS,
    STATION_M,
    THICKNESS,
    TWELFTHS,
    WALL,
    WIDEST_M,
    WRONG_SIZE_M,
    Background,
    Beams,
    Prior,
    carry,
    carry_near,
    look_up,
    mixed_share,
    mixed_share_of_few,
    outside_m,
    pointed,
    wall_reflectance,
)
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, Holes, rectangle
from wheelplane.vectors import turned

CONFIG = CentreConfig()
OUTLINES = {
    "disc": Circle(0.06),
    "plate": rectangle(0.28, 0.2),
    "holes": Holes(np.array([[0.09, 0.0, 0.03], [-0.05, 0.08, 0.02]])),
}
STATION = np.array([-0.9, 0.5, 1.6])


def state_of(station=STATION, centre=(0.002, -0.003), rotation=0.05, thickness_m=0.012):
    """A state whose beams come from the station."""
    state = pointed(Prior.of(thickness_m, CONFIG).mean, station, np.array(centre))
    state[CENTRE], state[ROTATION] = centre, rotation
    return state


def scattered(count=3000, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.2, 0.2, (count, 2)), rng.uniform(-0.001, 0.15, count)


@pytest.mark.parametrize("name", OUTLINES)
def test_beams_run_from_the_station_through_their_points(name):
    """Where they meet the plane by the intersection of lines, and the target's axes there."""
    outline, state, (plane, depth) = OUTLINES[name], state_of(), scattered()
    beams = carry(plane, depth, state, outline)
    points = np.column_stack([plane, -depth])
    ray = points - STATION
    met = STATION + ray * (-STATION[2] / ray[:, 2])[:, None]
    np.testing.assert_allclose(met[:, 2], 0.0, atol=1e-15)
    np.testing.assert_allclose(beams.q_m, met[:, :2] - state[CENTRE], atol=1e-14)
    np.testing.assert_allclose(beams.shrink, STATION[2] / (STATION[2] + depth), rtol=1e-14)
    own = outline.closest(turned(met[:, :2] - state[CENTRE], -state[ROTATION]))
    np.testing.assert_allclose(beams.x_m, own.x_m, atol=1e-14)
    np.testing.assert_allclose(beams.rho, turned(own.normal, state[ROTATION]), atol=1e-14)
    np.testing.assert_array_equal(beams.clear, own.clear)
    np.testing.assert_allclose(beams.share, own.share, atol=1e-12)


@pytest.mark.parametrize("name", OUTLINES)
def test_a_beam_at_the_edge_is_as_far_inside_the_wall_as_tau_says(name):
    """By the distance of its place at the wall's foot from an outline of that depth."""
    outline, thickness_m = OUTLINES[name], 0.004
    state = state_of(thickness_m=thickness_m)
    plane, _ = scattered()
    beams = carry(plane, np.zeros(len(plane)), state, outline)
    away = np.abs(beams.x_m) + (0.0 if name == "plate" else beams.x_m)
    near = (np.abs(away) < 0.02) & (np.abs(beams.x_m) < 0.01) & beams.clear
    foot = beams.q_m[near] - beams.x_m[near, None] * beams.rho[near]
    along = (foot + state[CENTRE] - STATION[:2]) / STATION[2]
    lower = turned(foot + thickness_m * along, -state[ROTATION])
    inside = -outline.closest(lower).x_m
    bent = thickness_m**2 * float(state[BEAM] @ state[BEAM]) / (2.0 * outline.size_m)
    tolerance = 1e-12 if name == "plate" else 0.25 * bent  # the next power of T / R
    np.testing.assert_allclose(beams.tau[near] * thickness_m, inside, rtol=0, atol=tolerance)
    assert np.count_nonzero(near) > 100
    assert np.ptp(inside) > 10.0 * tolerance


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize(("slope", "thickness_m"), [(0.3, 0.012), (3.0, 0.012), (3.0, 0.05)])
def test_those_near_are_all_near_and_as_carried(name, slope, thickness_m):
    outline, (plane, depth) = OUTLINES[name], scattered()
    station, band_m = np.array([-slope, 0.4 * slope, 1.0]), (0.006, 0.004)
    state = state_of(station, thickness_m=thickness_m)
    state[GROWTH] = 0.002
    whole = carry(plane, depth, state, outline)
    rows, beams = carry_near(plane, depth, state, outline, band_m)
    for field, values in vars(whole).items():
        np.testing.assert_allclose(getattr(beams, field), values[rows], atol=1e-13)
    wall_m = np.maximum(whole.tau, 0.0) * np.exp(state[THICKNESS])
    wanted = (whole.x_m > -band_m[0]) & (whole.x_m < band_m[1] + wall_m)
    assert not np.setdiff1d(np.flatnonzero(wanted), rows).size
    assert whole.x_m[rows].min() > -band_m[0]
    bent = thickness_m * (1.16 * slope**2) / (2.0 * outline.size_m)
    run = bent + np.hypot(*(whole.q_m[rows] + state[CENTRE] - station[:2]).T).max()
    assert whole.x_m[rows].max() < band_m[1] + 2.0 * np.exp(state[THICKNESS]) * run
    assert 0 < np.count_nonzero(wanted) <= len(rows) <= len(plane)


def test_the_far_wall_of_a_hole_beside_the_centre_is_near():
    """Beams fan out: its wall is met more steeply than at the target's centre."""
    hole = Holes(np.array([[0.09, 0.0, 0.03]]))
    state = state_of(np.array([-0.08, 0.0, 0.4]), (0.0, 0.0), 0.0, thickness_m=0.03)
    plane = np.column_stack([np.linspace(0.095, 0.119, 200), np.zeros(200)])
    whole = carry(plane, np.zeros(200), state, hole)
    wanted = whole.x_m < 0.004 + whole.tau * 0.03
    rows, _ = carry_near(plane, np.zeros(200), state, hole, (0.006, 0.004))
    assert 100 < np.count_nonzero(wanted) < 180
    assert np.isin(np.flatnonzero(wanted), rows).all()


def test_some_beams_are_those_rows():
    beams = carry(*scattered(50), state_of(), OUTLINES["disc"])
    rows = np.array([3, 7, 40])
    for field, values in vars(beams).items():
        np.testing.assert_array_equal(getattr(beams.taken(rows), field), values[rows])


def test_a_wall_reflects_by_lambert_s_law_its_own_share_of_it():
    state, wall = state_of(), np.array([0.0, 0.3, 1.0, 2.0])
    for share in (0.0, 0.5, 1.0):
        state[WALL] = share
        shown, free = wall_reflectance(wall, state)
        np.testing.assert_allclose(shown, np.maximum((1 - share) + share * wall, LEAST_WALL))
        np.testing.assert_array_equal(free, (1 - share) + share * wall > LEAST_WALL)


def test_the_prior_s_mean_is_what_is_stated():
    config = CONFIG.model_copy(update={"spot_radius_m": 0.0021})
    known, unknown = Prior.of(0.013, config), Prior.of(None, config)
    for prior in (known, unknown):
        assert np.exp(prior.mean[SPOT]) == pytest.approx(0.0021)
        assert not prior.mean[[0, 1, 2, 3, RATIO, ROTATION]].any()
        assert np.all(prior.weight > 0.0)
    assert np.exp(known.mean[THICKNESS]) == pytest.approx(0.013)
    assert known.weight[THICKNESS] == pytest.approx(STATED_THICKNESS**-2)
    assert unknown.weight[THICKNESS] < 0.01 * known.weight[THICKNESS]
    assert 0.003 < np.exp(unknown.mean[THICKNESS]) < 0.02
    others = np.arange(STATE) != THICKNESS
    np.testing.assert_array_equal(known.weight[others], unknown.weight[others])
    assert np.exp(Prior.of(0.0, config).mean[THICKNESS]) > 0.0  # a foil


def test_a_station_s_uncertainty_is_propagated_to_the_beams():
    """The largest variance of their slope, and that of the inverse distance, by derivatives."""
    prior, state = Prior.of(0.01, CONFIG), state_of()
    seen, step_m = prior.seen_from(STATION, state), 1e-7
    columns = []
    for axis in np.eye(3):
        there = (pointed(state, STATION + s * step_m * axis, state[CENTRE]) for s in (1.0, -1.0))
        columns.append(np.subtract(*there) / (2.0 * step_m))
    by_station = np.stack(columns, axis=1) * STATION_M
    variance = by_station @ by_station.T
    largest = np.linalg.eigvalsh(variance[BEAM, BEAM]).max()
    np.testing.assert_allclose(1.0 / seen.weight[BEAM], largest, rtol=1e-6)
    assert 1.0 / seen.weight[INVERSE] == pytest.approx(variance[INVERSE, INVERSE], rel=1e-6)
    np.testing.assert_allclose(seen.mean[BEAM], (state[CENTRE] - STATION[:2]) / STATION[2])
    assert seen.mean[INVERSE] == pytest.approx(1.0 / STATION[2])
    rest = [0, 1, *range(5, STATE)]
    np.testing.assert_array_equal(seen.mean[rest], prior.mean[rest])
    np.testing.assert_array_equal(seen.weight[rest], prior.weight[rest])


def test_a_footprint_may_be_far_finer_than_set_but_not_far_wider():
    prior = Prior.of(0.01, CONFIG)
    power, intensity = prior.by_power(), prior.by_intensity()
    for far, sigma in ((-2.0, CLEAN_SPOT), (0.0, CLEAN_SPOT), (2.0, SPOT_LOG)):
        state = power.mean.copy()
        state[SPOT] += far
        assert power.towards(state).off(state) == pytest.approx((far / sigma) ** 2)
        assert intensity.towards(state).weight[SPOT] == pytest.approx(SPOT_LOG**-2)


def test_what_a_prior_holds_and_nothing_else():
    prior, state = Prior.of(0.01, CONFIG), state_of()
    before = prior.mean.copy(), prior.weight.copy()
    held, plain, power = prior.held(state), prior.plain(), prior.by_power()

    def others(*some):
        return np.setdiff1d(np.arange(STATE), some)

    for one, means, weights in (
        (held, (2, 3), (2, 3, THICKNESS)),
        (plain, (WALL,), (WALL, SHAPE, GROWTH)),
        (power, (WALL,), (WALL, SPOT, GROWTH)),
        (prior.unsized(), (), (GROWTH,)),
        (prior.doubted(), (), (THICKNESS,)),
    ):
        np.testing.assert_array_equal(one.mean[others(*means)], before[0][others(*means)])
        np.testing.assert_array_equal(one.weight[others(*weights)], before[1][others(*weights)])
    np.testing.assert_array_equal(held.mean[BEAM], state[BEAM])
    np.testing.assert_allclose(held.weight[BEAM], HELD_BEAM**-2)
    assert held.weight[THICKNESS] == pytest.approx(HELD_THICKNESS**-2)
    seen = prior.seen_from(STATION, state)
    np.testing.assert_array_equal(seen.held(state).weight[BEAM], seen.weight[BEAM])  # firmer
    assert plain.mean[WALL] == 0.0
    np.testing.assert_allclose(plain.weight[[WALL, SHAPE]], HELD_WALL**-2)
    assert power.mean[WALL] == LAMBERT == 1.0  # by definition
    assert power.weight[WALL] == pytest.approx(LAMBERT_SIGMA**-2)
    assert power.weight[SPOT] == pytest.approx(CLEAN_SPOT**-2)
    assert power.weight[SPOT] < prior.weight[SPOT]
    assert plain.weight[GROWTH] == pytest.approx(HELD_SIZE_M**-2)
    assert power.weight[GROWTH] == pytest.approx(SIZE_M**-2)
    assert prior.unsized().weight[GROWTH] == pytest.approx(WRONG_SIZE_M**-2)
    unknown = Prior.of(None, CONFIG)
    assert prior.doubted().weight[THICKNESS] == unknown.weight[THICKNESS]
    state[GROWTH] = 1e-4
    beside = Prior.beside(state, 2e-4, 30.0)
    assert beside.weight[CHAMFER] == pytest.approx(1.0 / (ALIKE_CHAMFER_M**2 + 2e-4**2))
    assert beside.weight[MODULATION] == pytest.approx(1.0 / (ALIKE_MODULATION**2 + 30.0**2))
    held = Prior.beside(state, HELD_SIZE_M, HELD_MODULATION)
    assert held.is_sharp
    assert held.is_of_means
    np.testing.assert_array_equal(beside.mean[others(GROWTH)], state[others(GROWTH)])
    for one in (prior, beside):
        assert one.weight[ROTATION] == pytest.approx(ROTATION_RAD**-2)
        assert one.mean[GROWTH] == 0.0  # each edge has a size of its own
        assert one.weight[GROWTH] == pytest.approx(SIZE_M**-2)
    assert np.all(beside.weight[[2, 3, INVERSE]] > prior.weight[[2, 3, INVERSE]])
    np.testing.assert_array_equal(prior.mean, before[0])
    np.testing.assert_array_equal(prior.weight, before[1])


def ring(count, seed=0, share=None, tau=0.4):
    """Beams about an edge, as many at any distance outside, and the depth of a tilted plane."""
    rng = np.random.default_rng(seed)
    x_m, share = rng.uniform(-0.01, 0.045, count), rng.random(count) if share is None else share
    depth = np.where(x_m > 0.0015, 0.08 + 0.9 * x_m + 0.01 * share, 0.0)
    depth = depth + rng.normal(0.0, 0.001, count)
    none = np.zeros((count, 2))
    tau = np.full(count, tau) * np.where(rng.random(count) < 0.5, 1.0, -1.0)
    whole = np.ones(count)
    return Beams(x_m, none, tau, whole, none, 0.0 * whole, share, whole > 0.0, 0.0 * whole), depth


def by_sectors(beams, depth, state):
    """Rows (depth, from, slope, spread, usable), sector by sector; NaN where it is empty."""
    wall = np.clip(beams.tau, 0.0, None) * np.exp(state[THICKNESS])
    beyond = beams.x_m - np.exp(state[SPOT]) - wall
    deep, outer_m, (each, least) = depth > MIN_DEPTH_M, RING_M[1], IN_SECTOR
    found = np.sum(deep & (beyond > RING_M[0]) & (beyond < RING_M[1]))
    if found < LEAST_IN_RING:
        wide = RING_M[0] + (RING_M[1] - RING_M[0]) * LEAST_IN_RING / max(found, 1)
        outer_m, (each, least) = min(wide, WIDEST_M), IN_SECTOR_SPARSE
    inside = deep & (beyond > RING_M[0]) & (beyond < outer_m)
    count = min(max(int(np.sum(inside)) // each, 12), 90)
    part, rows = np.floor(beams.share * count).astype(int), []

    def middle(values, share=0.5):
        return np.sort(values)[int(share * len(values))]

    for k in range(count):
        here = inside & (part == k)
        if not here.any():
            rows.append([np.nan, np.nan, 0.0, np.nan, False])
            continue
        far = here & (beyond > (RING_M[0] + outer_m) / 2.0)
        halves, slope = (here & ~far, far), 0.0
        if min(np.sum(half) for half in halves) >= LEAST_IN_HALF:
            (z0, z1), (x0, x1) = (
                [middle(values[half]) for half in halves] for values in (depth, beams.x_m)
            )
            slope = (z1 - z0) / (x1 - x0)
        from_m = middle(beams.x_m[here])
        rest = depth[here] - slope * (beams.x_m[here] - from_m)
        spread = (middle(rest, 0.75) - middle(rest, 0.25)) / 1.349
        few = np.sum(here) < SPARSE
        usable = np.sum(here) >= least
        usable &= spread < (MAX_SPREAD_SPARSE if few else MAX_SPREAD) * middle(rest)
        beside = (part == k) & (beyond > 0.0) & (beyond < NEXT_M)
        behind = middle(rest) + slope * (np.clip(beams.x_m[beside], 0.0, None) - from_m)
        behind = np.maximum(behind, MIN_DEPTH_M)
        off = np.abs(depth[beside] - behind) > np.maximum(OFF_ROUGH * spread, OFF_SHARE * behind)
        usable &= np.sum(off) < LEAST_OTHER or np.mean(off) <= MOST_OTHER
        rows.append([middle(rest), from_m, slope, spread, usable])
    return np.array(rows, dtype=float)


@pytest.mark.parametrize("count", [60, 300, 600, 1500, 8000])
def test_the_background_of_a_sector_is_a_line_through_medians(count):
    beams, depth = ring(count)
    if count == 1500:  # a rough third, and an empty one
        depth = np.where(beams.share < 0.3, depth * (1.0 + 3.0 * np.sin(1e5 * depth) ** 2), depth)
        depth[beams.share > 0.7] = 0.0
    state, next_m = state_of(), np.exp(state_of()[SPOT]) + 0.004
    if count == 8000:  # another surface beside the edge
        nearer = (beams.share > 0.4) & (beams.share < 0.6) & (beams.x_m < next_m)
        depth = np.where(nearer & (beams.x_m > 0.0), 0.05, depth)
    found, expected = look_up(beams, depth, state), by_sectors(beams, depth, state)
    assert len(found.usable) == len(expected)
    shown = np.isfinite(expected[:, 0])
    for column, name in enumerate(("depth_m", "from_m", "slope", "spread_m", "usable")):
        values = getattr(found, name)[shown]
        np.testing.assert_allclose(values, expected[shown, column], atol=1e-12, err_msg=name)
    assert not found.usable[~shown].any()
    assert np.any(found.slope) == (count > 100)
    if count == 8000:
        middle = (np.arange(len(found.usable)) + 0.5) / len(found.usable)
        beside = (middle > 0.41) & (middle < 0.59)
        assert np.mean(found.usable[beside]) < 0.7 < 0.9 < np.mean(found.usable[~beside])


def test_the_background_is_that_of_its_plane():
    beams, depth = ring(20_000)
    found = look_up(beams, depth, state_of())
    assert found.usable.all()
    part = found.sector(beams)
    outside = (beams.x_m > 0.003) & (beams.x_m < 0.02)
    shown, slope = found.at(part, beams.x_m)
    truth = 0.08 + 0.9 * beams.x_m + 0.01 * beams.share
    # Noise of 1 mm, medians of 30 points 5 mm apart: 0.06 of the slope in each of 90 sectors.
    assert np.sqrt(np.mean((shown - truth)[outside] ** 2)) < 0.002
    assert abs(np.mean(slope[outside]) - 0.9) < 0.04
    np.testing.assert_allclose(np.median(found.spread_m), 0.001, rtol=0.2)


def test_no_background_is_nearer_than_the_least():
    flat = Background(*(np.array([v]) for v in (0.001, 0.0, 0.0, 0.0)), np.array([True]))
    depth, _ = flat.at(np.zeros(1, dtype=np.int64), np.array([0.01]))
    assert depth[0] == MIN_DEPTH_M


def about(shares, ring_count, mixed_count, hidden=(), empty=()):
    """Beams: in each share of the edge so many on the target, and so many mixed pixels."""
    x, depth, share = [], [], []
    for k in np.setdiff1d(range(TWELFTHS), empty):
        mixed = 0 if k in hidden else mixed_count
        x += [np.full(ring_count, -0.004), np.full(mixed, 0.0005), np.repeat([0.002, 0.02], 10)]
        depth += [np.zeros(ring_count), np.full(mixed, 0.05), np.repeat([0.0, 0.1], 10)]
        share += [np.full(ring_count + mixed + 20, (k + 0.5) / TWELFTHS)]
    x, depth, share = (np.concatenate(values) for values in (x, depth, share))
    whole, none = np.ones(len(x)), np.zeros((len(x), 2))
    beams = Beams(x, none, 0.0 * whole, whole, none, 0.0 * whole, share, whole > 0.0, 0.0 * whole)
    one = np.ones(shares)
    back = Background(0.1 * one, 0.0 * one, 0.0 * one, 0.0 * one, one > 0.0)
    return mixed_share(beams, depth, back)


def test_the_share_of_mixed_pixels_is_that_of_the_middle_of_the_edge():
    assert about(24, 10, 6) == pytest.approx(0.6)
    assert about(24, 10, 6, hidden=range(5)) == pytest.approx(0.6)
    assert about(24, 10, 6, hidden=range(7)) == 0.0
    assert about(24, 2, 1) == pytest.approx(0.5)  # few: of all
    assert about(24, 2, 1, hidden=range(5)) == pytest.approx(0.5 * 7.0 / 12.0)
    assert about(24, 10, 6, empty=range(8)) == pytest.approx(0.6)  # of what is in the scan
    assert about(24, 10, 6, hidden=range(8, 10), empty=range(8)) == pytest.approx(0.3)
    assert about(24, 0, 1) == 12.0


@pytest.mark.parametrize(("depth", "x_m", "counts"), [(0.05, 0.0, True), (0.01, 0.0, False),
                                                      (0.09, 0.0, False), (0.05, 0.006, False),
                                                      (0.05, -0.006, False),
                                                      (0.01, 0.002, False)])  # fmt: skip
def test_a_mixed_pixel_lies_between_and_near_the_edge(depth, x_m, counts):
    x = np.array([x_m, -0.004, -0.004])
    z, whole, none = np.array([depth, 0.0, 0.0]), np.ones(3), np.zeros((3, 2))
    beams = Beams(
        x, none, 0.0 * whole, whole, none, 0.0 * whole, 0.5 * whole, whole > 0.0, 0.0 * whole
    )
    one = np.ones(1)
    back = Background(0.1 * one, 0.0 * one, 0.0 * one, 0.0 * one, one > 0.0)
    assert mixed_share(beams, z, back) == (0.5 if counts else 0.0)


@pytest.mark.parametrize(
    ("depth", "x_m", "behind_m", "spread_m", "usable", "counts"),
    [
        (0.05, 0.0, 0.1, 0.0, True, True),
        (0.05, 0.0019, 0.1, 0.0, True, True),
        (0.05, -0.0019, 0.1, 0.0, True, True),
        (0.05, 0.0021, 0.1, 0.0, True, None),
        (0.05, 0.0, 0.1, 0.0, False, None),
        (0.014, 0.0, 0.1, 0.0, True, False),  # the target's wall
        (0.016, 0.0, 0.1, 0.0, True, True),
        (0.016, 0.0, 0.024, 0.0, True, None),  # too near behind the wall
        (0.016, 0.0, 0.026, 0.0, True, True),
        (0.0905, 0.0, 0.1, 0.0, True, True),
        (0.0915, 0.0, 0.1, 0.0, True, False),  # 3 mm and 6 % of its depth before it
        (0.05, 0.0, 0.1, 0.015, True, True),
        (0.05, 0.0, 0.1, 0.016, True, False),  # rough
    ],
)
def test_of_few_points_those_between_both_sides_are_mixed(
    depth, x_m, behind_m, spread_m, usable, counts
):
    """As a share of those next to the edge: two others are on the target and on the background."""
    x, z = np.array([x_m, 0.001, 0.001]), np.array([depth, 0.0, behind_m])
    whole, none = np.ones(3), np.zeros((3, 2))
    part = np.array([0.25, 0.75, 0.75])
    beams = Beams(x, none, 0.0 * whole, whole, none, 0.0 * whole, part, whole > 0.0, 0.0 * whole)
    one = np.ones(2)
    back = Background(
        behind_m * one, 0.0 * one, 0.0 * one, spread_m * one, np.array([usable, True])
    )
    found = mixed_share_of_few(beams, z, back, 0.015)
    near = 3 if counts is not None else 2
    near = near if behind_m > 0.025 else 0
    assert found == (1.0 / near if counts else 0.0)
    assert mixed_share_of_few(beams, z, back, 1.0) == 0.0


def test_each_place_in_a_state_is_of_one_quantity():
    places = [*range(STATE)[CENTRE], *range(STATE)[BEAM], INVERSE]
    places += [SPOT, THICKNESS, RATIO, ROTATION, WALL, SHAPE, GROWTH, CHAMFER, MODULATION]
    places += range(STATE)[ELLIPSE]
    assert places == list(range(STATE))


@pytest.mark.parametrize("far_m", [0.2, 12.0, 30.0])
@pytest.mark.parametrize("continuous", [True, False])
def test_points_as_deep_as_a_surface_beyond_the_edge_are_not_mixed_pixels(continuous, far_m):
    """Half of the background is at half of the other's depth; mixed pixels lie at any.

    All beyond 5 m counted as of one surface: an edge before a hall was taken for a clean one.
    """
    rng = np.random.default_rng(4)
    state = Prior.of(0.01, CONFIG).mean
    state[BEAM], state[INVERSE] = 0.0, 0.0
    radius = 0.125 + rng.uniform(-0.02, 0.02, 60_000)
    angle = rng.uniform(0.0, 2.0 * np.pi, 60_000)
    plane = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    far = far_m * np.where(rng.random(60_000) < 0.3, 0.5, 1.0) + 2e-4 * rng.normal(size=60_000)
    beyond = radius - 0.125
    depth = np.where(beyond < 0.0, 0.0, far)
    if continuous:
        depth = far_m * np.clip(0.5 + beyond / 0.002, 0.0, 1.0)
    beams = carry(plane, depth, state, Circle(0.125))
    background = look_up(beams, depth, state)
    every = mixed_share(beams, depth, background)
    besides = mixed_share(beams, depth, background, besides_surfaces=True)
    assert every > 0.3
    assert besides == (pytest.approx(every, rel=0.05) if continuous else 0.0)


@pytest.mark.parametrize("behind_m", [0.0, 0.3])
def test_points_at_the_scanner_or_behind_it_lie_far_outside_every_edge(behind_m):
    state = Prior.of(0.01, CentreConfig()).mean
    state[INVERSE] = 2.0
    plane, depth = np.array([[0.01, 0.02], [0.01, 0.0]]), np.array([-0.5 - behind_m, 0.0])
    with np.errstate(all="raise"):
        at_scanner, on_face = outside_m(plane, depth, state, Circle(0.125))
    assert at_scanner > 1e3
    assert on_face == pytest.approx(-0.115)
