"""Regions: a point lies in one by an independent rule, whatever the frame and the first corner."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wheelplane.capture.region import in_region, normal_of

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
HOOK = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [3.0, 2.0], [3.0, 3.0], [0, 3]]


def by_winding(points, polygon):
    """The winding number about each point (N, 2), as a sum of angles; inside where it is not 0."""
    ends = np.array(polygon)[None] - points[:, None]
    after = np.roll(ends, -1, axis=1)
    sine = ends[..., 0] * after[..., 1] - ends[..., 1] * after[..., 0]
    return np.abs(np.arctan2(sine, (ends * after).sum(axis=2)).sum(axis=1)) > np.pi


def scattered(seed=0):
    return np.random.default_rng(seed).uniform(-0.5, 3.5, (40_000, 3))


def flat(polygon):
    return np.column_stack([polygon, np.zeros(len(polygon))])


@pytest.mark.parametrize("polygon", [SQUARE, HOOK])
def test_a_point_is_inside_where_the_polygon_winds_about_it(polygon):
    points = scattered()
    inside = in_region(points, flat(polygon))
    assert 0.02 < inside.mean() < 0.6
    np.testing.assert_array_equal(inside, by_winding(points[:, :2], polygon))


@pytest.mark.parametrize("seed", range(4))
def test_it_is_so_in_every_frame_and_from_every_corner(seed):
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=seed).as_matrix(), rng.uniform(-50.0, 50.0, 3)
    points, corners = scattered(seed), flat(HOOK)
    inside = in_region(points, corners)
    placed = in_region(points @ turn.T + shift, corners @ turn.T + shift)
    assert np.count_nonzero(placed != inside) <= 1
    for changed in (np.roll(corners, 3, axis=0), corners[::-1]):
        np.testing.assert_array_equal(in_region(points, changed), inside)
    order = rng.permutation(len(points))
    np.testing.assert_array_equal(in_region(points[order], corners), inside[order])


def test_the_normal_is_that_of_the_plane_and_a_line_has_none():
    np.testing.assert_allclose(np.abs(normal_of(flat(HOOK))), [0.0, 0.0, 1.0], atol=1e-12)
    assert normal_of(np.array([[0.0, 0, 0], [1, 1, 1], [2, 2, 2]])) is None
    assert normal_of(np.zeros((3, 3))) is None


def test_corners_beyond_all_numbers_hold_nothing():
    """Nor do they warn, which a command would print."""
    assert normal_of(1e300 * flat(SQUARE)) is None
    assert not in_region(scattered(), 1e300 * flat(SQUARE) + 1e308).any()
