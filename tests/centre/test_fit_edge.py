"""The edge fit and its start: centre, beams and footprint are those of the scene."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.centre.test_edge_iterations import RECORD
from tests.support.scenes import Setup, Sheet, Wall, make
from wheelplane.centre.edge import fit_edge as module
from wheelplane.centre.edge.beam_direction import (
    first_beam,
    has_background,
    is_contradicted,
    seen_through,
)
from wheelplane.centre.edge.beams import BEAM, CENTRE, INVERSE, RATIO, Background, Prior
from wheelplane.centre.edge.edge_residuals import (
    LEAST_POINTED,
    LEAST_POINTING_M,
    POINTING_M,
    EdgeProblem,
    Zones,
    equations,
    pointing_m,
    predicted,
    spread,
    zone_scatter,
)
from wheelplane.centre.edge.fit_edge import Aim, EdgeToFit, aimed, fit_edge, look_behind
from wheelplane.centre.edge.mixed_fit import DIFFERENT, _solved
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, rectangle
from wheelplane.vectors import turned

CONFIG = CentreConfig()
PLAIN = Setup(
    spacing_m=0.002, half_width_m=0.2, pairs=12, noise_m=0.0003, turned=False, shift_m=(0, 0, 0)
)
SCENES = {
    "disc": (Circle(0.125), PLAIN),
    "rectangle": (rectangle(0.28, 0.2), PLAIN.but(half_m=(0.14, 0.1))),
}
START = np.zeros(2), 0.0


@functools.cache
def scanned(name, **changes):
    """Outline, points (N, 3) in the target's own axes, station (3,)."""
    outline, setup = SCENES[name]
    cloud = make(setup.but(**changes), 4)
    return outline, cloud.points_m, cloud.viewpoint_m


def true_state(station):
    state = Prior.of(0.01, CONFIG).mean
    state[BEAM], state[INVERSE] = -station[:2] / station[2], 1.0 / station[2]
    return state


def fitted(outline, points):
    begin = aimed(points, outline, 0.01, CONFIG)
    return fit_edge(points, EdgeToFit(outline, 0.01, 0.0003, CONFIG), begin)


@pytest.mark.parametrize("incidence", [5.0, 25.0])
@pytest.mark.parametrize("name", SCENES)
def test_the_background_shows_the_direction_of_the_beams(name, incidence):
    outline, points, station = scanned(name, incidence_deg=incidence)
    truth = true_state(station)
    found = first_beam(points[:, :2], -points[:, 2], Prior.of(0.01, CONFIG).mean, outline)
    np.testing.assert_allclose(found[BEAM], truth[BEAM], atol=0.04)
    if incidence > 10.0:
        assert np.hypot(*truth[BEAM]) > 0.4  # so no direction at all is wrong


@pytest.mark.parametrize("name", SCENES)
def test_background_is_seen_through_the_target_along_wrong_beams_only(name):
    outline, points, station = scanned(name, incidence_deg=25.0)
    plane, depth = points[:, :2], -points[:, 2]
    right, wrong = true_state(station), true_state(station)
    wrong[BEAM] *= -1.0
    assert has_background(plane, depth, right, outline)
    assert seen_through(plane, depth, right, outline) < 0.02
    assert not is_contradicted(plane, depth, right, outline)
    assert is_contradicted(plane, depth, wrong, outline)
    steep = right.copy()
    steep[BEAM] = [5.0, 0.0]
    assert is_contradicted(plane, depth, steep, outline)


def test_what_is_seen_through_is_a_share_and_no_number():
    outline, points, station = scanned("disc", incidence_deg=25.0)
    plane, depth, wrong = points[:, :2], -points[:, 2], true_state(station)
    wrong[BEAM] *= -1.0
    once = seen_through(plane, depth, wrong, outline)
    twice = seen_through(np.tile(plane, (2, 1)), np.tile(depth, 2), wrong, outline)
    assert 0.0 < once == twice


@pytest.mark.parametrize("x_m", [-0.01, 0.002, 0.02])
def test_the_slope_of_a_background_is_that_of_its_depth(x_m):
    rng = np.random.default_rng(1)
    background = Background(
        rng.uniform(0.1, 0.3, 3), np.full(3, 0.005), rng.normal(size=3), np.zeros(3), np.ones(3) > 0
    )
    part, step_m = np.arange(3), 1e-6
    low, high = (background.at(part, np.full(3, x_m + s * step_m))[0] for s in (-1.0, 1.0))
    _, slope = background.at(part, np.full(3, x_m))
    np.testing.assert_allclose(slope, (high - low) / (2.0 * step_m), atol=1e-6)
    assert np.any(slope) == (x_m > 0.0)


@pytest.mark.parametrize("name", SCENES)
def test_without_a_background_nothing_shows_the_beams_and_nothing_is_fitted(name):
    outline, points, station = scanned(name, background_m=None)
    plane, depth = points[:, :2], -points[:, 2]
    assert not has_background(plane, depth, true_state(station), outline)
    assert seen_through(plane, depth, true_state(station), outline) == np.inf
    assert not is_contradicted(plane, depth, true_state(station), outline)
    assert aimed(points, outline, 0.01, CONFIG) is None
    assert (
        fit_edge(points, EdgeToFit(outline, 0.01, 0.0003, CONFIG), Aim(true_state(station))) is None
    )
    assert not look_behind(points, outline, CONFIG, START, None).seen


@pytest.mark.parametrize("name", SCENES)
def test_a_stated_station_is_believed_unless_the_background_contradicts_it(name):
    outline, points, station = scanned(name, incidence_deg=25.0)
    truth = true_state(station)
    begin = aimed(points, outline, 0.01, CONFIG, START, station)
    np.testing.assert_allclose(begin.state[BEAM], truth[BEAM], rtol=1e-12)
    assert begin.state[INVERSE] == pytest.approx(truth[INVERSE])
    assert begin.station is station
    mirrored = station * [-1.0, -1.0, 1.0]
    instead = aimed(points, outline, 0.01, CONFIG, START, mirrored)
    np.testing.assert_allclose(instead.state[BEAM], truth[BEAM], atol=0.04)
    assert instead.station is None
    behind = look_behind(points, outline, CONFIG, START, instead.state)
    np.testing.assert_array_equal(behind.beam, instead.state[BEAM])


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_known_station_makes_the_centre_of_few_points_more_certain(name):
    """The station is stated 5 mm off in each axis, as its standard uncertainty allows."""
    outline, setup = SCENES[name]
    rng = np.random.default_rng(0)
    found = {"unknown": [], "known": []}
    for seed in range(30):
        cloud = make(setup.but(spacing_m=0.0128, incidence_deg=20.0, noise_m=0.0008), seed)
        stated = cloud.viewpoint_m + 0.005 * rng.normal(size=3)
        for known, station in (("unknown", None), ("known", stated)):
            begin = aimed(cloud.points_m, outline, 0.01, CONFIG, START, station)
            fit = fit_edge(cloud.points_m, EdgeToFit(outline, 0.01, 0.0008, CONFIG), begin)
            if fit is not None:
                u_m = np.sqrt(np.diag(fit.covariance_m2))
                found[known].append(np.stack([fit.centre_m, u_m]))
    error, u = (np.stack([np.stack(rows)[:, k] for rows in found.values()]) for k in (0, 1))
    rms = np.sqrt(np.mean(error**2, axis=(1, 2)))
    assert rms[1] < 0.9 * rms[0]
    assert np.median(u[1]) < 0.85 * np.median(u[0])
    assert np.mean(np.abs(error[1]) < 1.96 * u[1]) > 0.92


@pytest.mark.parametrize("name", SCENES)
def test_the_fit_finds_centre_beams_footprint_and_thickness(name):
    outline, points, station = scanned(name)
    found = fitted(outline, points)
    truth = true_state(station)
    assert found.converged
    assert found.misfit < 0.05
    u = math.sqrt(np.trace(found.covariance_m2) / 2.0)
    assert np.hypot(*found.centre_m) < min(4.0 * u, 6e-5)
    np.testing.assert_allclose(found.beam, truth[BEAM], atol=0.02)
    assert found.spot_m == pytest.approx(0.0015, rel=0.1)
    assert found.thickness_m == pytest.approx(0.01, rel=0.1)
    assert found.reflectance_ratio == pytest.approx(1.0, rel=0.1)
    assert abs(found.rotation_rad) < (1e-12 if name == "disc" else 1e-3)


@pytest.mark.parametrize("name", SCENES)
def test_the_fit_moves_and_rotates_with_the_points(name):
    outline, points, _ = scanned(name)
    here = fitted(outline, points)
    shift, angle = np.array([0.002, -0.003]), 0.02
    uv = turned(points[:, :2], angle) + shift
    moved = np.random.default_rng(0).permutation(np.column_stack([uv, points[:, 2]]))
    there = fitted(outline, moved)
    expected = turned(here.centre_m[None], angle)[0] + shift
    np.testing.assert_allclose(there.centre_m, expected, atol=2e-5)
    np.testing.assert_allclose(there.beam, turned(here.beam[None], angle)[0], atol=2e-3)
    if outline.shows_rotation:
        assert there.rotation_rad == pytest.approx(here.rotation_rad + angle, abs=2e-4)


def test_a_plane_that_is_too_high_moves_the_centre_as_the_derivative_says():
    outline, points, _ = scanned("disc", incidence_deg=25.0)

    def sharp(points):
        config = CONFIG.model_copy(update={"ambiguity_m": 0.0})
        begin = aimed(points, outline, 0.01, config)
        return fit_edge(points, EdgeToFit(outline, 0.01, 0.0003, config, chamfer_m=0.0), begin)

    here, lift = sharp(points), 5e-5
    up, down = (sharp(points - [0.0, 0.0, way * lift]) for way in (1.0, -1.0))
    np.testing.assert_allclose(
        (up.centre_m - down.centre_m) / 2.0, here.by_plane[:, 0] * lift, atol=1e-6
    )
    assert np.hypot(*here.by_plane[:, 0]) * lift > 4e-6  # so no derivative at all fails


def test_a_scanner_that_filters_mixed_pixels_shows_the_edge_in_the_middle_of_the_gap():
    outline, points, station = scanned("disc", filtered=True)
    found = fit_edge(points, EdgeToFit(outline, 0.01, 0.0003, CONFIG), Aim(true_state(station)))
    assert found.clean_shift_m < -0.5e-3
    u_m = math.sqrt(np.trace(found.covariance_m2))
    off_m = np.hypot(*(found.centre_m - true_state(station)[CENTRE]))
    assert off_m < 3.72 * math.hypot(u_m, 0.4 * np.hypot(*found.by_thickness_m))
    assert off_m < 3e-4


def test_the_state_is_what_the_fit_says():
    outline, points, _ = scanned("disc")
    found = fitted(outline, points)
    np.testing.assert_array_equal(found.state[CENTRE], found.centre_m)
    edge = EdgeToFit(outline, 0.01, 0.0003, CONFIG)
    again = fit_edge(points, edge, found)  # as another edge's fit
    np.testing.assert_allclose(again.centre_m, found.centre_m, atol=1e-5)


def test_a_dark_wall_moves_no_centre():
    """A wall as bright as the face would move the centre along the beams by 0.1 mm."""
    dark = (Wall(0.125, 0.01, echo=0.25),)
    outline, points, _ = scanned("disc", thickness_m=1e-5, extra=dark, background_echo=0.6)
    found = fitted(outline, points)
    u = math.sqrt(np.trace(found.covariance_m2) / 2.0)
    assert np.hypot(*found.centre_m) < min(4.0 * u, 6e-5)
    steep = float(np.hypot(*found.beam))
    assert 1.0 + found.wall * (steep - 1.0) == pytest.approx(0.25, abs=0.15)
    assert found.reflectance_ratio == pytest.approx(0.6, rel=0.15)


def at_truth(**changes):
    outline, points, station = scanned("disc", **changes)
    state, prior = true_state(station), Prior.of(0.01, CONFIG)
    problem = EdgeProblem(points[:, :2], -points[:, 2], prior, outline, 0.0003)
    background = problem.background(state)
    return outline, prior, equations(problem, background, state, Zones.alike(), True, True)


def test_residuals_where_the_influence_falls_do_not_take_all_information():
    outline, prior, linear = at_truth()
    u_m = [
        math.sqrt(
            np.trace(spread(replace(linear, change=change), outline, prior)[0][CENTRE, CENTRE])
        )
        for change in (linear.weight, 0.0 * linear.change, -linear.change)
    ]
    assert u_m[0] < u_m[1] < 4.0 * u_m[0]
    assert u_m[2] < 4.0 * u_m[0]


def scatter_of_zones(**changes):
    outline, points, station = scanned("disc", **changes)
    prior = Prior.of(0.01, CONFIG)
    points = np.random.default_rng(0).permutation(points)
    problem = EdgeProblem(points[:, :2], -points[:, 2], prior, outline, 0.0003)
    return zone_scatter(_solved(problem, true_state(station), Zones.alike(), 40).equations, prior)


@pytest.mark.parametrize(
    ("pointing", "shown"),
    [(2e-5, LEAST_POINTING_M), (1.15e-4, 1.15e-4), (1.35e-4, 1.35e-4), (3e-4, POINTING_M)],
)
def test_mixed_pixels_show_how_well_beams_point(pointing, shown):
    """Between the limits of what beams may have; strays do not count."""
    outline, points, station = scanned("disc")
    state, rng = true_state(station), np.random.default_rng(5)
    problem = EdgeProblem(points[:, :2], -points[:, 2], Prior.of(0.01, CONFIG), outline, 0.0003)
    background, zones = problem.background(state), Zones.alike()
    depth = problem.depth.copy()
    profile, _ = predicted(
        problem,
        problem.beams(state).taken(background.rows),
        background.part,
        background,
        state,
        zones,
    )
    off = 0.0003 * rng.normal(size=(len(profile.depth_m))) + profile.d_x * pointing * rng.normal(
        size=len(profile.depth_m)
    )
    depth[background.rows] = profile.depth_m + off
    strays = rng.choice(background.rows, len(background.rows) // 30)
    depth[strays] = rng.uniform(0.0, 0.08, len(strays))
    q = problem.beams(state).q_m
    plane = (
        state[CENTRE] + q * (1.0 + state[INVERSE] * depth)[:, None] + np.outer(depth, state[BEAM])
    )
    made = replace(problem, plane=plane, depth=depth)
    assert pointing_m(made, background, state, zones) == pytest.approx(shown, rel=0.1)
    few = background.of_some(LEAST_POINTED)
    assert pointing_m(made, few, state, zones) == problem.pointing_m


def test_a_reflectance_ratio_that_is_off_is_no_scatter_of_zones():
    _, prior, linear = at_truth()
    off = linear.residual_m + 0.05 * linear.slopes[:, RATIO]
    apart = zone_scatter(replace(linear, residual_m=off), prior) - zone_scatter(linear, prior)
    assert abs(apart) < 0.01


def test_backgrounds_of_one_brightness_do_not_differ():
    dark = Sheet((0.2, 0.0, -0.0799), half=(0.2, 0.4), echo=0.3)
    assert scatter_of_zones(background_tilt_deg=0.0) < DIFFERENT / 3.0
    assert scatter_of_zones(background_tilt_deg=0.0, extra=(dark,)) > DIFFERENT


@pytest.mark.parametrize(
    ("mixed", "loss", "by_pixels"),
    [(0.16, 9.0, True), (0.14, 0.49, True), (0.14, 0.51, False), (0.02, 0.0, False)],
)
def test_few_points_are_mixed_where_some_lie_between_or_a_fit_explains_them(
    monkeypatch, mixed, loss, by_pixels
):
    fitted, clean = (replace(RECORD, loss=loss), replace(RECORD, clean_shift_m=0.0))
    monkeypatch.setattr(module, "mixed_share_of_few", lambda *args: mixed)
    monkeypatch.setattr(module, "fit_mixed", lambda *args: fitted)
    monkeypatch.setattr(module, "fit_clean", lambda *args: clean)
    outline, points, station = scanned("disc", spacing_m=0.0125)
    begin = aimed(points, outline, 0.01, CONFIG, START, station)
    found = fit_edge(points, EdgeToFit(outline, 0.01, 2e-4, CONFIG), begin)
    assert found is (fitted if by_pixels else clean)
    monkeypatch.setattr(module, "fit_clean", lambda *args: None)
    assert fit_edge(points, EdgeToFit(outline, 0.01, 2e-4, CONFIG), begin) is fitted


def through_an_opening(seed, beyond_m, near_m=0.1, deep_m=0.44):
    """Centre's error over u along u and v of a disc before a wheel: openings and a spoke's end.

    Some of the edge has the deep of an opening behind it, and a rim that reaches as far beyond it.
    """
    rim = Sheet((0.0, 0.0, -near_m), outer=0.125 + beyond_m, inner=0.05)
    face = Sheet((-0.12, 0.0, -near_m), half=(0.14, 0.3))
    setup = PLAIN.but(
        background_m=deep_m, background_tilt_deg=0.0, extra=(rim, face), incidence_deg=4.0
    )
    cloud = make(setup, seed)
    found = fitted(Circle(0.125), cloud.points_m)
    return found.centre_m / np.sqrt(np.diag(found.covariance_m2)), found


@pytest.mark.parametrize("beyond_m", [0.004, 0.005, 0.007])
def test_a_rim_that_ends_just_beyond_the_edge_moves_no_centre(beyond_m):
    """It hides the opening behind it next to the edge, whose depth is that of most beyond."""
    squares, variances = 0.0, []
    for seed in range(4):
        off, found = through_an_opening(seed, beyond_m)
        squares += float(np.sum(off**2))
        variances.append(np.trace(found.covariance_m2) / 2.0)
        assert found.converged
    assert np.sqrt(np.mean(variances)) < 4e-5  # 6e-5 by that depth
    assert squares < stats.chi2.ppf(0.9995, 8)
