"""Centres by scanners that report the mean, the strongest or the first of a footprint's returns.

A footprint is 80 strips across the edge, each of which meets face, wall or background.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from wheelplane.centre.edge.beams import BEAM, RATIO, SPOT, THICKNESS, Prior, pointed
from wheelplane.centre.edge.clean_fit import BY_WALL, ERODED, LIKELY, _shares
from wheelplane.centre.edge.fit_edge import Aim, EdgeToFit, _reach_m, aimed, fit_edge, look_behind
from wheelplane.centre.edge.mixed_fit import LEAST, RIDGE, STEEP, _diverged, _is_strange
from wheelplane.centre.edge.solution import CONVERGED_M, SETTLED, EdgeFit, Solution, settled
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, Holes, rectangle
from wheelplane.vectors import turned

CONFIG, NOISE_M, SPOT_M = CentreConfig(), 3e-4, 0.0015
OUTLINES = {
    "disc": Circle(0.12),
    "plate": rectangle(0.28, 0.2),
    "holes": Holes(np.array([[0.09, 0.0, 0.03], [-0.05, 0.08, 0.03], [-0.05, -0.08, 0.03]])),
}
CENTRE_M, ROTATED, STATION = np.array([0.002, -0.001]), 0.01, np.array([-0.7, 0.4, 1.8])


@functools.cache
def scanned(
    name,
    returned="mean",
    spacing_m=0.002,
    thickness_m=0.01,
    echo=0.8,
    dim=1.0,
    station=tuple(STATION),
    seed=0,
    hidden=0.0,
):
    """Points (N, 3) about an outline; dim: 0 of a wall as bright as the face, 1 of Lambert's."""
    rng, outline, station = np.random.default_rng(seed), OUTLINES[name], np.array(station)
    steps = np.arange(-0.2, 0.2, spacing_m)
    q = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + spacing_m * rng.random(2)
    q = turned(q, 0.4)
    closest = outline.closest(turned(q, -ROTATED))
    near = np.abs(closest.x_m) < 0.04
    q, closest = q[near], outline.closest(turned(q[near], -ROTATED))
    slope = (q + CENTRE_M - station[:2]) / station[2]
    normal = turned(closest.normal, ROTATED)
    tau = -np.sum(normal * slope, axis=1)
    u = (np.arange(80) + 0.5) / 40.0 - 1.0
    across = SPOT_M * np.sqrt(1.0 + tau**2)[:, None] * u
    there = closest.x_m[:, None] + across
    aside = np.sum(slope**2, axis=1) - np.sum(normal * slope, axis=1) ** 2
    wall_m = _wall_depth_m(there, tau[:, None], (closest.bend * aside)[:, None])
    face, behind = there < 0.0, (there >= 0.0) & (wall_m >= thickness_m)
    wall = ~face & ~behind
    depth = np.where(wall, wall_m, 0.0)
    far = 0.1 + 0.1 * q[:, 0]
    depth = np.where(behind, far[:, None], depth)
    square = np.sum(slope**2, axis=1)
    depth = depth - (tau / (1.0 + square))[:, None] * across  # strips beside the beam's axis
    light = np.where(face, 1.0, np.where(behind, echo, 1.0 + dim * (tau[:, None] - 1.0)))
    power = np.clip(light, 1e-3, None) * np.sqrt(1.0 - u * u)
    front, back = (np.sum(power * part, axis=1) for part in (~behind, behind))
    if returned == "mean":
        z = np.sum(power * depth, axis=1) / np.sum(power, axis=1)
    else:
        disc = np.sqrt(1.0 - u * u)
        part = np.sum(disc * ~behind, axis=1) / np.sum(disc)
        kept = front > back if returned == "strongest" else part > 0.01
        mean = np.sum(power * depth * ~behind, axis=1) / np.maximum(front, 1e-12)
        z = np.where(kept, mean, far)
    met = np.column_stack([q + CENTRE_M, np.zeros(len(q))])
    ray = met - station
    z = z + NOISE_M * rng.normal(size=len(z))
    shown = closest.share >= hidden
    return outline, (met + ray * (z / station[2])[:, None])[shown]


def _wall_depth_m(there, tau, bent):
    """Depth at which a wall is met there outside the edge: there - tau d + bent d^2 / 2 = 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = 2.0 * there / (tau + np.sqrt(tau**2 - 2.0 * bent * there))
    return np.where((tau > 0.0) & (depth > 0.0), depth, np.inf)


def fitted(name, config=CONFIG, thickness_m=0.01, start=(CENTRE_M, ROTATED), **changes):
    outline, points = scanned(name, thickness_m=thickness_m, **changes)
    begin = aimed(points, outline, thickness_m, config, start)
    return fit_edge(points, EdgeToFit(outline, thickness_m, NOISE_M, config), begin)


def off_m(found):
    return found.centre_m - CENTRE_M


def u_m(found):
    return math.sqrt(np.trace(found.covariance_m2) / 2.0)


@pytest.mark.parametrize("returned", ["mean", "strongest", "first"])
@pytest.mark.parametrize("name", OUTLINES)
def test_the_centre_is_that_of_the_edge_whatever_the_scanner_reports(name, returned):
    found = fitted(name, returned=returned)
    assert found.converged
    assert (found.clean_shift_m is None) == (returned == "mean")
    # 1.5 % of how far outside such an edge lies is the model's own uncertainty (k = 1).
    model_m = 0.015 * (found.clean_shift_m or 0.0) + 5e-6
    assert np.hypot(*off_m(found)) < min(4.0 * math.hypot(u_m(found), model_m), 2.5e-4)
    if returned == "first":  # a footprint's whole radius outside
        assert found.clean_shift_m > 0.5 * SPOT_M
    if returned == "mean":
        beam = (CENTRE_M - STATION[:2]) / STATION[2]
        np.testing.assert_allclose(found.beam, beam, atol=0.02)
        assert found.spot_m == pytest.approx(SPOT_M, rel=0.1)
        assert found.reflectance_ratio == pytest.approx(0.8, rel=0.1)
        assert found.wall == pytest.approx(1.0, abs=0.25)
        assert found.covered > 0.9
        assert found.misfit < 0.05


@pytest.mark.parametrize("grown_m", [-0.001, 0.0, 0.001])
@pytest.mark.parametrize("returned", ["strongest", "first"])
def test_a_clean_edge_of_another_size_is_found(returned, grown_m):
    """By its wall, which begins at the edge: what a scanner reports moves the other sides alone."""
    _, points = scanned("disc", returned=returned)
    stated = Circle(0.12 - grown_m)
    begin = aimed(points, stated, 0.01, CONFIG, (CENTRE_M, ROTATED))
    found = fit_edge(points, EdgeToFit(stated, 0.01, NOISE_M, CONFIG), begin)
    if found is None:  # as if the beams at the edge had been filtered out
        assert returned == "strongest"
        assert grown_m < 0.0
        return
    assert abs(found.growth_m - grown_m) < 4.0 * found.growth_u_m < 4e-4
    size_m = np.hypot(*found.by_size_m)
    assert np.hypot(*off_m(found)) < 3.72 * math.hypot(u_m(found), size_m)
    if grown_m == 0.0:  # a known size costs hardly more than a stated one
        assert size_m < 2.0 * u_m(found)


@pytest.mark.parametrize("returned", ["strongest", "first"])
def test_a_dark_thick_wall_moves_no_clean_edge(returned):
    """As bright as the face, it would hide a footprint's share of the background on one side."""
    changes = {"thickness_m": 0.02, "echo": 1.5, "spacing_m": 0.0015}
    found = fitted("disc", returned=returned, **changes)
    assert np.hypot(*off_m(found)) < min(4.0 * u_m(found) + 3e-5, 2e-4)


@pytest.mark.parametrize("returned", ["mean", "strongest"])
def test_the_start_does_not_matter(returned):
    here = fitted("disc", returned=returned)
    there = fitted("disc", returned=returned, start=(np.array([0.005, -0.003]), ROTATED))
    apart = np.hypot(*(here.centre_m - there.centre_m))
    assert apart < (2e-6 if returned == "mean" else 0.3 * u_m(here))


@pytest.mark.parametrize("returned", ["mean", "strongest"])
def test_no_more_steps_than_allowed(returned):
    most = 1 if returned == "mean" else 3
    few = CONFIG.model_copy(update={"max_iterations": most})
    found = fitted("disc", few, returned=returned)
    assert found.iterations == most if returned == "strongest" else found.iterations <= most
    assert fitted("disc", returned=returned).iterations > most


@pytest.mark.parametrize(("hidden", "shown"), [(0.65, True), (0.85, False)])
@pytest.mark.parametrize("returned", ["mean", "strongest"])
def test_less_than_a_quarter_of_an_edge_gives_no_centre(returned, hidden, shown):
    outline, points = scanned("disc", returned=returned, hidden=hidden)
    state = pointed(Prior.of(0.01, CONFIG).mean, STATION, CENTRE_M)
    found = fit_edge(points, EdgeToFit(outline, 0.01, NOISE_M, CONFIG), Aim(state))
    assert (found is not None) == shown
    if shown:
        assert found.covered == pytest.approx(1.0 - hidden, abs=0.1)


@pytest.mark.parametrize("returned", ["mean", "strongest"])
def test_very_few_points_give_no_centre(returned):
    outline, points = scanned("disc", returned=returned)
    rng, state = np.random.default_rng(0), pointed(Prior.of(0.01, CONFIG).mean, STATION, CENTRE_M)
    few = points[rng.permutation(len(points))[:25]]
    assert LEAST > 5
    assert fit_edge(few, EdgeToFit(outline, 0.01, NOISE_M, CONFIG), Aim(state)) is None
    assert fit_edge(points[:0], EdgeToFit(outline, 0.01, NOISE_M, CONFIG), Aim(state)) is None


def test_a_station_in_the_prior_holds_the_beams():
    outline, points = scanned("disc", spacing_m=0.012)
    begin = aimed(points, outline, 0.01, CONFIG, (CENTRE_M, ROTATED), STATION)
    found = fit_edge(points, EdgeToFit(outline, 0.01, NOISE_M, CONFIG), begin)
    np.testing.assert_allclose(found.beam, (CENTRE_M - STATION[:2]) / STATION[2], atol=0.006)
    assert found.inverse_distance == pytest.approx(1.0 / STATION[2], abs=0.003)


def test_steep_beams_on_a_thick_wall_give_the_centre():
    station = (-1.9, 0.3, 1.4)
    found = fitted("disc", thickness_m=0.006, station=station, dim=0.0, spacing_m=0.0015)
    assert np.hypot(*found.beam) > STEEP
    assert np.hypot(*off_m(found)) < 3e-4
    assert np.exp(abs(np.log(found.thickness_m / 0.006))) < np.exp(RIDGE)


def test_what_lies_behind_is_seen_along_the_beams():
    outline, points = scanned("disc")
    start, state = (CENTRE_M, ROTATED), pointed(Prior.of(0.01, CONFIG).mean, STATION, CENTRE_M)
    behind = look_behind(points, outline, CONFIG, start, state)
    assert behind.seen
    np.testing.assert_array_equal(behind.beam, state[BEAM])
    unknown = look_behind(points, outline, CONFIG, start, None)
    assert unknown.seen
    assert unknown.beam is None
    face = points[np.abs(points[:, 2]) < 0.002]
    assert not look_behind(face, outline, CONFIG, start, state).seen


def logs(spot=0.0, thickness=0.0, ratio=0.0):
    state = Prior.of(0.01, CONFIG).mean.copy()
    state[[SPOT, THICKNESS, RATIO]] += spot, thickness, ratio
    return state


def test_a_solution_far_off_and_farther_from_the_prior_diverged():
    prior = Prior.of(0.01, CONFIG)
    for name in ("spot", "thickness", "ratio"):
        near, far, opposite = (logs(**{name: k * RIDGE}) for k in (0.9, 1.1, -1.1))
        assert not _diverged(near, logs(), prior)
        assert _diverged(far, logs(), prior)
        assert _diverged(opposite, logs(), prior)
        assert not _diverged(logs(), far, prior)  # nearer to the prior than before
        beams = logs()
        beams[BEAM] += 2.0
        assert not _diverged(beams, logs(), prior)


def converged(state, last_m):
    return Solution(state, *(None,) * 3, 5, last_m)


def test_a_fit_is_strange_where_it_did_not_converge_or_is_of_another_thickness():
    prior = Prior.of(0.01, CONFIG)
    assert not _is_strange(converged(logs(thickness=0.9 * RIDGE), 0.5 * CONVERGED_M), prior)
    assert _is_strange(converged(logs(), 2.0 * CONVERGED_M), prior)
    for way in (-1.1, 1.1):
        assert _is_strange(converged(logs(thickness=way * RIDGE), 0.5 * CONVERGED_M), prior)


@pytest.mark.parametrize("u", [0.01 * CONVERGED_M, 100.0 * CONVERGED_M])
def test_a_fit_settles_where_its_last_step_is_small_against_its_uncertainty(u):
    fit = fitted("disc")
    fit = replace(fit, covariance_m2=u**2 / 2.0 * np.eye(2))
    most = max(CONVERGED_M, SETTLED * u)
    assert settled(fit, converged(logs(), 0.99 * most)).converged
    assert not settled(fit, converged(logs(), 1.01 * most)).converged


def test_beams_matter_as_far_as_wall_and_footprint_reach():
    gentle, steep = logs(thickness=0.0), logs(thickness=np.log(2.0))
    steep[BEAM] = 1.8, -2.4
    spot_m, wall_m = np.exp(steep[SPOT]), 0.02
    ring_m, band_m = 0.011, 0.006
    assert _reach_m(steep) == pytest.approx(
        3.0 * wall_m + math.sqrt(10.0) * spot_m + ring_m + band_m
    )
    assert _reach_m(gentle) == 0.025


def beams_of(points, outline):
    """Where the beams of points (N, 3) lie beside an edge, and where those of its wall end."""
    slope = (points[:, :2] - STATION[:2]) / (STATION[2] - points[:, 2])[:, None]
    q = STATION[:2] + STATION[2] * slope
    closest = outline.closest(turned(q - CENTRE_M, -ROTATED))
    tau = -np.sum(turned(closest.normal, ROTATED) * slope, axis=1)
    return closest.x_m, 0.01 * np.maximum(tau, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("wide", [1.2, 2.0])
@pytest.mark.parametrize("kept", ["wall", "face"])
@pytest.mark.parametrize("name", OUTLINES)
def test_an_edge_whose_beams_were_filtered_out_is_in_the_middle_of_the_gap(name, kept, wide):
    """As software does that leaves out beams unlike their neighbours, with the wall or without."""
    outline, points = scanned(name)
    x_m, wall_m = beams_of(points, outline)
    inside_m = x_m - wall_m if kept == "wall" else x_m
    lost = (inside_m > -wide * SPOT_M) & (x_m - wall_m < wide * SPOT_M)
    state = pointed(Prior.of(0.01, CONFIG).mean, STATION, CENTRE_M)
    found = fit_edge(
        points[~lost], EdgeToFit(outline, 0.01, NOISE_M, CONFIG, chamfer_m=0.0), Aim(state)
    )
    assert found.clean_shift_m == pytest.approx(-wide * SPOT_M, rel=0.2)
    aside_m = 0.0 if found.by_thickness_m is None else 0.4 * np.hypot(*found.by_thickness_m)
    assert np.hypot(*off_m(found)) < 3.72 * math.hypot(u_m(found), found.unlike_m, aside_m)
    assert np.hypot(*off_m(found)) < (5e-4 if kept == "wall" else 1.5e-4)
    assert abs(found.growth_m) < 0.2 * wide * SPOT_M


@pytest.mark.parametrize("places", [40, 192])
def test_what_leaves_as_much_of_the_places_counts_as_much_and_what_leaves_more_less(places):
    """Down to nothing where that is out of the question, and without a step there."""
    prior, out = np.array(LIKELY), math.exp(BY_WALL / places)
    np.testing.assert_allclose(_shares(np.full(3, 2e-4), places), prior / prior.sum())
    np.testing.assert_allclose(_shares(np.zeros(3), places), prior / prior.sum())
    for worse in range(3):
        left_m, before = np.full(3, 2e-4), 1.0
        for more in np.append(np.linspace(1.0, out, 40)[1:], 2.0 * out):
            left_m[worse] = 2e-4 * more
            share = _shares(left_m, places)
            assert share.sum() == pytest.approx(1.0)
            assert 0.0 <= before - share[worse] < 0.05 or before == 1.0
            before = share[worse]
        assert before == 0.0


@pytest.mark.parametrize("returned", ["strongest", "first"])
def test_returns_that_part_leave_no_gap(returned):
    outline, points = scanned("disc", returned=returned)
    state = pointed(Prior.of(0.01, CONFIG).mean, STATION, CENTRE_M)
    found = fit_edge(points, EdgeToFit(outline, 0.01, NOISE_M, CONFIG), Aim(state))
    assert found.clean_shift_m > -ERODED * SPOT_M


def test_another_edge_begins_with_the_beams_of_the_first():
    first = fitted("disc")
    assert isinstance(first, EdgeFit)
    outline, points = scanned("holes")
    found = fit_edge(points, EdgeToFit(outline, 0.01, NOISE_M, CONFIG), first)
    np.testing.assert_allclose(found.beam, first.beam, atol=0.02)
    assert np.hypot(*off_m(found)) < 4.0 * u_m(found) + 1e-5
