"""The likelihood of rounded points by exact probabilities of every step, and its cells by loops."""

import math

import numpy as np
import pytest
from scipy import stats

from wheelplane.plane.rounded_plane import (
    _cells,
    _evaluate,
    _maximise,
    fit_rounded,
    logistic_tail,
    normal_tail,
)

NOISE = {normal_tail: stats.norm, logistic_tail: stats.logistic(scale=math.sqrt(3.0) / math.pi)}


def rounded(seed, sigma, count=300, state=(0.3, 0.8, -0.5)):
    """Points u, v within 1, w rounded to whole steps, of a plane of that height and slopes."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-1.0, 1.0, (count, 2))
    w = np.rint(state[0] + uv @ state[1:] + sigma * rng.normal(size=count))
    return np.column_stack([uv, w]), np.array([*state, math.log(sigma)])


def terms_of(step, height, sigma, noise):
    """Probability that a point at `height` comes to lie on a step; derivatives of its logarithm."""
    far, near = (step + 0.5 - height) / sigma, (step - 0.5 - height) / sigma
    p = noise.cdf(far) - noise.cdf(near) if near < 0 else noise.sf(near) - noise.sf(far)
    by_height = (noise.pdf(near) - noise.pdf(far)) / sigma
    return p, np.array([by_height, near * noise.pdf(near) - far * noise.pdf(far)]) / max(p, 1e-99)


@pytest.mark.parametrize("tail", NOISE)
@pytest.mark.parametrize("sigma", [0.05, 0.3, 1.7])
def test_value_slope_and_information_are_those_of_every_steps_probability(sigma, tail):
    noise = NOISE[tail]
    uvw, state = rounded(1, sigma, 60)
    reach = 3 + math.ceil(9.0 * sigma)
    value, slope, information = 0.0, np.zeros(4), np.zeros((4, 4))
    for u, v, w in uvw:
        at = state[0] + u * state[1] + v * state[2]
        J = np.array([[1.0, u, v, 0.0], [0.0, 0.0, 0.0, 1.0]])
        p, by = terms_of(w, at, sigma, noise)
        value, slope = value + math.log(p), slope + by @ J
        for step in range(round(at) - reach, round(at) + reach + 1):
            p, by = terms_of(step, at, sigma, noise)
            if p > 1e-14:
                information += p * np.outer(by @ J, by @ J)
    found = _evaluate(uvw, state, tail)
    assert found.value == pytest.approx(value, abs=1e-3 * len(uvw))
    u = np.sqrt(np.diag(information))  # of the slope itself, of which the tables lose little
    np.testing.assert_array_less(np.abs(found.slope - slope), 5e-3 * u)
    np.testing.assert_allclose(found.information, information, atol=2e-3 * information.max())
    assert sigma > 0.1 or abs(information[3, :3]).max() > 1.0  # height and noise are confounded


@pytest.mark.parametrize("start", [0.02, 5.0])
def test_the_maximum_is_reached_from_any_noise(start):
    uvw, state = rounded(2, 0.4, 2000)
    best = _maximise(uvw, state, normal_tail)
    found = _maximise(uvw, np.array([0.0, 0.0, 0.0, math.log(start)]), normal_tail)
    u = np.sqrt(np.diag(np.linalg.inv(_evaluate(uvw, best, normal_tail).information)))
    assert np.all(np.abs(found - best) < 0.05 * u)
    assert np.all(np.abs(found - state) < 5.0 * u)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_a_fit_is_in_metres_of_any_size(scale):
    """Radius, steps and noise times a factor: height and sigma follow, slopes stay."""
    uvw, state = rounded(3, 0.6, 4000)
    step, radius = 0.01 * scale, 0.2 * scale
    points = uvw * [radius, radius, step]
    found = fit_rounded(points, uvw[:, 2].astype(int), step, 0.5 * step, 12, radius / 6.0)
    size = np.abs(uvw[:, :2]).max() * radius
    exact = _maximise(uvw * [radius / size, radius / size, 1.0], state, normal_tail)
    assert found.height_m == pytest.approx(exact[0] * step, abs=1e-3 * step)
    np.testing.assert_allclose(found.slopes, exact[1:3] * step / size, atol=1e-3 * step / size)
    assert found.sigma_m == pytest.approx(math.exp(exact[3]) * step, rel=1e-3)
    off = points[:, 2] - found.height_m - points[:, :2] @ found.slopes
    assert found.rms_m == pytest.approx(np.sqrt(np.mean(off[found.kept] ** 2)))


def test_cells_are_the_weighted_means_of_their_points():
    uvw, state = rounded(4, 0.5, 3000)
    found, step, sigma = _evaluate(uvw, state, normal_tail), 0.01, 0.5
    uv = uvw[:, :2] * [0.3, 0.24]  # of 5 x 5 cells of 0.1 m; the outer ones take what is beyond
    cells = _cells(uv, found, sigma, step, 5, 0.1)
    column, row = (np.clip(np.floor(x / 0.1 + 2.5), 0, 4).astype(int) for x in uv.T)
    whole = np.bincount(5 * row + column, found.weight, 25) * sigma**2
    assert [tuple(i) for i in cells.index] == [
        (k % 5, k // 5) for k in range(25) if whole[k] > max(2.0, 0.2 * whole.max())
    ]
    for (c, r), at, mean, count in zip(
        cells.index, cells.uv_m, cells.mean_m, cells.count, strict=True
    ):
        own = (column == c) & (row == r)
        weight = found.weight[own]
        np.testing.assert_allclose(at, weight @ uv[own] / weight.sum())
        assert mean == pytest.approx(found.by_height[own].sum() / weight.sum() * step)
        assert count == pytest.approx(weight.sum() * sigma**2)
    assert cells.white_variance == pytest.approx((sigma * step) ** 2)
