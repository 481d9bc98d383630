"""A target of known shape is matched where it is; part of something larger is no target."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.detection.template_match import match_template, peaks
from wheelplane.targets.outline import Circle, rectangle
from wheelplane.targets.region import Region

DISC = Region(Circle(0.125))
PLATE = Region(rectangle(0.3, 0.2))
SQUARE = Region(rectangle(0.25, 0.25))
SHAPES = {"disc": (DISC, 0.0), "rectangle": (PLATE, np.pi), "square": (SQUARE, np.pi / 2)}


def points(region, turn, centre, seed, count=40_000):
    """Points (N, 2) spread over a face that is turned about its centre."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-region.radius_m, region.radius_m, (count, 2))
    uv = uv[region.holds(uv)]
    cos, sin = np.cos(turn), np.sin(turn)
    return uv @ np.array([[cos, sin], [-sin, cos]]) + centre


def place(uv, shape):
    region, period = SHAPES[shape]
    return match_template(uv, region, period, region.radius_m)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shape", SHAPES)
def test_a_whole_target_is_matched_within_a_cell(shape, seed):
    rng = np.random.default_rng([seed, 9])
    turn, centre = rng.uniform(0, np.pi), rng.uniform(-0.5, 0.5, 2)
    found = place(points(SHAPES[shape][0], turn, centre, seed), shape)
    assert np.hypot(*(found.centre_m - centre)) < found.cell_m
    assert found.match > 0.9
    period = SHAPES[shape][1]
    if period:
        off = (found.rotation_rad - turn + period / 2) % period - period / 2
        assert abs(off) < np.radians(4.0)  # turns are tried 3.75 degrees apart


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("shape", SHAPES)
def test_a_target_without_a_corner_matches_by_its_visible_share(shape, seed):
    uv = points(SHAPES[shape][0], 0.0, np.zeros(2), seed)
    found = place(uv[(uv[:, 0] < 0.02) | (uv[:, 1] < 0.02)], shape)
    assert 0.55 < found.match < 0.9
    assert np.hypot(*found.centre_m) < 4.0 * found.cell_m


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("behind", ["a step all round", "a wall beneath half of it"])
def test_points_that_reach_the_plane_by_noise_alone_are_not_of_the_target(shape, behind):
    region, period = SHAPES[shape]
    rng = np.random.default_rng(4)
    face = points(region, 0.0, np.zeros(2), 1, 4000)
    wall = rng.uniform(-0.4, 0.4, (40_000, 2))
    wall = wall[~region.holds(wall) if "step" in behind else wall[:, 0] > 0.02]
    face = face if "step" in behind else face[face[:, 0] < 0.02]
    leaks = rng.random(len(wall)) < 0.15
    near = np.concatenate([face, wall[leaks]])
    alone = match_template(face, region, period, region.radius_m)
    found = match_template(near, region, period, region.radius_m, wall[~leaks])
    assert found.match > 0.9 * alone.match
    assert np.hypot(*(found.centre_m - alone.centre_m)) < 2.0 * found.cell_m
    assert match_template(near, region, period, region.radius_m).match < 0.5 * alone.match


@pytest.mark.parametrize("count", [150, 300, 500, 1000])
@pytest.mark.parametrize("seed", range(5))
def test_few_points_match_by_where_they_end(count, seed):
    """On a scanner's grid, moved at random: the disc of few points, not a strip, nor a corner."""
    step = np.sqrt(np.pi * 0.125**2 / count)
    rng = np.random.default_rng([seed, count])
    axis = np.arange(-0.4, 0.4, step)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2) + rng.uniform(0, step, 2)
    grid += rng.normal(0, 0.05 * step, grid.shape)
    disc = np.hypot(*grid.T) < 0.125
    assert place(grid[disc], "disc").match > 0.8
    strip = disc & (np.abs(grid[:, 0]) < 0.03)
    corner = (grid > -0.125).all(axis=1)
    assert place(grid[strip], "disc").match < 0.5
    assert place(grid[corner], "disc").match < 0.5


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("width", [0.6, 2.0])
def test_part_of_a_larger_surface_is_no_target(shape, width):
    uv = np.random.default_rng(1).uniform(-width / 2, width / 2, (int(4e5 * width**2), 2))
    assert place(uv, shape).match < 0.25


def test_disc_of_another_size_matches_less():
    whole = place(points(DISC, 0.0, np.zeros(2), 0), "disc").match
    for ratio in (0.8, 1.25):
        other = Region(Circle(ratio * 0.125))
        assert place(points(other, 0.0, np.zeros(2), 0), "disc").match < 0.5 * whole


@pytest.mark.parametrize("count", [0, 1, 9])
def test_a_handful_of_points_matches_nothing(count):
    assert place(np.zeros((count, 2)), "disc").match == 0.0


def test_peaks_are_the_targets_and_not_the_corners_of_a_panel():
    rng = np.random.default_rng(3)
    one, other = np.array([0.0, 0.0]), np.array([0.6, 0.1])
    panel = rng.uniform([-0.1, 0.8], [0.7, 1.6], (4000, 2))
    faces = [points(DISC, 0.0, centre, 4, 3000) for centre in (one, other)]
    found = peaks(np.concatenate([*faces, panel]), 0.03, DISC, 0.0, 0.125, 0.1)
    assert {tuple(np.round(place, 1) + 0.0) for place, _ in found[:2]} == {tuple(one), tuple(other)}
    scores = [score for _, score in found]
    assert scores == sorted(scores, reverse=True)
    assert all(score < 0.5 * scores[1] for score in scores[2:])
