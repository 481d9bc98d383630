"""Pentagons: exact points give them back in any order, four or five; noise has its variance."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.five_point.pentagon import KEPT, fit_pentagon

PHASE = 2 * np.pi * np.arange(5) / 5


def corners(rng, radius=0.088):
    centre, turn = rng.uniform(-1, 1, 2), rng.uniform(0, 2 * np.pi)
    at = centre + radius * np.column_stack([np.cos(turn + PHASE), np.sin(turn + PHASE)])
    return centre, at


@pytest.mark.parametrize("seed", range(10))
def test_exact_points_give_centre_radius_and_free_corner(seed):
    rng = np.random.default_rng(seed)
    centre, at = corners(rng)
    order = rng.permutation(5)
    whole = fit_pentagon(at[order])
    np.testing.assert_allclose(whole.centre, centre, atol=1e-12)
    assert whole.radius_m == pytest.approx(0.088)
    for index in range(5):
        rest = fit_pentagon(np.delete(at[order], index, axis=0))
        np.testing.assert_allclose(rest.centre, centre, atol=1e-12)
        np.testing.assert_allclose(rest.free, at[order][index], atol=1e-12)
        assert rest.radius_m == pytest.approx(0.088)
        assert rest.square_m2 < 1e-24
    assert np.abs(np.delete(at, 0, axis=0).mean(axis=0) - centre).max() > 0.01


def test_residuals_belong_to_their_points():
    """A small error of one point keeps 0.6 of itself, in the order of the input."""
    rng = np.random.default_rng(1)
    _, at = corners(rng)
    order, error = rng.permutation(5), np.array([1e-5, -2e-5])
    points = at[order]
    points[3] += error
    np.testing.assert_allclose(fit_pentagon(points).residuals_m[3], KEPT * error, rtol=1e-3)


def test_noise_has_the_variances_of_least_squares():
    """Per axis the centre of five has 1/5, of four 4/15; 2 n - 4 degrees of freedom are left."""
    rng, runs, sigma = np.random.default_rng(2), 4000, 1e-4
    centres, squares = {4: [], 5: []}, {4: [], 5: []}
    for _ in range(runs):
        centre, at = corners(rng)
        noisy = at + rng.normal(0.0, sigma, (5, 2))
        for count, points in ((5, noisy), (4, noisy[1:])):
            found = fit_pentagon(points)
            centres[count].extend((found.centre - centre) / sigma)
            squares[count].append(found.square_m2 / sigma**2)
    for count, variance in ((5, 1 / 5), (4, 4 / 15)):
        spread = 5 * np.sqrt(2 / (2 * runs))
        assert np.var(centres[count]) == pytest.approx(variance, rel=spread)
        dof = 2 * count - 4
        assert np.mean(squares[count]) == pytest.approx(dof, rel=5 * np.sqrt(2 / dof / runs))
