"""The wheel's patch."""

import numpy as np
import pytest

from tests.support.round_wheels import axis_of, door_points, wheel_points
from wheelplane.config import Config
from wheelplane.targets import parse_target
from wheelplane.wheel import find_patch
from wheelplane.wheel.find_wheel import find_wheel


@pytest.mark.parametrize("seed", range(4))
def test_the_patch_faces_outwards_and_holds_the_wheel_alone(seed):
    rng = np.random.default_rng(seed)
    centre, direction = axis_of(rng)
    wheel = wheel_points(rng, centre, direction)
    far = centre + 3.0 + rng.normal(0.0, 0.1, (500, 3))
    points = np.concatenate([wheel, door_points(rng, centre, direction), far])
    found = find_wheel(points)
    assert found.basis[2] @ direction > 0.99
    assert np.linalg.norm(found.face_m + found.origin_m - centre, axis=1).max() < 0.5
    assert len(found.face_m) > 0.9 * len(wheel)


def test_a_target_named_wheel_is_the_wheel():
    rng = np.random.default_rng(9)
    centre, direction = axis_of(rng)
    points = wheel_points(rng, centre, direction)
    target = parse_target({"shape": "wheel"}, "test")
    found = find_patch(points, target, Config())
    assert np.array_equal(found.face_m, find_wheel(points).face_m)
