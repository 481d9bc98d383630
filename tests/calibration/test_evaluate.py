"""Tests of errors of indication, their budget and verdicts, on machines whose errors are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.support.calibration_bay import (
    CAMBER,
    ORIGIN,
    TOE,
    Bay,
    Protocol,
    as_readings,
    changed,
    item_of,
    machine,
    minutes,
    tilted,
)
from tests.support.validation_cars import TM30
from tests.support.validation_cars import stated as station_of
from wheelplane.batch.catalogue.calibration_row import calibration_row
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.evaluate import adjustments
from wheelplane.calibration.forms.item import DecisionRule
from wheelplane.calibration.forms.readings import Readings
from wheelplane.calibration.forms.table_file import FaultyTableError
from wheelplane.calibration.records import Calibration, worst
from wheelplane.calibration.reference import Reference
from wheelplane.errors import Doubt
from wheelplane.five_point import FivePointFile, Station, measure_five_point
from wheelplane.measurement import Evidence, align
from wheelplane.report.dcc.conformity import overall
from wheelplane.report.json.calibration import calibration_tree
from wheelplane.report.json.measurement import doubts_tree
from wheelplane.report.text.calibration import calibration_text

EXACT = changed(TOE, repeatability=1e-9, resolution=1e-9, mpe=None)


def run(bay, tested, rng=None, noisy=True, **changes):
    rule = changes.pop("rule", None)
    item = item_of(tested)
    item = item.model_copy(update={"decision": rule}) if rule else item
    return calibrate([bay.reference(noisy=noisy)], item, bay.readings(tested, rng))


def errors(found: Calibration) -> dict[str, float]:
    return {p.point: float(minutes(p.error.value)) for p in found.results[0].points}


def test_an_exact_machine_and_reference_give_the_planted_errors_exactly():
    bay = Bay(seed=1)
    found = run(bay, machine(toe=EXACT), noisy=False)
    (result,) = found.results
    for wheel in bay.truth["wheels"]:
        true = 1.0 + 0.02 * 60.0 * wheel["toe_deg"]
        assert errors(found)[wheel["name"]] == pytest.approx(true, abs=1e-7)
    assert minutes(result.characteristic.zero.value) == pytest.approx(1.0, abs=1e-7)
    assert result.characteristic.sensitivity.value == pytest.approx(1.02, abs=1e-9)
    assert minutes(result.hysteresis.value) == pytest.approx(1.0, abs=1e-7)
    assert abs(minutes(result.characteristic.linearity.value)) < 1e-6
    assert found.warnings == ()


def test_errors_turn_with_the_declared_sign():
    plain, turned = (
        run(Bay(seed=1), machine(toe=changed(EXACT, positive=sense, zero=zero)), noisy=False)
        for sense, zero in (("toe-in", 1.0), ("toe-out", -1.0))
    )
    for one, other in zip(plain.results[0].points, turned.results[0].points, strict=True):
        assert other.error.value == pytest.approx(-one.error.value, abs=1e-9)
        assert other.error.u == pytest.approx(one.error.u, rel=1e-6)


def test_the_budget_adds_up_and_the_order_of_readings_does_not_matter():
    bay = Bay(seed=2)
    tested = machine(protocol=Protocol(series=2), camber=CAMBER)
    reference, readings = bay.reference(), bay.readings(tested)
    found = calibrate([reference], item_of(tested), readings)
    for result in found.results:
        assert len(result.points) == 12
        for point in result.points:
            assert math.fsum(c.u**2 for c in point.budget) == pytest.approx(point.error.u**2)
            assert point.reading - point.reference.value == pytest.approx(point.error.value)
            assert point.reference.u < point.error.u
            assert point.n == 12
    rows = list(readings.rows)
    np.random.default_rng(0).shuffle(rows)
    mixed = calibrate([reference], item_of(tested), replace(readings, rows=tuple(rows)))
    by_point = {p.point: p for p in found.results[0].points}
    for point in mixed.results[0].points:
        assert point.error.value == pytest.approx(by_point[point.point].error.value, abs=1e-15)
        assert point.error.u == pytest.approx(by_point[point.point].error.u)
        assert point.error.dof == pytest.approx(by_point[point.point].error.dof)


@pytest.mark.parametrize("directions", [False, True])
def test_means_of_the_directions_are_those_of_error_and_hysteresis(directions):
    """Also where series were read unlike numbers of times, which makes them count no more."""
    bay = Bay(seed=2)
    toe = changed(TOE, reproducibility=2.0)
    tested = machine(toe=toe, protocol=Protocol(series=2, repeats=4, directions=directions))
    readings = bay.readings(tested)
    few = ("1", "up" if directions else "")
    rows = [o for o in readings.rows if o.repeat <= 2 or (o.series, o.direction) != few]
    (result,) = calibrate([bay.reference()], item_of(tested), replace(readings, rows=rows)).results
    for point in result.points:
        means = [one.mean for one in point.directions]
        assert sum(one.n for one in point.directions) == point.n
        assert np.mean(means) == pytest.approx(point.reading, abs=1e-12)
    if directions:
        apart = [p.directions[0].mean - p.directions[1].mean for p in result.points]
        assert np.mean(apart) == pytest.approx(result.hysteresis.value, abs=1e-12)


def test_en_compares_the_error_with_both_expanded_uncertainties():
    bay, tested = Bay(seed=3), machine()
    item = item_of(tested)
    toe = item.item.toe.model_copy(update={"uncertainty": "2'"})
    item = item.model_copy(update={"item": item.item.model_copy(update={"toe": toe})})
    found = calibrate([bay.reference()], item, bay.readings(tested))
    for point in found.results[0].points:
        own = math.radians(2.0 / 60.0)
        known = abs(point.error.value) / math.hypot(point.error.expanded, own)
        assert point.en == pytest.approx(known)
    assert run(bay, tested).results[0].points[0].en is None


@pytest.mark.parametrize(("scatter", "u"), [(0.3, 0.0), (0.0, 0.03 / math.sqrt(12.0))])
def test_resolution_is_in_the_budget_where_no_scatter_spreads_the_readings(scatter, u):
    toe = changed(TOE, resolution=0.03, repeatability=scatter, hysteresis=0.9)
    for point in run(Bay(seed=4), machine(toe=toe)).results[0].points:
        budget = {c.name: c.u for c in point.budget if c.origin == "readings"}
        assert minutes(budget.get("resolution", 0.0)) == pytest.approx(u, rel=1e-6)


def test_several_references_keep_what_is_stated_and_average_nothing_of_it():
    """Type B components are common to the series: U of the mean has them in full."""
    bay = Bay(seed=5)
    tested = machine(protocol=Protocol(series=3), toe=changed(TOE, repeatability=0.01))
    item, readings = item_of(tested), bay.readings(tested)
    exact = bay.reference("1", noisy=False)
    same = [replace(exact, series=str(k)) for k in (1, 2, 3)]
    several = [bay.reference(str(k)) for k in (1, 2, 3)]
    alone, alike, found = (
        calibrate(known, item, readings).results[0].points[0]
        for known in ([replace(exact, series=None)], same, several)
    )
    assert alike.reference.u == pytest.approx(alone.reference.u, rel=1e-6)
    assert found.reference.u == pytest.approx(alone.reference.u, rel=1e-3)
    assert found.error.u > alone.error.u  # the references scatter from series to series as well


def named(reference, component):
    """The same reference, the errors of its targets by another name."""
    wheels = reference.measurement.wheels
    observations = [
        replace(
            wheel.observation,
            evidence=Evidence(
                replace(
                    wheel.observation.fitted,
                    components=tuple(
                        replace(one, name=component) for one in wheel.observation.fitted.components
                    ),
                )
            ),
        )
        for wheel in wheels
    ]
    return Reference(align(observations, ORIGIN), reference.series)


def test_noise_of_a_scan_averages_over_several_references_and_counts_once():
    """As it scatters from one to the next, it is in the scatter between the series already."""
    bay = Bay(seed=5)
    tested = machine(protocol=Protocol(series=6), toe=changed(TOE, repeatability=0.01))
    item, readings = item_of(tested), bay.readings(tested)
    several = [named(bay.reference(str(k)), "plane noise") for k in range(1, 7)]
    alone, found = (
        calibrate(known, item, readings).results[0].points
        for known in ([replace(several[0], series=None)], several)
    )
    for one, mean in zip(alone, found, strict=True):
        assert mean.reference.u == pytest.approx(one.reference.u / math.sqrt(6.0), rel=1e-3)
        assert {line.origin for line in mean.budget} == {"readings"}
    ratios = [mean.error.u / one.error.u for one, mean in zip(alone, found, strict=True)]
    assert np.mean(ratios) == pytest.approx(1.0 / math.sqrt(6.0), rel=0.35)


def test_references_and_an_item_of_unlike_verticals_are_refused():
    bay, tested = Bay(seed=2), machine(toe=None, camber=CAMBER, protocol=Protocol(series=2))
    item, readings = item_of(tested), bay.readings(tested)
    wheels, gravity = bay.reference("1"), replace(tilted(bay.reference()), series="2")
    with pytest.raises(FaultyTableError, match=r"unlike verticals \(wheels, gravity\)"):
        calibrate([wheels, gravity], item, readings)
    for stated, fault in (("gravity", ""), ("floor", "counts it from floor, the reference is")):
        camber = item.item.camber.model_copy(update={"vertical": stated})
        own = item.model_copy(update={"item": item.item.model_copy(update={"camber": camber})})
        of_all = [replace(gravity, series=None)]
        if fault:
            with pytest.raises(FaultyTableError, match=fault):
                calibrate(of_all, own, readings)
            continue
        found = calibrate(of_all, own, readings)
        assert found.results[0].vertical == "gravity"
        assert "measured from gravity" in calibration_text(found)


def test_a_reading_far_from_the_others_is_named_and_spoils_no_other_point():
    bay, tested = Bay(seed=9), machine()
    sound = bay.readings(tested)
    (before,) = calibrate([bay.reference()], item_of(tested), sound).results
    at = next(k for k, one in enumerate(sound.rows) if one.point == "RL")
    wrong = replace(sound.rows[at], value=sound.rows[at].value + math.radians(14.0 / 60.0))
    spoilt = replace(sound, rows=(*sound.rows[:at], wrong, *sound.rows[at + 1 :]))
    found = calibrate([bay.reference()], item_of(tested), spoilt)
    (doubt,) = found.doubts
    assert f"row {wrong.row}, " in doubt
    assert "the readings at RL scatter by" in doubt
    assert found.decision == "undecided"
    for one, other in zip(before.points, found.results[0].points, strict=True):
        own = [line.u for line in other.budget if line.name == "repeatability"]
        if other.point == "RL":
            assert own[0] == pytest.approx(other.repeatability / math.sqrt(other.n), rel=1e-6)
            assert other.error.expanded > 3.0 * one.error.expanded
        else:
            assert other.error.expanded == pytest.approx(one.error.expanded, rel=0.05)


@pytest.mark.parametrize(
    ("unit", "step"), [("min", 1.0), ("min", 0.1), ("min", 0.5), ("deg", 0.01), ("dms", 20.0)]
)
def test_steps_of_the_readings_count_where_the_item_file_states_finer_ones(unit, step):
    """Readings of whole minutes without scatter are not known to a thousandth of one."""
    bay = Bay(seed=12)
    tested = machine(toe=changed(TOE, resolution=0.001, repeatability=0.02, hysteresis=0.0))
    sound = bay.readings(tested)
    scale = math.radians(1.0) / {"min": 60.0, "deg": 1.0, "dms": 3600.0}[unit]
    rows = tuple(
        replace(one, value=round(one.value / scale / step) * step * scale, unit=unit)
        for one in sound.rows
    )
    (result,) = calibrate([bay.reference()], item_of(tested), replace(sound, rows=rows)).results
    assert result.coarser == pytest.approx(step * scale)
    for point in result.points:
        assert point.resolution == pytest.approx(step * scale)
    if step == 1.0:
        shares = [line.u for line in result.points[0].budget if line.name == "resolution"]
        assert shares[0] == pytest.approx(scale / math.sqrt(12.0), rel=0.2)
    (plain,) = calibrate([bay.reference()], item_of(tested), sound).results
    assert plain.coarser is None


RIM_M = 16 * 0.0254
WRITTEN = {  # angle to the number of a unit, and back
    "mm": (lambda a: 1e3 * RIM_M * math.sin(a), lambda x: math.asin(x / 1e3 / RIM_M)),
    "mm/m": (lambda a: 1e3 * math.tan(a), lambda x: math.atan(x / 1e3)),
    "dms": (lambda a: math.degrees(a) * 3600.0, lambda x: math.radians(x / 3600.0)),
    "deg": (math.degrees, math.radians),
}


@pytest.mark.parametrize(
    ("unit", "step", "declared"),
    [("mm", 0.2, "0.01 mm"), ("mm/m", 0.5, "0.01 mm/m"), ("dms", 60.0, '1"'), ("dms", 300.0, '1"'),
     ("dms", 36.0, '1"'), ("deg", 0.05, "0.001°")],
)  # fmt: skip
def test_steps_are_found_in_whatever_unit_the_machine_indicates(unit, step, declared):
    """Whole minutes are 60 seconds, and steps at a rim are equal in mm, not as angles."""
    bay = Bay(seed=12)
    tested = machine(toe=changed(TOE, resolution=0.001, repeatability=0.02, hysteresis=0.0))
    item, sound = item_of(tested), bay.readings(tested)
    toe = item.item.toe.model_copy(update={"resolution": declared})
    named = item.item.model_copy(update={"rim": "16in", "toe": toe})
    item = item.model_copy(update={"item": named})
    write, read = WRITTEN[unit]
    rows = tuple(
        replace(one, value=read(round(write(one.value) / step) * step), unit=unit)
        for one in sound.rows
    )
    (result,) = calibrate([bay.reference()], item, replace(sound, rows=rows)).results
    assert result.coarser == pytest.approx(read(step), rel=1e-5)
    shares = [line.u for line in result.points[0].budget if line.name == "resolution"]
    assert shares[0] == pytest.approx(read(step) / math.sqrt(12.0), rel=0.25)


@pytest.mark.parametrize(
    ("unit", "step", "declared", "finer"),
    [("deg", 0.01, "1°", 0.01), ("deg", 0.01, "0.02°", 0.01), ("deg", 0.25, "0.25°", None),
     ("min", 0.3, "0.005°", None), ("mm", 0.05, "1 mm", 0.05)],
)  # fmt: skip
def test_readings_finer_than_the_resolution_are_named_and_the_resolution_counts(
    unit, step, declared, finer
):
    """A resolution of 1 degree, and readings of 0.23: one of both is wrong; 0.25 is of steps."""
    bay, tested = Bay(seed=12), machine(toe=changed(TOE, resolution=0.001))
    item, sound = item_of(tested), bay.readings(tested)
    toe = item.item.toe.model_copy(update={"resolution": declared})
    named = item.item.model_copy(update={"rim": "16in", "toe": toe})
    write, read = (WRITTEN | {"min": (minutes, lambda x: math.radians(x / 60.0))})[unit]
    rows = tuple(
        replace(one, value=read(round(float(write(one.value)) / step) * step), unit=unit)
        for one in sound.rows
    )
    item = item.model_copy(update={"item": named})
    (result,) = calibrate([bay.reference()], item, replace(sound, rows=rows)).results
    assert result.finer == (None if finer is None else pytest.approx(read(finer), rel=1e-5))
    assert result.coarser is None
    assert result.points[0].resolution == pytest.approx(named.resolution("toe"))


def test_the_same_value_again_and_again_shows_no_step():
    """A steady machine at one point reads 0.10 ten times, and 0.10 is no multiple of 0.1 alone."""
    bay, tested = Bay(seed=12), machine(toe=None, thrust_angle=changed(TOE, positive="right"))
    sound = bay.readings(tested)
    value = math.radians(10.0 / 60.0)
    rows = tuple(replace(one, value=value) for one in sound.rows)
    (result,) = calibrate([bay.reference()], item_of(tested), replace(sound, rows=rows)).results
    assert result.coarser is None


@pytest.mark.parametrize(
    "noise", ["plane noise", "surface noise", "range noise", "angle noise", "aiming"]
)
def test_noise_of_a_survey_is_drawn_anew_in_each_reference(noise):
    bay, tested = Bay(seed=5), machine(protocol=Protocol(series=3))
    several = [named(bay.reference(str(k)), noise) for k in range(1, 4)]
    readings = bay.readings(tested)
    (result,) = calibrate(several, item_of(tested), readings).results
    assert {line.origin for line in result.points[0].budget} == {"readings"}
    common = [named(one, "range bias") for one in several]
    (result,) = calibrate(common, item_of(tested), readings).results
    assert {line.origin for line in result.points[0].budget} == {"readings", "reference"}


def test_errors_against_several_surveys_by_a_total_station_are_as_large_as_stated():
    """Each with noise and aiming of its own: u is neither twice the error nor half of it."""
    toe = changed(TOE, zero=0.0, gain=0.0, hysteresis=0.0, repeatability=0.05, resolution=0.01)
    tested, squares = machine(toe=toe, protocol=Protocol(series=4)), []
    for seed in range(16):
        bay = Bay(seed=seed, trials=0)
        readings = bay.readings(tested)
        surveys = [bay.car.blocks() for _ in range(4)]
        references = [
            Reference(
                measure_five_point(
                    FivePointFile(blocks, "f", "", ()), Station(station_of(TM30), place)
                ),
                str(k),
            )
            for k, (blocks, place) in enumerate(surveys, 1)
        ]
        (result,) = calibrate(references, item_of(tested), readings).results
        squares += [(p.error.u**2, p.error.value**2) for p in result.points]
    of_u, of_error = np.mean(squares, axis=0)
    assert 0.4 < of_u / of_error < 2.5


@pytest.mark.parametrize(("operators", "series"), [((), 3), (("A", "B", "C"), 2)])
def test_errors_against_several_references_are_covered(operators, series):
    """Operators of one series share its scan, which the scatter between them does not show."""
    ratios = []
    protocol = Protocol(operators=operators, series=series)
    toe = changed(TOE, zero=0.0, gain=0.0, hysteresis=0.0, repeatability=0.05, resolution=0.01)
    for seed in range(12):
        bay, tested = Bay(seed=seed, trials=0), machine(toe=toe, protocol=protocol)
        several = [named(bay.reference(str(k)), "plane noise") for k in range(1, series + 1)]
        (result,) = calibrate(several, item_of(tested), bay.readings(tested)).results
        ratios += [point.error.value / point.error.expanded for point in result.points]
    assert np.mean(np.abs(ratios) <= 1.0) > 0.85


def test_single_readings_in_several_series_have_a_hysteresis_and_notes_with_numbers():
    bay, tested = Bay(seed=2), machine(protocol=Protocol(series=3, repeats=1))
    sound = bay.readings(tested)
    (result,) = calibrate([bay.reference()], item_of(tested), sound).results
    assert 0.0 < result.hysteresis.u < result.hysteresis.expanded < math.inf
    at = next(k for k, one in enumerate(sound.rows) if one.point == "RL")
    wrong = replace(sound.rows[at], value=sound.rows[at].value + math.radians(1.0))
    spoilt = replace(sound, rows=(*sound.rows[:at], wrong, *sound.rows[at + 1 :]))
    (doubt,) = calibrate([bay.reference()], item_of(tested), spoilt).doubts
    assert "the readings at RL scatter by" in doubt
    assert "nan" not in doubt


def test_hysteresis_is_no_repeatability_of_a_gauge():
    """The study is the same whatever the machine's hysteresis."""
    protocol = Protocol(operators=("A", "B", "C"), directions=True)
    tables = [changed(TOE, resolution=1e-9, hysteresis=h) for h in (0.0, 3.0)]
    studies = [
        run(Bay(seed=11), machine(toe=toe, protocol=protocol)).results[0].gauge_rr for toe in tables
    ]
    for part in ("ev", "av", "interaction", "pv"):
        assert getattr(studies[0], part) == pytest.approx(getattr(studies[1], part), rel=1e-6)
    rows = {row.source: row for row in studies[0].rows}
    readings, points = rows["total"].dof + 1 + 12, 12
    assert rows["equipment"].dof == readings - points * 3 - points


def test_a_series_shift_is_reproducibility_and_does_not_average_out_over_points():
    bay = Bay(seed=6)
    toe = changed(TOE, reproducibility=2.0, repeatability=0.1)
    found = run(bay, machine(toe=toe, protocol=Protocol(series=6)))
    (result,) = found.results
    assert minutes(result.reproducibility) == pytest.approx(2.0, rel=4.0 / math.sqrt(10.0))
    point = result.points[0]
    shares = {c.name: c for c in point.budget if c.origin == "readings"}
    assert shares["reproducibility"].dof == 5.0
    assert result.characteristic.zero.u == pytest.approx(shares["reproducibility"].u, rel=0.2)
    assert result.gauge_rr is not None
    assert result.gauge_rr.appraisers == ("1", "2", "3", "4", "5", "6")


def test_operators_are_appraisers_where_there_are_several():
    tested = machine(protocol=Protocol(operators=("Ana", "Rui"), series=2))
    (result,) = run(Bay(seed=7), tested).results
    assert result.gauge_rr.appraisers == ("Ana", "Rui")
    assert result.levels == ("series 1, Ana", "series 1, Rui", "series 2, Ana", "series 2, Rui")
    assert run(Bay(seed=7), machine()).results[0].no_gauge_rr


@pytest.mark.parametrize("short", [0.999, 0.99, 0.9, 0.4])
def test_a_ratio_below_the_agreed_one_is_written_below_it(short):
    bay, tested = Bay(seed=3), machine()
    readings, reference = bay.readings(tested), bay.reference()
    shared = DecisionRule(rule="shared", ratio=1.0)
    item = item_of(tested).model_copy(update={"decision": shared})
    point = calibrate([reference], item, readings).results[0].points[0]
    ratio = point.mpe / point.error.expanded / short
    item = item.model_copy(update={"decision": DecisionRule(rule="shared", ratio=ratio)})
    verdict = calibrate([reference], item, readings).results[0].points[0].verdict
    assert verdict.decision == "undecided"
    parts = verdict.reason.parts
    assert float(parts["value"]) < float(parts["ratio"])
    assert float(parts["value"]) == pytest.approx(short * ratio, abs=0.01)


def test_as_left_less_as_found_leaves_the_reference_out():
    bay, tested = Bay(seed=8), machine()
    better = machine(toe=changed(TOE, zero=0.0, gain=0.0))
    found = bay.readings(tested)
    left = tuple(as_readings(bay.truth, better, bay.car.rng, "as left"))
    both = replace(found, rows=(*found.rows, *left))
    done = calibrate([bay.reference()], item_of(tested), both)
    assert [one.state for one in done.results] == ["as found", "as left"]
    assert [one.state for one in done.final] == ["as left"]
    assert adjustments(done.results) == done.adjustments
    for one in done.adjustments:
        assert one.change.value == pytest.approx(one.left.value - one.found.value)
        assert one.change.u < one.found.u
        own = 0.3 * math.sqrt(2.0 / 6.0)
        assert minutes(one.change.u) == pytest.approx(own, rel=0.3)


def test_the_change_against_two_references_has_the_uncertainty_of_both():
    """Nothing was adjusted: the change is that of readings and references, and as u states it."""
    ratios, tested = [], machine(protocol=Protocol(series=1))
    for seed in range(20):
        bay = Bay(seed=100 + seed, trials=0)
        left = bay.readings(tested, state="as left").rows
        left = tuple(replace(one, series="2", row=one.row + 99) for one in left)
        rows = (*bay.readings(tested).rows, *left)
        unlike = [bay.reference("1"), bay.reference("2")]
        done = calibrate(unlike, item_of(tested), Readings("r", "", rows))
        ratios += [one.change.value / one.change.u for one in done.adjustments]
        same = [replace(unlike[0], series=None)]
        alone = calibrate(same, item_of(tested), Readings("r", "", rows))
        for one, other in zip(alone.adjustments, done.adjustments, strict=True):
            own = 0.3 * math.sqrt(2.0 / 6.0)
            assert minutes(one.change.u) == pytest.approx(own, rel=0.5)
            assert other.change.u == pytest.approx(
                math.hypot(one.change.u, *(p.reference.u for r in done.results for p in r.points
                                           if p.point == other.point)), rel=0.01
            )  # fmt: skip
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("failed", "again", "decision"),
    [
        (True, False, "not conform"),
        (True, True, "conform"),
        (False, False, "undecided"),
        (False, True, "conform"),
    ],
)
def test_a_point_that_was_not_read_again_keeps_its_verdict_as_found(failed, again, decision):
    """Nothing shows that it conforms as left; what was adjusted elsewhere says nothing of it."""
    bay, tested = Bay(seed=5, trials=2), machine(toe=changed(TOE, zero=0.0, gain=0.0))
    rows = bay.readings(tested).rows
    left = [replace(one, state="as left", row=one.row + 99) for one in rows]
    off = math.radians(0.5 * failed)
    rows = [replace(one, value=one.value + off * (one.point == "FL")) for one in rows]
    rows += [one for one in left if one.point in ("RR", "RL") or again]
    done = calibrate([bay.reference(noisy=False)], item_of(tested), Readings("r", "", tuple(rows)))
    assert done.decision_as_found == ("not conform" if failed else "conform")
    assert done.decision == decision
    names = () if again else ("FR", "FL", "1", "2")
    assert tuple(one.point for one in done.not_read_again) == names
    assert [one.unread for one in done.results] == [(), names]
    assert calibration_tree(done)["quantities"][1]["unread"] == list(names)
    assert ("Not read again as left" in calibration_text(done)) == (not again)
    row = calibration_row(calibration_tree(done))
    assert row.decision == decision
    assert (row.worst > 1.0) == (decision == "not conform")
    assert overall(done) == {"conform": "pass", "undecided": "conditionalPass"}.get(
        decision, "fail"
    )


@pytest.mark.parametrize(("zero", "decision"), [(0.0, "conform"), (60.0, "not conform")])
def test_the_verdict_as_found_is_of_all_that_was_read_as_found(zero, decision):
    """A camber that was not adjusted after the toe does not conform in either state."""
    bay, tested = Bay(seed=5, trials=2), machine(camber=changed(CAMBER, zero=zero))
    rows = bay.readings(tested).rows
    left = [replace(one, state="as left") for one in rows if one.quantity == "toe"]
    both = Readings("r", "", (*rows, *left))
    done = calibrate([bay.reference(noisy=False)], item_of(tested), both)
    toes, toes_left, cambers = done.results
    assert (toes.decision, toes_left.decision) == ("conform", "conform")
    assert cambers.decision == done.decision_as_found == done.decision == decision
    assert calibration_tree(done)["decision_as_found"] == decision
    before = calibrate([bay.reference(noisy=False)], item_of(tested), Readings("r", "", rows))
    assert before.decision_as_found is None
    assert before.decision == decision


def test_an_axle_that_was_read_as_found_alone_is_named():
    bay, tested = Bay(seed=5), machine(toe=None, total_toe=changed(TOE, axis=None, zero=0.0))
    rows = bay.readings(tested).rows
    left = [replace(one, state="as left") for one in rows if one.point == "front"]
    done = calibrate([bay.reference()], item_of(tested), Readings("r", "", (*rows, *left)))
    assert [one.unread for one in done.results] == [(), ("rear",)]
    assert done.decision != "conform"


@pytest.mark.parametrize(
    ("error", "rule", "decision"),
    [
        (0.0, DecisionRule(rule="guarded"), "conform"),
        (5.9, DecisionRule(rule="guarded"), "undecided"),
        (5.9, DecisionRule(rule="simple"), "conform"),
        (6.1, DecisionRule(rule="simple"), "not conform"),
        (5.9, DecisionRule(rule="shared", ratio=3.0), "conform"),
        (0.0, DecisionRule(rule="shared", ratio=100.0), "undecided"),
        (9.0, DecisionRule(rule="guarded"), "not conform"),
    ],
)
def test_each_rule_decides_as_jcgm_106_says(error, rule, decision):
    toe = changed(TOE, zero=error, gain=0.0, repeatability=0.01, resolution=0.001, hysteresis=0.0)
    found = run(Bay(seed=9), machine(toe=toe), noisy=False, rule=rule)
    assert {p.verdict.decision for p in found.results[0].points} == {decision}
    assert found.decision == worst(found.results[0].points) == decision
    for point in found.results[0].points:
        if decision == "conform":
            assert point.verdict.risk == pytest.approx(1.0 - point.verdict.probability)


def test_what_is_missing_is_named_all_at_once():
    bay, tested = Bay(seed=10), machine(protocol=Protocol(series=2), camber=CAMBER)
    readings = bay.readings(tested)
    gone = [r for r in readings.rows if not (r.point == "RR" and r.series == "2")]
    single = [r for r in gone if r.quantity == "toe" or (r.series, r.repeat) == ("1", 1)]
    rows = [r for r in single if r.quantity == "toe" or r.direction == "up"]
    with pytest.raises(FaultyTableError) as error:
        calibrate([bay.reference()], item_of(tested), replace(readings, rows=tuple(rows)))
    faults = error.value.faults
    assert sum("toe, as found: point RR has no reading in series 2" in f for f in faults) == 2
    assert any("camber, as found: no reading is repeated" in fault for fault in faults)


def test_two_points_show_a_mean_error_and_no_sensitivity():
    bay, tested = Bay(seed=11), machine(toe=EXACT)
    readings = bay.readings(tested)
    rows = tuple(r for r in readings.rows if r.point in ("FR", "FL"))
    reference = bay.reference(noisy=False)
    found = calibrate([reference], item_of(tested), replace(readings, rows=rows))
    line = found.results[0].characteristic
    assert line.sensitivity is None
    assert line.zero.value == pytest.approx(
        np.mean([p.error.value for p in found.results[0].points])
    )


@pytest.mark.parametrize("rule", ["guarded", "simple", "shared"])
def test_no_verdict_rests_on_a_reference_in_doubt(rule):
    """A vehicle in doubt leaves every point undecided, a trial in doubt that trial alone."""
    bay = Bay(seed=1)
    tested = machine(toe=changed(TOE, mpe=60.0))
    item = item_of(tested)
    item = item.model_copy(update={"decision": DecisionRule(rule=rule)})
    reference, readings = bay.reference(), bay.readings(tested)
    sound = calibrate([reference], item, readings)
    assert (sound.decision, sound.doubts) == ("conform", ())
    noted = replace(sound, notes=("Run-out is not in the uncertainty.",))
    assert noted.notes[0] in calibration_text(noted)
    of_trial, of_all = Doubt("{trial} is a copy", trial="2"), Doubt("it is mirrored")
    for doubt, subjects in (
        (of_trial, {"2"}),
        (of_all, {p.point for p in sound.results[0].points}),
    ):
        measurement = replace(reference.measurement, notes=(doubt,))
        found = calibrate([replace(reference, measurement=measurement)], item, readings)
        assert (found.decision, found.doubts) == ("undecided", (doubt,))
        verdicts = {point.point: point.verdict for point in found.results[0].points}
        assert {n for n, one in verdicts.items() if one.decision == "undecided"} == subjects
        assert all(verdicts[name].reason == doubt for name in subjects)
        assert " ".join(calibration_text(found).split()).count(str(doubt)) == 1
        assert doubts_tree(found.doubts) == calibration_tree(found)["doubts"]


def test_a_pair_is_in_doubt_by_either_of_its_targets():
    reference = Bay(seed=1).reference()
    doubt = Doubt("{trial} is a copy", trial="2")
    doubted = replace(reference, measurement=replace(reference.measurement, notes=(doubt, "other")))
    assert doubted.doubts_about("1+2") == doubted.doubts_about("2+3") == (doubt,)
    assert doubted.doubts_about("1+3") == doubted.doubts_about("rear") == ()
