"""The vehicle as workshops read it: values, axes, signs, words and units."""

from __future__ import annotations

import itertools
import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.five_point.test_components import STATED, file, observed, vehicle
from tests.support.plain_geometry import all_plain
from tests.support.printed import says_angle, says_width
from wheelplane.cli import main
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.components import Station
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.quantities import against, by_name, stated
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.view import View, read_view
from wheelplane.report.json.measurement import to_tree
from wheelplane.report.text.report import detailed_report, summary_table
from wheelplane.report.text.vehicle import vehicle_lines
from wheelplane.vehicle.axes import AXES
from wheelplane.vehicle.definitions import VEHICLE, WHEEL, named
from wheelplane.vehicle.frame import REFERENCE_WHEELS
from wheelplane.vehicle.jacobian import linearise

FIGURE_4 = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
WHEELS = [*REFERENCE_WHEELS, "FR", "RL"]
POSITIONS = np.array([[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.74, 0.01], [2.62, 0.76, 0.0]])
MIRROR = np.array([1.0, -1.0, 1.0])  # x ahead, y left, z up
OTHER = {"RR": "RL", "RL": "RR", "FR": "FL", "FL": "FR"}


def normals_of(toes, cambers, wheels=WHEELS):
    """Outward normals, x ahead, y left: tilted by the camber, then steered by the toe."""
    found = []
    for toe, camber, wheel in zip(toes, cambers, wheels, strict=True):
        side = 1.0 if wheel.endswith("L") else -1.0
        tilt, steer = (
            Rotation.from_euler("x", -side * camber),
            Rotation.from_euler("z", -side * toe),
        )
        found.append((steer * tilt).apply([0.0, side, 0.0]))
    return np.array(found)


def quantities(centres, normals, wheels=WHEELS):
    """By name: of a wheel (W,), of the vehicle a number."""
    values = linearise(np.asarray(centres), np.asarray(normals), wheels).values
    count = len(wheels)
    names = [entry.name for entry in WHEEL]
    found = {name: values[count * i : count * (i + 1)] for i, name in enumerate(names)}
    of_vehicle = values[count * len(WHEEL) :].tolist()
    return found | dict(zip((entry.name for entry in VEHICLE), of_vehicle, strict=True))


def some_car(seed):
    """Centres (4, 3) and normals (6, 3), every quantity of it well off zero."""
    rng = np.random.default_rng(seed)
    centres = POSITIONS + rng.uniform(-0.05, 0.05, (4, 3))
    return centres, normals_of(rng.uniform(-0.06, 0.06, 6), rng.uniform(-0.06, 0.06, 6))


# --- values -------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("shift", [0.0, 1e6])
def test_values_are_those_of_plain_geometry_in_any_pose(seed, shift):
    centres, normals = some_car(seed)
    rng = np.random.default_rng([seed, 1])
    turn, signs = Rotation.random(rng=rng), rng.choice([-1.0, 1.0], (6, 1))
    wanted = all_plain(centres, normals, WHEELS)
    found = linearise(turn.apply(centres) + shift, turn.apply(signs * normals), WHEELS).values
    # Coordinates of 1e6 m are rounded to 1e-10 m, which a metre or two makes an angle of.
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 + 4e-16 * shift)
    assert np.abs(wanted).min() > 1e-6  # none is right by being zero


def test_a_perfect_vehicle_has_one_axis_and_nothing_to_report():
    centres = [[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.75, 0], [2.6, 0.75, 0]]
    found = quantities(centres, normals_of([0.0] * 6, [0.0] * 6))
    sizes = {"rear_track": 1.5, "front_track": 1.5, "wheelbase": 2.6}
    sizes |= {"wheelbase_left": 2.6, "wheelbase_right": 2.6}
    for name, value in found.items():
        np.testing.assert_allclose(value, sizes.get(name, 0.0), rtol=0, atol=1e-15, err_msg=name)


def test_a_skewed_vehicle_has_the_angles_that_it_was_given():
    """Both tracks alike: the front axle 20 mm to the right, its right wheel 6 mm behind.

    Rear wheels: right 0.1° out, left 0.3° in; front: right 0.2° in, left 0.4° in.
    """
    toe = np.radians([-0.1, 0.3, 0.2, 0.4])
    centres = [[0, -0.75, 0], [0, 0.75, 0], [2.6, -0.77, 0], [2.606, 0.73, 0]]
    wheels = REFERENCE_WHEELS
    found = quantities(centres, normals_of(toe, [0.01, 0.03, -0.02, 0.005], wheels), wheels)
    middle = math.atan2(0.020, 2.603)
    sides = (math.atan2(0.020, 2.6) + math.atan2(0.020, 2.606)) / 2
    thrust = math.radians(0.2)
    turned = {"rear-axle": 0.0, "centreline": middle}
    turned |= {"thrust-line": thrust, "side-bisector": sides}
    for axis, angle in turned.items():
        expected = toe + np.array([1, -1, 1, -1]) * angle
        np.testing.assert_allclose(found[named("toe", axis)], expected, rtol=0, atol=1e-14)
        front, rear = 0.006 * math.cos(angle), 1.5 * math.sin(angle)
        assert found[named("front_setback", axis)] == pytest.approx(front - rear, abs=1e-14)
        if axis != "rear-axle":
            assert found[named("rear_setback", axis)] == pytest.approx(-rear, abs=1e-14)
        if axis in ("rear-axle", "thrust-line"):
            offset = 0.020 * math.cos(angle) - 2.603 * math.sin(angle)
            assert found[named("axle_offset", axis)] == pytest.approx(offset, abs=1e-14)
        if axis != "thrust-line":
            assert found[named("thrust_angle", axis)] == pytest.approx(thrust - angle, abs=1e-14)
    expected = {
        "centreline_angle": middle,
        "rear_squareness": -middle,
        "side_bisector_angle": sides,
        "steer_ahead": math.radians((0.4 - 0.2) / 2) - thrust,
        "rear_cross_toe": math.radians(0.4),
        "front_cross_toe": math.radians(0.2),
        "rear_cross_camber": 0.02,
        "front_cross_camber": 0.025,
        "wheelbase_left": math.hypot(2.606, 0.020),
        "wheelbase_right": math.hypot(2.6, 0.020),
    }
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, abs=1e-14), name


@pytest.mark.parametrize("seed", range(4))
def test_an_axis_changes_toe_but_not_camber_or_total_toe(seed):
    found = quantities(*some_car(seed))
    side = np.array([1.0 if wheel.endswith("L") else -1.0 for wheel in WHEELS])
    names = {"centreline": "centreline_angle", "thrust-line": "thrust_angle"}
    for axis, angle in (names | {"side-bisector": "side_bisector_angle"}).items():
        toe, turned = found[named("toe", axis)], np.full(6, found[angle])
        if axis == "thrust-line":  # of the trial of RL, the last one, with it in the place of RL
            turned[5] = (found["toe"][5] - found["toe"][0]) / 2
        np.testing.assert_allclose(toe, found["toe"] - side * turned, rtol=0, atol=1e-15)
        iso = np.tan(found[named("camber_iso", axis)])
        np.testing.assert_allclose(iso, np.tan(found["camber"]) / np.cos(toe), rtol=1e-12)
        assert toe[0] + toe[1] == pytest.approx(found["rear_total_toe"], abs=1e-15)
        assert np.abs(toe - found["toe"]).min() > 1e-4
    thrust = found["toe_to_thrust_line"]
    assert thrust[0] == pytest.approx(thrust[1], abs=1e-15)  # it bisects the rear toes


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("wheel", REFERENCE_WHEELS)
def test_a_trial_counts_from_the_thrust_line_of_the_vehicle_that_it_stands_on(seed, wheel):
    """The vehicle measured anew, its wheel as in the trial, has the trial's toe and ISO camber."""
    centres, normals = some_car(seed)
    index, wheels = REFERENCE_WHEELS.index(wheel), [*REFERENCE_WHEELS, wheel]
    found = quantities(centres, normals[:5], wheels)
    placed = normals[:4].copy()
    placed[index] = normals[4]
    anew = quantities(centres, placed, wheels[:4])
    for name in ("toe_to_thrust_line", "camber_iso_to_thrust_line", "toe", "camber"):
        assert found[name][4] == pytest.approx(anew[name][index], abs=1e-15)
    as_it_stood = quantities(centres, normals[:4], wheels[:4])
    for name in ("toe_to_thrust_line", "camber_iso_to_thrust_line"):
        np.testing.assert_allclose(found[name][:4], as_it_stood[name], rtol=0, atol=1e-15)
    for name in ("thrust_angle", "steer_ahead", "rear_total_toe"):
        assert found[name] == as_it_stood[name]  # of the vehicle as it stood in its own scans
    turned = anew["thrust_angle"] - as_it_stood["thrust_angle"]
    assert (abs(turned) > 1e-4) == (wheel in ("RR", "RL"))


@pytest.mark.parametrize("seed", range(4))
def test_in_a_mirror_quantities_with_a_side_change_sign(seed):
    centres, normals = some_car(seed)
    one = quantities(centres, normals)
    order = [1, 0, 3, 2, 4, 5]
    wheels = [*REFERENCE_WHEELS, *(OTHER[wheel] for wheel in WHEELS[4:])]
    two = quantities((centres * MIRROR)[order[:4]], (normals * MIRROR)[order], wheels)
    alike = {"rear_total_toe", "front_total_toe", "rear_track", "front_track", "wheelbase"}
    for name, value in one.items():
        if isinstance(value, np.ndarray):
            np.testing.assert_allclose(two[name][order], value, rtol=0, atol=1e-14, err_msg=name)
        elif name in alike:
            assert two[name] == pytest.approx(value, abs=1e-14), name
        elif name in ("wheelbase_left", "wheelbase_right"):
            sides = {"wheelbase_left": "wheelbase_right", "wheelbase_right": "wheelbase_left"}
            assert two[sides[name]] == pytest.approx(value, abs=1e-14)
        else:
            assert two[name] == pytest.approx(-value, abs=1e-14), name
            assert abs(value) > 1e-6, name


def test_first_order_invariants_of_the_frame():
    """Turn the rear axle by 1 mrad: toes and thrust follow; total toe, camber sum and what is
    counted from the thrust line only in second order."""
    centres, normals = some_car(3)
    before = quantities(centres, normals)
    for axis in ("z", "x"):  # yaw, then roll
        moved = centres.copy()
        moved[:2] = Rotation.from_euler(axis, 1e-3).apply(moved[:2])
        change = {name: value - before[name] for name, value in quantities(moved, normals).items()}
        angle = change["toe"] if axis == "z" else change["camber"]
        assert np.abs(angle).min() > 0.9e-3
        # 1 mrad times tilt and steer of up to 0.12 rad, and its own square
        assert abs(change["rear_total_toe"]) < 1e-3 * 0.12**2 + 1e-6
        assert abs(change["steer_ahead"]) < 1e-3 * 0.12**2 + 1e-6
        assert abs(change["camber"][:2].sum()) < 1e-3 * 0.12 + 1e-6
        if axis == "z":
            assert abs(change["thrust_angle"]) > 0.9e-3
            assert np.abs(change["toe_to_thrust_line"]).max() < 1e-3 * 0.12**2 + 1e-6


# --- uncertainty --------------------------------------------------------------------------------

VEHICLES = 200


@pytest.mark.slow
def test_errors_of_every_quantity_are_as_large_as_stated():
    """Vehicles whose truth is known, surveyed with errors that their instrument's file states."""
    rows = []
    for seed in range(VEHICLES):
        _, _, centres, normals, place, rng = vehicle(seed)
        blocks = observed(centres, normals, place, STATED, rng)
        known = measure_five_point(file(blocks), Station(STATED, place)).uncertainty
        true = all_plain(centres - centres[0], normals, REFERENCE_WHEELS)
        rows.append((known.values - true) / known.standard)
    errors = np.array(rows)
    spread = np.sqrt(np.mean(errors**2, axis=0))
    # A deviation from n errors is known to 1/sqrt(2 n); 4 of it: 62 quantities, many of them alike.
    limit = 4.0 / math.sqrt(2 * VEHICLES)
    np.testing.assert_allclose(spread, 1.0, rtol=0, atol=limit)
    assert np.all(np.abs(errors.mean(axis=0)) < 4.0 / math.sqrt(VEHICLES))
    assert np.all(np.abs(2 * spread - 1.0) > limit)
    assert np.all(np.abs(spread / 2 - 1.0) > limit)
    inside = np.mean(np.abs(errors) < 1.96, axis=0)
    assert abs(inside.mean() - 0.95) < 0.02


# --- a whole measurement ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measured():
    return measure_five_point(read_five_point(FIGURE_4))


@pytest.fixture(scope="module")
def mirrored():
    """The paper's vehicle in a mirror, left and right exchanged."""
    file = read_five_point(FIGURE_4)
    order = [1, 0, 3, 2, *range(4, len(file.blocks_m))]
    return measure_five_point(replace(file, blocks_m=(file.blocks_m * MIRROR)[order]))


def test_budget_and_angles_have_the_same_values(measured):
    known = by_name(measured)
    for wheel in measured.wheels:
        for kind in ("toe", "camber", "camber_iso"):
            shown = known[f"{wheel.observation.name}.{kind}"]
            assert shown.value == getattr(wheel.angles, f"{kind}_rad")
            assert shown.u == getattr(wheel, f"u_{kind}_rad")
    for kind in ("rear_track", "front_track", "wheelbase"):
        assert known[kind].value == getattr(measured.frame, f"{kind}_m")
    assert len(known) == len(measured.uncertainty.values) == len(stated(measured))


@pytest.mark.parametrize("axis", AXES)
def test_each_axis_has_its_own_set_of_quantities(measured, axis):
    chosen = against(stated(measured), axis)
    pairs = [(quantity.subject, quantity.kind) for quantity in chosen]
    assert len(set(pairs)) == len(pairs)
    kinds = {kind for _, kind in pairs}
    zero = {"rear-axle": "rear_setback", "thrust-line": "thrust_angle"}.get(axis, "axle_offset")
    every = {entry.kind for entry in (*WHEEL, *VEHICLE)}
    assert kinds == every - {zero}
    assert all(named(quantity.kind, axis) in quantity.name for quantity in chosen if quantity.axis)


def test_json_keeps_the_papers_angles_and_adds_the_axes(measured):
    trees = {axis: to_tree(measured, axis=axis) for axis in AXES}
    for axis, tree in trees.items():
        assert tree.pop("axis_in_use") == axis
    assert all(tree == trees["rear-axle"] for tree in trees.values())
    tree = trees["rear-axle"]
    frame = {name: np.array(tree["frame"][name]) for name in ("left", "forward", "up")}
    rear = {wheel["name"]: wheel["toe_deg"] for wheel in tree["wheels"][:2]}
    for axis, shown in tree["axes"].items():
        turn = math.radians(shown["angle_deg"])
        along = math.cos(turn) * frame["forward"] - math.sin(turn) * frame["left"]
        np.testing.assert_allclose(shown["direction"], along, rtol=0, atol=1e-15)
        for wheel, turned in zip(tree["wheels"], shown["wheels"], strict=True):
            assert turned["name"] == wheel["name"]
            side = 1.0 if wheel["wheel"].endswith("L") else -1.0
            toe = wheel["toe_deg"] - side * shown["angle_deg"]
            if axis == "thrust-line" and wheel["wheel"] in rear:  # half of the sum of both
                toe = (wheel["toe_deg"] + rear[OTHER[wheel["wheel"]]]) / 2.0
            assert turned["toe_deg"] == pytest.approx(toe, abs=1e-12)
            assert turned["camber_deg"] == wheel["camber_deg"]
            assert turned["u_camber_deg"] == wheel["u_camber_deg"]
        if axis == "rear-axle":
            assert (shown["angle_deg"], shown["u_angle_deg"], shown["rear_setback_m"]) == (0, 0, 0)
    assert tree["axes"]["side-bisector"]["axle_offset_m"] is None
    assert tree["axes"]["centreline"]["axle_offset_m"] == 0.0
    thrust = tree["axes"]["thrust-line"]
    assert thrust["angle_deg"] == tree["vehicle"]["thrust_angle_deg"]
    assert thrust["u_angle_deg"] == tree["vehicle"]["u_thrust_angle_deg"] > 0
    json.dumps(tree, allow_nan=False)


def test_u_of_toe_to_another_axis_takes_the_covariance_with_its_angle(measured):
    """Worked out from the JSON alone: var(toe -+ angle) = var + var -+ 2 cov."""
    tree = to_tree(measured)
    names, matrix = tree["covariance"]["quantities"], np.array(tree["covariance"]["matrix"])
    angles = {"centreline": "centreline_angle", "thrust-line": "thrust_angle"}
    apart = []
    for axis, angle in (angles | {"side-bisector": "side_bisector_angle"}).items():
        for wheel, shown in zip(tree["wheels"], tree["axes"][axis]["wheels"], strict=True):
            slope = np.zeros(len(names))
            slope[names.index(f"{wheel['name']}.toe")] = 1.0
            slope[names.index(angle)] = -1.0 if wheel["wheel"].endswith("L") else 1.0
            own = wheel["role"] == "trial" and wheel["wheel"] in ("RR", "RL")
            if axis == "thrust-line" and own:
                slope[:] = 0.0  # half of the sum of both rear toes, the trial's and the other's
                other = OTHER[wheel["wheel"]]
                slope[[names.index(f"{name}.toe") for name in (wheel["name"], other)]] = 0.5
            u = math.sqrt(slope @ matrix @ slope)
            assert shown["u_toe_deg"] == pytest.approx(u, rel=1e-9)
            apart.append(math.sqrt(slope**2 @ np.diag(matrix)) / u - 1.0)
    assert max(apart) > 0.5  # so leaving the covariance out is seen


# --- the text -----------------------------------------------------------------------------------


def line(text, label):
    """The cells of the one line that begins so."""
    (found,) = [row for row in text.split("\n") if row.startswith(f"  {label}  ")]
    return re.split(r"  +", found.strip())


def test_words_say_which_side(measured, mirrored):
    for measurement, behind, ahead, side in (
        (measured, "right", "left", "right"),
        (mirrored, "left", "right", "left"),
    ):
        text = vehicle_lines(measurement)
        known = by_name(measurement)
        value = abs(known["front_setback"].value) * 1e3
        _, words, u = line(text, "front setback")
        # U of all three is some 0.5 mm
        assert words == f"{behind} wheel {value:.2f} mm behind {ahead}"
        assert u == f"{known['front_setback'].u * 1e3:.2f} mm"
        offset = abs(known["axle_offset"].value) * 1e3
        assert line(text, "front axle offset")[1] == f"{offset:.2f} mm to the {side}"
        longer = abs(known["wheelbase_difference"].value) * 1e3
        assert line(text, "wheelbase difference")[1] == f"{ahead} longer by {longer:.2f} mm"
        assert line(text, "rear setback")[1] == "zero by this axis"
    assert by_name(measured)["front_setback"].value > 0.0  # FL 4.6 mm ahead of FR in the file


@pytest.mark.parametrize("axis", AXES)
def test_the_report_names_its_axis_and_keeps_to_it(measured, axis):
    view = View(axis)
    text = detailed_report(measured, view=view)
    assert text.count(f"Longitudinal axis in use ({axis})") == 1
    rows = summary_table(measured, view).split("\n")
    assert rows[0].count(f"toe to {axis}") == (axis != "rear-axle")
    known = by_name(measured)
    for row, wheel in zip(rows[1:], measured.wheels, strict=True):
        shown = known[f"{wheel.observation.name}.{named('toe', axis)}"]
        cells = row.split()
        assert says_angle(cells[2], math.degrees(shown.value), math.degrees(shown.expanded))
        assert says_width(cells[3], math.degrees(shown.u))
    assert ("front left toe to the thrust line" in text) == (axis != "thrust-line")


# --- units --------------------------------------------------------------------------------------

SECOND = math.radians(1 / 3600)
RIM = 0.4064


def read(text):
    """Radians of a printed angle or width; toe of a rim of 406.4 mm."""
    if found := re.fullmatch(r"([+-])(\d+)°(\d+)'([\d.]+)\"", text):
        sign, degrees, minutes, seconds = found.groups()
        whole = 3600 * int(degrees) + 60 * int(minutes) + float(seconds)
        return float(f"{sign}1") * whole * SECOND
    value, unit = re.fullmatch(r"([+-]?[\d.]+) ?(\D+)", text).groups()
    scale = {
        "°": lambda x: math.radians(x),
        '"': lambda x: x * SECOND,
        "mm/m": lambda x: math.atan(x / 1e3),
        "mm": lambda x: math.asin(x / 1e3 / RIM),
    }
    return scale[unit](float(value))


STYLES = {"dms": 0.05 * SECOND, "deg": math.radians(5e-6), "mm/m": 5e-7, "mm": 5e-7 / RIM}


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("sort", ["toe", "heading", "camber"])
def test_every_unit_reads_back(style, sort):
    view = View(angles=style, rim_m=RIM, digits="full")
    for angle in [0.0, *np.random.default_rng(5).uniform(-0.3, 0.3, 200)]:
        limit = max(STYLES.values()) if sort != "toe" else STYLES[style]
        assert read(view.angle(angle, sort)) == pytest.approx(angle, abs=limit * 1.11)
        assert view.angle(angle, sort)[0] in "+-"
        # a width is the change of what is printed
        near, far = (view.angle(angle + d, sort) for d in (-0.02, 0.02))
        width = read(view.width(0.04, sort, angle))
        if style in ("dms", "deg") or sort == "camber":
            assert read(far) - read(near) == pytest.approx(width, abs=4 * limit)
    assert view.angle(-1e-12, sort)[0] == "+"
    assert view.angle(math.radians(1), "camber").endswith("°" if style == "deg" else '"')


@pytest.mark.parametrize("style", ["mm/m", "mm"])
def test_a_width_is_the_slope_of_what_is_printed(style):
    view = View(angles=style, rim_m=RIM, digits="full")

    def number(angle):
        return float(view.angle(angle, "toe").split()[0])

    for at in (-0.3, 0.0, 0.2):
        rise = (number(at + 0.02) - number(at - 0.02)) / 2
        # the third derivative, at most 4 sec^4 of a tangent, and the last digit
        limit = 1e3 * 4 / math.cos(0.32) ** 4 * 0.02**3 / 6 * 2 + 2e-3
        assert float(view.width(0.02, "toe", at).split()[0]) == pytest.approx(rise, abs=limit)


@pytest.mark.parametrize("seed", range(3))
def test_millimetres_are_those_of_a_tape_at_the_rim(seed):
    """Distance between the rims behind, less that ahead, at the height of the wheel centres."""
    rng = np.random.default_rng(seed)
    toes, cambers = rng.uniform(-0.05, 0.05, 2), rng.uniform(-0.05, 0.05, 2)
    normals = normals_of(toes, cambers, ["FL", "FR"])
    ends = []
    for normal, y in zip(normals, (0.75, -0.75), strict=True):
        level = np.cross(normal, [0.0, 0.0, 1.0])
        level *= np.sign(level[0]) / np.linalg.norm(level)
        ends.append([np.array([0.0, y, 0.0]) + s * RIM / 2 * level for s in (1, -1)])
    (front_l, rear_l), (front_r, rear_r) = ends
    tape = (rear_l - rear_r)[1] - (front_l - front_r)[1]
    shown = View(angles="mm", rim_m=RIM).total_toe(*toes)
    assert float(shown.removesuffix(" mm")) == pytest.approx(1e3 * tape, abs=5.1e-4)


@pytest.mark.parametrize(("inches", "published_mm"), [(15, 2.4), (16, 2.5), (17, 2.7)])
def test_millimetres_are_those_of_a_makers_table(inches, published_mm):
    """Volvo C70, 1998: total toe of 0.33° at the flange of the rim, which stands 17.5 mm high."""
    view = read_view("rear-axle", "mm", f"{inches * 25.4 + 35:.1f}mm")
    each = math.radians(0.33 / 2)
    shown = float(view.total_toe(each, each).removesuffix(" mm"))
    assert shown == pytest.approx(published_mm, abs=0.05)
    assert abs(shown / 2 - published_mm) > 0.05


@pytest.mark.parametrize("rim", ["16in", "406.4mm", "0.4064m", " 406.4 mm "])
def test_a_rim_in_any_unit_is_one_rim(rim):
    assert read_view("rear-axle", "mm", rim).rim_m == pytest.approx(RIM, rel=1e-15)


@pytest.fixture
def wheelplane(capsys, monkeypatch):
    """Call the command in this process: exit code, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wheelplane", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            main()
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return call


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--angles", "mm"], "--angles mm without --rim"),
        (["--rim", "16in"], "--rim 16in without --angles mm"),
        (["--angles", "mm", "--rim", "16"], "a diameter with its unit is needed"),
        (["--angles", "mm", "--rim", "-16in"], "a diameter with its unit is needed"),
        (["--angles", "mm", "--rim", "nanmm"], "a diameter with its unit is needed"),
        (["--angles", "mm", "--rim", "16mm"], "0.016 m is no rim's"),
        (["--angles", "gon"], "'gon' is not one of"),
        (["--axis", "middle"], "'middle' is not one of"),
        (["--axis", "centreline", "--method", "tcgc-2013"], "reproduced as they were printed"),
    ],
)
def test_a_view_that_cannot_be_is_refused_in_one_line(wheelplane, options, says):
    code, out, err = wheelplane("five-point", FIGURE_4, *options)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err


def test_the_command_shows_the_axis_and_the_unit_that_it_was_asked_for(wheelplane, measured):
    options = ("--axis", "centreline", "--angles", "mm", "--rim", "16in")
    code, out, err = wheelplane("five-point", FIGURE_4, *options)
    assert (code, err) == (0, "")
    view = read_view("centreline", "mm", "16in")
    assert summary_table(measured, view) in out
    assert vehicle_lines(measured, view) in out
    assert line(out, "front axle offset")[1] == "zero by this axis"
    bisected = wheelplane("five-point", FIGURE_4, "--axis", "side-bisector")[1]
    assert line(bisected, "front axle offset")[1] == "nearly zero by this axis"
    tree = json.loads(wheelplane("five-point", FIGURE_4, *options, "--json")[1])
    assert tree["axis_in_use"] == "centreline"
    assert tree["wheels"][0]["toe_deg"] == math.degrees(measured.wheels[0].angles.toe_rad)


# --- limits -------------------------------------------------------------------------------------


def limits(entry, lower, upper):
    unit = "deg" if getattr(entry, "unit", "rad") == "rad" else "m"
    scale = math.degrees(1.0) if unit == "deg" else 1.0
    return {f"lower_{unit}": lower * scale, f"upper_{unit}": upper * scale}


def test_every_quantity_can_be_judged(measured):
    known = by_name(measured)
    for where, entry in itertools.chain(
        (("FL", entry) for entry in WHEEL), (("vehicle", entry) for entry in VEHICLE)
    ):
        shown = known[entry.name if where == "vehicle" else f"{where}.{entry.name}"]
        for middle, decision in (
            (shown.value, "conform"),
            (shown.value - 20 * shown.u, "not conform"),
        ):
            zone = limits(entry, middle - 9 * shown.u, middle + 9 * shown.u)
            table = Tolerance.model_validate({where: {entry.name: zone}, "trials": False})
            (verdict,) = assess(measured, table).verdicts
            assert verdict.decision == decision
            assert (verdict.quantity.value, verdict.quantity.u) == (shown.value, shown.u)
            assert verdict.quantity.dof == shown.dof


def test_limits_of_setback_have_a_side(measured, mirrored):
    table = Tolerance.model_validate({"vehicle": {"front_setback": {"upper_m": 0.0}}})
    assert assess(measured, table).decision == "not conform"
    assert assess(mirrored, table).decision == "conform"
