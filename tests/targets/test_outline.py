"""Outlines: signed distance, normals, area and symmetry against brute force and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.targets.outline import Circle, Holes, Polygon, is_symmetric, rectangle, sector
from wheelplane.vectors import turned

SIXTH = np.arange(6) * math.pi / 3.0
HEXAGON = Polygon(0.15 * np.column_stack([np.cos(SIXTH), np.sin(SIXTH)]))
KITE = Polygon(np.array([[0.2, 0.0], [0.02, 0.11], [-0.12, 0.01], [0.0, -0.15]]))
HOLES = Holes(np.array([[0.06, 0.01, 0.03], [-0.05, -0.04, 0.02]]))
CLOSED = {"circle": Circle(0.13), "rectangle": rectangle(0.36, 0.24), "hexagon": HEXAGON}
EDGES = CLOSED | {"kite": KITE}
OUTLINES = EDGES | {"holes": HOLES}
STEP_M = 1e-7


def points(count=4000, seed=0):
    return np.random.default_rng(seed).uniform(-0.25, 0.25, (count, 2))


def clear(outline, q):
    """Points whose nearest edge stays the same within a step."""
    moved = [outline.closest(q + s * np.eye(2)[k]).share for s in (-1e-5, 1e-5) for k in (0, 1)]
    here = outline.closest(q)
    same = [np.abs((m - here.share + 0.5) % 1.0 - 0.5) < 1e-2 for m in moved]
    return q[np.all(same, axis=0) & here.clear]


@pytest.mark.parametrize("name", OUTLINES)
def test_normal_is_the_gradient_of_the_distance(name):
    outline = OUTLINES[name]
    q = clear(outline, points())
    slopes = [
        (outline.outside_m(*(q + d).T) - outline.outside_m(*(q - d).T)) / (2.0 * STEP_M)
        for d in STEP_M * np.eye(2)
    ]
    closest = outline.closest(q)
    assert len(q) > 1000
    np.testing.assert_allclose(np.column_stack(slopes), closest.normal, atol=1e-5)
    np.testing.assert_allclose(np.hypot(*closest.normal.T), 1.0, atol=1e-12)
    np.testing.assert_allclose(closest.x_m, outline.outside_m(*q.T), atol=1e-15)


@pytest.mark.parametrize("name", OUTLINES)
def test_the_closest_point_lies_on_the_edge_at_its_support_and_share(name):
    outline = OUTLINES[name]
    closest = outline.closest(clear(outline, points()))
    foot = clear(outline, points()) - closest.x_m[:, None] * closest.normal
    np.testing.assert_allclose(outline.outside_m(*foot.T), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.sum(foot * closest.normal, axis=1), closest.support_m, atol=1e-9)
    np.testing.assert_allclose(outline.normals(closest.share), closest.normal, atol=1e-7)


@pytest.mark.parametrize("name", OUTLINES)
def test_curvature_is_the_rate_at_which_the_normal_rotates(name):
    outline = OUTLINES[name]
    q = clear(outline, points())
    closest = outline.closest(q)
    along = np.column_stack([-closest.normal[:, 1], closest.normal[:, 0]])
    ahead = outline.closest(q + STEP_M * along).normal - closest.normal
    rate = np.sum(ahead * along, axis=1) / STEP_M
    np.testing.assert_allclose(rate, closest.curve, rtol=1e-4, atol=1e-4)
    on_edge = outline.closest(q - closest.x_m[:, None] * closest.normal)
    np.testing.assert_allclose(on_edge.curve, closest.bend, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", EDGES)
def test_area_and_size_are_those_of_its_points(name):
    edge = EDGES[name]
    q = np.stack(np.meshgrid(*[(np.arange(800) + 0.5) / 1600.0 - 0.25] * 2), axis=-1).reshape(-1, 2)
    inside = q[edge.outside_m(*q.T) < 0.0]
    perimeter_m = 2.0 * math.pi * edge.radius_m
    assert len(inside) / 1600.0**2 == pytest.approx(edge.area_m2, abs=perimeter_m / 1600.0)
    assert np.hypot(*inside.T).max() == pytest.approx(edge.radius_m, abs=2e-3)
    assert np.abs(inside).max(axis=0) == pytest.approx(edge.half_m, abs=2e-3)
    outside = q[edge.outside_m(*q.T) > 0.0]
    assert np.hypot(*outside.T).min() == pytest.approx(edge.size_m, abs=2e-3)


@pytest.mark.parametrize("name", EDGES)
def test_sides_and_circle_bound_the_same_points_as_the_distance(name):
    edge, q = EDGES[name], points()
    inside = np.hypot(*q.T) < edge.radius_m
    for a, b, c in edge.sides_m:
        inside &= q @ [a, b] < c
    np.testing.assert_array_equal(inside, edge.outside_m(*q.T) < 0.0)


@pytest.mark.parametrize("name", EDGES)
def test_reach_is_the_farthest_point_that_keeps_the_margin(name):
    edge, margin = EDGES[name], 0.01
    angle = np.linspace(0.0, 2.0 * math.pi, 20_000)
    ways = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = np.full(len(angle), edge.radius_m - margin)
    for a, b, c in edge.sides_m:
        ahead = ways @ [a, b]
        reach[ahead > 0] = np.minimum(reach[ahead > 0], (c - margin) / ahead[ahead > 0])
    assert edge.reach_m(margin) == pytest.approx(reach.max(), rel=1e-3)
    assert edge.reach_m(0.0) == pytest.approx(edge.radius_m)


@pytest.mark.parametrize("name", [n for n in EDGES if n != "circle"])
def test_lever_and_axis_share_are_integrals_along_the_edge(name):
    edge = EDGES[name]
    share = (np.arange(200_000) + 0.5) / 200_000
    lengths = np.hypot(*(np.roll(edge.corners_m, -1, axis=0) - edge.corners_m).T)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    way = share * ends[-1]
    place = np.column_stack([np.interp(way, ends, np.append(k, k[0])) for k in edge.corners_m.T])
    normal = edge.normals(share)
    lever = place[:, 1] * normal[:, 0] - place[:, 0] * normal[:, 1]
    assert edge.lever_m2 == pytest.approx(np.mean(lever**2), rel=1e-4)
    weights = (edge.normals(share) @ edge.normals((ends[:-1] + lengths / 2.0) / ends[-1]).T) ** 2
    shares = weights.mean(axis=0) ** 2 / (weights**2).mean(axis=0)
    assert edge.axis_share == pytest.approx(shares.min(), rel=1e-4)


def test_shares_of_a_rectangle_begin_at_the_side_of_u():
    edge = rectangle(0.36, 0.24)
    corners = np.array([[0.18, -0.12], [0.18, 0.12], [-0.18, 0.12], [-0.18, -0.12]])
    middle = (corners + np.roll(corners, -1, axis=0)) / 2.0
    expected = np.array([0.12, 0.42, 0.72, 1.02]) / 1.2
    np.testing.assert_allclose(edge.closest(middle).share, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "count"), [("circle", 0), ("rectangle", 2), ("hexagon", 6), ("kite", 1)]
)
def test_symmetries_leave_the_distance_as_it_is_and_no_more_do(name, count):
    edge, q = EDGES[name], points()
    assert edge.symmetries == count
    for n in range(1, 13):
        same = np.allclose(edge.outside_m(*turned(q, 2 * math.pi / n).T), edge.outside_m(*q.T))
        assert same == (count == 0 or count % n == 0)


def test_a_hole_pattern_of_unlike_holes_has_no_symmetry():
    alike = np.array([[0.1, 0.0, 0.02], [-0.1, 0.0, 0.02]])
    assert is_symmetric(alike, 2)
    assert not is_symmetric(alike * [[1, 1, 1], [1, 1, 1.1]], 2)
    assert is_symmetric(np.zeros((0, 3)), 7)


@pytest.mark.parametrize(
    "corners",
    [
        [[0.1, 0.1], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]],  # clockwise
        [[0.1, 0.0], [0.3, 0.0], [0.3, 0.2]],  # the origin lies outside
        [[0.2, 0.0], [0.02, 0.02], [0.0, 0.2], [-0.2, -0.2]],  # not convex
    ],
)
def test_corners_that_make_no_convex_outline_are_refused(corners):
    with pytest.raises(ValueError, match="counterclockwise"):
        Polygon(np.array(corners))


def test_single_precision_stays_single():
    q = points().astype(np.float32)
    assert rectangle(0.3, 0.2).outside_m(*q.T).dtype == np.float32


def test_sectors_are_equal_parts():
    share = np.random.default_rng(1).uniform(0.0, 1.0, 10_000)
    np.testing.assert_array_equal(sector(share, 24), np.floor(share * 24))
    assert sector(np.array([1.0]), 24)[0] == 23


def test_a_stretched_outline_moves_its_sides_apart_and_together():
    """To the first order; a round one is turned or drilled, and has no width of its own."""
    plate, by_m = Polygon(np.array([[0.2, -0.1], [0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1]])), 1e-4
    resized = plate.resized(np.array([by_m, -by_m]))
    assert resized.half_m == pytest.approx((0.2 + by_m, 0.1 - by_m))
    share = np.linspace(0.0, 1.0, 57, endpoint=False)
    normals = plate.normals(share)
    side = np.argmax(normals @ plate.sides_m[:, :2].T, axis=1)
    moved_m = resized.sides_m[side, 2] - plate.sides_m[side, 2]
    np.testing.assert_allclose(plate.stretch(share) * by_m, moved_m, atol=1e-15)
    assert Circle(0.1).stretch(share) is None
    assert Holes(np.array([[0.0, 0.0, 0.04]])).stretch(share) is None
