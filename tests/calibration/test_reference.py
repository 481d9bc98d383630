"""Tests of reference values: those of the measurement, with its covariance, in the item's sense."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from tests.support.calibration_bay import CAMBER, TOE, Bay, changed, item_of, machine, tilted
from wheelplane.calibration.calibrate import calibrate
from wheelplane.calibration.forms.readings import Reading, Readings
from wheelplane.calibration.reference import Reference, joint_effects, reference_of
from wheelplane.five_point import FivePointFile, measure_five_point
from wheelplane.measurement import stated
from wheelplane.report.json.calibration import calibration_tree
from wheelplane.report.text.calibration import calibration_text
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
    front = next(name for name, wheel in REFERENCE.wheels.items() if wheel.wheel == "FR")
    to_thrust = REFERENCE.value("toe", front, declared(toe={"axis": "thrust-line"}))
    assert to_thrust.value == pytest.approx(REFERENCE.value("toe", front, PLAIN).value + thrust)
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


def place_of(name):
    """The wheel that a point stands for."""
    return REFERENCE.wheels[name].wheel


def to_thrust_line(normals, centres, names):
    """Toe to the thrust line by directions in the plane of the axles alone, radians.

    normals, centres: by name. Each wheel rolls along its level line; a trial takes its wheel's
    place in the sum of the two that roll at the rear.
    """
    left = centres["RL"] - centres["RR"]
    ahead = (centres["FR"] + centres["FL"] - centres["RR"] - centres["RL"]) / 2
    up = np.cross(ahead, left) / np.linalg.norm(np.cross(ahead, left))
    found = []
    for name in names:
        place = place_of(name)
        stands = {wheel: normals[wheel] for wheel in ("RR", "RL")} | {place: normals[name]}
        rolls = {}
        for wheel, normal in stands.items():
            roll = np.cross(normal, up)
            rolls[wheel] = roll * np.sign(roll @ ahead) / np.linalg.norm(roll)
        line = rolls["RR"] + rolls["RL"]
        to_left = np.arctan2(np.cross(line, rolls[place]) @ up, line @ rolls[place])
        found.append(-to_left if place.endswith("L") else to_left)
    return np.array(found)


@pytest.mark.slow
def test_toe_of_a_trial_to_the_thrust_line_is_that_of_the_vehicle_as_it_stands():
    """Value and covariance, by plain directions and by 20,000 draws of what the wheels share."""
    item, names = declared(toe={"axis": "thrust-line"}), list(REFERENCE.wheels)
    assert {place_of(name) for name in names[4:]} >= {"RR", "RL"}
    known = [REFERENCE.value("toe", name, item) for name in names]
    poses = {name: REFERENCE.wheels[name].pose for name in names}
    centres = {name: pose.centre_m for name, pose in poses.items()}
    plain = to_thrust_line({name: pose.normal for name, pose in poses.items()}, centres, names)
    # The plane of the axles here is the one through the middles: 1e-6 where the axles are skew.
    np.testing.assert_allclose([one.value for one in known], plain, rtol=0, atol=2e-5)
    of_reference = REFERENCE.by_name["thrust_angle"].value
    for name, one in zip(names, known, strict=True):
        side = 1.0 if place_of(name).endswith("L") else -1.0
        as_scanned = REFERENCE.by_name[f"{name}.toe"].value - side * of_reference
        own = name not in ("RR", "RL") and place_of(name) in ("RR", "RL")
        assert (abs(one.value - as_scanned) > 1e-4) == own
    effects = joint_effects(known)
    stated_covariance = sum(effect.factor @ effect.factor.T for effect in effects)
    rng, draws = np.random.default_rng(0), 20_000
    moved = np.zeros((draws, 6 * len(names)))
    for effect in known[0].effects:
        moved += rng.standard_normal((draws, effect.factor.shape[1])) @ effect.factor.T
    moved = moved.reshape(draws, len(names), 2, 3)
    drawn = np.array([
        to_thrust_line(
            {n: poses[n].normal + moved[k, i, 0] for i, n in enumerate(names)},
            {n: poses[n].centre_m + moved[k, i, 1] for i, n in enumerate(names)},
            names,
        )
        for k in range(draws)
    ])  # fmt: skip
    covariance = np.cov(drawn.T)
    u = np.sqrt(np.diag(covariance))
    # Of a drawn correlation: 1/sqrt(draws); four of them.
    np.testing.assert_allclose(
        stated_covariance / np.outer(u, u), covariance / np.outer(u, u), rtol=0,
        atol=4.0 * np.sqrt(2.0 / draws),
    )  # fmt: skip


def test_trials_of_rear_wheels_are_named_where_they_turn_their_line():
    to_thrust = declared(toe={"axis": "thrust-line"})
    for name in REFERENCE.wheels:
        own = name not in ("RR", "RL") and place_of(name) in ("RR", "RL")
        assert REFERENCE.in_place("toe", name, to_thrust) == own
        assert not REFERENCE.in_place("toe", name, PLAIN)


def test_a_machine_that_sees_the_trial_in_its_place_has_the_errors_that_it_was_made_with():
    """An alignment machine counts from the rear wheels as they stand; text and JSON name them."""
    tested = machine(toe=changed(TOE, axis="thrust-line", zero=0.0, gain=0.0, hysteresis=0.0))
    found = calibrate([REFERENCE], item_of(tested), BAY.readings(tested))
    (result,) = found.results
    own = [name for name in REFERENCE.wheels if REFERENCE.in_place("toe", name, found.item)]
    assert result.in_place == tuple(own) == ("1", "2")
    for point in result.points:
        assert abs(point.error.value) < 2.0 * point.error.expanded
        as_scanned = REFERENCE.by_name[f"{point.point}.toe"].value
        as_scanned += (1.0 if place_of(point.point).endswith("R") else -1.0) * (
            REFERENCE.by_name["thrust_angle"].value
        )
        off = abs(point.reading - as_scanned) > 10.0 * point.error.expanded
        assert off == (point.point in own)
    sentence = "the thrust line at 1, 2 is that with the trial in its rear wheel's place"
    assert sentence in " ".join(calibration_text(found).split())
    (tree,) = calibration_tree(found)["quantities"]
    assert tree["thrust_line_by_trial"] == ["1", "2"]


def test_a_reference_of_exactly_flat_blocks_has_no_uncertainty_of_its_own():
    """Nothing scatters and no station is stated: the readings alone are uncertain."""
    pentagon = np.array([[0, 0, 2], [0, 2, 1], [0, 1, -2], [0, -1, -2], [0, -2, 1]]) / 16.0
    centres = np.array([[1.5, 0, 0], [0, 0, 0], [1.5, 2.75, 0], [0, 2.75, 0]])
    blocks = centres[:, None] + pentagon
    reference = Reference(measure_five_point(FivePointFile(blocks, "flat", "", ())))
    item = item_of(machine())
    found = reference.value("toe", "RR", item.item)
    assert (found.value, found.u, found.dof) == (0.0, 0.0, math.inf)
    rows = [
        Reading(name, "toe", value, "deg", "1", k, "", "as found", "", row)
        for row, (name, (k, value)) in enumerate(
            itertools.product(("RR", "RL", "FR", "FL"), ((1, 1e-4), (2, 2e-4))), 2
        )
    ]
    (result,) = calibrate([reference], item, Readings("r", "", tuple(rows))).results
    for point in result.points:
        assert point.error.value == pytest.approx(1.5e-4)
        assert point.error.u > 0.0
        assert {line.origin for line in point.budget} == {"readings"}
