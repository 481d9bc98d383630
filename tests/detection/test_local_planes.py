"""Planes through neighbouring points: scores against their definition, and the laws of RANSAC."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.detection.local_planes import LocalPlanes

RADIUS, LIMIT, SIGMA = 0.125, 0.004, 0.0008


def cloud(seed, count=1500):
    """A tilted sheet of 0.6 m with noise and as many points in space about it; sheet's rotation."""
    rng = np.random.default_rng(seed)
    R = rotation(rng)
    sheet = rng.uniform(-0.3, 0.3, (count, 3)) * [1.0, 1.0, 0.0]
    sheet[:, 2] = rng.normal(0.0, SIGMA, count)
    return np.vstack([sheet, rng.uniform(-0.3, 0.3, (count, 3))]) @ R.T, R


@pytest.mark.parametrize("seed", range(3))
def test_score_is_its_definition_summed_point_by_point(seed):
    points, _ = cloud(seed)
    problem = LocalPlanes(points, RADIUS, LIMIT)
    models = problem.propose(40, np.random.default_rng(seed))
    expected = []
    for model in models:
        offset = points - model[:3]
        near = np.linalg.norm(offset, axis=1) <= 1.2 * RADIUS
        share = 1.0 - (offset[near] @ model[3:] / LIMIT) ** 2
        expected.append(share[share > 0.0].sum() if model[3:].any() else 0.0)
    assert np.std(expected) > 5.0
    np.testing.assert_allclose(problem.score(models), expected, rtol=1e-3, atol=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_proposals_pass_through_three_points_of_one_neighbourhood(seed):
    points, _ = cloud(seed)
    models = np.array(LocalPlanes(points, RADIUS, LIMIT).propose(60, np.random.default_rng(seed)))
    length = np.linalg.norm(models[:, 3:], axis=1)
    good = length > 0.0
    np.testing.assert_allclose(length[good], 1.0, atol=1e-12)
    assert np.count_nonzero(good) > 30  # the others drew a point twice
    for model in models[good]:
        offset = points - model[:3]
        exact = np.abs(offset @ model[3:]) < 1e-12
        near = np.linalg.norm(offset, axis=1) < np.sqrt(3.0) * RADIUS
        assert np.count_nonzero(exact & near) >= 3


@pytest.mark.parametrize("seed", range(4))
def test_refining_raises_the_score_and_finds_the_sheet(seed):
    points, R = cloud(seed)
    problem = LocalPlanes(points, RADIUS, LIMIT)
    tilt = 0.02
    model = np.array([*(R @ [0.0, 0.0, 0.001]), *(R @ [np.sin(tilt), 0.0, np.cos(tilt)])])
    refined = problem.refine(model)
    before, after = problem.score([model, refined])
    assert after > before
    assert np.linalg.norm(np.cross(refined[3:], R[:, 2])) < 0.25 * tilt
    assert abs((refined[:3]) @ R[:, 2]) < 0.0005


def test_score_and_success_do_not_depend_on_order_pose_or_the_sign_of_the_normal():
    points, _ = cloud(9)
    rng = np.random.default_rng(2)
    problem = LocalPlanes(points, RADIUS, LIMIT)
    models = [problem.refine(m) for m in problem.propose(10, rng)]
    T, t = rotation(rng), np.array([0.5, -0.2, 0.3])
    moved = LocalPlanes(rng.permutation(points) @ T.T + t, RADIUS, LIMIT)
    flipped = [np.array([*(T @ m[:3] + t), *(-T @ m[3:])]) for m in models]
    np.testing.assert_allclose(moved.score(flipped), problem.score(models), rtol=2e-3, atol=0.2)
    for one, other in zip(models, flipped, strict=True):
        assert moved.success_rate(other) == pytest.approx(problem.success_rate(one), abs=2e-3)


def test_success_rate_is_a_quarter_of_the_points_on_the_plane():
    rng = np.random.default_rng(1)
    sheet = rng.uniform(-0.05, 0.05, (1000, 3)) * [1.0, 1.0, 0.0]
    far = rng.uniform(-0.05, 0.05, (1000, 3)) + np.array([0.0, 0.0, 1.0])
    model = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert LocalPlanes(np.vstack([sheet, far]), RADIUS, LIMIT).success_rate(model) == 0.125


def test_points_on_a_line_propose_nothing_that_scores():
    line = np.outer(np.linspace(0.0, 0.1, 50), [1.0, 0.0, 0.0])
    problem = LocalPlanes(line, RADIUS, LIMIT)
    assert (problem.score(problem.propose(20, np.random.default_rng(0))) == 0.0).all()


def test_a_model_away_from_all_points_is_left_as_it_is():
    points, _ = cloud(3)
    model = np.array([5.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    problem = LocalPlanes(points, RADIUS, LIMIT)
    np.testing.assert_array_equal(problem.refine(model), model)
    assert problem.score([model])[0] == 0.0
