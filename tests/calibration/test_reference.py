"""Tests of reference values: those of the measurement, with its covariance, in the item's sense."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine, tilted
from wheelplane.calibration.reference import Reference, joint_effects, reference_of
from wheelplane.measurement import stated
from wheelplane.vehicle import AXES

BAY = Bay(seed=3, trials=4)
REFERENCE = BAY.reference()
PLAIN = item_of(machine(camber=CAMBER, total_toe=changed(TOE, axis=None))).item


def declared(**changes):
    item = item_of(machine(camber=CAMBER)).item
    return item.model_copy(
        update={kind: getattr(item, kind).model_copy(update=u) for kind, u in changes.items()}
    )


def test_every_quantity_is_that_of_the_measurement():
    for known in stated(REFERENCE.measurement):
        found = REFERENCE.by_name[known.name]
        assert found.value == pytest.approx(known.value, abs=1e-15)
        assert found.u == pytest.approx(known.u, rel=1e-9)
        assert found.dof == pytest.approx(known.dof)


def test_cambers_are_from_the_vertical_of_the_measurement():
    found = tilted(REFERENCE)
    for known in stated(found.measurement):
        assert found.by_name[known.name].value == pytest.approx(known.value, abs=1e-15)
        assert found.by_name[known.name].u == pytest.approx(known.u, rel=1e-9)
    for wheel, sense in (("RR", -1.0), ("RL", 1.0)):
        before, after = (one.by_name[f"{wheel}.camber"] for one in (REFERENCE, found))
        assert sense * np.degrees(before.value - after.value) == pytest.approx(0.5, abs=1e-3)
        assert 1e-4 < after.u < math.hypot(before.u, 1e-4)  # no lean of the frame is in it


def test_joint_effects_have_the_covariance_of_the_measurement():
    names = [f"{wheel}.toe" for wheel in REFERENCE.wheels]
    effects = joint_effects([REFERENCE.by_name[name] for name in names])
    covariance = sum(effect.factor @ effect.factor.T for effect in effects)
    known = REFERENCE.measurement.uncertainty.covariance[: len(names), : len(names)]
    np.testing.assert_allclose(covariance, known, rtol=1e-9)
    assert abs(known[0, 1]) > 1e-3 * known[0, 0]  # references of one frame are correlated


def test_toe_counts_from_the_declared_axis_and_in_the_declared_sense():
    thrust = REFERENCE.by_name["thrust_angle"].value
    plain = REFERENCE.value("toe", "1", PLAIN)
    for axis in AXES:
        found = REFERENCE.value("toe", "1", declared(toe={"axis": axis}))
        name = f"1.toe_to_{axis.replace('-', '_')}" if axis != "rear-axle" else "1.toe"
        assert found.value == REFERENCE.by_name[name].value
    side = 1.0 if REFERENCE.wheels["1"].wheel.endswith("L") else -1.0
    to_thrust = REFERENCE.value("toe", "1", declared(toe={"axis": "thrust-line"}))
    assert to_thrust.value == pytest.approx(plain.value - side * thrust)
    turned = REFERENCE.value("toe", "1", declared(toe={"positive": "toe-out"}))
    assert turned.value == -plain.value
    assert turned.u == plain.u
    iso = REFERENCE.value("camber", "1", declared(camber={"definition": "iso"}))
    camber = REFERENCE.value("camber", "1", PLAIN)
    assert math.tan(iso.value) == pytest.approx(math.tan(camber.value) / math.cos(plain.value))


def test_total_toe_of_two_targets_is_their_sum_and_no_frame_changes_it():
    pair, axle = (REFERENCE.value("total_toe", point, PLAIN) for point in ("FR+FL", "front"))
    assert pair.value == pytest.approx(axle.value, abs=1e-15)
    assert pair.u == pytest.approx(axle.u, rel=1e-9)
    one, other = (REFERENCE.value("toe", wheel, PLAIN) for wheel in ("FR", "FL"))
    assert pair.value == pytest.approx(one.value + other.value, abs=1e-15)
    coarse = Bay(seed=3, trials=4, centre=1e-3).reference()
    centres_matter = coarse.value("toe", "FL", PLAIN).u
    assert centres_matter > 5.0 * coarse.value("total_toe", "FR+FL", PLAIN).u


@pytest.mark.parametrize(
    ("kind", "point", "reason"),
    [
        ("toe", "9", "'9' is no wheel or trial of bay: known are RR, RL, FR, FL, 1, 2, 3, 4"),
        ("total_toe", "middle", "write front or rear, or two targets such as 1+2"),
        ("total_toe", "1+9", "'1+9' is no pair of targets"),
        ("total_toe", "FR+RR", "one left and one right target"),
    ],
)
def test_a_point_without_a_reference_value_says_why(kind, point, reason):
    assert reason in REFERENCE.value(kind, point, PLAIN)


@pytest.mark.parametrize(
    ("kind", "point", "table", "reason"),
    [
        ("thrust_angle", "vehicle", {"axis": "thrust-line"}, "zero by definition of its axis"),
        ("setback", "rear", {"axis": "rear-axle"}, "zero by definition of its axis"),
        ("caster", "FR", {}, "no steering sweep of FR, which caster needs"),
        ("toe_out_on_turns", "left", {"inner_deg": 20.0}, "no steering sweep of both front wheels"),
    ],
)
def test_what_the_capture_does_not_show_says_why(kind, point, table, reason):
    from wheelplane.calibration.forms.item import ItemQuantity

    item = PLAIN.model_copy(update={kind: ItemQuantity(resolution="1'", **table)})
    assert reason in REFERENCE.value(kind, point, item)
    assert point not in REFERENCE.points(kind, item)


def test_points_are_those_that_have_a_value():
    assert REFERENCE.points("toe", PLAIN) == ["RR", "RL", "FR", "FL", "1", "2", "3", "4"]
    assert REFERENCE.points("total_toe", PLAIN) == ["front", "rear"]


def test_the_reference_of_a_series_is_its_own_or_that_of_all():
    first, second = Reference(REFERENCE.measurement, "1"), Reference(REFERENCE.measurement, "2")
    assert reference_of([first, second], "2") is second
    assert reference_of([first, second], "3") is None
    assert reference_of([REFERENCE], "3") is REFERENCE
