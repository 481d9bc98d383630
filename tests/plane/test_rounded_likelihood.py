"""The likelihood of rounded points by exact probabilities of every step, and its cells by loops."""

import math

import numpy as np
import pytest
from scipy import stats

from wheelplane.errors import NotMeasuredError
from wheelplane.plane.rounded_plane import (
    FEW,
    HIDDEN,
    KEPT,
    _cells,
    _evaluate,
    _maximise,
    _Table,
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
@pytest.mark.parametrize("sigma", [0.05, 0.3, 1.7, 4.0])
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


@pytest.mark.parametrize("tail", NOISE)
@pytest.mark.parametrize("sigma", [0.002, 0.05, 0.4, 3.0])
def test_tables_hold_the_likelihood_of_a_point_at_any_distance(sigma, tail):
    """Also where it changes within a thousandth of a step."""
    noise = NOISE[tail]
    reach = np.linspace(-4.0, 4.0, 4001) * sigma
    table = _Table.of(sigma, tail)
    for away in (np.linspace(-0.5, 0.5, 1001), 0.5 + reach, -0.5 - reach):
        near, far = (np.abs(away) - 0.5) / sigma, (np.abs(away) + 0.5) / sigma
        p = noise.sf(near) - noise.sf(far)
        by_height = np.sign(away) * (noise.pdf(near) - noise.pdf(far)) / (sigma * p)
        by_noise = (near * noise.pdf(near) - far * noise.pdf(far)) / p
        found = [np.interp(away, table.at, y) for y in table.point]
        np.testing.assert_allclose(found[0], np.log(p), atol=2e-3)
        np.testing.assert_allclose(found[1] * sigma, by_height * sigma, atol=4e-3)
        np.testing.assert_allclose(found[2], by_noise, atol=8e-3)


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


def fitted(uvw, sigma=0.3):
    """Fit of points on steps of 1 within a radius of 1."""
    return fit_rounded(uvw, uvw[:, 2].astype(int), 1.0, sigma, 12, 0.2)


def test_points_beyond_their_step_by_more_than_four_sigma_are_left_out():
    uvw, _ = rounded(5, 0.15, 3000)
    uvw[0, :2] = 0.0
    uvw[:60:4, 2] += 1.0
    uvw[1:60:4, 2] -= 1.0
    found = fitted(uvw)
    off = np.abs(uvw[:, 2] - found.height_m - uvw[:, :2] @ found.slopes)
    np.testing.assert_array_equal(found.kept, off < 0.5 + KEPT * found.sigma_m)
    assert 5 < np.sum(~found.kept) < 31
    assert np.sum((off > 0.5) & found.kept) > 20
    again = fitted(uvw[found.kept])
    assert found.rms_m == pytest.approx(np.sqrt(np.mean(off[found.kept] ** 2)))
    np.testing.assert_allclose(again.slopes, found.slopes, atol=1e-3)


def test_many_points_are_all_fitted():
    """Some are fitted first, which must leave the answer alone."""
    uvw, state = rounded(6, 0.3, 45_000)
    uvw[:90, 2] += 6.0
    found = fitted(uvw)
    assert not found.kept[:90].any()
    assert found.kept[90:].mean() > 0.999
    exact = _maximise(uvw[found.kept], state, normal_tail)
    u = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(np.array([found.height_m, *found.slopes]) - exact[:3]) < 0.03 * u)
    assert np.all(np.abs(exact[:3] - state[:3]) < 5.0 * u)
    few = fitted(uvw[90::9])
    np.testing.assert_allclose(np.sqrt(np.diag(few.covariance)), 3.0 * u, rtol=0.1)


def test_steps_hide_an_angle_by_too_few_points_beyond_two_or_too_unsure_a_noise():
    """Both rules apart, as the levels and the information at the maximum give them."""
    kinds = set()
    for seed in range(90):
        rng = np.random.default_rng(seed)
        slope, sigma = rng.uniform(0.3, 1.5), math.exp(rng.uniform(-4.0, -1.2))
        uvw, _ = rounded(seed, sigma, int(rng.integers(40, 600)), (0.5, slope, 0.0))
        best = _maximise(uvw, np.array([0.0, 0.0, 0.0, math.log(0.5)]), normal_tail)
        off = np.abs(uvw[:, 2] - best[0] - uvw[:, :2] @ best[1:3])
        if np.any(off >= 0.5 + KEPT * math.exp(best[3])):
            continue
        information = _evaluate(uvw, best, normal_tail).information
        count = np.sort(np.unique(uvw[:, 2], return_counts=True)[1])[::-1]
        few = count[2:].sum() < FEW
        unsure = math.sqrt(np.linalg.pinv(information)[3, 3]) > HIDDEN
        kinds.add((few, unsure))
        if few or unsure:
            with pytest.raises(NotMeasuredError) as caught:
                fitted(uvw, 0.5)
            assert caught.value.status == "steps-too-coarse"
            assert f"only {count[2:].sum()} of its {len(uvw)} points" in str(caught.value)
        else:
            fitted(uvw, 0.5)
    assert len(kinds) == 4


def test_exactly_as_many_points_beyond_two_steps_as_needed():
    uvw, _ = rounded(7, 0.2, 2000, (0.5, 1.2, 0.0))
    order = np.argsort(np.unique(uvw[:, 2], return_inverse=True, return_counts=True)[2])[::-1]
    level = np.unique(uvw[:, 2])[order]
    main = np.isin(uvw[:, 2], level[:2])
    beyond = np.flatnonzero(~main)
    for count, enough in ((FEW, True), (FEW - 1, False)):
        some = np.sort(np.append(np.flatnonzero(main), beyond[:count]))
        if enough:
            assert fitted(uvw[some]).kept.all()
        else:
            with pytest.raises(NotMeasuredError, match=f"only {count} of its"):
                fitted(uvw[some])
