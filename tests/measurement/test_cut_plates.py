"""Plates of which a scan ends in the middle: what is left may fit at several placements."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.scenes import Setup, make
from wheelplane.config import Config
from wheelplane.detection import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.measure import fit_target
from wheelplane.targets import parse_target

CONFIG = Config()
PLATE = parse_target({"shape": "rectangle", "width": 0.3, "height": 0.2, "chamfer": 0.0}, "a test")
SCENE = Setup(spacing_m=0.002, half_m=(0.15, 0.1), half_width_m=0.2)
CUTS = {  # half planes that are kept, which leave a piece that is about as long as high
    "square": lambda u, v: u < 0.05,
    "slanted": lambda u, v: u + 0.36 * v < 0.06,
    "slanted back": lambda u, v: u - 0.36 * v < 0.04,
    "longer": lambda u, v: u < 0.07,
    "shorter": lambda u, v: u < 0.04,
}


def fitted_to(scene, seed):
    cloud = make(scene, seed)
    patch = find_target(cloud.points_m, PLATE, CONFIG.segment, 0)
    return cloud, fit_target(patch, PLATE, CONFIG).target


def off_in_u(cloud, fitted):
    """Length of the error of the centre in the plane, in its standard uncertainties."""
    axes = cloud.R[:, :2]
    off = axes.T @ (fitted.centre_m - cloud.centre_m)
    covariance = axes.T @ fitted.centre_covariance_m2 @ axes
    return float(np.sqrt(off @ np.linalg.solve(covariance, off)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cut", CUTS)
def test_the_edges_with_a_background_place_what_is_left_of_a_plate(cut, seed):
    cloud, fitted = fitted_to(SCENE.but(keep=CUTS[cut]), seed)
    assert fitted.method == "rim"
    assert off_in_u(cloud, fitted) < 4.0
    # Across the cut by half a width, known to 0.1 mm, from one side, which the mixed pixels place
    # as well as half a height is known, 0.1 mm, with 0.05 mm of noise; along it by two sides.
    axes = cloud.R[:, :2]
    across, along = np.sqrt(np.diag(axes.T @ fitted.centre_covariance_m2 @ axes))
    assert across < np.hypot(np.sqrt(2.0) * 1e-4, 5e-5)
    assert along < 7e-5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("cut", CUTS)
def test_without_a_background_it_is_placed_within_its_uncertainty_or_refused(cut, seed):
    try:
        cloud, fitted = fitted_to(SCENE.but(keep=CUTS[cut], background_m=None), seed)
        off = off_in_u(cloud, fitted)
    except NotMeasuredError:
        off = 0.0
    assert off < 4.0


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("shape", "setup", "keep"),
    [
        (
            {"shape": "rectangle", "width": 0.25, "height": 0.25},
            {"half_m": (0.125, 0.125)},
            lambda u, v: (u < -0.01) & (v < -0.01),
        ),
        (
            {"shape": "rectangle", "width": 0.25, "height": 0.25},
            {"half_m": (0.125, 0.125)},
            lambda u, v: u + v < -0.02,
        ),
        ({"shape": "disc", "diameter": 0.25}, {}, lambda u, v: (u < -0.02) & (np.abs(v) < 0.09)),
        ({"shape": "disc", "diameter": 0.25}, {}, lambda u, v: u < -0.04),
    ],
    ids=["corner", "triangle", "boxed arc", "arc"],
)
def test_a_corner_or_a_little_of_an_arc_is_no_outline(shape, setup, keep, seed):
    target = parse_target(shape, "a test")
    cloud = make(Setup(spacing_m=0.002, background_m=None, keep=keep, **setup), seed)
    with pytest.raises(NotMeasuredError) as refusal:
        fit_target(find_target(cloud.points_m, target, CONFIG.segment, 0), target, CONFIG)
    assert refusal.value.status in ("no-outline", "no-target")
