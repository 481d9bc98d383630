"""Which side of the wheels is up: by the floor in any coordinates, checked by z, never guessed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.scenes import rotation
from wheelplane.detection.up_direction import find_up
from wheelplane.errors import InputError

UP = np.array([0.0, 0.0, 1.0])
AXLES_M = np.array([[[0.0, -0.75, 0.0], [0.0, 0.75, 0.0]], [[2.7, -0.75, 0.0], [2.7, 0.75, 0.0]]])
NOISE_M = 0.002


def sheet(low, high, height, count, rng):
    """A level rectangle between two corners (x, y)."""
    points = np.empty((count, 3))
    points[:, :2] = rng.uniform(low, high, (count, 2))
    points[:, 2] = height
    return points


def scene(
    rng, depth=0.31, slope_deg=0.0, floor=True, body=True, ceiling=True, ghosts=0.0, deck=0.0
):
    """About the wheels' centres, z up: a car's body, the floor `depth` below, a ceiling; its slope
    about a random level axis grows from the car's middle. deck: a flat one that high instead."""
    parts = [AXLES_M.reshape(-1, 3)[rng.integers(4, size=4000)] + rng.uniform(-0.1, 0.1, (4000, 3))]
    if body:
        flank = sheet((-0.8, -0.8), (3.5, 0.8), 0.0, 20_000, rng)
        flank[:, 1] = np.sign(flank[:, 1]) * 0.8
        flank[:, 2] = rng.uniform(-0.1, 0.6, len(flank))
        parts += [flank, sheet((0.6, -0.6), (2.2, 0.6), 1.1, 8000, rng)]
        parts += [sheet((2.2, -0.7), (3.5, 0.7), 0.6, 4000, rng)]
    if deck:
        parts += [sheet((-1.0, -0.9), (3.6, 0.9), deck, 15_000, rng)]
    if ceiling:
        parts += [sheet((-5.0, -5.0), (8.0, 5.0), 2.9, 20_000, rng)]
    if floor:
        ground = sheet((-4.0, -4.0), (7.0, 4.0), -depth, 60_000, rng)
        hidden = (np.abs(ground[:, 1]) < 0.7) & (ground[:, 0] > -0.5) & (ground[:, 0] < 3.2)
        ground = ground[~hidden]
        fall = np.tan(np.radians(slope_deg)) * turned_axis(rng)
        ground[:, 2] += (ground[:, :2] - [1.35, 0.0]) @ fall
        mirrored = ground[: int(ghosts * len(ground))].copy()
        mirrored[:, 2] -= rng.uniform(0.0, 1.5, len(mirrored))
        parts += [ground, mirrored]
    points = np.concatenate(parts)
    return points + rng.normal(0.0, NOISE_M, points.shape)


def turned_axis(rng):
    turn = rng.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(turn), np.sin(turn)])


def leaning(degrees, rng):
    """A rotation by that angle about a random level axis, after one about z."""
    turn, (a, b) = rng.uniform(0.0, 2.0 * np.pi), turned_axis(rng)
    spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    K = np.array([[0, 0, b], [0, 0, -a], [-b, a, 0]])
    angle = np.radians(degrees)
    return (np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K) @ spin


def ends_anyhow(rng):
    """The axles in any order, their ends too."""
    axles = AXLES_M[rng.permutation(2)]
    return axles[:, rng.permutation(2)]


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    depth=st.floats(0.2, 0.6),
    slope=st.floats(0.0, 3.0),
    ghosts=st.floats(0.0, 0.04),
)
def test_the_floor_tells_up_in_any_coordinates(seed, depth, slope, ghosts):
    rng = np.random.default_rng(seed)
    R, shift = rotation(rng), rng.uniform(-1e4, 1e4, 3)
    points = scene(rng, depth, slope, ghosts=ghosts) @ R.T + shift
    up = find_up(points, ends_anyhow(rng) @ R.T + shift, "floor")
    assert up.direction @ R @ UP > 1.0 - 1e-9
    assert up.by.startswith("the floor, ")
    printed_m = 0.005  # half of its last digit
    assert float(up.by.split()[2]) == pytest.approx(depth, abs=0.02 + printed_m)


@pytest.mark.parametrize("hard", [{"ghosts": 0.04}, {"slope_deg": 3.0, "depth": 0.4}])
@pytest.mark.parametrize("seed", range(3))
def test_a_glossy_or_sloping_floor_is_one(seed, hard):
    """Points below it, mirrored, in four cells of five; or off level by more than it is rough."""
    assert "the floor" in find_up(scene(np.random.default_rng(seed), **hard), AXLES_M).by


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("degrees", [0.0, 5.0, 40.0])
def test_floor_and_z_together(degrees, seed):
    rng = np.random.default_rng(seed)
    R = leaning(degrees, rng)
    points, axles = scene(rng) @ R.T, ends_anyhow(rng) @ R.T
    for rule in ("auto", "floor", "z"):
        up = find_up(points, axles, rule)
        assert up.direction @ R @ UP > 1.0 - 1e-9
        assert ("floor" in up.by) == (rule != "z")
        assert (f"the z axis, {degrees:.1f}° off" in up.by) == (rule != "floor")


@pytest.mark.parametrize("seed", range(3))
def test_z_that_points_down_is_not_believed_over_a_floor_nor_the_floor_over_it(seed):
    rng = np.random.default_rng(seed)
    R = leaning(180.0, rng)
    points, axles = scene(rng) @ R.T, ends_anyhow(rng) @ R.T
    with pytest.raises(
        InputError, match=r"the floor, 0\.31 m .* to which z points: give --up floor"
    ):
        find_up(points, axles)
    assert find_up(points, axles, "floor").direction @ R @ UP > 0.999
    assert find_up(points, axles, "z").direction @ R @ UP < -0.999


@pytest.mark.parametrize("seed", range(3))
def test_where_z_lies_level_the_floor_alone_decides(seed):
    rng = np.random.default_rng(seed)
    R = leaning(80.0, rng)
    points, axles = scene(rng) @ R.T, ends_anyhow(rng) @ R.T
    up = find_up(points, axles)
    assert up.direction @ R @ UP > 0.999
    assert "z, 80.0° off, was not used" in up.by
    assert "z" not in find_up(points, axles, "floor").by
    with pytest.raises(
        InputError, match="up is unknown: the z axis is not upright: export the cloud"
    ):
        find_up(points, axles, "z")


@pytest.mark.parametrize("degrees", [0.0, 40.0, 60.0, 90.0, 120.0])
def test_a_mirror_image_is_said_to_be_possible_wherever_z_does_not_tell(degrees):
    """A mirrored cloud has the same floor: only z, which stays, can contradict it."""
    rng = np.random.default_rng(7)
    R = leaning(degrees, rng)
    points, axles = scene(rng) @ R.T, AXLES_M @ R.T
    mirror = np.eye(3) - 2.0 * np.outer(R @ UP, R @ UP)  # up becomes down
    for way in (np.eye(3), mirror):
        if degrees < 45.0 and way is mirror:
            with pytest.raises(InputError, match="to which z points"):
                find_up(points @ way.T, axles @ way.T)
            continue
        by = find_up(points @ way.T, axles @ way.T).by
        off = degrees if way is not mirror else 180.0 - degrees
        assert ("mirrored" in by) == (degrees > 45.0)
        assert f"z{'' if degrees > 45.0 else ' axis'}, {off:.1f}° off" in by


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "without",
    [
        {"floor": False},
        {"floor": False, "body": False, "ceiling": False},
        {"floor": False, "body": False, "deck": 0.6},
        {"depth": 1.9},  # on a lift
    ],
)
def test_without_a_floor_near_the_wheels_z_alone_decides(without, seed):
    rng = np.random.default_rng(seed)
    points = scene(rng, **without)
    up = find_up(points, AXLES_M)
    assert up.direction[2] > 0.999
    assert up.by == "the z axis, 0.0° off"
    with pytest.raises(InputError, match="up is unknown: no floor found below the wheels"):
        find_up(points, AXLES_M, "floor")
    R = leaning(90.0, rng)
    with pytest.raises(InputError, match=r"no floor found .* and the z axis is not upright"):
        find_up(points @ R.T, AXLES_M @ R.T)


def test_a_flat_deck_is_taken_for_a_floor_only_where_nothing_tells_otherwise():
    rng = np.random.default_rng(0)
    assert "floor" in find_up(scene(rng, deck=0.6, body=False), AXLES_M).by
    alone = scene(rng, floor=False, body=False, deck=0.6, ceiling=False)
    with pytest.raises(InputError, match="give --up floor if"):
        find_up(alone, AXLES_M)
    assert find_up(alone, AXLES_M, "z").direction[2] > 0.999
