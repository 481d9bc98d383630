"""The patch: what is fitted depends on its points and frame alone."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from wheelplane.config import PlaneConfig
from wheelplane.plane.fit_plane import fit_plane
from wheelplane.plane.patch import Patch
from wheelplane.targets.plates import DiscTarget

DISC = DiscTarget(shape="disc", diameter=0.25, thickness=0.01)
SIGMA = 0.0008


def patch(seed=0, count=5000):
    rng = np.random.default_rng(seed)
    uv = rng.uniform(-0.125, 0.125, (count, 2))
    points = np.column_stack([uv, rng.normal(0.0, SIGMA, count)])
    around = np.zeros((0, 3), np.float32)
    return Patch(np.array([3.0, -7.0, 1.5]), points, around, 0.9, np.eye(3), SIGMA)


def test_shifting_the_origin_shifts_the_plane_alone():
    here, shift = patch(), np.array([1.25, -0.5, 2.0])  # exact in binary
    one = fit_plane(here, DISC, PlaneConfig())
    other = fit_plane(replace(here, origin_m=here.origin_m + shift), DISC, PlaneConfig())
    np.testing.assert_allclose(other.centroid_m - one.centroid_m, shift, atol=1e-14)
    np.testing.assert_array_equal(other.basis, one.basis)
    assert other.sigma_m == one.sigma_m


def test_normal_is_on_the_side_of_the_patch_s():
    one = fit_plane(patch(), DISC, PlaneConfig())
    flipped = replace(patch(), basis=np.diag([1.0, -1.0, -1.0]))
    other = fit_plane(flipped, DISC, PlaneConfig())
    assert one.normal[2] > 0.9
    np.testing.assert_allclose(other.normal, -one.normal, atol=1e-12)


def test_the_surroundings_and_their_labels_do_not_enter_the_plane():
    here = patch()
    around = np.random.default_rng(1).normal(size=(100, 3)).astype(np.float32)
    intensity = np.ones(len(here.face_m), np.float32)
    changed = replace(
        here, around_m=around, match=0.4, face_intensity=intensity, part=3, station_m=np.ones(3)
    )
    one, other = (fit_plane(p, DISC, PlaneConfig()) for p in (here, changed))
    np.testing.assert_array_equal(other.basis, one.basis)
    np.testing.assert_array_equal(other.centroid_m, one.centroid_m)


def test_a_patch_is_not_changed_by_a_fit_nor_otherwise():
    here = patch()
    before = here.face_m.copy()
    fit_plane(here, DISC, PlaneConfig())
    np.testing.assert_array_equal(here.face_m, before)
    with pytest.raises(FrozenInstanceError):
        here.sigma_m = 1.0


def test_a_station_is_named_by_its_position_unless_that_contradicts_the_scan():
    stated = [replace(patch(), station_m=np.array([3.0, z, 1.5 + z])) for z in (2.0, 2.0004, 2.2)]
    names = [one.station for one in stated]
    assert names[0] == names[1] != names[2]
    assert patch().station is None
    behind = replace(patch(), station_m=np.array([3.0, -7.0, -1.0]))
    assert behind.station is None
    zero = replace(
        patch(), origin_m=np.array([0.0, 0.0, -2.0]), station_m=np.array([-0.0, 0.0, 1e-9])
    )
    assert zero.station == "station 0.000 0.000 0.000"
    assert replace(zero, station_m=np.array([-4e-4, 0.0, -0.0])).station == zero.station
    near = replace(patch(), station_m=np.array([3.0, -7.0, 1.6]))
    assert near.station == "station 3.000 -7.000 1.600"


def test_a_patch_is_whole_and_of_one_part_unless_stated():
    assert (patch().around_share, patch().part) == (1.0, 0)
    assert not patch().steps.step_m.any()


def placements_of(*elsewhere):
    """Patch of a rotated basis with other placements of its target."""
    basis = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
    return replace(patch(count=50), basis=basis, elsewhere=elsewhere)


PLACEMENTS = (np.array([0.03, -0.01]), 0.4), (np.array([-0.02, 0.05]), -1.3)


def test_a_placement_s_axes_are_those_of_the_target_shifted_and_rotated_there():
    """Where a mark of the target lies, in the first axes, at a placement: at its own coordinates.

    The points themselves stay in the scanner's frame.
    """
    one, mark = placements_of(*PLACEMENTS), np.array([0.07, 0.02])
    first, *others = one.placements
    np.testing.assert_array_equal(first.face_m, one.face_m)
    assert len(others) == 2
    for (by, turn), other in zip(PLACEMENTS, others, strict=True):
        c, s = np.cos(turn), np.sin(turn)
        there = one.origin_m + (by + [[c, -s], [s, c]] @ mark) @ one.basis[:2]
        found = other.basis @ (there - other.origin_m)
        np.testing.assert_allclose(found, [*mark, 0.0], atol=1e-14)
        moved = other.origin_m + other.face_m
        np.testing.assert_allclose(moved, one.origin_m + one.face_m, atol=1e-14)
        np.testing.assert_allclose(other.basis @ other.basis.T, np.eye(3), atol=1e-14)
        assert other.elsewhere == first.elsewhere == ()


def test_the_placements_of_a_target_turned_round_are_its_placements_turned_round():
    one = placements_of(*PLACEMENTS)
    mirrored = [[1.0], [-1.0], [-1.0]] * one.basis
    np.testing.assert_allclose(one.turned_round().basis, mirrored, atol=1e-15)
    for a, b in zip(one.placements, one.turned_round().placements, strict=True):
        np.testing.assert_allclose(b.origin_m, a.origin_m, atol=1e-14)
        np.testing.assert_allclose(b.basis, a.turned_round().basis, atol=1e-14)
        np.testing.assert_allclose(b.face_m, a.face_m, atol=1e-14)
