"""How a target lies turned about its own normal: true, honest on its u, none of round plates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.support.plates import fit, patch_of
from tests.support.printing import setup_of
from tests.support.scenes import Setup, make
from tests.support.single_scan import u_turn_rad
from wheelplane.centre.in_plane_rotation import PlaneRotation, combined_rotation
from wheelplane.centre.locate_centre import locate_centre
from wheelplane.centre.target_view import TargetView
from wheelplane.config import CentreConfig, PlaneConfig
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.targets.registry import load_target
from wheelplane.uncertainty.components import pointing_component

PLAIN = Setup(spacing_m=0.0022, half_width_m=0.24, pairs=12)
PERIODS = {
    "rectangle-360x240": ("edges", np.pi),
    "square-300": ("edges", np.pi / 2.0),
    "pattern-circles": ("print", np.pi / 2.0),
    "pattern-checkerboard": ("print", np.pi),
    "pattern-aruco": ("print", 2.0 * np.pi),
}


def made(name, seed, **changes):
    target = load_target(name)
    return make(setup_of(target, PLAIN).but(**changes), seed), target


def off(cloud, fitted):
    """Of the face from its true turn about its normal, radians, less whole periods."""
    u, period = cloud.R[:, 0], fitted.turn.period_rad
    angle = np.arctan2(np.cross(fitted.normal, u) @ fitted.turn.axis, u @ fitted.turn.axis)
    return angle - period * np.round(angle / period)


@pytest.mark.parametrize("name", PERIODS)
def test_edges_and_print_show_the_turn(name):
    """To a tenth of a milliradian, where the coarse look leaves fifty."""
    cloud, target = made(name, 1)
    fitted = fit(cloud, target, 1)
    assert (fitted.turn.mark, fitted.turn.period_rad) == pytest.approx(PERIODS[name])
    assert abs(fitted.turn.axis @ fitted.normal) < 1e-12
    assert np.linalg.norm(fitted.turn.axis) == pytest.approx(1.0, abs=1e-12)
    assert 1e-5 < u_turn_rad(fitted) < 1.2e-4
    assert abs(off(cloud, fitted)) < 3.72 * u_turn_rad(fitted)


@pytest.mark.parametrize("name", ["disc-250", "ring-300"])
def test_round_plates_show_none(name):
    cloud, target = made(name, 1)
    fitted = fit(cloud, target, 1)
    assert fitted.turn is None
    assert u_turn_rad(fitted) is None
    assert all(component.turn is None for component in fitted.components)
    assert all(component.factor.shape[1] in (2, 3) for component in fitted.components)


@pytest.mark.slow
def test_errors_are_no_larger_than_stated():
    """And no smaller than half of that, which is more of the model than its noise alone."""
    square, of_noise = [], []
    for seed in range(24):
        cloud, target = made("rectangle-360x240", seed)
        fitted = fit(cloud, target, seed)
        square.append((off(cloud, fitted) / u_turn_rad(fitted)) ** 2)
        of_noise.append(off(cloud, fitted) ** 2 / fitted.edge_fit.rotation_noise[2])
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(square)) / len(square)
    assert low / 4.0 < np.mean(square) < high
    assert low < np.mean(of_noise) < high


def test_without_background_the_turn_is_loose():
    cloud, target = made("square-300", 2, background_m=None)
    fitted = fit(cloud, target, 2)
    assert abs(off(cloud, fitted)) < 3.72 * u_turn_rad(fitted)
    assert 1e-3 < u_turn_rad(fitted) < 0.02


def test_the_turn_moves_with_the_scan():
    cloud, target = made("rectangle-360x240", 3, shift_m=(0.0, 0.0, 0.0))
    here = fit(cloud, target, 3)
    R = Rotation.from_rotvec([0.7, -0.4, 1.9]).as_matrix()
    moved = replace(
        cloud, points_m=cloud.points_m @ R.T, centre_m=R @ cloud.centre_m, R=R @ cloud.R
    )
    there = fit(moved, target, 3)
    assert off(moved, there) == pytest.approx(off(cloud, here), abs=0.02 * u_turn_rad(here))
    assert u_turn_rad(there) == pytest.approx(u_turn_rad(here), rel=0.01)


@pytest.mark.parametrize("name", ["rectangle-360x240", "pattern-checkerboard"])
@pytest.mark.parametrize("slope", [(1e-3, 0.0), (0.0, 1e-3)])
def test_a_leaning_plane_turns_a_face_that_is_seen_aslant(name, slope):
    """Its cause says by how much: the face is fitted again on the plane that leans."""
    cloud, target = made(name, 4, incidence_deg=30.0)
    patch = patch_of(cloud, target, 4)
    plane = fit_plane(patch, target, PlaneConfig())
    lean = np.array([0.0, *slope])
    known = replace(plane, correlated=replace(plane.correlated, covariance=np.outer(lean, lean)))
    before = locate_centre(TargetView(patch, known, target, CentreConfig()))
    (component,) = (c for c in before.components if c.name == "correlated noise")
    b = plane.basis
    column = int(np.argmax(np.linalg.norm(component.factor[:3], axis=0)))
    sign = np.sign(-(lean[1:] @ b[:2]) @ component.factor[:3, column])
    u, v = b[0] + slope[0] * b[2], b[1] + slope[1] * b[2]
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    tilted = np.stack([u / np.linalg.norm(u), np.cross(normal, u / np.linalg.norm(u)), normal])
    after = locate_centre(TargetView(patch, replace(plane, basis=tilted), target, CentreConfig()))
    angle = [np.arctan2(basis[1] @ f.turn.axis, basis[0] @ f.turn.axis)
             for basis, f in ((b, before), (tilted, after))]  # fmt: skip
    moved = angle[1] - angle[0]
    assert moved == pytest.approx(sign * component.turn[column], abs=0.02 * 1e-3)
    assert np.abs(moved) > 0.09 * 1e-3  # none at all, and the other way, fail


def test_a_scan_that_is_turned_turns_the_face():
    n = np.array([0.36, 0.48, 0.8])
    u = np.cross(n, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(n, [0.0, 0.0, 1.0]))
    component = pointing_component(1e-6, 8.0 * n, n)
    for axis in range(3):
        moved = Rotation.from_rotvec(1e-6 * np.eye(3)[axis]).apply(u)
        assert component.turn[axis] == pytest.approx(np.cross(n, u) @ moved, abs=1e-11)


def turn_of(mark, angle, variance, with_centre=(0.0, 0.0)):
    return PlaneRotation(mark, angle, 1.0, np.array([*with_centre, variance]), 0.0, np.zeros(3))


def test_edges_count_by_their_variances_and_not_beside_a_print():
    half = 0.5 * np.eye(2)
    a, b = turn_of("edges", 0.1, 1.0, (0.2, 0.4)), turn_of("edges", 0.4, 2.0)
    both = combined_rotation([a, b, None], [half, half, half])
    assert both.angle_rad == pytest.approx(0.2)
    assert both.noise == pytest.approx([2 / 3 * 0.5 * 0.2, 2 / 3 * 0.5 * 0.4, 2 / 3])
    printed = combined_rotation([a, turn_of("print", 0.3, 9.0)], [half, half])
    assert (printed.mark, printed.angle_rad) == ("print", pytest.approx(0.3))
    assert combined_rotation([None], [half]) is None
