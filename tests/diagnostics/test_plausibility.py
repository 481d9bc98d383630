"""Clouds that cannot be what they are said to be, and the many that can."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.support.scenes import WHEEL, make
from wheelplane.diagnostics.plausibility import (
    check_cloud,
    check_poses,
    check_vehicle_cloud,
    check_wheel_scan,
    check_wheels,
    float32_step,
    lone_points,
    vehicle_unit,
)
from wheelplane.diagnostics.selftest import certified_folder
from wheelplane.errors import InputError
from wheelplane.readers import Part

ROOT = Path(__file__).resolve().parents[2]
DIAMETER = 0.25
FACTOR = {"m": 1.0, "mm": 1e-3, "in": 0.0254, "cm": 0.01, "ft": 0.3048}
SITE = np.array([289_814.0, 4_320_978.0, 170.0])
WHEEL_M = make(WHEEL).points_m


def declared(points_m, shown, true):
    """Lengths read from a file in unit `true` when `stated` is declared, in metres."""
    return points_m / FACTOR[true] * FACTOR[shown]


@pytest.mark.parametrize("unit", FACTOR)
@pytest.mark.parametrize("shift", [0.0, SITE])
def test_a_wheel_is_believed_in_its_unit(unit, shift):
    check_wheel_scan(WHEEL_M + shift, DIAMETER, unit, "rr")
    check_cloud(WHEEL_M + shift, unit, "rr")


@pytest.mark.parametrize(
    ("shown", "true"), [("m", "mm"), ("mm", "m"), ("in", "m"), ("in", "mm"), ("mm", "in")]
)
def test_a_wheel_in_the_wrong_unit_is_refused_with_the_right_one(shown, true):
    wrong = declared(WHEEL_M, shown, true)
    if shown == "in" and true == "mm":  # 0.7 m read as 18 m: the target cannot be found, no more
        check_wheel_scan(wrong, DIAMETER, shown, "rr")
        return
    with pytest.raises(InputError) as caught:
        check_wheel_scan(wrong, DIAMETER, shown, "rr")
    text = str(caught.value)
    assert text.startswith("rr: the scan is ")
    assert f"wide in {shown}" in text
    assert re.search(rf'give length_unit = "({true}|m)"$', text)


def test_wide_scenes_that_hold_a_target_are_believed():
    rng = np.random.default_rng(1)
    around = rng.uniform(-800, 800, (20_000, 3))
    check_wheel_scan(np.vstack([around, WHEEL_M]), DIAMETER, "m", "rr")
    with pytest.raises(InputError, match="nowhere do 8 points"):
        check_wheel_scan(around, DIAMETER, "m", "rr")


@pytest.mark.parametrize(
    ("size", "unit", "hint"),
    [
        (2_000.0, "m", None),
        (19_000.0, "m", None),
        (25_000.0, "m", "give --length-unit mm"),
        (5e6, "m", "check the unit"),
        (0.0015, "mm", None),
        (0.0009, "mm", "if the file is in m, it is 900 mm wide: give --length-unit m"),
        (0.0, "mm", None),
    ],
)
def test_a_single_cloud_may_be_a_street_or_a_coin(size, unit, hint):
    points = np.random.default_rng(2).uniform(0, 1, (500, 3)) * [size, size / 2, size / 3]
    points[[0, -1]] = [[0, 0, 0], [size, 0, 0]]
    if hint is None:
        check_cloud(points, unit, "a.ply")
    else:
        with pytest.raises(InputError, match=re.escape(hint)):
            check_cloud(points, unit, "a.ply")


def single(points_m, unit):
    """As a file in `unit` with float32 coordinates is read."""
    return (points_m / FACTOR[unit]).astype(np.float32).astype(np.float64) * FACTOR[unit]


@pytest.mark.parametrize("unit", ["m", "mm", "in", "cm"])  # whole feet are no sign of float32
def test_float32_at_a_site_is_named_as_the_cause(unit):
    points = single(WHEEL_M + SITE, unit)
    step, place = float32_step(points, unit)
    gaps = np.diff(np.unique(points[:, 1]))
    assert step == pytest.approx(gaps[gaps > 1e-6].min(), rel=1e-6)
    assert place == pytest.approx(SITE[1], rel=1e-4)
    with pytest.raises(InputError, match=r"float32, which at 43\d\d km .* in steps of [\d.]+ mm"):
        check_wheel_scan(points, DIAMETER, unit, "rr")


def test_doubles_and_near_float32_are_not_blamed():
    for points in (WHEEL_M, WHEEL_M + SITE, np.round(WHEEL_M, 3) + SITE):
        assert float32_step(points, "m") == (0.0, 0.0)
    step, _ = float32_step(single(WHEEL_M, "m"), "m")
    assert step < 1e-6
    check_wheel_scan(single(WHEEL_M, "m"), DIAMETER, "m", "rr")


@pytest.mark.parametrize("unit", FACTOR)
@pytest.mark.parametrize("shift", [0.0, 5e6, 9e6, 12e6])
def test_whole_numbers_are_no_float32(unit, shift):
    """Millimetres as integers in a text, where float32 lies in steps of a half or of one."""
    whole = np.rint(WHEEL_M * 1e4) + shift
    assert float32_step(whole * FACTOR[unit], unit) == (0.0, 0.0)
    half = whole + np.random.default_rng(1).integers(0, 2, whole.shape) / 2
    if shift == 5e6:
        assert float32_step(half * FACTOR[unit], unit)[0] == pytest.approx(FACTOR[unit] / 2)


def vehicle(size, strays=0):
    """A cloud that long, half as wide, a quarter as high; strays lie 20 times as far."""
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 1, (20_000, 3)) * [size, size / 2, size / 4]
    points[:strays] *= 20.0
    return points


@pytest.mark.parametrize("unit", FACTOR)
@pytest.mark.parametrize("size", [1.8, 5.0, 30.0, 95.0])
@pytest.mark.parametrize("strays", [0, 40])
def test_a_vehicle_is_believed_in_its_unit(strays, size, unit):
    check_vehicle_cloud(vehicle(size, strays), DIAMETER, unit, "v")
    check_vehicle_cloud(vehicle(size, strays) + SITE, DIAMETER, unit, "v")


@pytest.mark.parametrize(
    ("shown", "true"),
    [("m", "mm"), ("mm", "m"), ("in", "m"), ("m", "in"), ("in", "mm"), ("mm", "in")],
)
@pytest.mark.parametrize("size", [5.0, 25.0])
def test_a_vehicle_in_the_wrong_unit_is_refused_with_the_right_one(size, shown, true):
    wrong = declared(vehicle(size), shown, true)
    with pytest.raises(InputError) as caught:
        check_vehicle_cloud(wrong, DIAMETER, shown, "v")
    text = str(caught.value)
    assert re.match(r"v: the cloud is [\d.]+ k?m?m wide in (m|mm|in), ", text)
    fix = f'give --length-unit {true}, or length_unit = "{true}" in a capture.toml'
    assert text.endswith(fix)


def test_a_yard_or_a_toy_is_no_vehicle():
    for size, says in ((130.0, "100 m at most: crop it, or"), (1.2, "at least 1.5 m")):
        with pytest.raises(InputError, match=says):
            check_vehicle_cloud(vehicle(size), DIAMETER, "m", "v")


def test_float32_far_away_is_named_as_the_cause_for_a_vehicle_too():
    with pytest.raises(InputError, match=r"v: its coordinates are float32"):
        check_vehicle_cloud(single(vehicle(6.0) + SITE, "m"), DIAMETER, "m", "v")
    check_vehicle_cloud(single(vehicle(6.0), "m"), DIAMETER, "m", "v")


@pytest.mark.parametrize("file", sorted(certified_folder().rglob("*.ds")), ids=str)
def test_certified_data_without_a_unit_are_believed(file):
    numbers = np.array(file.read_text().split()[1:], float).reshape(-1, 3)
    for unit in FACTOR:
        check_cloud(numbers * FACTOR[unit], unit, file.name)


@pytest.mark.parametrize(("count", "shift"), [(1, 9.9e9), (3, -1e12), (40, 30e3)])
def test_few_points_far_off_are_a_note(count, shift):
    points = WHEEL_M + SITE
    rows = np.random.default_rng(4).choice(len(points), count, replace=False)
    points[rows, 1] = shift
    text = lone_points(points)
    assert text.startswith(f"{count} of {len(points)} points lie")
    assert text.endswith(" km from the others")
    assert lone_points(WHEEL_M + SITE) == ""


def test_many_points_far_off_are_no_lone_ones():
    points = WHEEL_M.copy()
    points[: len(points) // 50] += 1e9
    assert lone_points(points) == ""
    assert lone_points(WHEEL_M * 1e6) == ""
    assert lone_points(np.empty((0, 3))) == ""


def turned_about_x(angle_rad):
    """A rotation (3, 3)."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


@pytest.mark.parametrize(
    ("R", "sound"),
    [
        (turned_about_x(0.7), True),
        (0.001 * turned_about_x(0.7), True),  # millimetres
        (np.round(turned_about_x(0.7), 4), True),
        (turned_about_x(0.7) @ np.diag([1.001, 1.0, 1.0]), False),
        (
            turned_about_x(0.7) @ np.array([[1.0, 1e-3, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            False,
        ),
    ],
    ids=["rotation", "scaled", "four decimals", "stretched", "sheared"],
)
def test_poses_that_change_angles_are_refused(R, sound):
    T = np.eye(4)
    T[:3, :3] = R
    parts = (Part("plain", 0, 5, None), Part("a", 5, 9, T))
    if sound:
        check_poses(parts, "rr.ptx")
        return
    with pytest.raises(InputError, match=r"^rr\.ptx: the pose of its scan a is no rotation: it "):
        check_poses(parts, "rr.ptx")


CENTRES_M = np.array([[-0.75, 0.0, 0.3], [0.75, 0.0, 0.3], [-0.75, 2.5, 0.3], [0.75, 2.5, 0.3]])
WHEELS = ("RR", "RL", "FR", "FL")


@pytest.mark.parametrize(
    ("scale", "pair"),
    [(1.0, None), (0.34, None), (0.3, "RR and RL"), (10.5, "RR and FL|RL and FR")],
)
def test_wheel_centres_as_near_or_far_as_on_no_vehicle_are_refused(scale, pair):
    """Tracks of 0.51 and 0.45 m, diagonals of 2.9 and 30.6 m."""
    if pair is None:
        check_wheels(scale * CENTRES_M, WHEELS, "here")
    else:
        with pytest.raises(InputError, match=f"^here: the wheel centres of ({pair}) lie"):
            check_wheels(scale * CENTRES_M, WHEELS, "here")


def test_scans_that_each_lie_in_coordinates_of_their_own_are_refused():
    """One wheel beside another, whatever the others are."""
    centres = CENTRES_M.copy()
    centres[3] = centres[0] + [0.05, 0.0, 0.0]
    with pytest.raises(InputError, match=r"of RR and FL lie 50 mm apart, .* one coordinate system"):
        check_wheels(centres, WHEELS, "here")


@pytest.mark.parametrize("true", FACTOR)
@pytest.mark.parametrize("read", FACTOR)
def test_the_unit_of_a_vehicle_is_the_one_that_makes_it_usual(read, true):
    tracks, wheelbases = (
        [size / FACTOR[true] * FACTOR[read] for size in one] for one in ([1.5], [2.5])
    )
    wanted = true if true != read else ""
    assert vehicle_unit(tracks, wheelbases, read) == wanted
