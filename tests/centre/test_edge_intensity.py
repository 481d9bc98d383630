"""Centres by the intensities of a target's own points, which fade over its edge."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from tests.centre.test_edge_iterations import ended
from tests.centre.test_edge_rows import DISC, PLATE, SIGMA_M, scene, state_of
from tests.support.parted_returns import PartedDisc
from wheelplane.centre import edge_centre
from wheelplane.centre.edge import clean_fit
from wheelplane.centre.edge.beams import (
    BEAM,
    CENTRE,
    CHAMFER,
    GROWTH,
    INVERSE,
    LIKELY_CHAMFER_M,
    ROTATION,
    SHAPE,
    SPOT,
    STATE,
    THICKNESS,
    U_CHAMFER_M,
    WALL,
    Prior,
    carry,
)
from wheelplane.centre.edge.clean_edge import target_depth_m
from wheelplane.centre.edge.clean_fit import EXPLAINED, FADING, SEEN
from wheelplane.centre.edge.edge_intensity import (
    EXPONENT,
    FADED,
    INNER_M,
    LEAST_INSIDE,
    LEAST_POWER,
    MOST_SPECKLE,
    ROUNDED,
    WHOLE,
    face_light,
    fading,
    intensity_equations,
    intensity_profile,
    relative_to_face,
    seen_fading,
    speckle,
)
from wheelplane.centre.edge.edge_residuals import (
    POINTING_M,
    SECTORS,
    EdgeProblem,
    profile_slopes,
    robust_weight,
)
from wheelplane.centre.edge.fit_edge import Aim, EdgeToFit, fit_edge, fit_intensities, square_on
from wheelplane.centre.edge_centre import ACROSS_BEAMS, ALONG_BEAMS, _by_backgrounds
from wheelplane.config import CentreConfig
from wheelplane.errors import NotMeasuredError
from wheelplane.targets import sector
from wheelplane.targets.outline import Circle, rectangle

CONFIG = CentreConfig()
THICKNESS_M = 0.01


def located(setup, seed, intensity=True, law=lambda power: power, config=CONFIG, chamfer_m=None):
    """Fit to one scan of a disc; law: what the scanner reports of a return's power."""
    points, power = setup.scan(seed)
    if intensity:
        points = np.column_stack([points, relative(setup, points, law(power))])
    return fitted(setup, points, config, chamfer_m)


def relative(setup, points, seen):
    """Intensities (N,) of points over that of the disc's face."""
    on_face = np.abs(points[:, 2]) < 3.0 * setup.noise_m
    light = face_light(points[on_face, :2], seen[on_face])
    assert light is not None
    return relative_to_face(points[:, :2], seen, light)


def fitted(setup, points, config=CONFIG, chamfer_m=None):
    """Fit to points of a disc and their intensities, from beams that are nearly right."""
    state = Prior.of(THICKNESS_M, config).mean
    state[BEAM], state[INVERSE] = np.array(setup.slope) + 0.01, 0.02
    begin = Aim(state)
    outline = Circle(setup.radius_m)
    return fit_edge(
        points, EdgeToFit(outline, THICKNESS_M, setup.noise_m, config, chamfer_m), begin
    )


def off_m(found, setup):
    """Without what the likeliest chamfer moves: the disc is sharp, and no file states it."""
    of_chamfer = LIKELY_CHAMFER_M / U_CHAMFER_M * (found.by_chamfer_m if found.exponent else 0.0)
    return found.centre_m - of_chamfer - setup.centre_m


@pytest.mark.slow
@pytest.mark.parametrize(
    "setup",
    [
        PartedDisc(),
        PartedDisc(side_rad=1.5),
        PartedDisc(side_rad=3.1, slope=(-0.1, 0.4)),
        PartedDisc(slope=(0.02, 0.01)),
        PartedDisc(returned="first"),
        PartedDisc(spot_m=0.0015),
        PartedDisc(spot_m=0.0045, radius_m=0.15),
    ],
)
def test_intensities_show_the_centre_whatever_is_behind(setup):
    """A background bright on one side moves where returns part by a fifth of the footprint."""
    seeds = range(3)
    found = [located(setup, seed) for seed in seeds]
    assert all(fit.exponent is not None and fit.converged for fit in found)
    off = np.array([off_m(fit, setup) for fit in found])
    u_m = np.array([math.sqrt(np.trace(fit.covariance_m2) / 2.0) for fit in found])
    assert np.hypot(*off.T).max() < 5e-5
    assert np.sqrt(np.mean(off**2)) < 2.0 * math.hypot(u_m.mean(), 0.004 * setup.spot_m)
    assert np.mean([fit.spot_m for fit in found]) == pytest.approx(setup.spot_m, rel=0.1)
    assert np.mean([fit.exponent for fit in found]) == pytest.approx(1.0, abs=0.35)
    blind = [located(setup, seed, intensity=False) for seed in seeds]
    assert all(fit.exponent is None and fit.clean_shift_m is not None for fit in blind)
    apart = np.array([off_m(fit, setup) for fit in blind])
    assert np.sqrt(np.mean(np.sum(apart**2, axis=1))) > 0.05 * setup.spot_m


@pytest.mark.slow
@pytest.mark.parametrize("side_rad", [0.0, 3.1])
def test_without_intensities_backgrounds_of_unlike_brightness_are_in_the_uncertainty(side_rad):
    """They move an edge all to one side, of which its own scatter shows a part."""
    alike = PartedDisc(bright=0.3, dark=0.3, side_rad=side_rad)
    unlike = PartedDisc(bright=0.5, dark=0.15, side_rad=side_rad)
    for setup in (alike, unlike):
        found = located(setup, 1, intensity=False, chamfer_m=0.0)
        covariance_m2 = found.covariance_m2 + _by_backgrounds(found)
        off = off_m(found, setup)
        assert off @ np.linalg.solve(covariance_m2, off) < 12.0
        assert (found.unlike_m > 1e-4) == (setup is unlike)


def test_outermost_points_may_lie_as_far_apart_as_unlike_backgrounds_move_them(monkeypatch):
    """By more than 2.5 mm from a plate's edges only another shape explains them."""
    found = located(PartedDisc(), 0, intensity=False)
    apart = SimpleNamespace(centre_m=found.centre_m + np.array([0.0, 0.0029]))
    monkeypatch.setattr(edge_centre, "fit_outline", lambda *args: apart)
    view = SimpleNamespace(config=CONFIG, spacing_m=0.0015, target=SimpleNamespace(chamfer=0.0))
    checked = np.zeros((0, 2)), rectangle(0.36, 0.24), view
    with pytest.raises(NotMeasuredError, match=r"lie 2\.9 mm apart"):
        edge_centre._model_variance(replace(found, unlike_m=0.0), *checked)
    assert edge_centre._model_variance(replace(found, unlike_m=5e-4), *checked) > 0.0


def test_backgrounds_move_a_centre_along_the_beams_more_than_across():
    found = located(PartedDisc(), 0, intensity=False)
    for beam in ([0.3, -0.4], [0.0, 0.0]):
        shares = _by_backgrounds(replace(found, beam=np.array(beam), unlike_m=2e-4)) / 4e-8
        across = np.array([0.8, 0.6])
        assert across @ shares @ across == pytest.approx(ACROSS_BEAMS**2)
        along = np.array([0.6, -0.8])
        expected = ALONG_BEAMS if beam[0] else ACROSS_BEAMS
        assert along @ shares @ along == pytest.approx(expected**2)


LAWS = {
    "root": np.sqrt,
    "square": np.square,
    "bytes": lambda power: np.round(200.0 * power),
    "logarithm": lambda power: 1.0 + 0.2 * np.log(np.maximum(power, 1e-3)),
    "offset": lambda power: 0.5 + power,
    "saturated": lambda power: np.minimum(power, 0.6),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_an_intensity_need_not_be_proportional_to_power(law):
    """Footprint and size that explain its law instead are alike all round."""
    setup = PartedDisc()
    found = located(setup, 0, law=LAWS[law])
    assert found.exponent is not None
    expected = {"root": 0.5, "square": 2.0, "bytes": 1.0}
    if law in expected:
        assert found.exponent == pytest.approx(expected[law], rel=0.15)
    assert np.hypot(*off_m(found, setup)) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [
        lambda power: np.ones(len(power)),
        lambda power: 1.0 + 0.1 * np.random.default_rng(0).normal(size=len(power)),
    ],
    ids=["alike", "noise"],
)
def test_intensities_that_do_not_fade_are_left_out(law):
    setup = PartedDisc()
    found, blind = located(setup, 0, law=law), located(setup, 0, intensity=False)
    assert found.exponent is None
    np.testing.assert_array_equal(found.centre_m, blind.centre_m)
    np.testing.assert_array_equal(found.covariance_m2, blind.covariance_m2)


def test_last_returns_end_inside_the_edge_all_round_but_where_they_are_the_walls():
    """A part of the footprint on the background decides, and not how bright that is."""
    setup = PartedDisc(returned="last", bright=0.4, dark=0.4, slope=(0.35, 0.1))
    found = located(setup, 0)
    assert found.exponent is None
    assert found.clean_shift_m < -0.5 * setup.spot_m
    off, covariance_m2 = off_m(found, setup), found.covariance_m2 + _by_backgrounds(found)
    assert off @ np.linalg.solve(covariance_m2, off) < 12.0
    assert np.hypot(*off) < 3e-4  # a wall 3.6 mm wide as seen, of which half would be 1.8 mm


@pytest.mark.parametrize("slope", [(0.01, -0.02), (0.25, -0.1)])
def test_nothing_needs_to_be_behind_the_edge(slope):
    """Nor anything to show the beams' direction, where these are nearly square to the target."""
    setup = PartedDisc(bright=0.0, dark=0.0, slope=slope)
    points, power = setup.scan(4)
    shown = power > 0.02
    points, power = points[shown], power[shown]
    light = face_light(points[:, :2], power)
    points = np.column_stack([points, relative_to_face(points[:, :2], power, light)])
    begin = square_on(THICKNESS_M, CONFIG, (np.zeros(2), 0.0))
    disc = Circle(setup.radius_m)
    found = fit_intensities(points, EdgeToFit(disc, THICKNESS_M, setup.noise_m, CONFIG), begin)
    if slope[0] > 0.2:
        assert found is None
        return
    assert np.hypot(*off_m(found, setup)) < 6e-5
    np.testing.assert_allclose(found.beam, slope, atol=0.06)
    blind = np.column_stack([points[:, :3], np.full(len(points), np.nan)])
    assert (
        fit_intensities(blind, EdgeToFit(disc, THICKNESS_M, setup.noise_m, CONFIG), begin) is None
    )


def lit_scene(outline, count=6000, thickness_m=0.012):
    """A problem whose intensities are those of its state, and that state."""
    state = state_of(thickness_m=thickness_m)
    state[EXPONENT], state[GROWTH] = math.log(1.3), 2e-4
    problem = scene(outline, state, count, mixed=False)
    return replace(problem, intensity=plain(problem, state, outline)), state


def plain(problem, state, outline):
    """Power of what face and wall return, by normal and semicircular distributions."""
    beams = carry(problem.plane, problem.depth, state, outline)
    run = state[BEAM] + state[INVERSE] * beams.q_m
    tau = -np.sum(beams.rho * run, axis=1) - beams.bent
    spot = np.exp(state[SPOT]) * np.sqrt(1.0 + tau**2)
    facing = np.maximum(tau, 0.0)
    places = [beams.x_m / spot, (beams.x_m - np.exp(state[THICKNESS]) * facing) / spot]
    bell = stats.truncnorm(-4.0, 4.0, scale=0.5)
    disc = stats.semicircular(scale=1.0)
    Fa, Fb = (
        (1.0 - state[SHAPE]) * disc.cdf(place) + state[SHAPE] * bell.cdf(place) for place in places
    )
    wall = np.maximum(1.0 + state[WALL] * (facing - 1.0), 0.02)
    power = 1.0 - Fa + wall * (Fa - Fb)
    return np.maximum(power, 1e-9) ** np.exp(state[EXPONENT])


@pytest.mark.parametrize("outline", [DISC, PLATE], ids=["disc", "plate"])
def test_rows_are_the_intensities_of_the_points_about_the_edge(outline):
    problem, state = lit_scene(outline)
    seen = problem.intensity + 0.02 * np.random.default_rng(1).normal(size=len(problem.depth))
    seen[::7] = np.nan
    linear = intensity_equations(replace(problem, intensity=seen), state, 0.03, True)
    beams, z = problem.beams(state), problem.depth
    before_m = 2.0 * np.exp(state[SPOT]) * math.sin(math.atan(float(np.hypot(*state[BEAM]))))
    front = beams.clear & (z > -5.0 * SIGMA_M - 1e-4 - before_m)
    front &= (z < target_depth_m(state, SIGMA_M)) & (beams.x_m + state[GROWTH] > -INNER_M)
    power = problem.intensity ** (1.0 / np.exp(state[EXPONENT]))
    rows = np.flatnonzero(front & np.isfinite(seen) & (power > LEAST_POWER))
    shown = slice(linear.depths, None)
    assert linear.depths == np.count_nonzero(front & (beams.x_m < 0.0))
    np.testing.assert_array_equal(linear.q_m[shown], beams.q_m[rows])
    rest = (seen - problem.intensity)[rows]
    np.testing.assert_allclose(linear.residual_m[shown], rest, atol=2e-4)
    run = -linear.slopes[shown, GROWTH]  # by x
    variance = (0.03 * problem.intensity[rows]) ** 2 + ROUNDED**2 + (run * POINTING_M) ** 2
    weight, change = robust_weight(rest**2 / variance, True)
    np.testing.assert_allclose(linear.weight[shown], weight / variance, rtol=0.02)
    np.testing.assert_allclose(linear.change[shown], change / variance, rtol=0.04, atol=3.0)
    way = state[BEAM] + state[INVERSE] * beams.q_m[rows]
    lower = -np.sum(beams.rho[rows] * way, axis=1) - beams.bent[rows]
    np.testing.assert_allclose(
        linear.by_height[shown], -run * lower * beams.shrink[rows], rtol=2e-3, atol=0.06
    )
    assert np.ptp(run) > 100.0
    assert linear.behind == 0


@pytest.mark.parametrize("chamfer_m", [0.0, 5e-4])
def test_slopes_are_those_of_central_differences(chamfer_m):
    """Seen from afar, x and tau depend on the state alone, as in the slopes.

    The footprint grows with tau, which is left out: the beams are nearly square to the target.
    """
    state = state_of((-12.0, 7.0, 180.0), rotation=0.02)
    state[EXPONENT], state[CHAMFER] = math.log(0.8), chamfer_m
    problem = scene(PLATE, state, 9000, mixed=False)
    problem = replace(problem, intensity=np.ones(len(problem.depth)))
    beams = problem.beams(state)
    chosen = np.flatnonzero(beams.clear & (np.abs(beams.x_m) < 0.8 * np.exp(state[SPOT])))

    def profile(at):
        there = carry(problem.plane, problem.depth, at, PLATE)
        return there.taken(chosen), intensity_profile(there.taken(chosen), at)

    there, here = profile(state)
    slopes = profile_slopes(here, there, problem.depth[chosen], state)
    for index in (0, 1, 2, 3, SPOT, THICKNESS, EXPONENT, ROTATION, WALL, SHAPE, GROWTH, CHAMFER):
        step = np.zeros(STATE)
        step[index] = 1e-7 if index in (0, 1, ROTATION, GROWTH, CHAMFER) else 1e-5
        ahead, behind = (profile(state + sign * step)[1].depth_m for sign in (1.0, -1.0))
        moved, shown = (ahead - behind) / (2.0 * step[index]), slopes[:, index]
        size = np.linalg.norm(shown)
        assert np.linalg.norm(moved - shown) < 0.03 * size, index
        assert size > 1e-6


def test_an_intensity_is_that_of_the_face_there():
    """Its brightness is a plane, whatever one in ten of its points is; in any unit."""
    rng = np.random.default_rng(0)
    plane = rng.uniform(-0.15, 0.15, (3000, 2))
    level = 40.0 * (1.0 + plane @ [0.4, -0.7])
    relative = 1.0 + 0.05 * rng.normal(size=3000)
    relative[::20] = 0.4
    intensity = (level * relative).astype(np.float32)
    intensity[5], intensity[8] = np.nan, np.nan
    found = relative_to_face(plane, intensity, face_light(plane[::2], intensity[::2]))
    known = np.isfinite(intensity)
    np.testing.assert_allclose(found[known], relative[known], rtol=0.01)
    assert np.isnan(found[[5, 8]]).all()
    other = relative_to_face(plane, 7.0 * intensity, face_light(plane[::2], 7.0 * intensity[::2]))
    np.testing.assert_allclose(other[known], found[known], rtol=1e-6)
    assert np.isnan(relative_to_face(plane, intensity, np.array([-1.0, 0.0, 0.0]))).all()


@pytest.mark.parametrize("kind", ["print", "negative", "few", "rough", "none"])
def test_a_face_of_no_one_brightness_has_no_relative_intensities(kind):
    rng = np.random.default_rng(0)
    plane = rng.uniform(-0.15, 0.15, (2000, 2))
    intensity = 1.0 + 0.03 * rng.normal(size=2000)
    if kind == "print":
        intensity = np.where(np.floor(plane[:, 0] / 0.02) % 2 == 0, 1.0, 0.1)
    elif kind == "negative":
        intensity = -intensity
    elif kind == "few":
        intensity[23:] = np.nan
    elif kind == "rough":
        intensity = 1.0 + 1.3 * MOST_SPECKLE * rng.normal(size=2000)
    else:
        intensity = np.full(2000, np.nan)
    assert face_light(plane, intensity) is None
    shown = 1.0 + 0.03 * rng.normal(size=2000)
    assert face_light(plane, shown) is not None


def test_speckle_is_the_scatter_inside_the_edge():
    problem, state = lit_scene(DISC)
    beams = problem.beams(state)
    inside = beams.x_m < -WHOLE * np.exp(state[SPOT])
    inside &= np.abs(problem.depth) < 5.0 * SIGMA_M + 1e-4
    rng = np.random.default_rng(2)
    seen = np.where(inside, 1.0 + 0.07 * rng.normal(size=len(inside)), 0.2)
    assert speckle(replace(problem, intensity=seen), state) == pytest.approx(0.07, rel=0.1)
    rows = np.flatnonzero(inside)
    for count, known in ((LEAST_INSIDE, True), (LEAST_INSIDE - 1, False)):
        few = np.full(len(seen), np.nan)
        few[rows[:count]] = seen[rows[:count]]
        assert (speckle(replace(problem, intensity=few), state) is not None) == known
    assert speckle(replace(problem, intensity=None), state) is None


def test_fading_is_the_share_of_sectors_and_what_is_explained():
    problem, state = lit_scene(DISC, 20_000)
    front, explained = fading(problem, state)
    assert front > 0.85
    assert explained == pytest.approx(1.0, abs=1e-3)
    alike = replace(problem, intensity=np.ones(len(problem.depth)))
    assert fading(alike, state) == (front, 0.0)
    part = sector(problem.beams(state).share, SECTORS)
    half, other = (np.where(side, problem.intensity, np.nan) for side in (part < 12, part >= 12))
    shares = [fading(replace(problem, intensity=seen), state)[0] for seen in (half, other)]
    assert sum(shares) == pytest.approx(front)
    assert max(shares) <= 0.5
    grey = np.where(problem.intensity < FADED, FADED, problem.intensity)
    faded = (problem.intensity < FADED) & np.isfinite(grey)
    assert faded.any()
    assert fading(replace(problem, intensity=grey), state)[1] < 0.9


def test_the_fit_keeps_where_its_returns_part():
    """The reflectance ratio is that of the background; a clean fit's shift is not its own."""
    found = located(PartedDisc(), 0)
    assert found.clean_shift_m is None
    assert found.is_clean
    assert 0.05 < found.reflectance_ratio < 1.0
    assert found.state[CENTRE].tolist() == found.centre_m.tolist()


def test_a_wall_of_another_brightness_is_no_fading():
    """To a camera it is darker all over: two brightnesses explain that as well as any footprint.

    The hole of a ring was 0.12 mm off at a u of 0.013 by walls of 0.7 times the face's brightness.
    """
    setup, rng = PartedDisc(spot_m=1e-4, noise_m=1e-4), np.random.default_rng(3)
    points, disc = setup.scan(3)[0], Circle(setup.radius_m)
    state = Prior.of(THICKNESS_M, CONFIG).mean
    state[CENTRE], state[BEAM], state[INVERSE] = setup.centre_m, setup.slope, 0.0
    state[SPOT], state[WALL], state[EXPONENT] = math.log(1e-4), 0.3, 0.0
    plane, depth = np.asfortranarray(points[:, :2]), -points[:, 2]
    on_wall = (depth > 1e-3) & (depth < THICKNESS_M + 1e-3)
    seen = np.where(on_wall, 0.75, 1.0) + 0.03 * rng.normal(size=len(depth))
    problem = EdgeProblem(plane, depth, Prior.of(THICKNESS_M, CONFIG), disc, setup.noise_m)
    assert np.count_nonzero(on_wall) > 50
    assert fading(replace(problem, intensity=seen), state)[1] < EXPLAINED - 0.2
    faded, there = lit_scene(DISC, 20_000)
    seen = faded.intensity + 0.03 * rng.normal(size=len(faded.depth))
    assert fading(replace(faded, intensity=seen), there)[1] > EXPLAINED + 0.1


@pytest.mark.parametrize("far", [0.9, 1.1])
def test_a_fit_needs_single_intensities_that_fade_on_the_far_side(monkeypatch, far):
    """In as many sectors of it as half of those in which a fit must: there no wall is darker."""
    problem, state = lit_scene(DISC, 40_000)
    beams = problem.beams(state)
    part = sector(beams.share, SECTORS)
    away = np.flatnonzero(np.bincount(part, beams.tau, SECTORS) < 0.0)
    count = math.ceil(far * SEEN * FADING * len(away)) - (far < 1.0)
    dark = ~np.isin(part, away) | np.isin(part, away[:count])
    seen = np.where(dark, problem.intensity, 1.0)
    shown = replace(problem, intensity=seen)
    assert (seen_fading(shown, state) >= SEEN * FADING) == (far > 1.0)
    fits = []

    def iterated(linearise, problem, state, most, damped):
        fits.append(state)
        return ended()

    monkeypatch.setattr(clean_fit, "_iterated", iterated)
    monkeypatch.setattr(clean_fit, "fading", lambda *args: (0.0, 0.0))
    assert clean_fit.by_intensity(shown, state, 40) is None
    assert len(fits) == (far > 1.0)
