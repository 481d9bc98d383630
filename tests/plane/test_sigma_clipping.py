"""Sigma clipping: true sigma in spite of outliers, a fixed point, and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tests.support.scenes import rotation
from wheelplane.errors import NotMeasuredError
from wheelplane.plane.least_squares import total_least_squares
from wheelplane.plane.sigma_clipping import CLIPPED_SIGMA_RATIO, Clipping, converge, first_sigma

SIGMA, COUNT = 0.001, 20_000
RESOLUTION = 1e-12


def sheet(seed, outliers=0.0):
    """Points of z = 0 with noise, a share of them outliers to one side, between 5 and 50 sigma."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(COUNT, 3)) * [0.1, 0.07, SIGMA]
    far = rng.random(COUNT) < outliers
    points[far, 2] = rng.uniform(5.0, 50.0, np.count_nonzero(far)) * SIGMA
    return points


def start(sigma=5.0 * SIGMA, tilt=0.002, **limits):
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    return Clipping(np.stack([np.zeros(3), np.zeros(3), normal]), np.zeros(3), sigma, **limits)


def test_ratio_is_that_of_a_truncated_normal_variable():
    assert pytest.approx(stats.truncnorm(-3.0, 3.0).std(), abs=5e-6) == CLIPPED_SIGMA_RATIO


@pytest.mark.parametrize("seed", range(4))
def test_outliers_change_neither_plane_nor_sigma_beyond_noise(seed):
    points = sheet(seed, outliers=0.1)
    clipping, moments = converge(points, start(), RESOLUTION)
    tilt = np.arctan2(np.linalg.norm(moments.normal[:2]), abs(moments.normal[2]))
    limit = 5.0 * SIGMA / (0.07 * np.sqrt(0.9 * COUNT))
    assert tilt < limit
    assert abs(moments.centroid_m @ moments.normal) < 5.0 * SIGMA / np.sqrt(0.9 * COUNT)
    assert clipping.sigma == pytest.approx(SIGMA, abs=5.0 * SIGMA / np.sqrt(2.0 * 0.9 * COUNT))
    everything = total_least_squares(points)  # the null answer
    assert abs(everything.centroid_m @ everything.normal) > 1.0 * SIGMA


@pytest.mark.parametrize("seed", range(4))
def test_a_converged_clipping_keeps_the_points_it_was_fitted_to(seed):
    points = sheet(seed, outliers=0.1)
    clipping, moments = converge(points, start(), RESOLUTION)
    kept = np.abs((points - clipping.point) @ clipping.basis[2]) < clipping.limit(RESOLUTION)
    assert np.count_nonzero(kept) == moments.count
    refitted = total_least_squares(points, kept)
    np.testing.assert_array_equal(refitted.basis, moments.basis)
    again, _ = converge(points, clipping, RESOLUTION)
    assert again.sigma == clipping.sigma


@pytest.mark.parametrize("seed", range(3))
def test_rotation_shift_and_permutation_move_the_plane_with_the_points(seed):
    rng = np.random.default_rng(seed)
    points, R, t = sheet(seed, 0.05), rotation(rng), rng.uniform(-5.0, 5.0, 3)
    before, _ = converge(points, start(), RESOLUTION)
    first = start()
    moved = Clipping(first.basis @ R.T, R @ first.point + t, first.sigma)
    after, _ = converge(rng.permutation(points) @ R.T + t, moved, RESOLUTION)
    np.testing.assert_allclose(np.abs(after.basis[2] @ R @ before.basis[2]), 1.0, atol=1e-12)
    np.testing.assert_allclose(after.point, R @ before.point + t, atol=1e-12)
    assert after.sigma == pytest.approx(before.sigma, rel=1e-9)


def test_no_point_beyond_the_cap_is_kept():
    points = sheet(0)
    cap = 1.5 * SIGMA
    _, moments = converge(points, start(tilt=0.0, cap=cap), RESOLUTION)
    share = stats.norm.cdf(1.5) - stats.norm.cdf(-1.5)
    assert moments.count / COUNT == pytest.approx(share, abs=5.0 * np.sqrt(0.25 / COUNT))


def test_points_without_noise_are_all_kept_within_their_resolution():
    points = sheet(1) * [1.0, 1.0, 0.0]
    clipping, moments = converge(points, start(tilt=0.0), RESOLUTION)
    assert moments.count == COUNT
    assert clipping.sigma < 1e-15
    assert clipping.limit(RESOLUTION) == RESOLUTION


@pytest.mark.parametrize("seed", range(4))
def test_first_sigma_is_that_of_the_noise_within_the_band(seed):
    depth = np.random.default_rng(seed).normal(0.3 * SIGMA, SIGMA, COUNT)
    far = np.full(COUNT, 0.5)  # beyond the band
    sigma = first_sigma(np.concatenate([depth, far]), 0.1)
    # Variance of a median absolute deviation: 1.36 sigma^2 / N (Rousseeuw, Croux 1993).
    assert sigma == pytest.approx(SIGMA, abs=5.0 * 1.17 * SIGMA / np.sqrt(COUNT))
    assert np.std(np.concatenate([depth, far])) > 100.0 * SIGMA


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.eye(3),
        np.outer(np.arange(50.0), [1.0, 0.0, 0.0]),  # a line
        np.zeros((50, 3)),
    ],
    ids=["none", "three", "line", "one"],
)
def test_points_that_span_no_plane_are_refused(points):
    with pytest.raises(NotMeasuredError) as caught:
        converge(points, start(sigma=1.0, tilt=0.0), RESOLUTION)
    assert caught.value.status == "too-few-points"


@pytest.mark.parametrize("count", [0, 9])
def test_too_few_depths_are_refused(count):
    with pytest.raises(NotMeasuredError, match=f"{count} points on the target, 10 needed"):
        first_sigma(np.zeros(count), 1.0)


def test_ten_depths_and_four_points_are_enough():
    assert first_sigma(np.arange(10.0), 100.0) == pytest.approx(1.4826 * 2.5)
    corners = np.array([[1.0, 1, 1], [-1, 1, -1], [-1, -1, 1], [1, -1, -1]]) * [0.1, 0.1, SIGMA]
    _, moments = converge(corners, start(tilt=0.0), RESOLUTION)
    assert moments.count == 4


@pytest.mark.parametrize(("width", "plane"), [(1e-6, True), (1e-10, False)])
def test_a_strip_spans_a_plane_if_it_is_wider_than_the_resolution(width, plane):
    strip = np.random.default_rng(1).normal(size=(50, 3)) * [0.1, width, 0.0]
    if plane:
        assert converge(strip, start(1.0, tilt=0.0), 1e-9)[1].count == 50
        return
    with pytest.raises(NotMeasuredError, match="span no plane"):
        converge(strip, start(1.0, tilt=0.0), 1e-9)
