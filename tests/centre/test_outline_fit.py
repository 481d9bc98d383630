"""Edges of faces: distances whose slopes are their normals, and the rim's equations' slopes."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.centre.edge.beams import MODULATION, ROTATION, STATE, Prior
from wheelplane.centre.edge.edge_residuals import ZONES, EdgeProblem, Zones, equations
from wheelplane.centre.outline_fit import check_outline, place_circle
from wheelplane.config import CentreConfig
from wheelplane.errors import NotMeasuredError
from wheelplane.targets.outline import Circle, Holes, rectangle
from wheelplane.vectors import turned

OUTLINES = {
    "circle": Circle(0.125, "a disc"),
    "rectangle": rectangle(0.36, 0.24),
    "hub hole": Holes(np.array([[0.0, 0.0, 0.04]]), "a hole"),
    "four holes": Holes(
        np.array([[u, v, 0.025] for u in (-0.09, 0.09) for v in (-0.09, 0.09)]), "holes"
    ),
}
STEP = 1e-6
MISSED = dict(
    zip(
        (0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12, MODULATION, 14, 15),
        (0.01, 0.01, 0.05, 0.05, 0.05, 0.1, 1e-5, 0.03, 1e-5, 0.05, 0.01, 0.01, 1e-4, 0.05, 0.05),
        strict=True,
    )
)  # of the slopes


def about(outline, count=400, seed=0):
    """Places up to 10 mm off the outline, clear of where edges meet."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-0.2, 0.2, (40 * count, 2))
    closest = outline.closest(q)
    return q[(np.abs(closest.x_m) < 0.01) & closest.clear][:count]


@pytest.mark.parametrize("name", OUTLINES)
def test_normal_is_the_slope_of_the_distance_and_curve_that_of_the_normal(name):
    outline = OUTLINES[name]
    q = about(outline)
    closest = outline.closest(q)
    along = np.column_stack([-closest.normal[:, 1], closest.normal[:, 0]])
    for axis in np.eye(2):
        ahead, behind = outline.closest(q + STEP * axis), outline.closest(q - STEP * axis)
        slope = (ahead.x_m - behind.x_m) / (2 * STEP)
        np.testing.assert_allclose(slope, closest.normal @ axis, atol=1e-8)
        bent = np.sum((ahead.normal - behind.normal) * along, axis=1) / (2 * STEP)
        np.testing.assert_allclose(bent, closest.curve * (along @ axis), atol=1e-5)


@pytest.mark.parametrize("name", OUTLINES)
def test_the_distance_alone_is_that_of_the_feet(name):
    outline = OUTLINES[name]
    q = np.random.default_rng(1).uniform(-0.3, 0.3, (1000, 2))
    shown = outline.outside_m(*q.T)
    np.testing.assert_allclose(shown, outline.closest(q).x_m, rtol=1e-12, atol=1e-15)
    if isinstance(outline, Circle):
        np.testing.assert_allclose(shown, np.hypot(*q.T) - outline.size_m, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", OUTLINES)
def test_the_foot_lies_on_the_edge_whose_bend_and_support_are_reported(name):
    outline = OUTLINES[name]
    q = about(outline)
    closest = outline.closest(q)
    foot = q - closest.x_m[:, None] * closest.normal
    on_edge = outline.closest(foot)
    np.testing.assert_allclose(on_edge.x_m, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.sum(foot * closest.normal, axis=1), closest.support_m, atol=1e-12)
    np.testing.assert_allclose(on_edge.curve, closest.bend, atol=1e-9)
    np.testing.assert_allclose(on_edge.share, closest.share, atol=1e-9)
    at = outline.normals(closest.share)
    np.testing.assert_allclose(at, closest.normal, atol=1e-9)


@pytest.mark.parametrize("name", OUTLINES)
def test_equal_shares_are_equal_lengths(name):
    outline = OUTLINES[name]
    rng = np.random.default_rng(2)
    q = rng.uniform(-0.2, 0.2, (400_000, 2))
    share = outline.closest(q).share[np.abs(outline.closest(q).x_m) < 0.001]
    count = np.bincount((share * 4 * 6).astype(int), minlength=24)
    assert abs(count - len(share) / 24).max() < 5 * np.sqrt(len(share) / 24)


def problem_of(outline, state, rng):
    """Points of a plate's edge as `state` has it, with their noise: half of them mixed."""
    closest = about(outline, 3000, 5)
    depth = np.where(outline.closest(closest).x_m < 0.0, 0.0, 0.08) + rng.normal(
        0, 0.0005, len(closest)
    )
    mixed = rng.random(len(closest)) < 0.3
    depth[mixed] = rng.uniform(0.0, 0.08, np.count_nonzero(mixed))
    seen = turned(closest, state[ROTATION]) * (1.0 + state[4] * depth)[:, None]
    plane = state[:2] + seen + depth[:, None] * state[2:4]
    prior = Prior.of(0.008, CentreConfig()).bevelled().by_phase()
    return EdgeProblem(plane, depth, prior, outline, 0.0008)


@pytest.mark.parametrize("name", ["circle", "rectangle", "hub hole", "four holes"])
@pytest.mark.parametrize("index", list(MISSED))
def test_slopes_of_the_equations_are_those_of_central_differences(name, index):
    outline = OUTLINES[name]
    rng = np.random.default_rng(3)
    logs = np.log([0.0015, 0.008, 1.3])
    size_and_spot = [0.75, 0.3, 0.0, 3e-4, 60.0, 0.1, -0.05]
    state = np.array([0.001, -0.002, 0.3, -0.2, 0.4, *logs, 0.03, *size_and_spot])
    problem = problem_of(outline, state, rng)
    background = problem.background(state)
    zones = Zones(rng.normal(0.0, 0.2, ZONES), 0.5)
    here = equations(problem, background, state, zones, True, False)
    step = np.zeros(STATE)
    step[index] = size = 1e-2 if index == MODULATION else 1e-7
    ahead = equations(problem, background, state + step, zones, True, False)
    behind = equations(problem, background, state - step, zones, True, False)
    same = len(ahead.residual_m) == len(behind.residual_m) == len(here.residual_m)
    assert same  # no point crossed the band's limits
    seen = -(ahead.residual_m - behind.residual_m) / 2e-7
    shown = here.slopes[:, index] * (size / 1e-7)
    # Left out of the slopes: how the wall's bend, the fanning of the beams and the spot's slant go.
    assert np.linalg.norm(seen - shown) <= MISSED[index] * np.linalg.norm(seen) + 1e-6
    moves = index != ROTATION or outline.shows_rotation
    assert (np.linalg.norm(seen) > 0.01) == moves


def half_disc(rng, count=600):
    """Places on a disc of 0.125 m about (0.03, -0.01), of which a straight edge hides half."""
    q = rng.uniform(-0.125, 0.125, (4 * count, 2))
    return q[(np.hypot(*q.T) < 0.125) & (q @ [0.8, 0.6] > 0.01)] + [0.03, -0.01]


@pytest.mark.parametrize("seed", range(5))
def test_a_half_hidden_disc_is_placed_by_its_round_side(seed):
    face = half_disc(np.random.default_rng(seed))
    assert np.linalg.norm(face.mean(axis=0) - [0.03, -0.01]) > 0.04  # the null answer
    spacing = 0.25 / np.sqrt(2.0 * len(face) / (np.pi / 4.0))
    for points in (face, np.vstack([face, [0.19, 0.02]])):  # a stray beyond
        centre = place_circle(points, 0.125)
        assert np.linalg.norm(centre - [0.03, -0.01]) < 0.8 * spacing


def test_no_circle_is_placed_on_what_is_none():
    rng = np.random.default_rng(1)
    assert place_circle(rng.uniform(-0.125, 0.125, (500, 2)), 0.125) is None  # a square
    assert place_circle(np.zeros((5, 2)), 0.125) is None


@pytest.mark.parametrize(
    ("outline", "sides"),
    [(Circle(0.125), (0.13, 0.13)), (rectangle(0.36, 0.24), (0.19, 0.12))],
)
def test_another_size_and_another_surface_are_distinguished(outline, sides):
    """A larger target reaches beyond its edge on opposite sides, a board beside it on one."""
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.25, 0.25, (400_000, 2))

    def of(half_u, half_v):
        if isinstance(outline, Circle):
            return points[np.hypot(*points.T) < half_u]
        return points[(np.abs(points) < [half_u, half_v]).all(axis=1)]

    checked = outline, np.zeros(2), 0.0, 0.001, 0.0
    with pytest.raises(NotMeasuredError, match=r"^the target reaches .*: check its sizes$"):
        check_outline(of(*sides), *checked)
    own = of(0.125, 0.0) if isinstance(outline, Circle) else of(0.18, 0.12)
    board = points[(points[:, 0] > 0.03) & (np.abs(points[:, 1]) < 0.2)]
    with pytest.raises(NotMeasuredError, match=r"and not opposite: .* hides a part of it"):
        check_outline(np.vstack([own, board]), *checked)


def test_strays_among_very_many_points_are_not_the_edge_of_the_target():
    """One point in a thousand lies anywhere about a disc of 250 mm, as noise of millions does."""
    rng = np.random.default_rng(3)

    def disc(radius_m, count):
        angle, radius = rng.uniform(0.0, 2.0 * np.pi, count), radius_m * np.sqrt(rng.random(count))
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])

    strays = 0.14 * disc(1.0, 600)
    assert np.count_nonzero(np.hypot(*strays.T) > 0.128) > 72  # one in each sector, and more
    checked = Circle(0.125), np.zeros(2), 0.0, 0.0003, 0.0
    assert check_outline(np.vstack([disc(0.125, 600_000), strays]), *checked)
    with pytest.raises(NotMeasuredError, match="beyond the edge"):
        check_outline(disc(0.128, 600_000), *checked)


def test_a_footprint_beside_the_edge_may_return_the_target():
    """By first returns of a wide footprint points lie as far beyond the edge all round."""
    points = np.random.default_rng(5).uniform(-0.15, 0.15, (300_000, 2))
    disc = points[np.hypot(*points.T) < 0.129]
    checked = Circle(0.125), np.zeros(2), 0.0, 0.0003, 0.0
    assert check_outline(disc, *checked, 0.004)
    with pytest.raises(NotMeasuredError, match="beyond the edge"):
        check_outline(disc, *checked, 0.001)
