"""Printed boards: symmetry of the print, corners of the printed area, invariance of its layout."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wheelplane.targets.pattern_board import PatternTarget
from wheelplane.vectors import turned

BASE = {"shape": "pattern", "width": 0.4, "height": 0.4, "pitch": 0.04}
BOARDS = {
    "circles": BASE | {"kind": "circles", "rows": 4, "columns": 6, "circle_diameter": 0.02},
    "checkerboard": BASE | {"kind": "checkerboard", "rows": 5, "columns": 5},
    "aruco": BASE
    | {"kind": "aruco", "rows": 2, "columns": 2, "pitch": 0.13, "marker_size": 0.1}
    | {"dictionary": "DICT_4X4_50", "ids": (0, 1, 2, 3)},
}


def board(name, **changes):
    return PatternTarget(**(BOARDS[name] | changes))


@pytest.mark.parametrize("name", BOARDS)
def test_rotation_and_offset_move_the_print_as_a_rigid_body(name):
    plain, moved = board(name), board(name, turn_deg=30.0, offset=(0.01, -0.02))
    shift = np.array([0.01, -0.02])
    for here, there in ((plain.places_m, moved.places_m), (plain.corners_m, moved.corners_m)):
        expected = turned(here, math.radians(30.0)) + shift
        np.testing.assert_allclose(there, expected, atol=1e-15)


@pytest.mark.parametrize("name", BOARDS)
def test_print_period_maps_the_features_onto_themselves(name):
    """No smaller part of it fits features without ids; markers have ids, in their order."""
    target = board(name)
    places = target.places_m

    def same(angle):
        apart = turned(places, angle)[:, None] - places
        return bool(np.all(np.hypot(*np.moveaxis(apart, 2, 0)).min(axis=1) < 1e-12))

    period = target.print_period_rad
    assert same(period)
    if name == "aruco":
        assert period == pytest.approx(2.0 * math.pi)
    else:
        assert not any(same(period / n) for n in (2, 3))


@pytest.mark.parametrize("name", BOARDS)
def test_corners_hold_every_feature(name):
    target = board(name)
    half = target.corners_m.max(axis=0)
    grown = target.places_m + target.feature_size_m / 2.0
    assert np.all(np.abs(grown) <= half + 1e-15)
    touch = target.feature_size_m / 2.0 if name != "checkerboard" else target.pitch
    np.testing.assert_allclose(target.places_m.max(axis=0) + touch, half, atol=1e-15)


def test_a_print_as_large_as_the_board_is_taken_and_a_larger_one_is_not():
    edge = 2.0 * board("circles").corners_m.max(axis=0)
    assert board("circles", width=edge[0] + 1e-6, height=edge[1] + 1e-6).radius_m > 0.0
    with pytest.raises(ValueError, match="beyond the board"):
        board("circles", width=edge[0] - 1e-6, height=edge[1] + 1e-6)


def test_a_round_board_has_a_round_edge_and_says_so():
    target = board("circles", width=None, height=None, diameter=0.4)
    assert not target.edge.shows_rotation
    assert target.turn_period_rad == 0.0
    assert target.description == "a round board of 400 mm"
    assert board("circles").description == "a board of 400 x 400 mm"
