"""The preview of a cloud: its own points, scattered over it, reproducible."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from wheelplane.cloud.preview import OF_A_SCAN, by_wheel, cloud_sample

CENTRES = np.array([[0.0, -0.75, 0.3], [0.0, 0.75, 0.3], [2.7, -0.75, 0.3], [2.7, 0.75, 0.3]])


def cloud(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-3.0, -4.0, 0.0], [6.0, 4.0, 2.0], (count, 3))


@pytest.mark.parametrize("count", [0, 1, 100, OF_A_SCAN, 50_000, 400_000])
def test_points_are_the_clouds_own_and_about_as_many(count):
    points = cloud(count) + np.array([1e5, -2e5, 0.0])
    kept = cloud_sample(points)
    assert kept.offsets_m.dtype == np.float32
    assert len(kept.points_m) <= 1.1 * OF_A_SCAN
    assert len(kept.points_m) >= min(count, 0.9 * OF_A_SCAN)
    if count:  # float32 holds 5 m to 2.4e-7 m, float64 2e5 m to 3e-11 m
        apart, rows = cKDTree(points - points[0]).query(kept.points_m - points[0])
        assert apart.max() < 1e-6
        assert len(np.unique(rows)) == len(rows)


def test_the_same_points_every_time_and_from_all_over():
    points = cloud(200_000)
    one, other = cloud_sample(points), cloud_sample(points.copy())
    np.testing.assert_array_equal(one.offsets_m, other.offsets_m)
    # the mean of n uniform positions is off by width/sqrt(12 n)
    width = np.array([9.0, 8.0, 2.0])
    off = np.abs(one.points_m.mean(axis=0) - points.mean(axis=0))
    assert (off < 5.0 * width / np.sqrt(12 * len(one.points_m))).all()
    assert (off > 0.0).all()


def test_each_wheel_gets_the_points_nearest_to_it():
    points = np.vstack([cloud(60_000), [[500.0, 0.0, 0.0]]])
    parts = by_wheel(points, CENTRES, 40_000)
    assert sum(len(part.points_m) for part in parts) <= 40_000
    for index, part in enumerate(parts):
        assert len(part.points_m) > 4000
        apart = np.linalg.norm(part.points_m[:, None] - CENTRES, axis=2)
        own = apart[:, index]
        assert (own <= apart.min(axis=1) + 1e-5).all()
        assert own.max() < 10.0  # the far point is none of the vehicle's


def test_of_a_target_in_a_hall_half_are_close_to_it_and_none_are_of_the_hall():
    """In the first quarter as in the whole; of all, 1 in 20 is close to it."""
    rng = np.random.default_rng(2)
    hall = rng.uniform([-30, -30, -3], [30, 30, 9], (300_000, 3))
    car = rng.uniform([-0.5, -2.0, -0.3], [3.2, 0.0, 1.2], (80_000, 3))
    target = np.array([1.0, -0.5, 0.2])
    plate = target + rng.uniform(-0.1, 0.1, (20_000, 3))
    kept = cloud_sample(np.vstack([hall, car, plate]), target_m=target).points_m
    assert 0.9 * OF_A_SCAN < len(kept) < 1.1 * OF_A_SCAN
    apart = np.linalg.norm(kept - target, axis=1)
    assert apart.max() < 6.0
    for part in (apart, apart[: len(apart) // 4]):
        assert 0.4 < np.mean(part < 0.25) < 0.6


@pytest.mark.parametrize("count", [0, 5, 3000])
def test_few_points_are_all_kept_about_a_target(count):
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (count, 3))
    kept = cloud_sample(points, target_m=np.zeros(3))
    assert len(kept.points_m) == count
