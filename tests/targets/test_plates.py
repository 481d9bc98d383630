"""Plates own their region: edge, holes, description, and margins along all edges."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.targets.outline import Circle, Polygon, rectangle
from wheelplane.targets.plates import DiscTarget, RectangleTarget, RingTarget, SquareTarget
from wheelplane.targets.region import Region

DISC = DiscTarget(shape="disc", diameter=0.25)
RING = RingTarget(shape="ring", diameter=0.3, hole_diameter=0.08)
RECTANGLE = RectangleTarget(shape="rectangle", width=0.36, height=0.24)
SQUARE = SquareTarget(shape="square", side=0.3, hole_diameter=0.05, hole_spacing=0.18)
PLATES = {"disc": DISC, "ring": RING, "rectangle": RECTANGLE, "square": SQUARE}


@pytest.mark.parametrize("name", PLATES)
@pytest.mark.parametrize("margin", [0.0, 0.004])
def test_a_margin_leaves_the_points_that_are_that_far_from_every_edge(name, margin):
    target = PLATES[name]
    uv = np.random.default_rng(2).uniform(-0.25, 0.25, (20_000, 2))
    far = target.edge.outside_m(*uv.T) < -margin
    if target.holes:
        far &= target.holes.outside_m(*uv.T) < -margin
    region = target.region.shrunk(margin)
    np.testing.assert_array_equal(region.holds(uv), far)
    np.testing.assert_array_equal(region.filled.holds(uv), target.edge.outside_m(*uv.T) < -margin)
    radius, sides, holes = region.bounds_m  # what loops over points take
    held = np.hypot(*uv.T) < radius
    for a, b, c in sides:
        held &= uv @ [a, b] < c
    for u, v, hole in holes:
        held &= np.hypot(uv[:, 0] - u, uv[:, 1] - v) > hole
    np.testing.assert_array_equal(held, far)


@pytest.mark.parametrize("name", PLATES)
def test_a_margin_outwards_takes_it_back(name):
    region = PLATES[name].region
    uv = np.random.default_rng(3).uniform(-0.25, 0.25, (20_000, 2))
    np.testing.assert_array_equal(region.shrunk(0.01).shrunk(-0.01).holds(uv), region.holds(uv))
    assert np.all(region.shrunk(-0.01).holds(uv)[region.holds(uv)])
    assert np.count_nonzero(region.shrunk(-0.01).holds(uv)) > np.count_nonzero(region.holds(uv))


@pytest.mark.parametrize("name", PLATES)
def test_polygons_run_along_the_edges(name):
    target = PLATES[name]
    outer, *holes = target.region.polygons_m(96)
    np.testing.assert_allclose(target.edge.outside_m(*outer.T), 0.0, atol=1e-12)
    assert len(holes) == len(target.region.holes_m)
    for hole in holes:
        np.testing.assert_allclose(target.holes.outside_m(*hole.T), 0.0, atol=1e-12)


def test_messages_name_the_target_and_its_holes():
    assert SQUARE.edge.description == "a square of 300 mm"
    assert SQUARE.holes.description == "the holes of a square of 300 mm"
    assert RECTANGLE.edge.size_text == "360 x 240 mm"
    assert DISC.edge.size_text == "250 mm across"
    assert DISC.holes is None


OFF = [0.06, 0.0, 0.02]
REGIONS = {
    "ring": (RING.region, 0.0),
    "disc with a hole beside its centre": (Region(Circle(0.15), np.array([OFF])), 2 * math.pi),
    "disc with two holes": (Region(Circle(0.15), np.array([OFF, [-0.06, 0, 0.02]])), math.pi),
    "square with one hole": (Region(rectangle(0.3, 0.3), np.array([OFF])), 2 * math.pi),
    "square with two holes": (
        Region(rectangle(0.3, 0.3), np.array([OFF, [-0.06, 0, 0.02]])),
        math.pi,
    ),
    "square with four": (SQUARE.region, math.pi / 2.0),
    "triangle": (
        Region(Polygon(0.2 * np.array([[1, 0], [-0.5, 0.75**0.5], [-0.5, -(0.75**0.5)]]))),
        2.0 * math.pi / 3.0,
    ),
}


@pytest.mark.parametrize("name", REGIONS)
def test_period_is_the_smallest_rotation_onto_itself(name):
    region, period = REGIONS[name]
    assert region.period_rad == pytest.approx(period)


def test_lever_of_a_round_target_is_that_of_its_holes():
    """A rotation by d moves a hole at distance r by r d, which half of its edge shows."""
    region = Region(Circle(0.15), np.array([OFF]))
    assert region.lever_m2 == pytest.approx(0.06**2 / 2.0)
    assert SQUARE.region.lever_m2 == pytest.approx(0.15**2 / 3.0)
