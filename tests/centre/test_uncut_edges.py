"""Straight edges that a crop has cut are no edges, whatever the scanner reports beside them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.measurement.test_cut_plates import PLATE, SCENE, fitted_to, off_in_u
from tests.support.scenes import make
from wheelplane.centre.edge.beams import BEAM, CENTRE, INVERSE, SIZE_M, Prior
from wheelplane.centre.edge_centre import _is_lost
from wheelplane.centre.outline_fit import SECTORS
from wheelplane.centre.uncut_edges import in_sectors, uncut_sectors
from wheelplane.config import Config
from wheelplane.detection import find_target
from wheelplane.errors import NotMeasuredError
from wheelplane.measure import fit_target
from wheelplane.targets import parse_target, sector

BOTH = {  # half planes that are kept, without either short edge
    "alike": lambda u, v: np.abs(u) < 0.13,
    "slanted": lambda u, v: np.abs(u + 0.08 * v) < 0.135,
    "uneven": lambda u, v: (u < 0.14) & (u > -0.12),
}
OUTLINE = PLATE.edge
DISC = parse_target({"shape": "disc", "diameter": 0.25}, "a test")
BAND_M, SPACING_M = 0.002, 0.003
NORMALS = OUTLINE.normals((np.arange(SECTORS) + 0.5) / SECTORS)
RIGHT, LEFT = NORMALS[:, 0] > 0.9, NORMALS[:, 0] < -0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cut", "spot_m", "seed"),
    [("alike", 0.0, 2), ("alike", SCENE.spot_m, 1), ("slanted", 0.0, 1), ("uneven", 0.0, 2)],
)
def test_long_edges_alone_place_no_plate(cut, spot_m, seed):
    """Clean ones placed it up to 30 mm off, at a stated u of 0.1 mm."""
    with pytest.raises(NotMeasuredError, match="only parallel edges of a rectangle"):
        fitted_to(SCENE.but(keep=BOTH[cut], spot_m=spot_m), seed)


@pytest.mark.slow
def test_a_clean_edge_that_is_cut_a_little_is_left_out():
    """Its last points pulled the centre 22 u off."""
    cloud, fitted = fitted_to(SCENE.but(keep=lambda u, v: u < 0.146, spot_m=0.0), 0)
    assert fitted.method == "rim"
    assert off_in_u(cloud, fitted) < 4.0


@pytest.mark.parametrize("spot_m", [0.0, 0.0015], ids=["clean", "mixed"])
def test_nothing_beyond_a_whole_edge_leaves_it_an_edge(spot_m):
    """As before a void, or in the shadow of a projector."""

    def without(cloud):
        uvw = (cloud.points_m - cloud.centre_m) @ cloud.R
        return cloud.points_m[(uvw[:, 0] < 0.1) | (uvw[:, 2] > -0.02)]

    scene = SCENE.but(spot_m=spot_m)
    fitted = [placed(points(make(scene, 1)), 1) for points in (lambda c: c.points_m, without)]
    (whole, u_m), (beside, u_beside_m) = fitted
    assert np.linalg.norm(beside - whole) < 4.0 * np.hypot(u_m, u_beside_m)
    assert u_beside_m < 2.0 * u_m + 1.2 * SIZE_M  # by the width, where one side of two shows


@pytest.mark.parametrize(
    ("outline", "sd_mm", "lost"),
    [
        (OUTLINE, (0.1, 1.0), True),
        (OUTLINE, (0.1, 0.6), False),
        (OUTLINE, (0.02, 0.4), False),
        (DISC.edge, (0.1, 1.0), False),
    ],
    ids=["parallel", "one of them short", "all certain", "arc"],
)
def test_a_fit_to_parallel_edges_is_lost(outline, sd_mm, lost):
    """However small its u along them: it follows from noise, for edges that lie anywhere."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    covariance = turn @ np.diag(np.square(1e-3 * np.array(sd_mm))) @ turn.T
    assert _is_lost(SimpleNamespace(covariance_m2=covariance), 0.0, outline) == lost


def placed(points_m, seed):
    """Centre and the standard uncertainty of its parts in the plane, rms."""
    patch = find_target(points_m, PLATE, Config().segment, seed)
    fitted = fit_target(patch, PLATE, Config()).target
    return fitted.centre_m, float(np.sqrt(np.trace(fitted.centre_covariance_m2) / 2.0))


def plate(reach_u_m, *, background):
    """Points of a face (M, 2) that ends at reach_u_m on the right, and about its edge (N, 3)."""
    u, v = np.meshgrid(np.arange(-0.2, 0.2, SPACING_M), np.arange(-0.15, 0.15, SPACING_M))
    uv = np.column_stack([u.ravel(), v.ravel()])
    on = OUTLINE.outside_m(*uv.T) < 0.0
    face, behind = uv[on & (uv[:, 0] < reach_u_m)], uv[~on & background(uv)]
    depth = np.concatenate([np.zeros(len(face)), np.full(len(behind), -0.05)])
    return face, np.column_stack([np.concatenate([face, behind]), depth])


def state():
    found = Prior.of(None, Config().centre).mean
    found[CENTRE] = 0.0
    return found


def sectors(reach_u_m, background, outline=OUTLINE):
    face, near = plate(reach_u_m, background=background)
    return uncut_sectors(near, face, outline, state(), BAND_M, SPACING_M)


@pytest.mark.parametrize("reach_m", [0.2, 0.14])
def test_an_edge_with_a_background_was_not_cut(reach_m):
    assert sectors(reach_m, lambda uv: np.abs(uv[:, 0]) < 1.0) is None


def test_of_a_plate_alone_nothing_is_known():
    assert sectors(0.14, lambda uv: np.abs(uv[:, 0]) > 1.0) is None


def test_a_round_edge_is_none_that_a_straight_crop_leaves():
    assert sectors(0.14, lambda uv: uv[:, 0] < 0.14, DISC.edge) is None


def test_an_edge_where_the_size_says_it_is_was_not_cut():
    assert sectors(0.2, lambda uv: uv[:, 0] < 0.14) is None


def test_an_edge_inside_that_with_nothing_beyond_may_have_been_cut():
    held = sectors(0.14, lambda uv: uv[:, 0] < 0.14)
    np.testing.assert_array_equal(held, ~RIGHT)


def test_neither_is_an_edge_where_neither_has_a_background_and_one_is_cut():
    held = sectors(0.14, lambda uv: np.abs(uv[:, 0]) < 0.14)
    np.testing.assert_array_equal(held, ~(RIGHT | LEFT))


def test_an_edge_ends_not_like_those_with_a_background_that_are_hidden():
    held = sectors(-0.1, lambda uv: uv[:, 0] > 0.15)
    np.testing.assert_array_equal(held, RIGHT)


def test_points_belong_to_the_sector_where_their_beams_meet_the_plane():
    rng = np.random.default_rng(2)
    uv, here = rng.uniform(-0.2, 0.2, (200, 2)), state()
    here[BEAM] = 0.3, -0.1
    for depth in (0.0, 0.05):
        feet = uv - depth * here[BEAM]
        feet /= 1.0 + here[INVERSE] * depth
        expected = RIGHT[sector(OUTLINE.closest(feet).share, SECTORS)]
        found = in_sectors(RIGHT, uv, np.full(200, depth), OUTLINE, here)
        np.testing.assert_array_equal(found, expected)
