"""Tests of the warnings: a wrong sign or axis is named, a right one never."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.conventions import convention_warnings


def warnings(bay, **tables):
    tested = machine(**tables)
    reference, item, readings = bay.reference(), item_of(tested), bay.readings(tested)
    found = calibrate([reference], item, readings)
    known = convention_warnings(found.results, [reference], item.item, readings.rows)
    assert known == found.warnings
    return found.warnings


@pytest.mark.parametrize("seed", range(20))
def test_right_declarations_give_no_warning(seed):
    bay = Bay(seed=seed)
    toe = changed(TOE, zero=3.0, gain=-0.05, axis=("rear-axle", "thrust-line")[seed % 2])
    assert warnings(bay, toe=toe, camber=CAMBER) == ()


@pytest.mark.parametrize("seed", range(5))
def test_the_opposite_sign_is_named(seed):
    toe = changed(TOE, declared_positive="toe-out")
    (text,) = warnings(Bay(seed=seed), toe=toe)
    assert 'the opposite sign, positive = "toe-in",' in text
    camber = changed(CAMBER, declared_positive="top-in", zero=2.0)
    assert any('positive = "top-out"' in text for text in warnings(Bay(seed=seed), camber=camber))


def test_another_axis_is_named_where_the_axes_differ():
    named = 0
    for seed in range(10):
        bay = Bay(seed=seed)
        toe = changed(TOE, axis="thrust-line", declared_axis="rear-axle", zero=0.5)
        found = warnings(bay, toe=toe)
        apart = abs(60.0 * bay.truth["vehicle"]["thrust_angle_deg"])
        named += bool(found)
        assert bool(found) or apart < 3.0
        assert all("another axis" in text for text in found)
        assert apart < 5.0 or 'axis = "thrust-line"' in found[0]
    assert named > 5


@pytest.mark.parametrize("state", ["as found", "as left"])
def test_readings_are_compared_with_the_references_of_their_own_series(state):
    """Each series has positions of its own; a sign that is wrong in both is named of both."""
    tested = machine(toe=changed(TOE, declared_positive="toe-out"))
    bays = [Bay(seed=1), Bay(seed=2)]
    first, second = (bay.readings(tested) for bay in bays)
    later = [replace(one, series="2", state=state) for one in second.rows]
    references = [bay.reference(str(k)) for k, bay in enumerate(bays, 1)]
    both = replace(first, rows=(*first.rows, *later))
    found = calibrate(references, item_of(tested), both).warnings
    states = dict.fromkeys(["as found", state])
    assert [text.split(":")[0] for text in found] == [f"toe, {one}" for one in states]
    assert all('the opposite sign, positive = "toe-in",' in text for text in found)
    right = item_of(machine())
    assert calibrate(references, right, both).warnings == ()


def otherwise(readings, change):
    """The same readings, changed one by one."""
    return replace(readings, rows=tuple(change(one) for one in readings.rows))


def warned(bay, tested, change):
    found = calibrate([bay.reference()], item_of(tested), otherwise(bay.readings(tested), change))
    return found.warnings


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("side", ["L", "R"])
def test_a_sign_that_is_wrong_on_one_side_is_named_with_its_points(seed, side):
    bay = Bay(seed=seed)
    own = [w["name"] for w in bay.truth["wheels"] if w["wheel"][1] == side]
    (text,) = warned(
        bay, machine(), lambda one: replace(one, value=one.value * (1 - 2 * (one.point in own)))
    )
    assert f"the opposite sign at {', '.join(own)}, on one side of the vehicle" in text


@pytest.mark.parametrize(("unit", "meant", "factor"), [("min", "deg", 60), ("deg", "min", 1 / 60)])
def test_a_unit_that_was_taken_for_another_is_named(unit, meant, factor):
    """Degrees in a column of minutes: 0.25 of a degree is read as a quarter of a minute."""
    (text,) = warned(
        Bay(seed=3), machine(), lambda one: replace(one, value=one.value / factor, unit=unit)
    )
    assert f"another unit, {meant} instead of {unit}," in text


def test_columns_that_were_exchanged_are_named():
    kinds = {"toe": "camber", "camber": "toe"}
    found = warned(
        Bay(seed=4), machine(camber=CAMBER), lambda one: replace(one, quantity=kinds[one.quantity])
    )
    assert ["another quantity, camber," in found[0], "another quantity, toe," in found[1]] == [
        True,
        True,
    ]
