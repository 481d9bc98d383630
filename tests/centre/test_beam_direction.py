"""Direction of the beams from exact shadows: every beam ends on the target or on the background."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.centre.edge import beam_direction
from wheelplane.centre.edge.beam_direction import (
    AGREE_M,
    COARSE_STEP,
    FINE_STEP,
    INSIDE,
    LEAST_IN_SECTOR,
    MAX_CONSTANT_M,
    MAX_THROUGH,
    RING_M,
    STEEPEST,
    TRIED_FROM,
    UNSURE_INVERSE,
    WINDOW_M,
    Shadow,
    _background_outside,
    _by_consensus,
    _from_elsewhere,
    _of_all_directions,
    directions,
    first_beam,
    has_background,
    is_contradicted,
    seen_through,
)
from wheelplane.centre.edge.beams import (
    BEAM,
    CENTRE,
    INVERSE,
    MIN_DEPTH_M,
    ROTATION,
    SPOT,
    Prior,
    carry,
)
from wheelplane.config import CentreConfig
from wheelplane.targets.outline import Circle, rectangle
from wheelplane.vectors import turned

OUTLINES = {"disc": Circle(0.125), "plate": rectangle(0.28, 0.2)}
CENTRE_M, ROTATED = np.array([0.003, -0.002]), 0.06


def start():
    state = Prior.of(0.01, CentreConfig()).mean
    state[CENTRE], state[ROTATION] = CENTRE_M, ROTATED
    return state


def shadow(
    outline,
    slope,
    count=40_000,
    depth_m=0.1,
    hidden=0.0,
    seed=0,
    uneven_m=0.0,
    distance_m=2.0,
    spokes_m=0.0,
):
    """Points (N, 2) and depths where beams of a station end; beyond 40 mm the background is deeper.

    hidden: share of the edge beside which something else hides the background; uneven_m: how much
    deeper it is beside the middle of the edge than beside its ends; spokes_m: than beside five
    parts of it.
    """
    rng, station = np.random.default_rng(seed), np.append(CENTRE_M, 0.0)
    station += distance_m * np.append(-np.array(slope), 1.0)
    q = rng.uniform(-0.24, 0.24, (count, 2))
    closest = outline.closest(turned(q, -ROTATED))
    depth = np.where(closest.x_m < 0.04, depth_m, 2.0 * depth_m)
    depth += uneven_m * np.sin(np.pi * closest.share) ** 2
    depth += spokes_m * (np.sin(10.0 * np.pi * closest.share) > 0.0)
    depth = np.where(closest.x_m < 0.0, 0.0, depth + 0.05 * depth_m * q[:, 0] / 0.24)
    shown = (closest.share > hidden) | (closest.x_m < 0.0) | (closest.x_m > 0.015)
    met = np.column_stack([q + CENTRE_M, np.zeros(count)])
    points = met + (met - station) * (depth / station[2])[:, None]
    np.testing.assert_allclose(points[:, 2], -depth, atol=1e-12)
    return points[shown, :2], depth[shown]


SLOPES = [(0.0, 0.0), (0.5, -0.2), (-0.3, 0.3)]


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("hidden", [0.0, 0.3])
@pytest.mark.parametrize("name", OUTLINES)
def test_a_shadow_shows_the_beams(name, hidden, slope):
    """Points 2.4 mm apart and a background 0.1 m deep: 0.01 of the slope in 36 sectors.

    Roughly where the edge of a disc is hidden: all sectors decide as long as none contradicts.
    """
    outline = OUTLINES[name]
    plane, depth = shadow(outline, slope, hidden=hidden)
    found = first_beam(plane, depth, start(), outline)
    rough = name == "disc" and hidden > 0.0
    np.testing.assert_allclose(found[BEAM], slope, atol=0.1 if rough else 0.015)
    np.testing.assert_array_equal(np.delete(found, [2, 3]), np.delete(start(), [2, 3]))


@pytest.mark.parametrize("distance_m", [0.55, 0.8, 1.2, 2.5, 9.0])
@pytest.mark.parametrize("name", OUTLINES)
def test_a_shadow_shows_the_beams_of_near_and_far_scanners(name, distance_m):
    """Before a wheel, between whose spokes it is 0.35 m deeper: as if seen from 2.5 m, one of 0.8 m
    was 0.13 of the slope off, and centres 0.4 mm.
    """
    outline, slope = OUTLINES[name], (0.3, -0.2)
    plane, depth = shadow(outline, slope, distance_m=distance_m, depth_m=0.085, spokes_m=0.35)
    found = first_beam(plane, depth, start(), outline)
    np.testing.assert_allclose(found[BEAM], slope, atol=0.015)
    assert found[INVERSE] == pytest.approx(1.0 / distance_m, abs=0.2)
    kept = np.delete(np.arange(12), [2, 3, INVERSE])
    np.testing.assert_array_equal(found[kept], start()[kept])


@pytest.mark.parametrize(("of_all", "taken"), [((18, 34), 1.5), ((26, 34), 0.55)])
def test_a_distance_that_some_points_agree_with_must_agree_with_all(monkeypatch, of_all, taken):
    """A rectangle from 0.58 m was fitted as from 0.9 m: its centre was 0.28 mm off."""

    def best_shadow(plane, depth, state, outline, ways):
        every, inverse = len(depth) == 2 * TRIED_FROM, round(state[INVERSE], 2)
        counts = {0.55: of_all if every else (16, 21), 1.5: (33, 36) if every else (28, 32)}
        return Shadow(state, *counts.get(inverse, (12, 34)))

    monkeypatch.setattr(beam_direction, "_best_shadow", best_shadow)
    points = np.zeros((2 * TRIED_FROM, 2)), np.zeros(2 * TRIED_FROM)
    found = _from_elsewhere(*points, start(), OUTLINES["disc"])
    assert found.state[INVERSE] == taken


@pytest.mark.parametrize("inverse", [0.3, 0.8, 1.4])
def test_no_other_distance_than_a_known_one_is_tried(inverse):
    outline, state = OUTLINES["disc"], start()
    plane, depth = shadow(outline, (0.3, -0.2), distance_m=0.8, depth_m=0.085, spokes_m=0.35)
    state[INVERSE] = inverse
    assert first_beam(plane, depth, state, outline, known=True)[INVERSE] == inverse
    assert first_beam(plane, depth, state, outline)[INVERSE] == pytest.approx(1.25, abs=0.2)


@pytest.mark.parametrize("count", [1300, 2500])
def test_a_shadow_of_few_points_shows_the_beams(count):
    plane, depth = shadow(OUTLINES["disc"], (0.5, -0.2), count=count)
    found = first_beam(plane, depth, start(), OUTLINES["disc"])
    spacing_m = 0.48 / np.sqrt(count)
    np.testing.assert_allclose(found[BEAM], (0.5, -0.2), atol=spacing_m / 0.1)


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("name", OUTLINES)
def test_dust_seen_through_the_target_hides_no_shadow(name, slope):
    """5 % of the beams end anywhere before or behind: where the edge is bare they pulled it in."""
    rng, outline = np.random.default_rng(6), OUTLINES[name]
    plane, depth = shadow(outline, slope, hidden=0.3 if name == "disc" else 0.15)
    station = np.append(CENTRE_M - 2.0 * np.array(slope), 2.0)
    points = np.column_stack([plane, -depth])
    dust = rng.random(len(depth)) < 0.05
    ends = 2.0 + rng.uniform(-0.5, 0.5, np.count_nonzero(dust))
    points[dust] = station + (points[dust] - station) * (ends / (2.0 + depth[dust]))[:, None]
    found = first_beam(points[:, :2], -points[:, 2], start(), outline)
    np.testing.assert_allclose(found[BEAM], slope, atol=0.05)


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("distance_m", [1.5, 2.9])
def test_a_deep_background_contradicts_no_beams_of_another_distance(name, distance_m):
    """0.44 m behind, as through a wheel: the start takes the scanner for 2.5 m away."""
    outline, rng = OUTLINES[name], np.random.default_rng(2)
    station = np.append(CENTRE_M, distance_m)
    q = rng.uniform(-0.24, 0.24, (40_000, 2))
    depth = np.where(outline.outside_m(*turned(q, -ROTATED).T) < 0.0, 0.0, 0.44)
    met = np.column_stack([q + CENTRE_M, np.zeros(len(q))])
    points = met + (met - station) * (depth / distance_m)[:, None]
    found = first_beam(points[:, :2], depth, start(), outline)
    np.testing.assert_allclose(found[BEAM], 0.0, atol=0.02)


def test_mixed_pixels_before_the_background_are_no_shadow():
    """A third of the points just outside the edge lie nearer, as mixed pixels and walls do."""
    plane, depth = shadow(OUTLINES["disc"], (0.5, -0.2))
    rng, state = np.random.default_rng(3), start()
    state[BEAM], state[INVERSE] = (0.5, -0.2), 0.5
    x = carry(plane, depth, state, OUTLINES["disc"]).x_m
    pulled = (np.abs(x) < 0.012) & (rng.random(len(x)) < 0.3)
    station = np.append(CENTRE_M - 2.0 * np.array([0.5, -0.2]), 2.0)
    points = np.column_stack([plane, -depth])
    run = (station[2] + 0.06) / (station[2] + 0.1)
    points[pulled] = station + (points[pulled] - station) * run
    depth = -points[:, 2]
    found = first_beam(points[:, :2], depth, start(), OUTLINES["disc"])
    np.testing.assert_allclose(found[BEAM], (0.5, -0.2), atol=0.03)


@pytest.mark.parametrize("slope", [(0.1, 0.0), (-1.2, 0.9), (2.0, 2.4), (0.0, -3.8)])
def test_all_directions_hold_that_of_steep_beams(slope):
    plane, depth = shadow(OUTLINES["disc"], slope)
    found = _of_all_directions(plane, depth, start(), OUTLINES["disc"])
    assert np.hypot(*(found[BEAM] - slope)) < 1.5 * FINE_STEP * np.hypot(1.0, np.hypot(*slope))
    untouched = np.delete(found, [2, 3, INVERSE])
    np.testing.assert_array_equal(untouched, np.delete(start(), [2, 3, INVERSE]))


@pytest.mark.parametrize("name", OUTLINES)
def test_an_uneven_background_shows_the_beams(name):
    """60 to 260 mm deep: a slope half a coarse step off moves its shadow into the target."""
    rng, off = np.random.default_rng(8), []
    for seed in range(16):
        slope = rng.uniform(-0.8, 0.8, 2)
        plane, depth = shadow(OUTLINES[name], slope, 10_000, 0.06, seed=seed, uneven_m=0.2)
        found = first_beam(plane, depth, start(), OUTLINES[name])
        off.append(np.inf if found is None else np.hypot(*(found[BEAM] - slope)))
    assert np.max(off) < 0.1


def test_few_deep_points_show_no_direction():
    plane, depth = shadow(OUTLINES["disc"], (0.5, 0.0))
    deep = np.flatnonzero(depth > 0.05)
    for count, shown in ((49, False), (60, True), (500, True)):
        rows = np.append(np.flatnonzero(depth < 0.05), deep[:count])
        found = _of_all_directions(plane[rows], depth[rows], start(), OUTLINES["disc"])
        assert (found is not None) == shown


def test_a_background_seen_through_the_target_shows_no_direction():
    """Points at all places, deep: no direction keeps them outside."""
    rng = np.random.default_rng(1)
    plane, depth = rng.uniform(-0.2, 0.2, (8000, 2)), np.full(8000, 0.1)
    assert first_beam(plane, depth, start(), OUTLINES["disc"]) is None
    assert first_beam(plane[:100], 0.0 * depth[:100], start(), OUTLINES["disc"]) is None


@pytest.mark.parametrize(("steepest", "step"), [(STEEPEST, COARSE_STEP), (COARSE_STEP, FINE_STEP)])
def test_directions_cover_a_disc_evenly(steepest, step):
    tried = directions(steepest, step)
    apart = np.hypot(*(tried[:, None] - tried).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    assert apart.min() > 0.85 * step
    rng = np.random.default_rng(0)
    anywhere = rng.uniform(-steepest, steepest, (4000, 2))
    anywhere = anywhere[np.hypot(*anywhere.T) < steepest]
    nearest = np.hypot(*(anywhere[:, None] - tried).transpose(2, 0, 1)).min(axis=1)
    assert nearest.max() < 0.75 * step
    assert np.hypot(*tried.T).max() < steepest + 0.5 * step
    assert np.hypot(*tried.T).min() == 0.0


@pytest.mark.parametrize("name", OUTLINES)
def test_the_score_of_a_direction_counts_points_on_both_sides(name):
    outline, slopes = OUTLINES[name], np.array([[0.0, 0.0], [0.6, -0.3], [-1.0, 2.0]])
    plane, depth = shadow(outline, (0.6, -0.3), count=3000)
    state = start()
    state[INVERSE] = 0.7
    scores = []
    for slope in slopes:
        state[BEAM] = slope
        x = carry(plane, depth, state, outline).x_m
        near = x[np.abs(x) < WINDOW_M]
        scores.append(np.sum(near > 0.0) - INSIDE * np.sum(near < 0.0))
    found = _background_outside(plane, depth, state, slopes, outline)
    np.testing.assert_array_equal(found, scores)


def sectors(count=20, constant=0.001, slope=(0.03, -0.05)):
    angle = 2.0 * np.pi * np.arange(count) / count
    table = np.column_stack([np.ones(count), 0.1 * np.cos(angle), 0.1 * np.sin(angle)])
    return table, table @ [constant, *slope]


def test_most_sectors_that_agree_decide():
    table, values = sectors()
    np.testing.assert_allclose(_by_consensus(table, values), [0.001, 0.03, -0.05], atol=1e-12)
    some = values.copy()
    some[3:11] += 0.02 + 0.01 * np.arange(8) ** 2
    np.testing.assert_allclose(_by_consensus(table, some), [0.001, 0.03, -0.05], atol=1e-12)
    noisy = values + 0.3 * AGREE_M * np.cos(7.0 * np.arange(20))
    all_of_them = np.linalg.lstsq(table, noisy, rcond=None)[0]
    np.testing.assert_allclose(_by_consensus(table, noisy), all_of_them, atol=1e-12)


def test_a_shift_common_to_all_sectors_is_no_answer_where_another_is():
    table, values = sectors()
    far = values.copy()
    far[:12] = table[:12] @ [1.5 * MAX_CONSTANT_M, 0.03, 0.4]
    np.testing.assert_allclose(_by_consensus(table, far), [0.001, 0.03, -0.05], atol=1e-12)
    alone = table @ [1.5 * MAX_CONSTANT_M, 0.03, 0.4]
    expected = [1.5 * MAX_CONSTANT_M, 0.03, 0.4]
    np.testing.assert_allclose(_by_consensus(table, alone), expected, atol=1e-12)


def test_sectors_of_one_direction_are_not_solved_for_two():
    """Opposite sides of a plate, each of several sectors, and one sector across."""
    normals = np.array([[1.0, 0.0]] * 4 + [[-1.0, 0.0]] * 4 + [[0.0, 1.0]])
    table = np.column_stack([np.ones(9), 0.1 * normals])
    found = _by_consensus(table, table @ [0.0, 0.03, -0.05])
    np.testing.assert_allclose(found, [0.0, 0.03, -0.05], atol=1e-9)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.9, 0.4)])
def test_what_is_seen_through_is_counted_in_two_rings(slope):
    """Each as far from the edge as a slanted footprint is longer; of points at clean depth.

    Farther by what a distance of the scanner that is off moves them.
    """
    outline, rng = OUTLINES["disc"], np.random.default_rng(4)
    plane, depth = rng.uniform(-0.3, 0.3, (30_000, 2)), rng.uniform(0.0, 0.2, 30_000)
    state = start()
    state[BEAM], state[SPOT] = slope, np.log(0.004)
    beams = carry(plane, depth, state, outline)
    longer = 1.5 * 0.004 * (np.sqrt(1.0 + beams.tau**2) - 1.0)
    longer += UNSURE_INVERSE * depth * np.hypot(*beams.q_m.T)
    inside = (-RING_M[1] < beams.x_m + longer) & (beams.x_m + longer < -RING_M[0])
    outside = (RING_M[0] < beams.x_m - longer) & (beams.x_m - longer < RING_M[1])
    clean = depth > 0.8 * np.median(depth[outside & (depth > 2.0 * MIN_DEPTH_M)])
    expected = np.sum(inside & clean) / np.sum(outside & clean)
    assert seen_through(plane, depth, state, outline) == pytest.approx(expected, abs=1e-12)
    assert 0.5 < expected < 1.5
    assert is_contradicted(plane, depth, state, outline)


def test_a_corner_is_beside_no_edge():
    outline, state = OUTLINES["plate"], start()
    state[CENTRE], state[ROTATION], state[BEAM] = 0.0, 0.0, 0.0
    state[INVERSE] = 0.0
    corner = np.array([[0.134, 0.0995], [0.146, 0.0995]])
    side = np.array([[0.134, 0.0], [0.146, 0.0]])
    deep = np.full(2, 0.1)
    assert seen_through(corner, deep, state, outline) == np.inf
    assert seen_through(side, deep, state, outline) == 1.0
    through = np.vstack([side, side[:1]])
    assert seen_through(through, np.full(3, 0.1), state, outline) == 2.0


def test_a_tenth_seen_through_contradicts():
    outline, state = OUTLINES["disc"], start()
    state[CENTRE], state[BEAM], state[INVERSE] = 0.0, 0.0, 0.0

    def at(inside, outside):
        x = np.array([-0.006] * inside + [0.006] * outside)
        angle = np.arange(len(x)) * 2.4
        q = (0.125 + x)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return q, np.full(len(x), 0.1), state, outline

    assert not is_contradicted(*at(9, 100))
    assert is_contradicted(*at(11, 100))
    assert seen_through(*at(11, 100)) == pytest.approx(0.11)
    assert MAX_THROUGH == 0.1
    assert not is_contradicted(*at(5, 0))  # nothing outside


@pytest.mark.parametrize(
    ("share", "each", "depth_m", "x_m", "shown"),
    [
        (0.30, 40, 0.1, 0.01, True),
        (0.20, 40, 0.1, 0.01, False),
        (0.30, 40, 0.1, -0.01, True),
        (0.30, 40, 0.1, 1.5 * WINDOW_M, False),
        (0.30, 40, 0.5 * MIN_DEPTH_M, 0.01, False),
        (1.00, LEAST_IN_SECTOR, 0.1, 0.01, True),
        (1.00, 2.8, 0.1, 0.01, True),
        (1.00, 0.7, 0.1, 0.01, False),
    ],
)
def test_a_background_is_seen_beside_a_quarter_of_the_edge(share, each, depth_m, x_m, shown):
    """Points evenly beside a share of the edge, `each` in a 36th of it."""
    count, state = round(36 * share * each), start()
    state[CENTRE], state[BEAM], state[INVERSE] = 0.0, 0.0, 0.0
    angle = 2.0 * np.pi * share * (np.arange(count) + 0.5) / count
    q = (0.125 + x_m) * np.column_stack([np.cos(angle), np.sin(angle)])
    assert has_background(q, np.full(count, depth_m), state, OUTLINES["disc"]) == shown
