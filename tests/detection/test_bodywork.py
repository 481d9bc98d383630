"""Bodywork between two axles, and the gap between two vehicles."""

import numpy as np
import pytest

from tests.support.scenes import rotation
from wheelplane.detection.bodywork import is_bodied

REAR, FRONT, ACROSS = np.array([0.0, 0.0, 0.3]), np.array([2.6, 0.0, 0.3]), np.array([0, 1.5, 0.0])


def side(rng, low, high, height=(0.2, 0.9)):
    """Points of a car's left side, between two places along it, and of the floor."""
    x, z = rng.uniform(low, high, 3_000), rng.uniform(*height, 3_000)
    floor = rng.uniform((-3.0, -3.0), (6.0, 3.0), (3_000, 2))
    panel = np.column_stack([x, np.full(len(x), 0.8), z])
    return np.concatenate([panel, np.column_stack([floor, np.zeros(len(floor))])])


@pytest.mark.parametrize("seed", range(3))
def test_a_side_from_axle_to_axle_is_bodywork_in_any_coordinates(seed):
    rng = np.random.default_rng(seed)
    R, shift = rotation(rng), rng.uniform(-1e3, 1e3, 3)
    for points, whole in (
        (side(rng, -0.7, 3.3), True),
        (np.concatenate([side(rng, -0.7, 0.9), side(rng, 1.5, 3.3)]), False),
        (np.concatenate([side(rng, -0.7, 0.9), side(rng, 2.2, 3.3)]), False),
        (np.concatenate([side(rng, -0.4, 0.4), side(rng, 2.2, 3.0)]), None),  # wheels alone
        (side(rng, -0.7, 3.3, height=(1.0, 2.0)), None),  # a beam above the gap
        (side(rng, -0.7, 3.3) + np.array([0.0, 0.6, 0.0]), None),  # a wall beside it
        (np.zeros((0, 3)), None),
    ):
        moved = points @ R.T + shift
        ends = (R @ REAR + shift, R @ FRONT + shift)
        assert is_bodied(moved, *ends, R @ ACROSS) is whole
        assert is_bodied(moved, *ends[::-1], -(R @ ACROSS)) is whole


def test_axles_closer_than_a_gap_have_none():
    assert is_bodied(np.zeros((0, 3)), REAR, REAR + np.array([0.3, 0.0, 0.0]), ACROSS)
