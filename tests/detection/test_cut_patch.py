"""The patch cut about a candidate: all points of the target, its surroundings, and its front."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.detection.candidates import Candidate
from wheelplane.detection.cut_patch import MAX_DEPTH_M, around_slab, cut_patch
from wheelplane.errors import NotMeasuredError
from wheelplane.targets.plates import DiscTarget

DISC = DiscTarget(shape="disc", diameter=0.25)
CENTRE = np.array([1.0, -2.0, 0.5])
BAND = 0.01


def scene(seed, count=4000):
    """Points (N, 3) of a disc w = 0, and of a wheel 0.1 m behind it; which are the disc's."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-0.125, 0.125, (count, 2))
    disc = np.column_stack([uv, rng.normal(0.0, 0.0008, count)])[np.hypot(*uv.T) < 0.125]
    wheel = rng.uniform([-0.3, -0.3, -0.12], [0.3, 0.3, -0.1], (count, 3))
    order = rng.permutation(len(disc) + count)
    return np.vstack([disc, wheel])[order], order < len(disc)


def cut(points, R, sign=1.0, most=100_000, intensity=None):
    basis = R.T * np.array([[1.0], [sign], [sign]])
    candidate = Candidate(CENTRE, basis, 0.9, 0.0008, BAND, len(points))
    return cut_patch(points @ R.T + CENTRE, intensity, candidate, DISC, most)


@pytest.mark.parametrize("seed", range(3))
def test_all_points_of_the_target_are_on_it_with_their_intensities(seed):
    points, on_disc = scene(seed)
    R = rotation(np.random.default_rng(seed))
    intensity = np.arange(len(points), dtype=np.float32)
    patch = cut(points, R, intensity=intensity)
    np.testing.assert_array_equal(np.sort(patch.face_intensity), intensity[on_disc])
    local = patch.face_m @ R
    row = patch.face_intensity.astype(int)
    np.testing.assert_allclose(local, points[row], atol=1e-12)
    assert len(patch.around_m) > 0
    assert (np.abs(patch.around_m @ R[:, 2]) >= BAND - 1e-6).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_normal_points_away_from_the_wheel(sign):
    points, _ = scene(1)
    R = rotation(np.random.default_rng(4))
    patch = cut(points, R, sign)
    assert patch.basis[2] @ R[:, 2] > 0.999
    assert np.linalg.det(patch.basis) > 0.0
    mirrored = cut(points * [1.0, 1.0, -1.0], R, sign)
    assert mirrored.basis[2] @ R[:, 2] < -0.999


def test_a_floor_in_front_does_not_flip_the_normal():
    points, _ = scene(2)
    rng = np.random.default_rng(3)
    floor = rng.uniform([-1.0, -0.4, 0.0], [1.0, -0.38, 0.7], (20_000, 3))
    patch = cut(np.vstack([points, floor]), np.eye(3))
    in_front = np.count_nonzero(patch.around_m[:, 2] > 0.0)
    assert in_front > np.count_nonzero(patch.around_m[:, 2] < 0.0)  # the null answer
    assert patch.basis[2, 2] > 0.0


def test_surroundings_are_thinned_and_the_target_is_not():
    points, on_disc = scene(5)
    wheel = np.count_nonzero(~on_disc)
    patch = cut(points, np.eye(3), most=wheel // 4)
    assert patch.around_share == pytest.approx(0.25, rel=1e-3)
    assert len(patch.face_m) == np.count_nonzero(on_disc)
    assert len(patch.around_m) == pytest.approx(wheel / 4, abs=5.0 * np.sqrt(wheel * 3 / 16))


def test_slab_of_the_surroundings_widens_with_depth_within_its_limits():
    slab = around_slab(DISC)
    depth = np.array([0.0, 0.1, 0.2, 0.5])
    reach = np.array([_widest(slab, d) for d in depth])
    assert (np.diff(reach) >= 0.0).all()
    assert reach[1] > reach[0] > DISC.radius_m
    assert not slab.holds(np.array([0.0]), np.array([MAX_DEPTH_M * 1.01]))[0]


def _widest(slab, depth):
    """The largest distance from the axis that the slab holds at a depth, to a millimetre."""
    aside = np.arange(0.0, 5.0, 0.001)
    return aside[slab.holds(aside**2, np.full(len(aside), depth))].max()


@pytest.mark.parametrize("count", [0, 29])
def test_too_few_points_on_the_target_are_refused(count):
    points, on_disc = scene(6)
    few = np.vstack([points[on_disc][:count], points[~on_disc]])
    with pytest.raises(NotMeasuredError, match=f"{count} points on the target, 30") as caught:
        cut(few, np.eye(3))
    assert caught.value.status == "too-few-points"
