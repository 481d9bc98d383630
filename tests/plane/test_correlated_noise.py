"""Correlated noise: found where it is, not where it is not, and its cost for the plane known."""

import numpy as np
import pytest
from scipy import stats

from wheelplane.cloud.moments import SlabMoments, sums_by
from wheelplane.plane.correlated_noise import (
    LENGTHS_OF_RADIUS,
    Cells,
    cells_across,
    cells_of,
    correlated_noise,
)

RADIUS = 0.12


def noise_of(uv, residual, radius, resolution=0.0):
    """What residuals (N,) at uv (N, 2) say, averaged over the cells of a raster on the target."""
    across = cells_across(len(uv))
    held = SlabMoments(np.zeros((across**2, 10)), np.zeros((0, 3)), across, 2.0 * radius / across)
    uvw = np.column_stack([uv, residual])
    spread = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
    cells = cells_of(sums_by(held.cells(uvw), uvw, across**2), across, held.side_m)
    return correlated_noise(cells, radius, spread, resolution)


def field(rng, uv, length, sigma):
    """Gaussian field of covariance sigma^2 exp(-d^2 / (2 length^2)) at uv, by random waves.

    The spectrum of that kernel is normal: wave vectors N(0, 1/length^2), phases uniform.
    """
    waves = 400
    k, phase = rng.standard_normal((2, waves)) / length, rng.uniform(0, 2 * np.pi, waves)
    total = np.zeros(len(uv))
    for start in range(0, waves, 50):
        part = slice(start, start + 50)
        total += np.cos(uv @ k[:, part] + phase[part]).sum(axis=1)
    return sigma * np.sqrt(2.0 / waves) * total


def scanned(seed, white=5e-4, sigma=0.0, length=0.01, count=6000, keep=lambda uv: uv[:, 0] < 1):
    """Errors (3,) of a plane fitted to noise on a disc, and what its residuals say."""
    rng = np.random.default_rng([seed, 7])
    uv = rng.uniform(-RADIUS, RADIUS, (count, 2))
    uv = uv[(np.hypot(*uv.T) < RADIUS) & keep(uv)]
    height = white * rng.standard_normal(len(uv))
    if sigma:
        height += field(rng, uv, length, sigma)
    uv -= uv.mean(axis=0)
    slopes = np.column_stack([np.ones(len(uv)), uv])
    wrong = np.linalg.lstsq(slopes, height, rcond=None)[0]
    seen = noise_of(uv, height - slopes @ wrong, RADIUS)
    white_part = seen.white_sigma_m**2 * np.linalg.inv(slopes.T @ slopes)
    return wrong, seen, white_part


SEEDS = 60


@pytest.mark.slow
@pytest.mark.parametrize("keep", [lambda uv: uv[:, 0] < 1, lambda uv: uv[:, 0] < 0.02], ids="ab")
@pytest.mark.parametrize("length", [0.005, 0.01, 0.02])
def test_tilts_under_correlated_noise_are_as_uncertain_as_said(length, keep):
    found = [scanned(seed, 2e-4, 8e-4, length, keep=keep) for seed in range(SEEDS)]
    tilts = np.array([wrong[1:] for wrong, _, _ in found])
    whole = np.array([(white + seen.covariance + seen.form_covariance) for _, seen, white in found])
    claimed = np.array([white for _, _, white in found])
    nees = np.einsum("ki,kij,kj->k", tilts, np.linalg.inv(whole[:, 1:, 1:]), tilts)
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * SEEDS)
    # s and L are estimated as well; with a few dozen waves across the face that adds a fifth.
    assert 0.7 * low < nees.sum() < 1.25 * high
    naive = np.einsum("ki,kij,kj->k", tilts, np.linalg.inv(claimed[:, 1:, 1:]), tilts)
    assert naive.sum() > 10 * high


@pytest.mark.parametrize("length", [0.005, 0.01, 0.02])
def test_size_and_length_of_the_noise_come_out(length):
    seen = [scanned(seed, 2e-4, 8e-4, length)[1] for seed in range(12)]
    # Of N_eff = r^2 / (2 L^2) waves, 18 for the longest, over 12 scans: 1/sqrt(2 * 18 * 12) = 5 %.
    # A plane feels s L alone, and so do cells of 20 mm where L is a quarter of them.
    product = np.median([s.sigma_m * s.length_m for s in seen])
    assert product == pytest.approx(8e-4 * length, rel=0.25)
    if length > 0.005:
        assert np.median([s.sigma_m for s in seen]) == pytest.approx(8e-4, rel=0.25)
    steps = np.diff(np.log(LENGTHS_OF_RADIUS)).max()
    assert abs(np.log(np.median([s.length_m for s in seen]) / length)) < steps
    assert all(2e-4 * 0.9 < s.white_sigma_m < np.hypot(2e-4, 8e-4) for s in seen)


def test_independent_noise_is_left_alone():
    found = [scanned(seed)[1] for seed in range(100)]
    wrong = sum(seen.sigma_m > 0.0 for seen in found)
    # A gain of 9/2 in likelihood over nothing: chance below 1 % with the choice of a length.
    assert wrong <= stats.binom.ppf(0.999, 100, 0.01)
    assert all(not seen.covariance.any() for seen in found if seen.sigma_m == 0.0)
    sigma = np.sqrt(np.mean([seen.white_sigma_m**2 for seen in found]))
    assert sigma == pytest.approx(5e-4, rel=4.5 / np.sqrt(2 * 4500 * 100))


def test_rotated_shifted_and_scaled():
    rng = np.random.default_rng(0)
    uv = rng.uniform(-RADIUS, RADIUS, (6000, 2))
    uv = uv[np.hypot(*uv.T) < RADIUS]
    height = field(rng, uv, 0.015, 8e-4) + 2e-4 * rng.standard_normal(len(uv))
    seen = noise_of(uv, height, RADIUS)
    twice = noise_of(2.0 * uv, 3.0 * height, 2.0 * RADIUS)
    assert twice.sigma_m == pytest.approx(3.0 * seen.sigma_m, rel=1e-9)
    assert twice.length_m == pytest.approx(2.0 * seen.length_m, rel=1e-9)
    np.testing.assert_allclose(
        twice.covariance[1:, 1:], (3.0 / 2.0) ** 2 * seen.covariance[1:, 1:], rtol=1e-9
    )
    quarter = noise_of(uv @ [[0.0, 1.0], [-1.0, 0.0]], height, RADIUS)
    assert quarter.covariance[1, 1] == pytest.approx(seen.covariance[2, 2], rel=1e-6)
    assert seen.covariance[1, 1] > 0.0


def test_a_bent_target_is_form_error_not_noise():
    rng = np.random.default_rng(3)
    uv = rng.uniform(-RADIUS, RADIUS, (20_000, 2))
    uv = uv[np.hypot(*uv.T) < RADIUS]
    saddle = 1e-3 * (uv[:, 0] ** 2 - uv[:, 1] ** 2) / RADIUS**2
    seen = noise_of(uv, saddle + 2e-4 * rng.standard_normal(len(uv)), RADIUS)
    assert np.trace(seen.form_covariance) > 10 * np.trace(seen.covariance)


def test_a_dense_spot_hides_no_noise_of_the_rest_of_the_target():
    """A spot of 4 cm, 8 times as dense, took the cells from the rest: no noise was seen."""
    nees = []
    for seed in range(20):
        rng = np.random.default_rng([seed, 8])
        uv = rng.uniform(-RADIUS, RADIUS, (8000, 2))
        spot = rng.uniform(0.03, 0.07, (1600, 2))
        uv = np.vstack([uv[np.hypot(*uv.T) < RADIUS], spot])
        height = 5e-4 * rng.standard_normal(len(uv)) + field(rng, uv, 0.02, 3e-4)
        uv -= uv.mean(axis=0)
        slopes = np.column_stack([np.ones(len(uv)), uv])
        wrong = np.linalg.lstsq(slopes, height, rcond=None)[0]
        seen = noise_of(uv, height - slopes @ wrong, RADIUS)
        whole = seen.white_sigma_m**2 * np.linalg.inv(slopes.T @ slopes)
        whole += seen.covariance + seen.form_covariance
        assert seen.sigma_m > 1e-4
        nees.append(wrong[1:] @ np.linalg.solve(whole[1:, 1:], wrong[1:]))
    assert sum(nees) < 1.25 * stats.chi2.ppf(0.9995, 2 * 20)


@pytest.mark.parametrize("count", [0, 5, 60])
def test_few_points_tell_nothing_and_do_no_harm(count):
    rng = np.random.default_rng(1)
    seen = noise_of(rng.uniform(-1, 1, (count, 2)), rng.normal(size=count), 1.0)
    assert np.all(np.isfinite(seen.covariance))
    if count < 12:
        assert not seen.covariance.any()


def test_rounding_is_no_noise():
    rng = np.random.default_rng(1)
    uv = rng.uniform(-RADIUS, RADIUS, (5000, 2))
    steps = 1e-16 * np.floor(uv[:, 0] / 0.03)
    assert noise_of(uv, steps, RADIUS, resolution=1e-14).sigma_m == 0.0
    assert noise_of(uv, 1e10 * steps, RADIUS, resolution=1e-14).sigma_m > 0.0


def test_noise_that_is_not_clear_has_no_length_and_gains_nothing():
    """Nor has it a size or degrees of freedom, in squares or along lines."""
    rng = np.random.default_rng(2)
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(10), np.arange(10)))
    index = np.stack([column, row], axis=1)
    for side in (0.02, np.array([0.01, 0.02])):
        mean = 0.2 * rng.normal(size=100)
        known = Cells((index - 4.5) * side, mean, np.full(100, 25.0), index, side, 1.0)
        for lined in ([], [known, known]):
            seen = correlated_noise(known, RADIUS, 1.0, 0.0, lined)
            assert (seen.sigma_m, seen.length_m, seen.dof) == (0.0, 0.0, np.inf)
            assert seen.gains == (0.0,) * (1 + len(lined))
