"""Steering sweeps: the kingpin by rigid-body truth, its uncertainty, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.support.turning import (
    NORMAL_RAD,
    PLACES,
    WHEELS,
    Scene,
    facing,
    kingpin,
    rolled,
    side,
    swept,
)
from wheelplane.capture.open_capture import open_capture
from wheelplane.errors import InputError
from wheelplane.kinematics.steering_axis import STEERED
from wheelplane.kinematics.toe_out_on_turns import INNER_RAD
from wheelplane.measurement.quantities import steering_quantity
from wheelplane.report.json.measurement import to_json
from wheelplane.report.text.kinematics import steering_text
from wheelplane.uncertainty.components import flatness_component, mounting_component

MINUTE = np.radians(1 / 60)
SWEEP = np.radians([-20.0, -10.0, 0.0, 10.0, 20.0])
CASTER, INCLINATION = np.radians(4.3), np.radians(12.4)


def one(scene, wheel="FL", steers=SWEEP, **more):
    swept(scene, wheel, CASTER, INCLINATION, steers, **more)
    (found,) = scene.measure().steering_axes
    return found


@pytest.mark.parametrize("wheel", ["FR", "FL"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_exact_scans_give_the_axis_that_was_set(wheel, mirrored):
    scene = Scene(1, noise=0.0)
    if mirrored:  # the other wheel's scene in a mirror is this wheel's
        scene = Scene(1, noise=0.0, mirrored=True)
        other = {"L": "R", "R": "L"}
        name = wheel[0] + other[wheel[1]]
        scene.references()
        swept(scene, name, CASTER, INCLINATION, SWEEP)
        named = {w: w[0] + other[w[1]] for w in WHEELS}
        scene.seen = [
            replace(s, name=named.get(s.name, s.name), wheel=named[s.wheel]) for s in scene.seen
        ]
        scene.seen[:4] = [scene.seen[i] for i in (1, 0, 3, 2)]
        (found,) = scene.measure().steering_axes
    else:
        found = one(scene.references(), wheel)
    assert (found.wheel, found.status, found.dof) == (wheel, "ok", 12)
    assert found.caster.value == pytest.approx(CASTER, abs=1e-9)
    assert found.inclination.value == pytest.approx(INCLINATION, abs=1e-9)
    assert found.lateral_offset.value == pytest.approx(0.12, abs=1e-9)
    assert found.longitudinal_offset.value == pytest.approx(-0.02, abs=1e-9)
    assert found.chi_square < 1e-9


def test_the_axis_is_in_the_scanners_coordinates_and_turns_with_them():
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    plain = one(Scene(2, noise=0.0).references())
    scene = Scene(2, noise=0.0, turned=turn).references()
    moved = one(scene)
    np.testing.assert_allclose(moved.axis, turn.apply(plain.axis), atol=1e-9)
    true = scene.R.apply(kingpin("FL", CASTER, INCLINATION))
    np.testing.assert_allclose(moved.axis, true, atol=1e-9)
    assert moved.caster.u == pytest.approx(plain.caster.u, rel=1e-6)
    beside = np.array([-0.02, -0.12 * side("FL"), 0.0])
    where = scene.R.apply(PLACES["FL"] + beside) + scene.shift
    np.testing.assert_allclose(moved.point_m, where, atol=1e-8)


def test_order_of_the_scans_tells_nothing():
    scene = Scene(4).references()
    swept(scene, "FL", CASTER, INCLINATION, SWEEP)
    (plain,) = scene.measure().steering_axes
    scene.seen[4:] = scene.seen[:3:-1]
    (turned,) = scene.measure().steering_axes
    for name in ("caster", "inclination"):
        assert getattr(plain, name).value == pytest.approx(getattr(turned, name).value, abs=1e-10)
        assert getattr(plain, name).u == pytest.approx(getattr(turned, name).u, rel=1e-6)
    assert plain.chi_square == pytest.approx(turned.chi_square, rel=1e-4)


def drawn(count, seed, **more):
    """Errors over u of caster and inclination, and chances of the fits, over many cars."""
    scores, chances = [], []
    for i in range(count):
        found = one(Scene(seed + i).references(), "FL" if i % 2 else "FR", **more)
        scores.append(
            [
                (found.caster.value - CASTER) / found.caster.u,
                (found.inclination.value - INCLINATION) / found.inclination.u,
                (found.lateral_offset.value - 0.12) / found.lateral_offset.u,
                (found.longitudinal_offset.value + 0.02) / found.longitudinal_offset.u,
            ]
        )
        chances.append(found.probability)
    return np.array(scores), np.array(chances)


@pytest.mark.slow
def test_errors_are_as_large_as_stated_and_the_fit_as_good():
    scores, chances = drawn(100, 1000)
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(scores)) / len(scores)
    assert np.all((low < np.mean(scores**2, axis=0)) & (np.mean(scores**2, axis=0) < high))
    assert stats.kstest(chances, "uniform").pvalue > 1e-3


def test_u_is_what_the_cone_allows():
    """Inclination hangs on the sagitta of the arc: u = sigma / |1 - cos t| about its mean."""
    scene = Scene(5, noise=0.0, centre_m=1e-4).references()
    few = one(scene, steers=np.radians([-20.0, 0.0, 20.0]))
    sagitta = 1.0 - np.cos(np.radians([-20.0, 0.0, 20.0]))
    expected = NORMAL_RAD / np.linalg.norm(sagitta - sagitta.mean())
    assert few.inclination.u == pytest.approx(expected, rel=0.1)
    assert few.caster.u == pytest.approx(NORMAL_RAD / np.linalg.norm(np.sin(SWEEP[[0, 2, 4]])),
                                         rel=0.35)  # fmt: skip
    many = one(Scene(5, noise=1.0, centre_m=1e-4).references(),
               steers=np.radians([-20.0, 0.0, 20.0] * 4))  # fmt: skip
    assert many.inclination.u == pytest.approx(few.inclination.u / 2.0, rel=0.05)


def test_what_sits_with_the_plate_cancels():
    """A plate clamped half a degree askew, its form unknown: the cone takes it, u does not grow."""
    lean = Rotation.from_rotvec(np.radians([0.4, 0.0, -0.3]))
    plain = one(Scene(6, noise=0.0).references())
    askew = one(Scene(6, noise=0.0).references(), plate=lean)
    assert askew.caster.value == pytest.approx(CASTER, abs=1e-9)
    assert askew.inclination.value == pytest.approx(INCLINATION, abs=1e-9)
    loose = Scene(6, noise=0.0).references()
    for i, seen in enumerate(swept(loose, "FL", CASTER, INCLINATION, SWEEP).seen):
        target = seen.fitted
        extra = (
            flatness_component(1e-3, 0.125, target.normal),
            mounting_component(0.01, 0.0, target.normal),
        )
        more = replace(target, components=(*target.components, *extra))
        loose.seen[i] = replace(seen, evidence=replace(seen.evidence, target=more))
    (found,) = loose.measure().steering_axes
    # the form lifts the reference centres by flatness/sqrt(12), which turns the frame about up only
    assert found.caster.u == pytest.approx(plain.caster.u, rel=0.05)
    assert found.inclination.u == pytest.approx(plain.inclination.u, rel=0.2)


def test_a_reference_scan_serves_as_a_position_and_errs_in_both_alike():
    scene = Scene(7, noise=0.0)
    toe, camber = 0.0, -0.01
    scene.references({"FL": (toe, camber)})
    swept(scene, "FL", CASTER, INCLINATION, [-0.35, 0.35])
    scene.look("FL again", "sweep", "FL", PLACES["FL"], facing("FL", toe, camber), source="FL.ply")
    (found,) = scene.measure().steering_axes
    assert found.scans == ("FL 0", "FL 1", "FL again")
    assert found.caster.value == pytest.approx(CASTER, abs=1e-9)


def test_a_plate_that_moves_on_the_wheel_is_reported():
    scene = Scene(8).references()
    swept(scene, "FL", CASTER, INCLINATION, SWEEP)
    moved = scene.seen[5]
    n = moved.fitted.normal + 10 * NORMAL_RAD * np.cross(moved.fitted.normal, [0.3, 0.5, 0.8])
    target = replace(moved.fitted, normal=n / np.linalg.norm(n))
    scene.seen[5] = replace(moved, evidence=replace(moved.evidence, target=target))
    (found,) = scene.measure().steering_axes
    assert found.status == "not-one-axis"
    assert found.probability < 1e-3
    assert (found.caster, found.inclination, found.included_angle, found.axis) == (None,) * 4
    assert one(Scene(8).references()).status == "ok"


def test_a_wheel_that_rolls_is_seen_by_a_plate_that_wobbles_alone():
    """Rolled back and forth by 10 degrees: a square plate shows nothing and errs in nothing."""
    for lean_deg, status in ((0.0, "ok"), (0.5, "not-one-axis")):
        scene = Scene(9).references()
        axle, axis = facing("FL", 0.0, -0.01), kingpin("FL", CASTER, INCLINATION)
        plate = Rotation.from_rotvec(np.radians(lean_deg) * np.array([0.6, 0.0, 0.8])).apply(axle)
        for i, (steer, roll) in enumerate(zip(SWEEP, (0.0, 0.17, -0.17, 0.17, 0.0), strict=True)):
            R = Rotation.from_rotvec(steer * axis)
            centre = np.array(PLACES["FL"])
            point = centre - [0.02, 0.12, 0.0]
            normal = R.apply(Rotation.from_rotvec(roll * axle).apply(plate))
            scene.look(f"{i}", "sweep", "FL", point + R.apply(centre - point), normal)
        (found,) = scene.measure().steering_axes
        assert found.status == status


@pytest.mark.parametrize("lock_deg", [2.0, 20.0])
def test_a_body_that_leans_is_reported_however_far_the_wheel_was_steered(lock_deg):
    """By 0.1 degrees at one position: over 2 degrees of lock it is 1.5 degrees of caster."""
    scene = Scene(3).references()
    steers = np.radians([-lock_deg, 0.0, lock_deg])
    assert one(replace(scene, seen=[*scene.seen]), steers=steers).status != "not-one-axis"
    swept(scene, "FL", CASTER, INCLINATION, steers)
    lean = scene.R * Rotation.from_rotvec([np.radians(0.1), 0.0, 0.0]) * scene.R.inv()
    ground = scene.R.apply([2.64, 0.0, -0.3]) + scene.shift
    last = scene.seen[-1]
    centre_m = ground + lean.apply(last.fitted.centre_m - ground)
    target = replace(last.fitted, normal=lean.apply(last.fitted.normal), centre_m=centre_m)
    scene.seen[-1] = replace(last, evidence=replace(last.evidence, target=target))
    (found,) = scene.measure().steering_axes
    assert (found.status, found.caster, found.inclination) == ("not-one-axis", None, None)


@pytest.mark.parametrize(
    ("steers", "status", "known"),
    [
        ([-20, 20], "too-few-positions", (False, False)),
        ([-0.5, 0, 0.5], "range-too-small", (False, False)),
        ([-3, 0, 3], "range-too-small", (True, False)),
    ],
)
def test_too_little_is_said_never_a_wild_number(steers, status, known):
    scene = Scene(10).references()
    found = one(scene, steers=np.radians(steers))
    assert found.status == status
    assert found.reason
    assert (found.caster is not None, found.inclination is not None) == known
    text = steering_text(scene.measure())
    assert f"{status}: {found.reason}" in text


def test_toe_out_on_turns():
    """The outer wheel follows a curve; the positions do not hit 20 degrees."""
    steers = np.radians([-21.0, -16.0, -11.0, 0.0, 11.0, 16.0, 21.0])
    scene = Scene(11, noise=0.0).references()
    for wheel in ("FR", "FL"):
        inner = side(wheel)
        own = [s if s * inner > 0 else s + inner * 0.4 * s * s for s in steers]
        for i, steer in enumerate(own):
            scene.look(
                f"{wheel} {i}", "sweep", wheel, np.array(PLACES[wheel]),
                facing(wheel, -side(wheel) * steer, 0.0), replace(TURN, position=f"p{i}"),
            )  # fmt: skip
    left, right = scene.measure().toe_out
    for found in (left, right):
        true = 0.4 * np.radians(20.0) ** 2
        assert found.status == "ok"
        assert found.difference.value == pytest.approx(true, abs=1e-9)
        # linear between 16 and 21 is off by 0.4 (20 - 16)(21 - 20) deg^2; half of that is stated
        curve = 0.4 * np.radians(4.0) * np.radians(1.0) / 2.0
        assert found.u_interpolation_rad == pytest.approx(curve, rel=1e-3)
        assert NORMAL_RAD < found.difference.u < np.hypot(curve, 4.0 * NORMAL_RAD)


def test_a_target_that_slips_leaves_no_toe_out_on_turns():
    """By a degree on FL, with which toe-out on the left turn is off by half of that."""
    scene = Scene(4).references()
    for wheel in STEERED:
        steers = SWEEP + 0.2 * SWEEP**2 * side(wheel)
        swept(scene, wheel, CASTER, INCLINATION, steers, positions=[*map(str, range(len(SWEEP)))])
    still = scene.measure()
    assert [(turn.turn, turn.status) for turn in still.toe_out] == [("left", "ok"), ("right", "ok")]
    slip = Rotation.from_rotvec(np.radians(1.0) * scene.R.apply([0.0, 0.0, 1.0]))
    last = scene.seen[-1]
    target = replace(last.fitted, normal=slip.apply(last.fitted.normal))
    scene.seen[-1] = replace(last, evidence=replace(last.evidence, target=target))
    found = scene.measure()
    assert [axis.status for axis in found.steering_axes] == ["ok", "not-one-axis"]
    for turn in found.toe_out:
        assert (turn.status, turn.difference) == ("not-one-axis", None)
        assert turn.reason.startswith("the scans of FL do not turn about one axis")
    limited = steering_quantity(found, "toe_out_left", INNER_RAD)
    assert limited.value is None
    assert limited.reason == f"not measured, not-one-axis: {found.toe_out[0].reason}"


def test_u_of_toe_out_counts_both_wheels():
    """At a position of 20 degrees: the outer wheel's error, and the inner's by the slope."""
    scene = Scene(14, noise=0.0, centre_m=1e-9).references()
    for wheel in ("FR", "FL"):
        for i, steer in enumerate(np.radians([-30.0, -20.0, 0.0, 20.0, 30.0])):
            own = steer if steer * side(wheel) > 0 else steer + side(wheel) * 0.4 * steer * steer
            scene.look(
                f"{wheel} {i}", "sweep", wheel, np.array(PLACES[wheel]),
                facing(wheel, -side(wheel) * own, 0.0), replace(TURN, position=f"p{i}"),
            )  # fmt: skip
    slope = 1.0 - 0.8 * np.radians(20.0)
    for found in scene.measure().toe_out:
        assert found.u_interpolation_rad < 1e-9
        assert found.difference.u == pytest.approx(NORMAL_RAD * np.hypot(1.0, slope), rel=0.01)


def test_toe_out_that_was_not_reached_is_said():
    scene = Scene(12).references()
    for wheel in ("FR", "FL"):
        swept(scene, wheel, CASTER, INCLINATION, SWEEP * 0.7, positions="abcde")
    assert [f.status for f in scene.measure().toe_out] == ["not-reached"] * 2
    alone = Scene(12).references()
    swept(alone, "FL", CASTER, INCLINATION, SWEEP, positions="abcde")
    assert alone.measure().toe_out == ()


def test_json_holds_all_with_units():
    scene = Scene(13).references()
    swept(scene, "FL", CASTER, INCLINATION, SWEEP)
    rolled(scene, "RR", [0.0, np.pi])
    tree = json.loads(to_json(scene.measure()))
    (found,) = tree["steering"]["kingpins"]
    assert found["caster_deg"] == pytest.approx(np.degrees(CASTER), abs=0.05)
    assert found["expanded_caster_deg"] == pytest.approx(1.96 * found["u_caster_deg"], rel=1e-3)
    assert {w["role"] for w in tree["wheels"]} == {"reference", "sweep", "runout"}
    assert tree["runouts"][0]["frame"] == "plate centres"
    assert to_json(scene.measure()) == to_json(scene.measure())


SQUARE = {"u_turn": 7.5e-5}  # of the square's turn about its normal, default scanner
ENDS = np.radians([-20.0, 0.0, 20.0])


@pytest.mark.parametrize("period", [np.pi / 2.0, np.pi, 2.0 * np.pi])
@pytest.mark.parametrize("wheel", ["FR", "FL"])
def test_exact_turns_about_the_normal_give_the_axis_too(wheel, period):
    """Whichever of the equal turns each scan reports; they add one equation each, less one."""
    found = one(Scene(1, noise=0.0, period=period, **SQUARE).references(), wheel)
    assert (found.status, found.dof) == ("ok", 12 + len(SWEEP) - 1)
    assert found.with_rotation == len(SWEEP)
    assert found.caster.value == pytest.approx(CASTER, abs=1e-9)
    assert found.inclination.value == pytest.approx(INCLINATION, abs=1e-9)
    assert found.lateral_offset.value == pytest.approx(0.12, abs=1e-9)
    assert found.chi_square < 1e-9


def test_a_turn_hangs_on_the_sine_where_the_normal_hangs_on_the_sagitta():
    """1 / u^2 = |sin t|^2 / u_turn^2 + |1 - cos t|^2 / u_normal^2, each about its mean.

    And the frame's roll, sqrt(2) u_centre / track.
    """
    turns, disc, loose = (
        one(Scene(5, noise=0.0, centre_m=1e-4, **more).references(), steers=ENDS)
        for more in (SQUARE, {}, {"u_turn": 10.0})
    )
    sagitta = 1.0 - np.cos(ENDS)
    by_normal = np.linalg.norm(sagitta - sagitta.mean()) / NORMAL_RAD
    by_turn = np.linalg.norm(np.sin(ENDS)) / SQUARE["u_turn"]
    expected = np.hypot(1.0 / np.hypot(by_normal, by_turn), np.sqrt(2.0) * 1e-4 / 1.5)
    assert turns.inclination.u == pytest.approx(expected, rel=0.05)
    assert turns.inclination.u < 0.3 * disc.inclination.u
    assert turns.caster.u == pytest.approx(disc.caster.u, rel=0.01)
    assert loose.inclination.u == pytest.approx(disc.inclination.u, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("with_centre", [0.0, 0.9])
def test_errors_with_turns_are_as_large_as_stated_and_the_fit_as_good(with_centre):
    scores, chances, errors = [], [], []
    for i in range(100):
        scene = Scene(2000 + i, with_centre=with_centre, **SQUARE).references()
        found = one(scene, "FL" if i % 2 else "FR", steers=ENDS)
        known = (found.caster, found.inclination, found.lateral_offset, found.longitudinal_offset)
        true = (CASTER, INCLINATION, 0.12, -0.02)
        scores.append([(k.value - t) / k.u for k, t in zip(known, true, strict=True)])
        errors.append(found.inclination.value - INCLINATION)
        chances.append(found.probability)
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(scores)) / len(scores)
    means = np.mean(np.square(scores), axis=0)
    assert np.all((low < means) & (means < high))
    assert stats.kstest(chances, "uniform").pvalue > 1e-3
    assert np.max(np.abs(errors)) < 3.0 * MINUTE  # discs: 3.4' rms


def test_turns_move_with_the_scanners_coordinates_and_in_a_mirror():
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    plain = one(Scene(2, noise=0.0, **SQUARE).references())
    moved = one(Scene(2, noise=0.0, turned=turn, **SQUARE).references())
    np.testing.assert_allclose(moved.axis, turn.apply(plain.axis), atol=1e-9)
    assert moved.inclination.u == pytest.approx(plain.inclination.u, rel=1e-6)
    scene = swept(Scene(2, noise=0.0, mirrored=True, **SQUARE).references(), "FR",
                  CASTER, INCLINATION, SWEEP)  # fmt: skip
    other = {"FR": "FL", "FL": "FR", "RR": "RL", "RL": "RR"}
    scene.seen = [
        replace(s, name=other.get(s.name, s.name), wheel=other[s.wheel]) for s in scene.seen
    ]
    scene.seen[:4] = [scene.seen[i] for i in (1, 0, 3, 2)]
    (found,) = scene.measure().steering_axes
    assert (found.wheel, found.status) == ("FL", "ok")
    assert found.inclination.value == pytest.approx(INCLINATION, abs=1e-9)
    assert found.inclination.u == pytest.approx(plain.inclination.u, rel=0.05)


def test_which_of_the_equal_turns_is_reported_changes_nothing():
    """But the second order of the normals' errors."""
    scene = swept(Scene(21, **SQUARE).references(), "FL", CASTER, INCLINATION, SWEEP)
    (plain,) = scene.measure().steering_axes
    for i, quarters in ((4, 1), (5, 3), (7, 2)):
        target = scene.seen[i].fitted
        R = Rotation.from_rotvec(quarters * np.pi / 2.0 * target.normal)
        jumped = replace(target, turn=replace(target.turn, axis=R.apply(target.turn.axis)))
        scene.seen[i] = replace(scene.seen[i], evidence=replace(scene.seen[i].evidence,
                                                                target=jumped))  # fmt: skip
    (again,) = scene.measure().steering_axes
    for name in ("caster", "inclination"):
        assert getattr(again, name).value == pytest.approx(
            getattr(plain, name).value, abs=(3.0 * NORMAL_RAD) ** 2
        )
        assert getattr(again, name).u == pytest.approx(getattr(plain, name).u, rel=1e-3)
    assert again.chi_square == pytest.approx(plain.chi_square, rel=1e-3)


@pytest.mark.parametrize("slip_deg", [0.1, 5.0, 20.0, 30.0, 45.0, 60.0])
def test_a_plate_that_slips_about_its_own_normal_is_reported(slip_deg):
    """A disc shows nothing of it; a whole period is none."""
    slips = np.radians([0.0, 0.0, slip_deg, 0.0, 0.0])
    found = one(Scene(22, **SQUARE).references(), slips=slips)
    assert found.status == "not-one-axis"
    assert "slipped" in found.reason
    assert ("in its plane by 30°" in found.reason) == (slip_deg in (30.0, 60.0))
    if slip_deg < 22.5:
        assert "hold the brake" in found.reason
    assert one(Scene(22).references(), slips=slips).status == "ok"
    assert one(Scene(22, **SQUARE).references(), slips=[0, 0, np.pi / 2, 0, 0]).status == "ok"


def test_a_scan_without_a_turn_serves_among_those_with():
    """It counts by normal and centre; one turn alone tells nothing and is left out."""
    none = [None] * len(SWEEP)
    disc = one(Scene(23, noise=0.0).references())
    every = one(Scene(23, noise=0.0, **SQUARE).references())
    some = one(Scene(23, noise=0.0, **SQUARE).references(), slips=[0.0, None, None, 0.0, 0.0])
    alone = one(Scene(23, noise=0.0, **SQUARE).references(), slips=[0.0, *none[1:]])
    assert (some.with_rotation, some.dof) == (3, 12 + 3 - 1)
    assert (alone.with_rotation, alone.dof) == (0, 12)
    assert every.inclination.u < some.inclination.u < 0.5 * disc.inclination.u
    assert alone.inclination.u == disc.inclination.u
    for found in (some, alone):
        assert found.inclination.value == pytest.approx(INCLINATION, abs=1e-9)


def test_a_print_may_lie_turned_on_its_board():
    """Turns by edges and by print are not compared: those that are more count."""
    scene = swept(Scene(24, noise=0.0, **SQUARE).references(), "FL", CASTER, INCLINATION, SWEEP)
    for i in (4, 8):
        target = scene.seen[i].fitted
        R = Rotation.from_rotvec(0.02 * target.normal)
        mine = replace(target.turn, axis=R.apply(target.turn.axis), mark="print")
        scene.seen[i] = replace(scene.seen[i], evidence=replace(
            scene.seen[i].evidence, target=replace(target, turn=mine)))  # fmt: skip
    (found,) = scene.measure().steering_axes
    assert (found.status, found.with_rotation, found.mark) == ("ok", 3, "edges")
    assert found.inclination.value == pytest.approx(INCLINATION, abs=1e-9)


def test_the_report_says_when_turns_counted():
    scene = swept(Scene(25, **SQUARE).references(), "FL", CASTER, INCLINATION, SWEEP)
    said = "shown by their edges, is used on FL (5 of 5 scans)"
    assert said in " ".join(steering_text(scene.measure()).split())
    (tree,) = json.loads(to_json(scene.measure()))["steering"]["kingpins"]
    assert (tree["scans_with_turn"], tree["turn_by"]) == (5, "edges")
    disc = swept(Scene(25).references(), "FL", CASTER, INCLINATION, SWEEP)
    assert "in-plane rotation" not in steering_text(disc.measure())
    (tree,) = json.loads(to_json(disc.measure()))["steering"]["kingpins"]
    assert (tree["scans_with_turn"], tree["turn_by"]) == (0, None)


TURN = swept(Scene(0).references(), "FL", 0.0, 0.0, [0.0]).seen[-1].turn

TOML = """
target = "disc-250"
[reference]
RR = "rr.xyz"
RL = "rl.xyz"
FR = "fr.xyz"
FL = "fl.xyz"
"""


def opened(folder, extra):
    for name in ("rr", "rl", "fr", "fl", "b", "c"):
        (folder / f"{name}.xyz").write_text("0 0 0\n")
    (folder / "capture.toml").write_text(TOML + extra)
    with open_capture(folder) as capture:
        return capture.entries[4:]


def entry(table, **keys):
    return f"[[{table}]]\n" + "".join(f"{key} = {json.dumps(v)}\n" for key, v in keys.items())


def test_capture_names_sweeps_and_run_outs(tmp_path):
    extra = entry("sweep", wheel="FL", name="straight", file="fl.xyz", position="0")
    extra += entry("sweep", wheel="FL", name="left", file="b.xyz", position="1")
    extra += entry("runout", wheel="RR", name="up", file="rr.xyz", angle_deg=0)
    extra += entry("runout", wheel="RR", name="down", file="c.xyz", angle_deg=-180, u_angle_deg=2)
    seen = [(e.name, e.role, e.wheel, e.turn) for e in opened(tmp_path, extra)]
    assert [row[:3] for row in seen] == [
        ("straight", "sweep", "FL"),
        ("left", "sweep", "FL"),
        ("up", "runout", "RR"),
        ("down", "runout", "RR"),
    ]
    assert seen[1][3].position == "1"
    assert seen[2][3].u_rad == pytest.approx(np.radians(1.0))
    assert (seen[3][3].angle_rad, seen[3][3].u_rad) == pytest.approx((-np.pi, np.radians(2)))


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (entry("sweep", wheel="RL", name="a", file="b.xyz"), "RL, which does not steer"),
        (entry("sweep", wheel="FL", name="a", file="fr.xyz"), "'fr.xyz' occurs twice"),
        (
            entry("sweep", wheel="FL", name="a", file="b.xyz", position="1")
            + entry("sweep", wheel="FL", name="b", file="c.xyz", position="1"),
            "another scan at position '1'",
        ),
        (entry("sweep", wheel="FL", name="FL", file="b.xyz"), "'FL' occurs twice"),
        (entry("sweep", wheel="FL", name="a", file="b.xyz", angle=2), "unknown key"),
        (entry("runout", wheel="FL", name="a", file="b.xyz", angle_deg=0), "the only one of FL"),
        (entry("runout", wheel="FL", name="a", file="b.xyz"), "'runout.0.angle_deg' is missing"),
        (
            entry("runout", wheel="FL", name="a", file="b.xyz", angle_deg=0)
            + entry("runout", wheel="FL", name="b", file="b.xyz", angle_deg=180),
            "'b.xyz' occurs twice",
        ),
    ],
)
def test_what_is_no_sweep_is_refused_in_one_line(tmp_path, extra, said):
    with pytest.raises(InputError if "unknown" not in said and "missing" not in said
                       else Exception, match=said) as error:  # fmt: skip
        opened(tmp_path, extra)
    assert "\n" not in str(error.value)
