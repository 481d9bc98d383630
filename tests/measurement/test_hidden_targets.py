"""Targets hidden in part: detection is off by more than the margin, and what hides them mixes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.plates import patch_of
from tests.support.scenes import Setup, Sheet, make
from wheelplane.config import Config
from wheelplane.detection import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.measure import fit_target
from wheelplane.plane import fit_plane
from wheelplane.targets import load_target, parse_target

CONFIG = Config()
DISC = load_target("disc-250")
PLATE = parse_target({"shape": "rectangle", "width": 0.3, "height": 0.2}, "a test")
DISC_SCENE = Setup(spacing_m=0.002, half_width_m=0.15, keep=lambda u, _: u < 0.02)
PLATE_SCENE = DISC_SCENE.but(half_m=(0.15, 0.1), half_width_m=0.2)


def by_truth(cloud, target):
    """A patch with its origin and axes where they are in truth."""
    patch = patch_of(cloud, target)
    axes = patch.basis[:2] @ cloud.R[:, 0]
    turn = np.arctan2(axes[1], axes[0]) if target.turn_period_rad else 0.0
    return patch.placed(cloud.centre_m, turn)


def moved(patch, shift_m, turn_rad=0.0):
    """The patch of a detection that is off along u and v, and by a rotation."""
    return patch.placed(patch.origin_m + np.array(shift_m) @ patch.basis[:2], turn_rad)


def apart_in_u(one, other):
    """Length of the difference of two normals, in the first one's standard uncertainties."""
    plane, fitted = one.plane, one.target
    off = plane.basis[:2] @ (other.plane.normal - plane.normal)
    covariance = plane.basis[:2] @ fitted.normal_covariance @ plane.basis[:2].T
    return float(np.sqrt(off @ np.linalg.solve(covariance, off)))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("scene", "target", "shift_m", "turn_rad"),
    [
        (DISC_SCENE, DISC, (0.013, 0.0), 0.0),
        (DISC_SCENE, DISC, (-0.005, -0.009), 0.0),
        (PLATE_SCENE, PLATE, (-0.008, 0.002), 0.0),
        (PLATE_SCENE, PLATE, (0.0, 0.0), 0.06),
    ],
)
def test_the_plane_does_not_depend_on_where_detection_put_the_target(
    scene, target, shift_m, turn_rad, seed
):
    true = by_truth(make(scene, seed), target)
    right = fit_target(true, target, CONFIG)
    off = fit_target(moved(true, shift_m, turn_rad), target, CONFIG)
    assert apart_in_u(right, off) < 0.15
    assert abs(off.plane.count / right.plane.count - 1.0) < 0.005


def test_where_detection_is_near_enough_the_first_fit_stands():
    cloud = make(DISC_SCENE.but(keep=None), 1)
    patch = moved(by_truth(cloud, DISC), (0.001, 0.001))
    found, first = fit_target(patch, DISC, CONFIG).plane, fit_plane(patch, DISC, CONFIG.plane)
    assert found.centroid_m.tobytes() == first.centroid_m.tobytes()
    assert found.basis.tobytes() == first.basis.tobytes()


def board(height_m, low_m=0.03, high_m=0.2):
    """A board before the target, over u from low to high."""
    middle = ((low_m + high_m) / 2.0, 0.0, height_m)
    return Sheet(middle, half=((high_m - low_m) / 2.0, 0.25), echo=0.6)


@pytest.mark.parametrize("wrong_side", [False, True])
def test_a_board_before_a_target_takes_away_its_part_alone(wrong_side):
    """Detection takes the side with more points for the back: here it may be that of the board."""
    scene = DISC_SCENE.but(keep=None, extra=(board(0.02),))
    sharp = DISC.model_copy(update={"chamfer": 0.0})
    cloud = make(scene, 2)
    patch = by_truth(cloud, sharp)
    found = fit_target(patch.turned_round() if wrong_side else patch, sharp, CONFIG)
    fitted = found.target
    assert fitted.method == "rim"
    assert fitted.normal @ cloud.normal > 0.99
    assert fitted.edge_fit.covered > 0.5
    off = cloud.R[:, :2].T @ (fitted.centre_m - cloud.centre_m)
    covariance = cloud.R[:, :2].T @ fitted.centre_covariance_m2 @ cloud.R[:, :2]
    assert off @ np.linalg.solve(covariance, off) < 4.0**2
    assert np.trace(covariance) < 2.0 * 5e-5**2  # without an edge fit: 0.5 mm


def scaled_errors(scene, seeds):
    """Errors of normals (N, 2) along the target's axes, in their standard uncertainties."""
    scaled = []
    for seed in seeds:
        cloud = make(scene, seed)
        try:
            patch = find_target(cloud.points_m, DISC, CONFIG.segment, 0)
        except NotMeasuredError:
            continue
        fitted = fit_target(patch, DISC, CONFIG).target
        axes = cloud.R[:, :2]
        normal = fitted.normal * np.sign(fitted.normal @ cloud.normal)
        u = np.sqrt(np.diag(axes.T @ fitted.normal_covariance @ axes))
        scaled.append(axes.T @ (normal - cloud.normal) / u)
    return np.array(scaled)


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene",
    [
        DISC_SCENE.but(keep=lambda u, _: u < 0.05),  # 25 % hidden
        DISC_SCENE.but(keep=lambda u, _: u < 0.01),  # 45 %
        *(DISC_SCENE.but(keep=None, extra=(board(h),)) for h in (0.01, 0.03)),
        *(DISC_SCENE.but(keep=None, extra=(board(h, 0.05, 0.066),)) for h in (0.008, 0.1)),
    ],
)
def test_errors_of_targets_hidden_in_part_are_their_uncertainty(scene):
    scaled = scaled_errors(scene, range(40))
    count = len(scaled)
    assert count > 20
    assert np.all(np.abs(scaled.mean(axis=0)) < 3.0 * scaled.std(axis=0) / np.sqrt(count))
    assert 0.8 < np.sqrt(np.mean(scaled**2)) < 1.25
