"""Digits follow the uncertainty: two of U, the value to the same place, in every unit."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.support.paths import FIGURE_4
from tests.support.printed import arc_s, arc_step_s, seconds_of, step, two_digits
from tests.support.reported import measured
from tests.support.turning import Scene, rolled, swept
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement.quantities import by_name
from wheelplane.report.format.digits import (
    arc,
    decimal,
    metres,
    millimetres,
    place_of,
    rounded,
    sexagesimal,
    size,
)
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.view import View
from wheelplane.report.format.writer import Writer
from wheelplane.report.plots.angle_chart import angles_text
from wheelplane.report.plots.budget import budget_drawing
from wheelplane.report.plots.drawing import Text
from wheelplane.report.plots.top_view import top_drawing
from wheelplane.report.tables.kinematics import runout_tables, steering_tables
from wheelplane.report.tables.vehicle import vehicle_table
from wheelplane.report.tables.wheels import axles_table, wheels_table

SECOND = math.radians(1.0 / 3600.0)
RIM_M = 0.4064
# from a tenth of a milliarcsecond to some 30 degrees
WIDTHS = st.floats(-9.3, -0.3).map(lambda power: 10.0**power)
ANGLES = st.floats(-0.5, 0.5)
EDGES = [0.0996, 0.0995, 0.995, 0.9951, 9.95, 9.96, 99.5, 99.6, 994.9, 995.1, 0.105, 1.05, 10.5]


@pytest.mark.parametrize(
    ("expanded", "place", "text"),
    [
        (0.0996, -2, "0.10"),
        (0.00994, -4, "0.0099"),
        (23.4, 0, "23"),
        (99.6, 1, "100"),
        (130.0, 1, "130"),
        (4.3, -1, "4.3"),
        (1.0, -1, "1.0"),
        (0.95, -2, "0.95"),
        (12345.0, 3, "12000"),
    ],
)
def test_the_second_digit_gives_the_place(expanded, place, text):
    assert place_of(expanded) == place
    assert decimal(expanded, expanded, 3, "") == text


@pytest.mark.parametrize("unknown", [math.nan, 0.0, math.inf, -1.0, 1e-12])
def test_without_an_uncertainty_the_digits_are_fixed(unknown):
    assert place_of(unknown) is None
    assert decimal(1.23456, unknown, 3) == "+1.235"
    assert sexagesimal(1180.74 * SECOND, unknown) == "+00°19'40.7\""
    assert metres(1.234567, unknown) == "1.23457 m"
    assert millimetres(0.0012345, unknown) == "1.234 mm"


@pytest.mark.parametrize(
    ("seconds", "expanded_s", "value", "width"),
    [
        (-1180.74, 23.4, "-00°19'41\"", '23"'),
        (1180.74, 130.4, "+00°19'40\"", '130"'),
        (1180.74, 4.3, "+00°19'40.7\"", '4.3"'),
        (1180.74, 0.0996, "+00°19'40.74\"", '0.10"'),
        (1180.74, 994.0, "+00°19'40\"", '990"'),
        (1180.74, 1260.0, "+00°20'", "21'"),
        (1180.74, 6000.0, "+00°20'", "100'"),
        (54321.0, 61200.0, "+15°", "17°"),
        (3599.7, 23.0, "+01°00'00\"", '23"'),
        (-3596.0, 130.0, "-01°00'00\"", '130"'),
        (-0.4, 23.0, "+00°00'00\"", '23"'),
        (-4.9, 130.0, "+00°00'00\"", '130"'),
        (-29.9, 1260.0, "+00°00'", "21'"),
        (math.nan, 23.0, "undefined", '23"'),
        (math.nan, 130.0, "undefined", '130"'),
    ],
)
def test_degrees_minutes_and_seconds_end_where_the_uncertainty_ends(
    seconds, expanded_s, value, width
):
    assert sexagesimal(seconds * SECOND, expanded_s * SECOND) == value
    assert size(expanded_s * SECOND, "rad") == width


@given(angle=ANGLES, expanded=WIDTHS)
@example(angle=-0.4 * SECOND, expanded=23.0 * SECOND)
@example(angle=0.0, expanded=0.0996 * SECOND)
def test_an_angle_and_its_uncertainty_in_arc(angle, expanded):
    value, width = sexagesimal(angle, expanded), size(expanded, "rad")
    true_s, expanded_s = (math.degrees(x) * 3600.0 for x in (angle, expanded))
    unit_s = arc_step_s(expanded_s)
    read_s = seconds_of(value)
    assert abs(read_s - true_s) <= 0.5 * unit_s + 1e-9 * abs(true_s)
    assert arc_s(width) == pytest.approx(expanded_s, abs=0.5 * unit_s * (1.0 + 1e-9))
    for read in (read_s, arc_s(width)):
        assert read / unit_s == pytest.approx(round(read / unit_s), abs=1e-6 + 1e-9 * abs(read))
    digits = re.sub(r"\D", "", width).lstrip("0")
    assert len(digits) == 2 or (len(digits) == 3 and digits[2] == "0")
    assert (value[0] == "-") == (read_s < 0.0)
    small = arc(angle, expanded, "+")
    assert arc_s(small) == pytest.approx(read_s, abs=1e-6 + 1e-12 * abs(read_s))
    assert (small[0] == "-") == (arc_s(small) < 0.0)


def in_unit(angle, expanded, style):
    """Value, U and number of the unit's mark, by the definitions of the units."""
    if style == "deg":
        return math.degrees(angle), math.degrees(expanded), "°"
    if style == "mm/m":
        return 1e3 * math.tan(angle), 1e3 * expanded / math.cos(angle) ** 2, " mm/m"
    return 1e3 * RIM_M * math.sin(angle), 1e3 * RIM_M * math.cos(angle) * expanded, " mm"


def check_pair(value, width, true, expanded):
    """Check a printed number and its printed U, both without unit."""
    unit = step(expanded)
    assert abs(float(value) - true) <= 0.5 * unit * (1.0 + 1e-9) + 1e-12 * abs(true)
    assert float(width) == pytest.approx(float(two_digits(expanded)), rel=1e-12)
    decimals = [len(text.partition(".")[2]) for text in (value, width)]
    assert decimals[0] == decimals[1] == max(0, -round(math.log10(unit)))
    assert float(value) / unit == pytest.approx(round(float(value) / unit), rel=1e-9, abs=1e-9)
    assert (value[0] == "-") == (float(value) < 0.0)


@given(angle=ANGLES, expanded=WIDTHS, style=st.sampled_from(["deg", "mm/m", "mm"]))
def test_an_angle_and_its_uncertainty_in_decimal_units(angle, expanded, style):
    view = View(angles=style, rim_m=RIM_M)
    true, wide, mark = in_unit(angle, expanded, style)
    if abs(wide / step(wide) % 1.0 - 0.5) < 1e-6 or wide < 2e-6:
        return  # a tie, which the unit's own rounding decides; or too small for any digits
    value, width = view.angle(angle, "toe", expanded), view.width(expanded, "toe", angle)
    assert value.endswith(mark)
    check_pair(value.removesuffix(mark), width.removesuffix(mark), true, wide)


@given(left=ANGLES, right=ANGLES, expanded=WIDTHS, style=st.sampled_from(["deg", "mm/m", "mm"]))
def test_a_total_and_its_uncertainty_share_their_place(left, right, expanded, style):
    view = View(angles=style, rim_m=RIM_M)
    texts = view.total_toe(left, right, expanded), view.width(expanded, "total", left + right)
    value, width = (text.rstrip(" m/°") for text in texts)
    if float(width) < 2e-6:
        return
    assert len(value.partition(".")[2]) == len(width.partition(".")[2])
    assert len(re.sub(r"\D", "", width).lstrip("0").rstrip("0")) <= 2


@given(length=st.floats(-5.0, 5.0), expanded=st.floats(-8.0, -0.5).map(lambda power: 10.0**power))
@example(length=0.0, expanded=0.001)
def test_a_length_in_metres_and_its_uncertainty_in_millimetres(length, expanded):
    wide = 1e3 * expanded
    if abs(wide / step(wide) % 1.0 - 0.5) < 1e-6:
        return
    value, width = metres(length, expanded, "+"), size(expanded, "m")
    assert value.endswith(" m")
    assert width.endswith(" mm")
    unit = step(wide) / 1e3
    float64 = 2e-15  # rounding of a length of up to 5 m
    assert abs(float(value[:-2]) - length) <= 0.5 * unit * (1.0 + 1e-9) + float64
    assert float(width[:-3]) == pytest.approx(float(two_digits(wide)), rel=1e-12)
    assert len(value[:-2].partition(".")[2]) == max(0, -round(math.log10(unit)))
    small = millimetres(length, expanded, "+")
    check_pair(small[:-3], width[:-3], 1e3 * length, wide)


@pytest.mark.parametrize("edge", EDGES)
def test_boundaries_are_those_of_the_exact_number(edge):
    """Two digits of the binary number itself: 0.0995 lies below its name, 0.0996 above 0.0995."""
    assert decimal(edge, edge, 3, "") == f"{two_digits(edge):f}"
    assert float(rounded(edge, place_of(edge), "")) == float(two_digits(edge))


def test_full_digits_are_fixed_whatever_the_uncertainty():
    full, known = View(digits="full"), View()
    assert full.angle(0.01, "toe", 0.001) == known.angle(0.01, "toe") == "+00°34'22.6\""
    assert known.angle(0.01, "toe", 0.001) == "+00°34'20\""
    assert full.width(0.001, "toe") == '206.3"'
    assert known.width(0.001, "toe") == '210"'
    assert full.length(1.5, 0.01) == "1.50000 m"
    assert known.length(1.5, 0.01) == "1.500 m"


@pytest.mark.parametrize("value", [-0.0, -1e-12, -0.04])
def test_a_zero_has_no_minus(value):
    assert rounded(value, -1) == "+0.0"
    assert rounded(value, 1) == "+0"
    assert decimal(value, 1.5, 3) == "+0.0"


# --- tables and plots ---------------------------------------------------------------------------


def ends_alike(value, width):
    """Whether a printed value ends at the last place of its printed U; text of either language."""
    if value[-1] in "\"'°" and width[-1] in "\"'°" and "°" in value[:-1] + value[-1:]:
        if width[-1] != value[-1]:
            return False
        return width[-1] != '"' or decimals(value) == decimals(width)
    shift = 3 if value.endswith(" m") and width.endswith(" mm") else 0
    return decimals(value) == decimals(width) + shift


def decimals(text):
    found = re.search(r"[.,](\d+)", text)
    return len(found[1]) if found else 0


def turned():
    """Sweeps, run-outs and repeat scans, so that all tables are there."""
    made = Scene(seed=3).references()
    swept(made, "FL", 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    rolled(made, "RR", np.radians([0.0, 180.0]))
    return made.measure()


@pytest.fixture(scope="module")
def measurements():
    return [measured(1), turned(), measure_five_point(read_five_point(FIGURE_4))]


@pytest.mark.parametrize("language", ["en", "pt"])
@pytest.mark.parametrize("style", ["dms", "deg", "mm/m", "mm"])
def test_in_every_table_a_value_ends_where_its_uncertainty_ends(measurements, style, language):
    writer = Writer(load_translations(language), View(angles=style, rim_m=RIM_M))
    pairs = 0
    for measurement in measurements:
        tables = [
            wheels_table(measurement, writer),
            axles_table(measurement, writer),
            vehicle_table(measurement, writer),
            *(table for table, _ in steering_tables(measurement, writer)),
            *(table for table, _ in runout_tables(measurement, writer)),
        ]
        for table in tables:
            for row in table.rows:
                for column, head in enumerate(table.head):
                    value, width = row[column - 2], row[column]
                    if head == "U" and width != writer.none:
                        number = re.search(r"[+\d][^a-z]*(mm/m|mm|m)?|-\d.*", value)[0]
                        assert ends_alike(number, width), (table.caption, value, width)
                        pairs += 1
    assert pairs > 60


def test_a_value_that_ends_elsewhere_is_seen():
    assert ends_alike("+00°19'40.7\"", '4.3"')
    assert not ends_alike("+00°19'40.7\"", '23"')
    assert not ends_alike("+00°19'40\"", "21'")
    assert ends_alike("1.3653 m", "1.1 mm")
    assert not ends_alike("1.36527 m", "1.1 mm")


def test_plots_show_the_same_digits():
    known, en = by_name(measured(1)), load_translations("en")
    above = {m.text for m in top_drawing(measured(1), en, View()).marks if isinstance(m, Text)}
    chart = angles_text(measured(1), None, en, View())
    bars = {m.text for m in budget_drawing(measured(1), en).marks if isinstance(m, Text)}
    for wheel in ("RR", "RL", "FR", "FL"):
        for kind in ("toe", "camber"):
            found = known[f"{wheel}.{kind}"]
            assert sexagesimal(found.value, found.expanded) in above
            assert sexagesimal(found.value, found.expanded) in chart
            assert f"{size(found.u, 'rad')};  {size(found.expanded, 'rad')}" in bars
    thrust = known["thrust_angle"]
    assert f"thrust line: {sexagesimal(thrust.value, thrust.expanded)}" in above
