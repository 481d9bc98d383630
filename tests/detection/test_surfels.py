"""Surfels of a cloud, the surfaces they form, and candidate positions of the target on them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import WHEEL, make, rotation
from wheelplane.cloud.moments import sums_by
from wheelplane.cloud.voxel_grid import box, voxel_key, voxel_moments
from wheelplane.detection.hypotheses import hypotheses, joined
from wheelplane.detection.surfels import (
    CACHED,
    _local_noise,
    _neighbours,
    _planes,
    find_surfels,
    planes_of,
)
from wheelplane.targets.plates import DiscTarget

DISC = DiscTarget(shape="disc", diameter=0.25)
EDGE, LIMIT = 0.031, 0.004


def sheet(width, height, sigma, seed, density=40_000):
    """A rectangle about the origin in z = 0, with noise across it."""
    rng = np.random.default_rng(seed)
    count = int(density * width * height)
    uv = rng.uniform(-0.5, 0.5, (count, 2)) * [width, height]
    return np.column_stack([uv, rng.normal(0.0, sigma, count)])


def surfels_of(points):
    return find_surfels(voxel_moments(points, box(points)[0] - EDGE, EDGE), LIMIT)


@pytest.mark.parametrize("seed", range(5))
def test_planes_agree_with_the_eigenvectors(seed):
    rng = np.random.default_rng(seed)
    groups = [rng.normal(size=(30, 3)) * [1.0, 0.6, 0.02] @ rotation(rng).T + rng.normal(size=3)
              for _ in range(50)]  # fmt: skip
    which = np.repeat(np.arange(50), 30)
    centroid, normal, spread = planes_of(sums_by(which, np.concatenate(groups), 50))
    for k, points in enumerate(groups):
        values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
        np.testing.assert_allclose(centroid[k], points.mean(axis=0), atol=1e-12)
        assert abs(normal[k] @ vectors[:, 0]) > 1.0 - 1e-9
        np.testing.assert_allclose(spread[k] ** 2, values[:2], rtol=1e-6, atol=1e-8)
        assert normal[k][np.argmax(np.abs(normal[k]))] > 0.0


def test_planes_of_a_point_and_of_a_line_are_finite():
    line = np.outer(np.arange(8.0), [1.0, 2.0, 3.0])
    both = np.concatenate([np.ones((8, 3)), line])
    answers = planes_of(sums_by(np.repeat([0, 1], 8), both, 2))
    assert all(np.isfinite(part).all() for part in answers)


@pytest.mark.parametrize(("count", "side"), [(0, 5), (1, 5), (40, 5), (300, 7), (343, 7)])
def test_noise_is_the_lower_third_of_that_of_the_voxels_that_touch(count, side):
    rng = np.random.default_rng(count)
    key = np.sort(rng.choice(side**3, count, replace=False))
    index = np.stack(np.unravel_index(key, (side,) * 3), axis=1) + 1
    sigma = rng.uniform(1.0, 2.0, count).astype(np.float32).astype(float)
    of_step = _neighbours(voxel_key(index))
    apart = np.abs(index[:, None] - index).max(axis=2)
    found = {tuple(pair) for pairs in of_step for pair in pairs.T.tolist()}
    assert found == {(i, j) for i, j in np.argwhere(apart == 1).tolist() if i < j}
    thirds = [np.sort(sigma[near])[(np.sum(near) - 1) // 3] for near in apart <= 1]
    np.testing.assert_array_equal(_local_noise(sigma, of_step), thirds)


def test_planes_are_those_of_all_voxels_at_once_and_none_of_none():
    points = np.random.default_rng(1).uniform(0.0, 1.0, (60_000, 3))
    voxels = voxel_moments(points, np.full(3, -EDGE), EDGE)
    row = np.arange(0, len(voxels.key), 2)
    assert len(row) > CACHED
    for rows in (row, row[:0]):
        for part, whole in zip(_planes(voxels, rows), planes_of(voxels.sums[rows]), strict=True):
            np.testing.assert_allclose(part, whole, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_sheet_is_one_surface_and_points_in_space_are_none(seed):
    rng = np.random.default_rng(seed)
    points = sheet(0.6, 0.4, 8e-4, seed) @ rotation(rng).T
    found = surfels_of(points)
    largest = np.bincount(found.surface).max()
    assert largest > 0.9 * len(found.row)
    assert len(found.row) > 0.6 * 0.6 * 0.4 / EDGE**2
    space = surfels_of(rng.uniform(-0.3, 0.3, (20_000, 3)))
    assert len(space.row) == 0 or np.bincount(space.surface).max() < 0.1 * largest


@pytest.mark.parametrize("step", [0.005, 0.008, 0.02])
@pytest.mark.parametrize("sigma", [3e-4, 8e-4])
def test_a_step_separates_two_surfaces(sigma, step):
    rng = np.random.default_rng(7)
    plate, behind = sheet(0.24, 0.24, sigma, 1), sheet(0.5, 0.5, sigma, 2)
    behind = behind[np.abs(behind[:, :2]).max(axis=1) > 0.12] - [0.0, 0.0, step]
    found = surfels_of(np.concatenate([plate, behind]) @ rotation(rng).T)
    two = np.sort(np.bincount(found.surface))[-2:]
    expected = 0.24**2 / EDGE**2
    assert 0.5 * expected < two[0]  # the plate, less the cubes across its edge
    assert two[1] < 6.0 * expected


def test_a_curved_surface_is_connected_but_its_normals_rotate():
    rng = np.random.default_rng(0)
    turn = rng.uniform(0, np.pi / 2, 60_000)
    points = np.column_stack([np.cos(turn), np.sin(turn), rng.uniform(0, 0.5, len(turn))])
    found = surfels_of(points + rng.normal(0, 3e-4, points.shape))
    assert np.bincount(found.surface).max() > 0.8 * len(found.row)
    assert np.linalg.norm(found.normal[:, 2]) < 0.1 * np.sqrt(len(found.row))


@pytest.mark.parametrize("seed", range(4))
def test_first_hypothesis_is_the_target(seed):
    cloud = make(WHEEL, seed)
    points = cloud.points_m
    found = hypotheses(surfels_of(points), DISC)
    best = found[0]
    assert np.linalg.norm(best.centre_m - cloud.centre_m) < EDGE
    assert abs(best.normal @ cloud.normal) > np.cos(0.02)
    assert [h.score for h in found] == sorted((h.score for h in found), reverse=True)
    for k, one in enumerate(found):  # none twice
        for other in found[:k]:
            offset = one.centre_m - other.centre_m
            near = np.linalg.norm(offset) < 0.0625 and abs(offset @ one.normal) < 0.01
            assert not (near and abs(one.normal @ other.normal) > 0.9)


def test_a_target_cut_in_two_by_a_shadow_is_one_hypothesis():
    rng = np.random.default_rng(4)
    disc = sheet(0.25, 0.25, 8e-4, 5)
    disc = disc[np.hypot(disc[:, 0], disc[:, 1]) < 0.125]
    cut = disc[np.abs(disc[:, 0]) > 0.04] @ rotation(rng).T
    surfels = surfels_of(cut)
    parts = hypotheses(surfels, DISC)
    found = joined(parts, surfels, DISC, LIMIT)
    assert found[0].score > parts[0].score
    assert np.linalg.norm(found[0].centre_m) < 0.03
    assert found[0].score > 0.4
