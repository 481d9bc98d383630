"""Near copies of points on a plane: their distance, and which points stay."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.plane.copies import (
    copies_within_m,
    first_in_places,
    first_within,
    places_shared,
    some_of,
)

NORMAL, SIGMA_M, SPACING_M = np.array([0.0, 0.0, 1.0]), 3e-4, 1e-3


def face(rng, side=40):
    """Points on a jittered grid, with noise along the normal."""
    grid = np.stack(np.meshgrid(*[np.arange(side) * SPACING_M] * 2), axis=-1).reshape(-1, 2)
    grid += rng.uniform(-0.2, 0.2, grid.shape) * SPACING_M
    return np.column_stack([grid, rng.normal(0.0, SIGMA_M, len(grid))])


@pytest.mark.parametrize("times", [2, 3, 6])
def test_the_distance_lies_between_copies_and_the_next_points(times):
    rng = np.random.default_rng(times)
    points = face(rng)
    copies = [points + rng.normal(0.0, 2e-5, points.shape) for _ in range(times - 1)]
    cloud = rng.permutation(np.vstack([points, *copies]))
    reach_m = copies_within_m(cloud, some_of(cloud)[0], NORMAL, SIGMA_M)
    assert 3e-5 < reach_m < 0.6 * SPACING_M
    assert len(first_within(cloud, reach_m)) == pytest.approx(len(points), rel=0.005)


@pytest.mark.parametrize("density", [1, 2, 4])
def test_scattered_points_of_any_density_are_no_copies(density):
    """As of merged stations: a tenth of them have one neighbour far nearer than all others."""
    rng = np.random.default_rng(density)
    points = np.column_stack(
        [rng.uniform(0.0, 0.04, (1600 * density, 2)), np.zeros(1600 * density)]
    )
    points[:, 2] = rng.normal(0.0, SIGMA_M, len(points))
    assert copies_within_m(points, some_of(points)[0], NORMAL, SIGMA_M) == 0.0


def test_lines_of_close_points_are_no_copies():
    """Twenty times as dense along as across, with noise that is alike along each."""
    rng = np.random.default_rng(0)
    u, v = np.meshgrid(np.arange(800) * 5e-5, np.arange(40) * SPACING_M)
    w = np.repeat(rng.normal(0.0, SIGMA_M, (40, 20)), 40, axis=1)
    points = np.stack([u, v, w], axis=-1).reshape(-1, 3)
    assert copies_within_m(points, some_of(points)[0], NORMAL, SIGMA_M) == 0.0


def test_of_a_chain_each_point_is_kept_that_no_kept_one_is_near():
    chain = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0], [9.0, 0, 0]])
    np.testing.assert_array_equal(first_within(chain, 1.5), [0, 2, 4])


def test_places_are_shared_to_the_micrometre():
    points = face(np.random.default_rng(1))
    assert not places_shared(some_of(points))
    twice = np.vstack([points, points[::10] + 1e-9])
    assert places_shared(some_of(twice))
    np.testing.assert_array_equal(first_in_places(twice), np.arange(len(points)))
