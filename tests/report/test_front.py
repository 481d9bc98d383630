"""The first page: what it holds, its bars, and what was before."""

from __future__ import annotations

import html
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from tests.support.paths import FIGURE_4
from tests.support.printed import says_angle
from tests.support.reported import lost, measured
from tests.support.turning import Scene, rolled, swept
from wheelplane.errors import InputError
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.quantities import by_name
from wheelplane.measurement.tolerance import ToleranceInterval
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.earlier import check_comparable, check_same_vehicle, read_earlier
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.view import PAPER, View
from wheelplane.report.format.writer import NONE, Writer
from wheelplane.report.html.front import front
from wheelplane.report.html.page import ReportOptions, html_report
from wheelplane.report.json.measurement import to_json, to_tree
from wheelplane.report.plots.angles import BAND, BAR_END, BAR_WIDE, COLOURS, bar_drawing
from wheelplane.report.plots.drawing import CircleMark, Path
from wheelplane.report.tables.front import changes_table, front_groups
from wheelplane.report.text.vehicle import before_text

EN = load_translations("en")
WRITER = Writer(EN, PAPER)
ZONE = {"lower_deg": -5.0, "upper_deg": 5.0}
LIMITS = {
    "front": {"toe": ZONE, "camber": ZONE, "caster": {"lower_deg": 60.0}},
    "rear": {"toe": {"upper_deg": -5.0}},
    "vehicle": {"thrust_angle": ZONE, "wheelbase": {"lower_m": 1.0}, "front_cross_toe": ZONE},
}


@pytest.fixture(scope="module")
def turned():
    made = Scene(seed=3).references()
    for wheel in ("FL", "FR"):
        swept(made, wheel, 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    rolled(made, "RR", np.radians([0.0, 180.0]))
    return made.measure()


@pytest.fixture(scope="module")
def judged(turned):
    return assess(replace(turned, notes=()), Tolerance.model_validate(LIMITS))


def rows_of(groups):
    return [row for group in groups for row in group.rows]


# --- what it holds ------------------------------------------------------------------------------


def test_each_axle_then_the_vehicle_then_the_steering_axes(turned):
    groups = front_groups(turned, None, WRITER)
    assert [group.title for group in groups] == [
        "Front axle", "Rear axle", "Vehicle", "Steering axes"]  # fmt: skip
    labels = ["toe, left", "toe, right", "toe, total",
              "camber, left", "camber, right", "camber, cross"]  # fmt: skip
    assert [row.label for row in groups[0].rows] == [row.label for row in groups[1].rows] == labels
    assert [row.label for row in groups[3].rows] == [
        "caster, left", "caster, right", "SAI, left", "SAI, right"]  # fmt: skip
    plain = front_groups(measured(1), None, WRITER)
    assert [group.title for group in plain] == ["Front axle", "Rear axle", "Vehicle"]


def test_the_values_are_those_of_the_measurement(turned):
    known = by_name(turned)
    groups = front_groups(turned, None, WRITER)
    names = ["FL.toe", "FR.toe", "front_total_toe", "FL.camber", "FR.camber", "front_cross_camber",
             "RL.toe", "RR.toe", "rear_total_toe", "RL.camber", "RR.camber", "rear_cross_camber",
             "thrust_angle"]  # fmt: skip
    for row, name in zip(rows_of(groups), names, strict=False):
        value, expanded = (math.degrees(x) for x in (known[name].value, known[name].expanded))
        assert says_angle(row.value, value, expanded)
        assert math.degrees(row.at.value) == value
    left, right = turned.steering_axes[1], turned.steering_axes[0]
    for row, known_axis in zip(groups[3].rows, (left.caster, right.caster), strict=False):
        assert row.at.value == known_axis.value


def test_from_another_axis_toe_is_that_axis_s(turned):
    writer = Writer(EN, View("thrust-line"))
    groups = front_groups(turned, None, writer)
    assert [group.title for group in groups][2] == "Steering axes"  # thrust angle: zero
    assert groups[0].rows[0].at.value == by_name(turned)["FL.toe_to_thrust_line"].value


def test_every_quantity_with_limits_is_there_once(turned, judged):
    rows = rows_of(front_groups(turned, judged, WRITER))
    assert len([row for row in rows if row.decision]) == len(judged.verdicts)
    assert {row.label for row in rows[-2:]} == {"front cross toe", "wheelbase"}
    caster = next(row for row in rows if row.label == "caster, left")
    assert (caster.decision, caster.lower, caster.upper) == ("not conform", "+60°", NONE)
    assert next(row for row in rows if row.label == "wheelbase").lower == "+1000 mm"


def test_what_has_limits_and_was_not_measured_has_no_bar():
    limits = Tolerance.model_validate({"front": {"caster": {"lower_deg": 1.0}}})
    shown = front(measured(1), assess(measured(1), limits), WRITER)
    title, lines = shown.groups[-1]
    assert title == EN("front.others")
    assert [(line.row.value, line.bar, line.sign) for line in lines] == [(NONE, None, "?")] * 2


def test_of_trials_only_what_does_not_conform():
    for low, count in ((-5.0, 0), (0.5, 1)):
        limits = {"camber": {"lower_deg": low, "upper_deg": 5.0}}
        tolerance = Tolerance.model_validate({"front": limits, "rear": limits})
        groups = front_groups(measured(1), assess(measured(1), tolerance), WRITER)
        others = [group.rows for group in groups if group.title == EN("front.others")]
        assert sum(map(len, others)) == count


@pytest.mark.parametrize("language", LANGUAGES)
def test_verdict_table_and_notes_come_before_the_annexes(turned, judged, language):
    words = load_translations(language)
    noted = replace(turned, notes=("Counted as zero: this and that.",))
    text = html_report(noted, judged, ReportOptions(words, PAPER), still=True)
    first, rest = text.split('<div class="annexes">')
    for part in ('class="verdict not-conform"', 'class="front"', words("turned.caster"),
                 words("turned.inclination"), words("quantity.thrust_angle"),
                 "Counted as zero: this and that."):  # fmt: skip
        assert part in first
        assert part in first or part not in rest
    for part in (words("results.wheels"), words("verdict.table"), words("section.wheels"),
                 words("plot.budget_title"), words("origin.inputs")):  # fmt: skip
        assert part in rest.split("<script")[0]
        assert f">{part}</" not in first.split("</nav>")[1]


def test_what_was_not_measured_stands_on_the_first_page():
    text = html_report(lost(), None, ReportOptions(EN, PAPER), still=True)
    assert EN("status.no_target_do") in text.split('<div class="annexes">')[0]


# --- bars ---------------------------------------------------------------------------------------

LIMIT = ToleranceInterval(-0.01, 0.03)


def parts(drawing):
    marks = drawing.marks
    bands = [m for m in marks if isinstance(m, Path) and m.fill == BAND]
    dots = [m for m in marks if isinstance(m, CircleMark) and m.stroke == "none"]
    rings = [m for m in marks if isinstance(m, CircleMark) and m.stroke != "none"]
    heads = [m for m in marks if isinstance(m, Path) and m.closed and m.fill in COLOURS.values()]
    return bands, dots, rings, heads


@pytest.mark.parametrize("value", np.linspace(-0.028, 0.048, 20))
def test_the_dot_lies_in_the_band_where_the_value_lies_within_the_limits(value):
    bar = bar_drawing("", (value, 0.001, 0.01), LIMIT, (0.0, 1.0), "conform")
    (band,), (dot,), (ring,), heads = parts(bar)
    left, right = np.asarray(band.points)[:, 0].min(), np.asarray(band.points)[:, 0].max()
    assert (left <= dot.x <= right) == (LIMIT.lower <= value <= LIMIT.upper)
    assert heads == []
    middle = (left + right) / 2.0
    assert ring.x == pytest.approx(middle)  # 0.01, the middle of the limits
    assert right - left == pytest.approx((BAR_WIDE - 2 * BAR_END) / 2.0)
    scale = (right - left) / LIMIT.width
    assert dot.x - middle == pytest.approx(scale * (value - 0.01))


@pytest.mark.parametrize(("value", "side"), [(-0.5, -1), (0.5, 1)])
def test_what_lies_beyond_the_picture_is_an_arrowhead_at_its_end(value, side):
    bar = bar_drawing("", (value, 0.001, None), LIMIT, (0.0, 1.0), "not conform")
    _, dots, _, (head,) = parts(bar)
    assert dots == []
    x = np.asarray(head.points)[:, 0]
    assert 0.0 <= x.min() < x.max() <= BAR_WIDE
    assert (x.mean() > BAR_WIDE / 2.0) == (side > 0)


@pytest.mark.parametrize(
    ("interval", "inside"),
    [(ToleranceInterval(0.02, math.inf), 0.03), (ToleranceInterval(-math.inf, -0.02), -0.03)],
)
def test_one_limit_makes_a_band_to_the_end(interval, inside):
    bar = bar_drawing("", (inside, 0.001, None), interval, (0.0, 1.0), "conform")
    (band,), (dot,), _, _ = parts(bar)
    x = np.asarray(band.points)[:, 0]
    assert x.min() <= dot.x <= x.max()
    end = x.max() if interval.upper == math.inf else x.min()
    assert end == pytest.approx(BAR_WIDE - BAR_END if interval.upper == math.inf else BAR_END)


def test_without_limits_rows_of_one_kind_share_their_scale():
    shown = front(measured(1), None, WRITER)
    toes = [line for _, lines in shown.groups for line in lines if line.row.kind == "toe"]
    positions = [parts(line.bar)[1][0].x for line in toes]
    values = [line.row.at.value for line in toes]
    line = np.polyfit(values, positions, 1)
    np.testing.assert_allclose(np.polyval(line, values), positions, atol=1e-6)
    assert not shown.limited
    assert not shown.changed


# --- before and after ---------------------------------------------------------------------------


@pytest.fixture
def before(turned, tmp_path):
    """The measurement itself, its angles 0.1 degrees less, as a file."""
    tree = to_tree(turned)
    for entry in tree["uncertainty"]:
        entry["value"] -= 0.1 if entry["unit"] == "deg" else 0.0
    path = tmp_path / "measurement.json"
    path.write_text(json.dumps(tree | {"date": "2026-11-02", "capture": "the first"}))
    return read_earlier(path)


def test_each_change_is_the_difference_with_the_uncertainty_of_both(turned, before):
    known = by_name(turned)
    for row, name in zip(rows_of(front_groups(turned, None, WRITER, before)),
                         ("FL.toe", "FR.toe", "front_total_toe"), strict=False):  # fmt: skip
        expanded = math.degrees(known[name].expanded)
        assert says_angle(row.before[0], math.degrees(known[name].value) - 0.1, expanded)
        assert says_angle(row.change[0], 0.1, math.sqrt(2.0) * expanded)


def test_before_and_after_stand_on_the_page_in_the_text_and_in_the_json(turned, before):
    table = changes_table(turned, before, Writer(EN, PAPER, plain=True))
    assert len(table.rows) == 17  # 12 of the axles, the thrust angle, four of the steering
    text = html_report(turned, None, ReportOptions(EN, PAPER, before=before), still=True)
    first = html.unescape(text.split('<div class="annexes">')[0])
    assert "the first, 2026-11-02" in first
    for row in table.rows:
        assert row[2] in first
    tree = to_tree(turned, before=before)
    assert tree["before"]["capture"] == "the first"
    entry = next(e for e in tree["before"]["quantities"] if e["quantity"] == "RR.toe")
    assert entry["change"] == pytest.approx(0.1)
    assert entry["now"] - entry["before"] == pytest.approx(entry["change"])
    assert entry["u"] == pytest.approx(math.sqrt(2.0) * math.degrees(by_name(turned)["RR.toe"].u))
    assert to_tree(turned)["before"] is None
    assert to_json(turned) != to_json(turned, before=before)


def test_a_trial_that_was_at_another_wheel_has_no_value_before(tmp_path):
    """Trials 1 and 3 of Figure 4, at RL and RR, and the two the other way about."""
    points = read_five_point(FIGURE_4)
    now, earlier = (
        measure_five_point(replace(points, blocks_m=points.blocks_m[[0, 1, 2, 3, *trials]]))
        for trials in ((4, 6), (6, 4))
    )
    (tmp_path / "m.json").write_text(to_json(earlier))
    before = read_earlier(tmp_path / "m.json")
    limits = Tolerance.model_validate({"rear": LIMITS["rear"], "front": LIMITS["rear"]})
    rows = rows_of(front_groups(now, assess(now, limits), WRITER, before))
    assert all((row.at_before is None) == row.label.startswith(("1", "2")) for row in rows)
    assert any(row.label.startswith("1") for row in rows)
    named = {entry["quantity"] for entry in to_tree(now, before=before)["before"]["quantities"]}
    assert "RR.toe" in named
    assert not named & {"1.toe", "1.camber", "2.toe", "2.camber"}
    kept = to_tree(now, before=replace(before, wheels={}))["before"]["quantities"]
    assert {"1.toe", "2.toe"} <= {entry["quantity"] for entry in kept}


def test_a_five_point_measurement_can_be_what_was_before(tmp_path):
    five = measure_five_point(read_five_point(FIGURE_4))
    (tmp_path / "m.json").write_text(to_json(five))
    earlier = read_earlier(tmp_path / "m.json")
    changes = changes_table(five, earlier, WRITER)
    assert len(changes.rows) == 13
    assert {row[6] for row in changes.rows} <= {"+00°00'", "+00°00'00\""}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be read"),
        ("x", "not JSON"),
        ("[]", "no measurement of schema"),
        ('{"schema": "wheelplane/validation/1"}', "no measurement of schema"),
        ('{"schema": "wheelplane/measurement/1", "capture": "c"}', "incomplete"),
        ('{"schema": "wheelplane/measurement/1", "capture": "c", "vehicle_name": null, '
         '"date": null, "steering": {"kingpins": []}, "uncertainty": [{"unit": "deg"}]}',
         "incomplete"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_measurement_ends_in_one_line(content, says, tmp_path):
    path = tmp_path / "m.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=says) as refused:
        read_earlier(path)
    assert "\n" not in str(refused.value)
    assert str(path) in str(refused.value)


def test_another_vehicle_is_refused(before):
    named = replace(before, vehicle="AA-00-BB")
    check_same_vehicle(named, "AA-00-BB", "capture")
    check_same_vehicle(named, None, "capture")
    check_same_vehicle(replace(before, vehicle=None), "CC-11-DD", "capture")
    with pytest.raises(InputError, match=r"'AA-00-BB', capture of 'CC-11-DD'"):
        check_same_vehicle(named, "CC-11-DD", "capture")


def test_what_shows_no_change_is_refused(before, turned):
    """Later ones, and angles of the axle against those of the target as mounted."""
    made = replace(turned.provenance, date="2026-11-20", vehicle="mine")
    now, known = replace(turned, provenance=made), before
    assert known.compensated == {w.observation.name for w in turned.wheels if w.compensated}
    known = replace(known, compensated=frozenset({"RR"}))
    rolled_wheel = replace(turned.wheels[0], compensated=True)
    now = replace(now, wheels=(rolled_wheel, *turned.wheels[1:]))
    check_comparable(known, now)
    check_comparable(replace(known, date=None), now)
    for changed, says in (
        ({"date": "2999-01-01"}, "2999-01-01, after .* of 2026-11-20: exchange"),
        ({"compensated": frozenset({"RR", "FL"})}, "of FL are .* before, .* mounted after"),
        ({"compensated": frozenset()}, "of RR are .* run-out, after, .* mounted before"),
        ({"vertical": "gravity"}, "--vertical gravity"),
        ({"vehicle": "another"}, "of the vehicle 'another'"),
    ):
        with pytest.raises(InputError, match=says):
            check_comparable(replace(known, **changed), now)


@pytest.mark.parametrize(
    ("date", "other", "after"),
    [
        ("2026-11-20T15:00:00", "2026-11-20T10:30:00", True),  # the day of an adjustment
        ("2026-11-20T10:30:00", "2026-11-20T15:00:00", False),
        ("2026-11-20T10:30:00", "2026-11-20T10:30:00", False),
        ("2026-11-20T15:00:00+05:00", "2026-11-20T11:00:00+00:00", False),
        ("2026-11-20T12:00:00+00:00", "2026-11-20T13:00:00+02:00", True),
        ("2026-11-20T15:00:00", "2026-11-20T10:00:00+00:00", False),  # of unlike kinds: the day
        ("2026-11-20T15:00:00", "2026-11-20", False),
        ("2026-11-21", "2026-11-20T10:00:00", True),
        ("20 November", "2026-11-20T10:00:00", False),
    ],
)
def test_what_was_before_was_not_after_on_the_same_day(before, turned, date, other, after):
    now = replace(turned, provenance=replace(turned.provenance, date=other))
    free = frozenset(w.observation.name for w in now.wheels if w.compensated)
    known = replace(before, date=date, vehicle=None, compensated=free)
    if after:
        with pytest.raises(InputError, match=f"is of {re.escape(date)}, after .*: exchange"):
            check_comparable(known, now)
    else:
        check_comparable(known, now)


def test_changes_by_the_same_scans_are_called_so(before, turned):
    """U of a change is that of two independent measurements."""
    scans = {"rr.ply": "1", "rl.ply": "2"}
    now = replace(turned, provenance=replace(turned.provenance, inputs=scans))
    for inputs, same in ((frozenset("12"), True), (frozenset("13"), False), (frozenset(), False)):
        table = changes_table(now, replace(before, inputs=inputs), WRITER)
        assert ("same scans" in table.caption) == same
        text = before_text(now, replace(before, inputs=inputs), View())
        assert ("two independent measurements" in text) != same
