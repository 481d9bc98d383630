"""Tests of zero error, sensitivity and linearity: exact lines, covariance by simulation."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.calibration.line import characteristic
from wheelplane.measurement import Estimate, estimate
from wheelplane.uncertainty import Effect

N = 9
X = np.linspace(-0.01, 0.01, N)
NAMES = [str(k) for k in range(N)]
SHARED = Effect("frame", 1e-4 * np.where(np.arange(N) % 2, 1.0, -1.0)[:, None], np.inf, False)
COMMON = Effect("range bias", np.full((N, 1), 5e-5), np.inf, False)
OWN = Effect("plane noise", 4e-5 * np.eye(N), np.inf, False)
READ = Effect("repeatability", 6e-5 * np.eye(N), 18.0, False)
BUDGET = [("reference", one) for one in (SHARED, COMMON, OWN)] + [("readings", READ)]


def known(values, effects=(SHARED, COMMON, OWN)):
    return [
        estimate(float(v), row, list(effects)) for v, row in zip(values, np.eye(N), strict=True)
    ]


def test_an_exact_line_is_found_exactly():
    line = characteristic(NAMES, known(X), 2e-4 + 0.03 * X, BUDGET)
    assert line.zero.value == pytest.approx(2e-4, abs=1e-14)
    assert line.sensitivity.value == pytest.approx(1.03, abs=1e-11)
    assert abs(line.linearity.value) < 1e-14
    assert line.fits == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1.02, 1.4])
def test_the_estimates_are_unbiased_and_their_u_is_that_of_many_experiments(gain):
    """References share errors of their frame: taken as independent, u would be far too small."""
    rng, count, found = np.random.default_rng(1), 3000, []
    for _ in range(count):
        of_reference = sum(
            e.factor @ rng.normal(size=e.factor.shape[1]) for e in (SHARED, COMMON, OWN)
        )
        read = READ.factor @ rng.normal(size=N)
        seen = X + of_reference
        found.append(characteristic(NAMES, known(seen), gain * X + 3e-4 + read - seen, BUDGET))
    for name, true in (("zero", 3e-4), ("sensitivity", gain)):
        values = np.array([getattr(one, name).value for one in found])
        u = np.mean([getattr(one, name).u for one in found])
        assert abs(values.mean() - true) < 4.0 * u / np.sqrt(count)
        assert values.std() == pytest.approx(u, rel=4.0 / np.sqrt(2.0 * count) + 0.03)
    assert found[0].zero.u > 4.9e-5 * gain  # what is common does not average out
    p = np.array([one.fits for one in found])
    assert abs(np.mean(p < 0.05) - 0.05) < 0.03


def test_a_bend_is_seen_and_named_at_its_point():
    errors = np.zeros(N)
    errors[4] = 2e-3
    line = characteristic(NAMES, known(X), errors, BUDGET)
    assert line.worst_point == "4"
    assert line.linearity.value > 5.0 * line.linearity.u
    assert line.fits < 1e-3


@pytest.mark.parametrize("values", [np.zeros(N), np.full(N, 0.3), 1e-6 * X])
def test_points_without_spread_have_a_mean_error_and_no_line(values):
    line = characteristic(NAMES, known(values), np.full(N, 1e-4), BUDGET)
    assert line.zero.value == pytest.approx(1e-4)
    assert line.sensitivity is line.linearity is line.fits is None


def test_a_reference_without_uncertainty_and_readings_without_scatter_are_fitted():
    exact = [Estimate(float(x), 0.0) for x in X]
    line = characteristic(NAMES, exact, 0.01 * X, [("readings", READ)])
    assert line.sensitivity.value == pytest.approx(1.01)
    none = characteristic(
        NAMES, exact, 0.01 * X, [("readings", Effect("none", np.zeros((N, 1)), np.inf, False))]
    )
    assert none.zero.u == 0.0
