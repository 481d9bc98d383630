"""Tests of the notes on copying mistakes: slips are named by point, honest readings are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine, minutes
from wheelplane.calibration import CertificateFile, Readings, issue
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.reference import Reference
from wheelplane.calibration.slips import EXCHANGED, OTHER_SIGN_AT, copying_doubts
from wheelplane.errors import Doubt
from wheelplane.measurement import Estimate
from wheelplane.report.json.calibration import calibration_tree
from wheelplane.report.text.calibration import calibration_text
from wheelplane_synth.parameters.machine import Protocol

MINUTE = np.radians(1.0 / 60.0)
U = 0.5  # minutes
HONEST = 150  # machines; two quantities each


def doubted(references, errors, kind="toe", u=U):
    """The points in doubt and their templates; minutes."""
    names = [str(k) for k in range(len(references))]
    known = [Estimate(error * MINUTE, u * MINUTE, np.inf) for error in errors]
    found = copying_doubts(names, known, np.asarray(references) * MINUTE, kind, "as found")
    return {int(name): doubt.template for name, doubt in found.items()}


def bay_of(seed, trials=8):
    """A bay, its machine and the readings."""
    bay = Bay(seed=seed, trials=trials)
    tested = machine(toe=changed(TOE, zero=3.0, gain=-0.05), camber=CAMBER)
    return bay.reference(), item_of(tested), bay.readings(tested)


def copied(readings, row):
    return Readings(readings.source, readings.sha256, tuple(map(row, readings.rows)))


@pytest.mark.parametrize("seed", range(6))
def test_a_point_whose_readings_lost_their_sign_is_in_doubt_alone(seed):
    reference, item, sound = bay_of(seed)
    assert calibrate([reference], item, sound).doubts == ()
    toe = {n: minutes(reference.value("toe", n, item.item).value) for n in reference.wheels}
    point = max(toe, key=lambda name: abs(toe[name]))
    wrong = copied(
        sound,
        lambda one: (
            replace(one, value=-one.value) if (one.point, one.quantity) == (point, "toe") else one
        ),
    )
    found = calibrate([reference], item, wrong)
    (doubt,) = found.doubts
    assert doubt.template == OTHER_SIGN_AT
    assert f"toe, as found: the readings at {point} lie" in doubt
    verdicts = {(p.quantity, p.point): p.verdict.decision for r in found.results for p in r.points}
    assert verdicts["toe", point] == "undecided"
    assert "not conform" not in verdicts.values()
    assert found.decision == "undecided"
    assert issue(found, CertificateFile()).doubted


@pytest.mark.parametrize("slip", ["sign", "scatter"])
@pytest.mark.parametrize("seed", range(2))
def test_a_point_in_doubt_moves_neither_line_nor_hysteresis(seed, slip):
    """They are those of the same readings without that point, and name it."""
    reference, item, sound = bay_of(seed)
    toe = {n: minutes(reference.value("toe", n, item.item).value) for n in reference.wheels}
    point = max(toe, key=lambda name: abs(toe[name]))

    def spoilt(one):
        if (one.point, one.quantity) != (point, "toe"):
            return one
        off = 40.0 * MINUTE if one.repeat == 1 and one.direction == "up" else 0.0
        return replace(one, value=-one.value if slip == "sign" else one.value + off)

    done = calibrate([reference], item, copied(sound, spoilt))
    found, rows = done.results[0], tuple(one for one in sound.rows if one.point != point)
    (known, _) = calibrate([reference], item, Readings("r", "", rows)).results
    assert found.left_out == (point,)
    for name in ("zero", "sensitivity"):
        one, other = (getattr(each.characteristic, name) for each in (found, known))
        assert one.value == pytest.approx(other.value, abs=0.02 * other.u)
        assert one.expanded == pytest.approx(other.expanded, rel=0.1)
    assert found.hysteresis.value == pytest.approx(known.hysteresis.value, abs=1e-12)
    assert found.hysteresis.expanded == pytest.approx(known.hysteresis.expanded, rel=0.1)
    assert found.characteristic.worst_point != point
    assert done.results[1].left_out == ()
    assert calibration_tree(done)["quantities"][0]["left_out"] == [point]
    text = calibration_text(done)
    assert (
        f"left out of zero error, sensitivity, linearity, hysteresis and gauge R&R: {point}\n"
        in text
    )


def test_a_point_in_doubt_is_no_part_of_the_gauge_study():
    """Its equipment variation is no more than the repeatability, which leaves it out."""
    bay, protocol = Bay(seed=0), Protocol(operators=("Ana", "Rui"))
    tested = machine(protocol=protocol)
    reference, sound = bay.reference(), bay.readings(tested)
    wrong = copied(
        sound,
        lambda one: replace(one, value=one.value + 30.0 * MINUTE * (one.row == sound.rows[0].row)),
    )
    found = calibrate([reference], item_of(tested), wrong).results[0]
    left = [one for one in sound.rows if one.point != sound.rows[0].point]
    known = calibrate([reference], item_of(tested), Readings("r", "", tuple(left))).results[0]
    assert found.left_out == (sound.rows[0].point,)
    assert found.gauge_rr == known.gauge_rr
    assert found.gauge_rr.ev == pytest.approx(found.repeatability, rel=0.2)


def test_the_line_is_of_all_points_where_all_are_in_doubt():
    reference, item, sound = bay_of(0)
    of_all = replace(reference.measurement, notes=(Doubt("The vehicle is upside down."),))
    found = calibrate([Reference(of_all)], item, sound).results[0]
    plain = calibrate([reference], item, sound).results[0]
    assert found.left_out == ()
    assert found.characteristic == plain.characteristic
    assert found.hysteresis == plain.hysteresis


@pytest.mark.parametrize("seed", range(6))
def test_two_points_whose_readings_were_exchanged_are_in_doubt_both(seed):
    reference, item, sound = bay_of(seed)
    camber = {n: minutes(reference.value("camber", n, item.item).value) for n in reference.wheels}
    low, high = min(camber, key=camber.get), max(camber, key=camber.get)
    other = {low: high, high: low}
    wrong = copied(sound, lambda one: replace(one, point=other.get(one.point, one.point)))
    found = calibrate([reference], item, wrong)
    notes = {doubt.parts["kind"]: doubt for doubt in found.doubts}
    assert notes["camber"].template == EXCHANGED
    assert {notes["camber"].parts["point"], notes["camber"].parts["other"]} == {low, high}
    cambers = next(result for result in found.results if result.quantity == "camber")
    undecided = {p.point for p in cambers.points if p.verdict.decision == "undecided"}
    assert undecided == {low, high}
    assert {p.point for p in cambers.points if p.doubts} == {low, high}


def test_an_exchange_of_opposite_angles_is_one_mistake_and_no_two():
    x = np.array([-50.0, -30.0, -10.0, 0.0, 12.0, 30.0, 55.0])
    e = np.array([0.3, 0.0, -0.2, 0.1, 0.0, 0.2, -0.1])
    assert doubted(x, e) == {}
    readings = (x + e)[[0, 5, 2, 3, 4, 1, 6]]
    assert doubted(x, readings - x) == {1: EXCHANGED, 5: EXCHANGED}
    lost = np.where(np.arange(7) == 5, -(x + e), x + e)
    assert doubted(x, lost - x) == {5: OTHER_SIGN_AT}
    assert doubted(x, lost - x, "track") == {}  # a length has no sign


def test_several_slips_are_named_each():
    rng = np.random.default_rng(1)
    x = np.linspace(-60.0, 61.0, 12)
    readings = 2.0 + 0.97 * x + U * rng.standard_normal(12)
    readings[[1, 7]] = readings[[7, 1]]
    readings[10] = -readings[10]
    found = doubted(x, readings - x)
    assert found == {1: EXCHANGED, 7: EXCHANGED, 10: OTHER_SIGN_AT}


def test_what_no_slip_explains_is_no_doubt():
    """A point that is off otherwise, one sign for all, a gain, an axis, and too few points."""
    x = np.array([-50.0, -30.0, -11.0, 2.0, 12.0, 33.0, 55.0])
    for error in (-100.0, -8.0, 8.0, 25.0, 100.0):
        e = np.where(np.arange(7) == 5, error, 0.0)
        assert doubted(x, e) == {}, error
    assert doubted(x, -2.0 * x) == {}
    assert doubted(x, 0.3 * x + 5.0) == {}
    assert doubted(x, np.array([7.0, -7.0] * 3 + [7.0])) == {}
    assert doubted(x[:2], [0.0, 60.0]) == {}
    small = np.where(np.abs(x) < 3.0, -2.0 * x, 0.0)
    assert doubted(x, small, u=1.0) == {}  # 4' off at u 1': four, and the line's
    assert doubted(x, small, u=0.1) == {3: OTHER_SIGN_AT}


@pytest.mark.slow
def test_honest_machines_are_not_doubted():
    """Zero errors, gains, hysteresis, scatter and steps of any size, from 4 to 16 points."""
    for seed in range(HONEST):
        rng = np.random.default_rng([7, seed])

        def drawn(table, rng=rng):
            return changed(
                table,
                zero=float(rng.uniform(-10, 10)),
                gain=float(rng.uniform(-0.1, 0.1)),
                hysteresis=float(rng.uniform(0, 2)),
                repeatability=float(rng.choice([0.0, 0.1, 0.3, 1.0, 3.0])),
                resolution=float(rng.choice([0.1, 1.0])),
            )

        plan = Protocol(series=int(rng.choice([1, 3])), repeats=2, directions=False)
        tested = machine(protocol=plan, toe=drawn(TOE), camber=drawn(CAMBER))
        bay = Bay(seed=seed, trials=int(rng.choice([0, 1, 2, 4, 8, 12])))
        found = calibrate([bay.reference()], item_of(tested), bay.readings(tested, rng))
        slips = [doubt for doubt in found.doubts if doubt.template in (EXCHANGED, OTHER_SIGN_AT)]
        assert slips == [], seed
