"""Conventions: signs and workshop angles that are printed, of the same measurement.json."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.measurement.test_repeatability import measurement as repeated
from tests.report.test_poses import STEP, unit
from tests.support.printed import arc_s
from tests.support.turning import Scene, swept
from tests.support.validation_cars import write_capture
from wheelplane.cli import cli
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement import Estimate, ToeOut, check_by_monte_carlo, pool_repeats
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.quantities import by_name, workshop_angles
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.report_options import ReportOptions
from wheelplane.report.format.view import ANGLE_STYLES, CONVENTIONS, PAPER, View
from wheelplane.report.format.writer import Writer
from wheelplane.report.html.page import html_report
from wheelplane.report.plots.drawing import Text
from wheelplane.report.plots.sign_convention import signs_drawing
from wheelplane.report.tables.checks import monte_carlo_table, repeats_table
from wheelplane.report.tables.conformity import limits_table, notes
from wheelplane.report.tables.front import front_groups
from wheelplane.report.tables.kinematics import steering_tables
from wheelplane.report.tables.vehicle import axes_table, vehicle_table
from wheelplane.report.text.budget import budget_text
from wheelplane.report.text.report import detailed_report
from wheelplane.report.text.vehicle import vehicle_lines
from wheelplane.uncertainty.propagation import effects_of

FIGURE_4 = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
TURNED = [name for name in CONVENTIONS if name != "default"]


@pytest.fixture(scope="module")
def measured():
    return measure_five_point(read_five_point(FIGURE_4))


def writer(convention, language="en"):
    return Writer(load_translations(language), View(convention=convention), plain=True)


def workshop(x):
    """Radversatz front, rear and Radstandsdifferenz from normals and centres (4, 2, 3)."""
    rr, rl, fr, fl = x[:, 1]
    left = unit(rl - rr)
    ahead = (fl + fr - rl - rr) / 2
    # the front axle's line meets the plane across the rear one ahead of its middle
    ahead = ahead - unit(fl - fr) * (ahead @ left) / (unit(fl - fr) @ left)
    up = np.cross(unit(ahead), left)
    rolls = [np.cross(n * np.sign(n @ left), up) for n in x[:2, 0]]
    thrust = unit(unit(rolls[0]) + unit(rolls[1]))
    thrust = thrust * np.sign(thrust @ ahead)
    front, rear = (np.arcsin(unit(right - other) @ thrust) for right, other in ((fr, fl), (rr, rl)))
    return np.array([front, rear, front - rear])


def test_workshop_angles_are_those_of_the_lines(measured):
    poses = [wheel.pose for wheel in measured.wheels[:4]]
    x = np.array([[pose.normal, pose.centre_m] for pose in poses])
    found = workshop_angles(measured)
    assert [angle.kind for angle in found] == [
        "front_setback_angle", "rear_setback_angle", "wheelbase_angle",
    ]  # fmt: skip
    assert [angle.value for angle in found] == pytest.approx(workshop(x), abs=1e-9)
    steps = STEP * np.eye(x.size).reshape(-1, *x.shape)
    J = np.stack([(workshop(x + s) - workshop(x - s)) / (2 * STEP) for s in steps], axis=1)
    V = sum((J @ e.factor) @ (J @ e.factor).T for e in effects_of(poses))
    assert [angle.u for angle in found] == pytest.approx(np.sqrt(np.diag(V)), rel=1e-5)
    right_longer = by_name(measured)["wheelbase_difference"].value < 0.0
    assert (found[2].value > 0.0) == right_longer


@pytest.mark.parametrize("language", ["en", "pt"])
@pytest.mark.parametrize("convention", TURNED)
def test_headings_are_positive_to_the_left(measured, convention, language):
    rows = {}
    for name in ("default", convention):
        table = vehicle_table(measured, writer(name, language))
        rows[name] = {row[0].partition(",")[0]: row for row in table.rows}
    known, words = by_name(measured), load_translations(language)
    for kind in ("thrust_angle", "steer_ahead"):
        label = words(f"quantity.{kind}")
        before, after = (rows[name][label] for name in ("default", convention))
        assert known[kind].value != 0.0
        assert before[1].translate(str.maketrans("+-", "-+")) == after[1]
        assert before[2] == after[2]
        assert after[0] == f"{label}, {words(f'sign_left.{kind}')}"
    workshop_rows = words("quantity.front_setback_angle") in rows[convention]
    assert workshop_rows == (convention == "german-workshop")


@pytest.mark.parametrize("convention", TURNED)
def test_limits_are_turned_with_their_quantity(measured, convention):
    value = np.degrees(by_name(measured)["thrust_angle"].value)
    limits = {"lower_deg": float(value) - 3.0, "upper_deg": float(value) + 5.0}
    tolerance = Tolerance.model_validate({"vehicle": {"thrust_angle": limits}})
    verdicts = assess(measured, tolerance)
    (plain,) = limits_table(verdicts, writer("default")).rows
    (turned,) = limits_table(verdicts, writer(convention)).rows
    signs = str.maketrans("+-", "-+")
    assert turned[3] == plain[3].translate(signs)
    assert (turned[4], turned[5]) == (plain[5].translate(signs), plain[4].translate(signs))
    assert turned[6:] == plain[6:]
    assert "thrust to the left" in notes(verdicts, writer(convention))
    assert "thrust to the right" in notes(verdicts, writer("default"))
    fronts = [
        next(
            row
            for group in front_groups(measured, verdicts, writer(name))
            for row in group.rows
            if row.kind == "thrust_angle"
        )
        for name in ("default", convention)
    ]
    assert fronts[1].at.value == -fronts[0].at.value
    assert fronts[1].interval.upper == -fronts[0].interval.lower


def as_printed(angle_deg, kind, view):
    """Number of an angle in the unit of a view, and how that begins."""
    angle = np.radians(angle_deg)
    wheels = {"toe": 1, "toe_to_centreline": 1, "rear_total_toe": 2}.get(kind)
    if view.angles == "deg":
        return angle_deg, "°"
    if view.angles == "mm/m" and kind not in ("camber", "cross_caster"):
        return 1e3 * np.tan(angle), "mm/m"
    if view.angles == "mm" and wheels:
        return 1e3 * view.rim_m * wheels * np.sin(angle / wheels), "mm"
    return None, "°"


@pytest.mark.parametrize("angles", ANGLE_STYLES)
def test_limits_are_written_in_the_unit_of_the_values(measured, angles):
    view = View(angles=angles, rim_m=0.4)
    of_wheel = {"toe": {}, "toe_to_centreline": {}, "camber": {}}
    of_vehicle = {"rear_total_toe": {}, "thrust_angle": {}, "cross_caster": {}}
    for number, limits in enumerate([*of_wheel.values(), *of_vehicle.values()]):
        limits |= {"lower_deg": -20.0 - number, "upper_deg": 0.25 + number}
    tolerance = Tolerance.model_validate({"FL": of_wheel, "vehicle": of_vehicle, "trials": False})
    verdicts = assess(measured, tolerance)
    rows = limits_table(verdicts, Writer(load_translations("en"), view, plain=True)).rows
    stated = of_wheel | of_vehicle
    assert {verdict.quantity.name for verdict in verdicts.verdicts} == set(stated)
    for verdict, row in zip(verdicts.verdicts, rows, strict=True):
        kind = verdict.quantity.name
        value = verdict.quantity.value
        at = [None if value is None else np.degrees(value), *stated[kind].values()]
        for text, angle_deg in zip(row[3:6], at, strict=True):
            if angle_deg is None:
                assert text == "-"
                continue
            wanted, unit = as_printed(angle_deg, kind, view)
            if wanted is None:
                assert "°" in text
                assert "'" in text
            else:
                number = re.match("[-+0-9.]+", text)[0]
                assert text.removeprefix(number).strip() == unit
                last = 10.0 ** -len(number.partition(".")[2])
                assert float(number) == pytest.approx(wanted, abs=0.51 * last)
        if value is not None:
            assert ("mm" in row[6]) == ("mm" in row[3]) == ("mm" in row[7])


def test_text_and_drawing_say_which_convention_is_in_use(measured):
    assert "onvention" not in vehicle_lines(measured, PAPER)
    for convention in TURNED:
        text = vehicle_lines(measured, replace(PAPER, convention=convention))
        assert load_translations("en").known("convention", convention)[:20] in text
    drawn = {name: signs_drawing(writer(name)) for name in CONVENTIONS}
    for name, drawing in drawn.items():
        side, other = ("left", "right") if name in TURNED else ("right", "left")
        texts = [drawing.title, *(mark.text for mark in drawing.marks if isinstance(mark, Text))]
        assert f"+ thrust angle: to the {side}" in texts
        assert not any(f"to the {other}" in text for text in texts)
    paths = [[m for m in one.marks if not isinstance(m, Text)] for one in drawn.values()]
    assert repr(paths[0]) != repr(paths[1])


@pytest.mark.parametrize("language", ["en", "pt"])
def test_headings_are_said_to_be_positive_to_the_side_they_are(measured, language):
    """A table of lines was turned to the left under a column "+ to the right"."""
    right, left = {"en": ("to the right", "to the left"),
                   "pt": ("para a direita", "para a esquerda")}[language]  # fmt: skip
    words = load_translations(language)
    for convention in CONVENTIONS:
        view = View(convention=convention)
        side, other = (left, right) if convention in TURNED else (right, left)
        texts = [
            repr(axes_table(measured, Writer(words, view))),
            html_report(measured, None, ReportOptions(words, view), still=True),
            *([detailed_report(measured, None, view)] if language == "en" else []),
        ]
        note = words("vehicle.note", side=side.split()[-1])[:30]
        for text in texts:
            assert f"+ {side}" in text
            assert f"+ {other}" not in text
            assert text is texts[0] or note in " ".join(text.split())


def test_the_json_is_the_same_in_every_convention(tmp_path):
    write_capture(tmp_path / "car", 3, trials=0)
    command = ["measure", str(tmp_path / "car"), "--axis", "rear-axle"]
    printed = {name: CliRunner().invoke(cli, [*command, "--json", "--convention", name]).output
               for name in CONVENTIONS}  # fmt: skip
    assert len(set(printed.values())) == 1
    assert printed["default"].startswith("{")
    text = CliRunner().invoke(cli, [*command[:2], "--convention", "iso-8855"]).output
    assert "Longitudinal axis in use (centreline)" in text


@pytest.mark.parametrize("plain", [True, False])
def test_checks_are_in_the_unit_of_the_angles_and_name_their_axis(plain):
    """Repeat scans, Monte Carlo, u of toe-out's curve and the budget: as all angles beside them."""
    found = check_by_monte_carlo(repeated(), 20_000, 0)
    view = View("centreline", "deg")
    writer = Writer(load_translations("en"), view, plain=plain)
    by_arc = Writer(load_translations("en"), View("centreline"), plain=plain)
    (group,) = pool_repeats(found)
    rows = repeats_table(found, writer).rows
    assert [row[2] for row in rows] == ["toe to the normal of the rear axle", "camber"]
    for row, angle in zip(rows, group.angles, strict=True):
        numbers = angle.pooled, angle.u, angle.drift, angle.u_drift
        for text, size in zip((row[3], row[4], row[7], row[8]), numbers, strict=True):
            assert text.endswith("°")
            near = Estimate(size, angle.u_drift if size == angle.drift else angle.u).expanded
            assert float(text[:-1]) == pytest.approx(np.degrees(size), abs=0.1 * np.degrees(near))
    drawn = monte_carlo_table(found, found.monte_carlo, writer).rows
    same = monte_carlo_table(found, found.monte_carlo, by_arc).rows
    assert len(drawn) == len(same) > 20
    for row, other in zip(drawn, same, strict=True):
        assert row[0] == other[0]
        for text, arc in zip(row[1:3], other[1:3], strict=True):
            if not text.endswith("m"):
                assert text.endswith("°")
                assert float(text[:-1]) == pytest.approx(arc_s(arc) / 3600.0, rel=0.05)
    shown = budget_text(found, view).partition("Noise of each scan")[0]
    assert re.search(r"^ +RR toe to centreline +0\.\d+° +0\.\d+° ", shown, re.MULTILINE)
    assert '"' not in shown


def test_the_curve_of_toe_out_is_in_the_unit_of_the_angles():
    made = Scene(seed=3).references()
    swept(made, "FL", 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    of_curve = np.radians(0.0123)
    turn = ToeOut("left", difference=Estimate(0.02, 1e-4), u_interpolation_rad=of_curve)
    found = replace(made.measure(), toe_out=(turn,))
    for angles, shown in (("deg", "0.012°"), ("dms", '44"'), ("mm/m", '44"')):
        writer = Writer(load_translations("en"), View(angles=angles), plain=True)
        (row,) = steering_tables(found, writer)[-1][0].rows
        assert row[-2] == shown
