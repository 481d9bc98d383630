"""Poses of a rotating target: slopes by central differences, rotations by scipy, whitening."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wheelplane.errors import NotMeasuredError
from wheelplane.kinematics.plate_pose import (
    Poses,
    State,
    across,
    residual,
    start,
    turn_about,
    whitening,
)

TURNS = np.array([-0.3, 0.1, 0.35])
AXIS, NORMAL, FACE = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])


def unit(rng):
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def scene(extra=(0.0, 0.0, 0.0), period=np.pi / 2):
    """Exact poses about the z axis whose in-plane rotation is seen, each off by `extra`."""
    rotations = [Rotation.from_rotvec(turn * AXIS) for turn in TURNS]
    normals = np.stack([R.apply(NORMAL) for R in rotations])
    centres = np.stack([R.apply([0.1, 0.5, 0.3]) for R in rotations])
    faces = np.stack(
        [Rotation.from_rotvec(more * n).apply(R.apply(FACE))
         for R, n, more in zip(rotations, normals, extra, strict=True)]
    )  # fmt: skip
    return Poses(normals, centres, np.eye(21) * 1e-8, (0, 1, 2), faces, np.full(3, period))


@pytest.mark.parametrize("seed", range(5))
def test_rotation_about_an_axis_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    axis, angle = unit(rng), rng.uniform(-np.pi, np.pi)
    expected = Rotation.from_rotvec(angle * axis).as_matrix()
    np.testing.assert_allclose(turn_about(axis, angle), expected, atol=1e-14)


@pytest.mark.parametrize("vector", [*np.eye(3), [0.6, -0.64, 0.48]])
def test_the_two_vectors_across_complete_a_basis(vector):
    basis = np.vstack([across(np.array(vector)), vector])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-14)


def test_slopes_of_the_residual_are_its_central_differences():
    rng = np.random.default_rng(7)
    seen = scene()
    sides = np.stack([across(normal) for normal in seen.normals])
    axis, normal = unit(rng), unit(rng)
    state = State(axis, rng.normal(size=3), normal, rng.normal(size=3), TURNS + 0.05,
                  across(normal)[0])  # fmt: skip
    _, slopes = residual(state, seen, sides)
    numbers = slopes.shape[1]
    assert slopes.shape == (5 * 3 + 3, 9 + 3 + 1)
    for column in range(numbers):
        step = 1e-6 * np.eye(numbers)[column]
        plus, minus = (residual(state.moved(way * step), seen, sides)[0] for way in (1, -1))
        np.testing.assert_allclose(slopes[:, column], -(plus - minus) / 2e-6, atol=1e-8)


def test_whitened_observations_are_independent_with_unit_variance():
    rng = np.random.default_rng(3)
    seen = scene()
    root = rng.normal(size=(21, 21))
    seen = Poses(seen.normals, seen.centres_m, root @ root.T, seen.with_face, seen.faces,
                 seen.periods_rad)  # fmt: skip
    L, B = whitening(np.stack([across(normal) for normal in seen.normals]), seen)
    white = np.linalg.solve(L, B) @ root
    np.testing.assert_allclose(white @ white.T, np.eye(len(L)), atol=1e-6)


def test_equal_in_plane_rotations_are_taken_as_the_nearest():
    state, plain = start(scene(), TURNS, AXIS)
    _, back = start(scene((0.0, np.pi / 2, -np.pi)), TURNS, AXIS)
    np.testing.assert_allclose(back.faces, plain.faces, atol=1e-12)
    np.testing.assert_allclose(state.normal, NORMAL, atol=1e-12)
    left, _ = residual(state, back, np.stack([across(normal) for normal in back.normals]))
    np.testing.assert_allclose(left, 0.0, atol=1e-12)


def test_an_in_plane_rotation_between_two_equal_ones_is_refused():
    with pytest.raises(NotMeasuredError) as error:
        start(scene((0.0, np.pi / 4, 0.0)), TURNS, AXIS)
    assert error.value.status == "not-one-axis"
