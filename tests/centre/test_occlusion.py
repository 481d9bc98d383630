"""Surfaces before a target: found from where it is not seen, and left out with their edges."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.plates import patch_of
from tests.support.scenes import Setup, Sheet, make
from wheelplane.centre import TargetView, occlusion
from wheelplane.centre.occlusion import clear_of_occluders, scanner_by_shadow
from wheelplane.config import CentreConfig, PlaneConfig
from wheelplane.plane import fit_plane
from wheelplane.targets import load_target, parse_target

MARGIN_M, DISTANCE_M = PlaneConfig().edge_margin_m, 3.0
DISC = load_target("disc-250")
RING = parse_target({"shape": "ring", "diameter": 0.25, "hole_diameter": 0.08}, "a test")
OPEN = Setup(spacing_m=0.002, half_width_m=0.15, noise_m=0.0004)


def board(height_m, low_m=0.03, high_m=0.2):
    """A board parallel to the target, over u from low to high."""
    middle = ((low_m + high_m) / 2.0, 0.0, height_m)
    return Sheet(middle, half=((high_m - low_m) / 2.0, 0.25), echo=0.6)


def rod(height_m):
    return board(height_m, 0.05, 0.066)


def viewed(cloud, target=DISC, patch=None):
    patch = patch or patch_of(cloud, target)
    return TargetView(patch, fit_plane(patch, target, PlaneConfig()), target, CentreConfig())


def slopes(view, scanner_m):
    """Slopes of the beams from a position, along u and v of the plane, and its side."""
    u, v, w = view.in_plane((scanner_m - view.patch.origin_m)[None])[0]
    return np.array([-u / w, -v / w]), np.sign(w)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("height_m", [0.02, 0.1, 0.25])
@pytest.mark.parametrize("shape", [board, rod])
def test_the_shadow_shows_the_beams_across_it(shape, height_m, seed):
    """Along the edge of what hides the target it shows nothing."""
    cloud = make(OPEN.but(extra=(shape(height_m),)), seed)
    view = viewed(cloud)
    found, side = slopes(view, scanner_by_shadow(view, MARGIN_M, DISTANCE_M))
    true, true_side = slopes(view, cloud.viewpoint_m)
    across = view.plane.basis[:2] @ cloud.R[:, 0]
    assert side == true_side
    assert abs((found - true) @ across) * height_m < MARGIN_M - 0.0016  # a footprint of 1.6 mm


@pytest.mark.parametrize("by_shadow", [False, True])
@pytest.mark.parametrize("wrong_side", [False, True])
@pytest.mark.parametrize("extra", [board(0.02), board(0.15), rod(0.03), rod(0.008)])
def test_no_mixed_pixel_is_left(extra, by_shadow, wrong_side):
    cloud = make(OPEN.but(extra=(extra,)), 3)
    patch = patch_of(cloud, DISC)
    view = viewed(cloud, patch=patch.turned_round() if wrong_side else patch)
    scanner_m = cloud.viewpoint_m
    if by_shadow:
        scanner_m = scanner_by_shadow(view, MARGIN_M, DISTANCE_M)
    clear = clear_of_occluders(view, MARGIN_M, scanner_m)
    assert clear.basis[2] @ cloud.normal > 0.99
    pure = {tuple(point) for point in np.round(cloud.face_m - clear.origin_m, 7)}
    inside = DISC.region.shrunk(MARGIN_M).holds(clear.face_m @ clear.basis[:2].T)
    near = inside & (np.abs(clear.face_m @ clear.basis[2]) < 0.003)
    left = [tuple(point) in pure for point in np.round(clear.face_m[near], 7)]
    assert len(left) > 0.45 * np.count_nonzero(cloud.on_face)
    assert all(left)


def dust(cloud, share, seed):
    """The cloud's points and strays before the target, that share of those on it."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(cloud.face_m, int(share * len(cloud.face_m)), replace=False)
    ahead = cloud.viewpoint_m - chosen
    strays = chosen + ahead * rng.uniform(0.004, 0.08, (len(chosen), 1))
    return np.vstack([cloud.points_m, strays])


@pytest.mark.parametrize(
    ("setup", "target"),
    [
        (OPEN, DISC),
        (OPEN.but(spacing_m=0.008, half_width_m=0.3), DISC),
        (OPEN.but(keep=lambda u, _: u < 0.02), DISC),  # cut: nothing before it
        (OPEN.but(extra=(Sheet((0, -0.31, 0.3), (0, 1, 0), half=(1.0, 1.0)),)), DISC),  # a floor
        (OPEN.but(holes=((0, 0, 0.04),), extra=(Sheet((0, 0, 0.02), outer=0.015),)), RING),  # a hub
    ],
)
def test_points_of_a_target_that_nothing_hides_stay(setup, target):
    cloud = make(setup, 5)
    view = viewed(cloud, target)
    assert clear_of_occluders(view, MARGIN_M, cloud.viewpoint_m) is view.patch
    assert scanner_by_shadow(view, MARGIN_M, DISTANCE_M) is None


def test_strays_before_a_target_hide_nothing():
    cloud = make(OPEN, 6)
    object.__setattr__(cloud, "points_m", dust(cloud, 0.03, 6))
    view = viewed(cloud)
    assert clear_of_occluders(view, MARGIN_M, cloud.viewpoint_m) is view.patch
    assert scanner_by_shadow(view, MARGIN_M, DISTANCE_M) is None


def test_a_scanner_elsewhere_does_not_let_the_background_hide_a_target():
    """A position that the file states wrongly, behind the target, or off by 40 degrees."""
    cloud = make(OPEN.but(extra=(Sheet((0.3, 0, 0.1), half=(0.14, 0.4)),)), 7)
    view = viewed(cloud)
    behind = cloud.centre_m - 2.5 * cloud.normal
    aside = cloud.centre_m + cloud.R @ np.array([2.0, 0.0, 1.5])
    assert clear_of_occluders(view, MARGIN_M, behind) is view.patch
    assert clear_of_occluders(view, MARGIN_M, aside) is view.patch


@pytest.mark.parametrize("extra", [(), (rod(0.03),), (board(0.15),), (rod(0.008), rod(0.2))])
@pytest.mark.parametrize("share", [0.0, 0.03, 0.3])
def test_the_targets_own_beams_decide_as_all_do(extra, share, monkeypatch):
    cloud = make(OPEN.but(extra=extra), 8)
    object.__setattr__(cloud, "points_m", dust(cloud, share, 8))
    view = viewed(cloud)
    by_few = clear_of_occluders(view, MARGIN_M, cloud.viewpoint_m)
    monkeypatch.setattr(occlusion, "FEW_BEAMS", len(view.patch.face_m))  # one beam decides nothing
    by_all = clear_of_occluders(view, MARGIN_M, cloud.viewpoint_m)
    assert (by_few is view.patch) == (by_all is view.patch)
    assert np.array_equal(by_few.face_m, by_all.face_m)
