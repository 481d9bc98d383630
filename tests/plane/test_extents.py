"""Sides of the smallest rectangle about points."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.plane.find_planes import find_planes, smallest_rectangle
from wheelplane.vectors import turned


@pytest.mark.parametrize("degrees", [0.0, 0.3, 17.0, 45.0, 89.9])
@pytest.mark.parametrize("sides", [(1.0, 1.0), (2.0, 0.1), (0.3, 0.2)])
def test_a_rectangle_has_its_sides_however_it_lies(sides, degrees):
    rng = np.random.default_rng(1)
    corners = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    points = np.vstack([corners, rng.random((9000, 2))]) * sides + 50.0
    long, short = smallest_rectangle(turned(points, np.radians(degrees)))
    assert long == pytest.approx(max(sides), rel=1e-3)
    assert short == pytest.approx(min(sides), rel=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_no_direction_has_a_smaller_rectangle(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(3, 300), 2)) @ rng.normal(size=(2, 2)) + 7.0
    long, short = smallest_rectangle(points)
    angles = np.radians(np.arange(0.0, 90.0, 0.01))
    sides = [np.ptp(turned(points, angle), axis=0) for angle in angles]
    least = min(sides, key=np.prod)
    assert np.prod(least) * (1.0 - 3e-3) < long * short <= np.prod(least) * (1.0 + 1e-12)


def test_a_point_and_a_line():
    for count in (1, 5):
        assert smallest_rectangle(np.ones((count, 2))) == (0.0, 0.0)
    long, short = smallest_rectangle(np.outer(np.linspace(0.0, 1.0, 30), [3.0, 4.0]))
    assert (long, short) == (pytest.approx(5.0), pytest.approx(0.0, abs=1e-12))
    assert smallest_rectangle(np.array([[1.0, 1.0], [4.0, 5.0]])) == pytest.approx((5.0, 0.0))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e5])
@pytest.mark.parametrize("degrees", [0.0, 90.0, 31.0])
def test_corners_alone_have_their_sides_in_any_unit(degrees, scale):
    corners = np.array([[0.0, 0.0], [0.0, 2.0], [3.0, 0.0], [3.0, 2.0]]) * scale
    inner = np.random.default_rng(1).random((200, 2)) * [3.0 * scale, 2.0 * scale]
    for points in (corners, np.vstack([inner, corners])):
        found = smallest_rectangle(turned(points, np.radians(degrees)))
        np.testing.assert_allclose(found, [3.0 * scale, 2.0 * scale], rtol=1e-5)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_point_farthest_out_counts_beside_others_of_its_strip(sign):
    """A spike on a short side: the rectangle is longer by it."""
    corners = np.array([[0.0, 0.0], [0.0, 0.4], [1.0, 0.0], [1.0, 0.4], [-5e-4, 0.2]])
    found = smallest_rectangle(sign * corners)
    np.testing.assert_allclose(found, [1.0005, 0.4], rtol=1e-5)


def test_the_faces_of_a_cube_are_squares():
    rng = np.random.default_rng(2)
    points = rng.random((60_000, 3))
    for side in range(6):
        points[side * 10_000 : (side + 1) * 10_000, side % 3] = side // 3
    planes = find_planes(points + rng.normal(0.0, 1e-4, points.shape), 6)
    assert len(planes) == 6
    for plane in planes:
        # Points of the next faces within three sigma of this one lie on its edges.
        np.testing.assert_allclose(plane.extents_m, 1.0, atol=0.002)
