"""The geometric circle against its definition, independent minimisers, and certified answers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from wheelplane.diagnostics.circle import fit_circle
from wheelplane.errors import InputError, NotMeasuredError

EPS = np.finfo(float).eps


def arc(seed, count=40, sigma=0.0, turn=2.0, radius=0.7):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, turn * np.pi, count))
    centre = rng.uniform(-3, 3, 2)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return centre + rim * (radius + rng.normal(0, sigma, (count, 1))), centre, radius


@pytest.mark.parametrize("turn", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_exact_circle(seed, turn):
    points, centre, radius = arc(seed, turn=turn)
    circle = fit_circle(points)
    # An arc of angle t tells the centre as sagitta over its own size: eps / (1 - cos(t / 2)).
    limit = 64 * EPS * np.abs(points).max() / (1 - np.cos(min(turn, 1.0) * np.pi / 2)) ** 2
    np.testing.assert_allclose(circle.centre_m, centre, atol=limit)
    assert abs(circle.radius_m - radius) < limit
    assert np.linalg.norm(points.mean(axis=0) - centre) > limit


@pytest.mark.parametrize("seed", range(6))
def test_agrees_with_a_minimiser_of_the_distances(seed):
    points, centre, radius = arc(seed, sigma=0.02, turn=1.2)
    best = optimize.least_squares(
        lambda s: np.hypot(*(points - s[:2]).T) - s[2],
        [*centre, radius],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    circle = fit_circle(points)
    found = [*circle.centre_m, circle.radius_m]
    np.testing.assert_allclose(found, best.x, atol=1e-8)
    # The algebraic circle, from which it starts, is another one.
    rows = np.column_stack([2 * points, np.ones(len(points))])
    algebraic = np.linalg.lstsq(rows, np.sum(points**2, axis=1), rcond=None)[0]
    assert np.abs(algebraic[:2] - best.x[:2]).max() > 1e-6


def test_three_points_lie_on_their_circle():
    points = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
    circle = fit_circle(points)
    np.testing.assert_allclose(circle.centre_m, [2.0, 1.5], atol=8 * EPS)
    assert circle.radius_m == pytest.approx(2.5, abs=8 * EPS)


@pytest.mark.parametrize("seed", range(3))
def test_turned_shifted_mirrored_permuted_and_scaled(seed):
    points, _, _ = arc(seed, sigma=0.01)
    before = fit_circle(points)
    rng = np.random.default_rng(seed)
    c, s = np.cos(rng.uniform(0, 6)), np.sin(rng.uniform(0, 6))
    for move in (np.array([[c, -s], [s, c]]), np.diag([1.0, -1.0]), 1e3 * np.eye(2)):
        t = rng.uniform(-1e4, 1e4, 2)
        after = fit_circle(rng.permutation(points) @ move.T + t)
        scale = np.sqrt(abs(np.linalg.det(move)))
        limit = 256 * EPS * (1e4 + 10 * scale)
        np.testing.assert_allclose(after.centre_m, move @ before.centre_m + t, atol=limit)
        assert after.radius_m == pytest.approx(scale * before.radius_m, abs=limit)


def test_stated_covariance_is_that_of_the_centre():
    sigma, count, runs = 0.01, 60, 300
    total = 0.0
    for seed in range(runs):
        points, centre, _ = arc(seed, count, sigma, turn=1.0)
        circle = fit_circle(points, lambda excess: np.full_like(excess, sigma**-2))
        off = circle.centre_m - centre
        total += off @ np.linalg.solve(circle.covariance_m2, off)
    # Chi-square of 2 degrees a run: mean 2, deviation sqrt(4 / runs).
    assert abs(total / runs - 2.0) < 4 * np.sqrt(4.0 / runs)


def test_a_known_radius_holds_a_short_arc():
    sigma = 0.003
    errors = {None: [], (0.7, 1e-4): []}
    for seed in range(40):
        points, centre, _ = arc(seed, 40, sigma, turn=0.2)
        for known, off in errors.items():
            circle = fit_circle(points, lambda e: np.full_like(e, sigma**-2), known)
            off.append(np.linalg.norm(circle.centre_m - centre))
    assert np.median(errors[(0.7, 1e-4)]) < 0.2 * np.median(errors[None])


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_points_are_refused(count):
    with pytest.raises(InputError, match=f"at least 3 points, got {count}"):
        fit_circle(np.zeros((count, 2)))


def test_points_on_a_line_are_refused():
    with pytest.raises(NotMeasuredError, match="on a line"):
        fit_circle(np.linspace(0, 1, 9)[:, None] * [3.0, -1.0])
