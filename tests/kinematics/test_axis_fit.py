"""The axis of a target that rotates: exact poses, rigid motions, slopes, and what has no axis."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wheelplane.errors import NotMeasuredError
from wheelplane.kinematics.axis_fit import fit_one_axis
from wheelplane.kinematics.plate_pose import Poses

AXIS = np.array([0.2, -0.3, 0.93]) / np.linalg.norm([0.2, -0.3, 0.93])
POINT = np.array([0.4, -0.1, 0.2])
NORMAL = np.array([0.1, 0.97, 0.2]) / np.linalg.norm([0.1, 0.97, 0.2])
CENTRE = np.array([0.5, 0.3, 0.25])
TURNS = np.radians([-20.0, -8.0, 3.0, 21.0])
U_TURNS = np.array([1e-3, np.inf, np.inf, np.inf])


def poses(turns=TURNS, motion=None, shift=0.0):
    """Exact poses of a target that rotates about AXIS through POINT, then moved as a whole."""
    motion = motion or Rotation.identity()
    rotations = [Rotation.from_rotvec(turn * AXIS) for turn in turns]
    normals = np.stack([motion.apply(R.apply(NORMAL)) for R in rotations])
    centres = np.stack([motion.apply(POINT + R.apply(CENTRE - POINT)) + shift for R in rotations])
    variances = np.tile(np.repeat([1e-10, 1e-8], 3), len(turns))
    return Poses(normals, centres, np.diag(variances), (), np.zeros((0, 3)), np.zeros(0))


def off_axis(fit, point, axis):
    """Distance of a point of the true axis from the fitted one."""
    return np.linalg.norm(np.cross(point - fit.point_m, axis))


def test_exact_poses_give_axis_point_and_rotations():
    fit = fit_one_axis(
        poses(), TURNS + 0.01 * (TURNS[0] != TURNS), U_TURNS, AXIS + np.array([0.05, 0.0, 0.0])
    )
    np.testing.assert_allclose(fit.axis, AXIS, atol=1e-9)
    np.testing.assert_allclose(fit.turns_rad, TURNS, atol=1e-8)
    np.testing.assert_allclose(fit.normal, NORMAL, atol=1e-9)
    np.testing.assert_allclose(fit.centre_m, CENTRE, atol=1e-9)
    assert off_axis(fit, POINT, AXIS) < 1e-9
    assert fit.axis @ (fit.centre_m - fit.point_m) == pytest.approx(0.0, abs=1e-12)
    assert (fit.dof, fit.chi_square) == (5 * 4 + 1 - 13, pytest.approx(0.0, abs=1e-6))


def test_the_axis_moves_with_the_scanner():
    motion, shift = Rotation.from_rotvec([0.7, -0.4, 1.3]), np.array([5.0, -2.0, 1.0])
    fit = fit_one_axis(poses(motion=motion, shift=shift), TURNS, U_TURNS, motion.apply(AXIS))
    np.testing.assert_allclose(fit.axis, motion.apply(AXIS), atol=1e-9)
    assert off_axis(fit, motion.apply(POINT) + shift, fit.axis) < 1e-9


def test_slopes_are_those_of_the_fit_itself():
    """Central differences by one coordinate of a centre, and by a tilt of a normal."""
    exact = poses()
    fit = fit_one_axis(exact, TURNS, U_TURNS, AXIS)

    def moved(place, column, way, step):
        name = "normals" if column == 0 else "centres_m"
        values = getattr(exact, name).copy()
        values[place] += step * way
        values[place] /= np.linalg.norm(values[place]) if column == 0 else 1.0
        return fit_one_axis(replace(exact, **{name: values}), TURNS, U_TURNS, AXIS)

    for place, column, way in (
        (1, 3, np.array([1.0, 0.0, 0.0])),
        (3, 3, np.array([0.0, 0.6, 0.8])),
        (2, 0, np.cross(exact.normals[2], [0.0, 0.0, 1.0])),
    ):
        plus, minus = (moved(place, column, way, h) for h in (1e-6, -1e-6))
        at = slice(6 * place + column, 6 * place + column + 3)
        for slopes, high, low in (
            (fit.d_axis, plus.axis, minus.axis),
            (fit.d_point, plus.point_m, minus.point_m),
            (fit.d_turns, plus.turns_rad, minus.turns_rad),
        ):
            expected = (high - low) / 2e-6
            assert np.abs(expected).max() > 1e-3
            np.testing.assert_allclose(slopes[:, at] @ way, expected, atol=1e-5)


def test_poses_that_do_not_rotate_have_no_axis():
    with pytest.raises(NotMeasuredError) as error:
        fit_one_axis(poses(np.zeros(4)), np.zeros(4), U_TURNS, AXIS)
    assert error.value.status == "no-axis"
