"""Generalised least squares against its definition; scatter that makes the squares as expected."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from wheelplane.uncertainty.scatter import least_squares, scatter_beyond

LINE = np.column_stack([np.ones(6), np.arange(6.0)])


def correlated(rng, count=6):
    A = rng.normal(size=(count, count))
    return A @ A.T + np.eye(count)


@pytest.mark.parametrize("seed", range(3))
def test_coefficients_are_those_of_whitened_values(seed):
    rng = np.random.default_rng(seed)
    covariance, values = correlated(rng), rng.normal(size=6)
    L = np.linalg.cholesky(covariance)
    A, y = np.linalg.solve(L, LINE), np.linalg.solve(L, values)
    expected, (square,), *_ = np.linalg.lstsq(A, y)
    found, u, chi_square = least_squares(LINE, values, covariance)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    np.testing.assert_allclose(u, np.sqrt(np.diag(np.linalg.inv(A.T @ A))), rtol=1e-9)
    assert chi_square == pytest.approx(square, rel=1e-9)


def test_an_error_that_all_share_adds_to_the_mean_and_to_no_difference():
    values, ones = np.array([1.0, 2.0, 4.0]), np.ones((3, 1))
    own, shared = np.eye(3), 100.0 * np.ones((3, 3))
    found, u, chi_square = least_squares(ones, values, own + shared)
    assert found[0] == pytest.approx(values.mean())
    assert u[0] == pytest.approx(np.sqrt(1.0 / 3.0 + 100.0))
    assert chi_square == pytest.approx(np.sum((values - values.mean()) ** 2), rel=1e-9)


def test_the_unit_of_values_changes_nothing():
    rng = np.random.default_rng(4)
    covariance, values = correlated(rng), rng.normal(size=6)
    here, small = (least_squares(LINE, k * values, k * k * covariance) for k in (1.0, 1e-9))
    np.testing.assert_allclose(small[0], 1e-9 * here[0], rtol=1e-9)
    np.testing.assert_allclose(small[1], 1e-9 * here[1], rtol=1e-9)
    assert small[2] == pytest.approx(here[2], rel=1e-9)


def test_values_without_any_uncertainty_cannot_be_compared():
    with pytest.raises(ValueError, match="without any uncertainty"):
        least_squares(LINE, np.zeros(6), np.zeros((6, 6)))


@pytest.mark.parametrize("slopes", [np.ones((6, 1)), LINE], ids=["mean", "line"])
def test_with_the_scatter_squares_are_as_expected(slopes):
    rng = np.random.default_rng(5)
    covariance, values = correlated(rng), 30.0 * rng.normal(size=6)
    scatter = scatter_beyond(slopes, values, covariance, float(np.ptp(values)))
    wider = covariance + scatter**2 * np.eye(6)
    chi_square = least_squares(slopes, values, wider)[2]
    assert chi_square == pytest.approx(6 - slopes.shape[1], rel=1e-9)
    assert stats.chi2.sf(least_squares(slopes, values, covariance)[2], 5) < 1e-6


def test_the_scatter_is_at_most_what_is_allowed_and_none_where_there_is_none():
    values = np.array([-100.0, 0.0, 100.0])
    assert scatter_beyond(np.ones((3, 1)), values, np.eye(3), 7.0) == 7.0
    assert scatter_beyond(np.ones((3, 1)), values / 1e3, np.eye(3), 7.0) < 1e-15
