"""Run-out: the axle by rigid-body truth, what of it depends on the stated turns, and what moved."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.support.turning import (
    CENTRE_M,
    NORMAL_RAD,
    WHEELS,
    Scene,
    across_axle,
    facing,
    mounted,
    rolled,
)
from wheelplane.report.text.kinematics import runout_text
from wheelplane.uncertainty import UncertaintyComponent
from wheelplane.uncertainty.components import flatness_component, mounting_component
from wheelplane.vehicle.angles import wheel_angles

SOLVE = import_module("wheelplane.kinematics.solve")  # whose door has its function by this name
TOE, CAMBER = 0.003, -0.012  # of `rolled`
WOBBLE = np.radians([0.3, 0.4])  # half a degree
OFF = (0.0018, 0.0011)
HALF = np.array([0.0, np.pi])
QUARTERS = np.radians([0.0, 90.0, 180.0, 270.0])


@pytest.fixture(autouse=True)
def exact_mounting(monkeypatch):
    """Targets without a run-out are mounted exactly here, whatever that of another one shows."""
    monkeypatch.setattr(SOLVE, "with_mounting", lambda best: best)


def one(scene, wheel="FL", turns=HALF, **more):
    """Return the run-out of a wheel whose reference scan shows it at a rotation of its own."""
    plate = {"wobble": WOBBLE, "eccentric_m": OFF}
    mounted(scene, wheel, **plate)
    (found,) = rolled(scene, wheel, turns, **plate | more).measure().runouts
    return found


@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize("turns", [HALF, QUARTERS, np.radians([10.0, 100.0, 250.0])])
def test_exact_scans_give_the_axle_that_was_set(wheel, turns):
    found = one(Scene(1, noise=0.0).references(), wheel, turns)
    assert (found.status, found.dof) == ("ok", 5 * len(turns) - 9)
    assert found.angles.toe.value == pytest.approx(TOE, abs=1e-9)
    assert found.angles.camber.value == pytest.approx(CAMBER, abs=1e-9)
    assert found.axial_runout.value == pytest.approx(np.radians(0.5), abs=1e-8)
    assert found.radial_runout.value == pytest.approx(np.hypot(*OFF), abs=1e-9)
    assert np.tan(found.axial_clock.value) == pytest.approx(0.75, rel=0.02)
    assert np.tan(found.radial_clock.value) == pytest.approx(18 / 11, rel=0.02)
    np.testing.assert_allclose(found.turns_rad, turns, atol=1e-7)
    # a plate left as it is would be half a degree off
    assert np.hypot(found.angles.toe.u, found.angles.camber.u) < 0.02 * found.axial_runout.value


def test_the_axle_is_in_the_scanners_coordinates_and_turns_with_them():
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7])
    plain = one(Scene(2, noise=0.0).references())
    moved = one(Scene(2, noise=0.0, turned=turn).references())
    np.testing.assert_allclose(moved.axis, turn.apply(plain.axis), atol=1e-9)
    assert moved.angles.toe.u == pytest.approx(plain.angles.toe.u, rel=1e-6)
    assert moved.axial_clock.value == pytest.approx(plain.axial_clock.value, abs=1e-7)


def scores(count, turns, u_turn=0.002, spread=0.0, **more):
    """Errors of toe, camber, wobble and eccentricity over u; errors of toe; chances."""
    rows, errors, chances = [], [], []
    for i in range(count):
        jitter = spread * np.random.default_rng([i, 9]).normal(size=len(turns))
        found = one(
            Scene(100 + i).references(), "FL" if i % 2 else "RR", turns + jitter,
            stated=turns, u_turn=u_turn, **more,
        )  # fmt: skip
        true = (TOE, CAMBER, np.radians(0.5), np.hypot(*OFF))
        known = (found.angles.toe, found.angles.camber, found.axial_runout, found.radial_runout)
        rows.append([(k.value - t) / k.u for k, t in zip(known, true, strict=True)])
        errors.append(found.angles.toe.value - TOE)
        chances.append(found.probability)
    return np.array(rows), np.array(errors), np.array(chances)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turns", "spread"), [(HALF, 0.0175), (QUARTERS, 0.0175), (QUARTERS, 0.1), (HALF, 0.002)]
)
def test_errors_are_as_large_as_stated_and_the_fit_as_good(turns, spread):
    """With turns that are off by what is stated of them."""
    rows, _, chances = scores(80, turns, u_turn=spread, spread=spread)
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(rows)) / len(rows)
    means = np.mean(rows**2, axis=0)
    assert np.all((low < means) & (means < high))
    assert stats.kstest(chances, "uniform").pvalue > 1e-3


def test_two_positions_halve_the_variance_and_four_quarter_it():
    base = np.hypot(NORMAL_RAD / np.sqrt(2), np.sqrt(2) * CENTRE_M / 1.5)
    two = one(Scene(3, noise=0.0).references(), u_turn=1e-4)
    four = one(Scene(3, noise=0.0).references(), turns=QUARTERS, u_turn=1e-4)
    assert two.angles.toe.u == pytest.approx(base, rel=0.02)
    finer = np.hypot(NORMAL_RAD / 2.0, np.sqrt(2) * CENTRE_M / 1.5)
    assert four.angles.toe.u == pytest.approx(finer, rel=0.02)


def test_a_turn_known_badly_costs_two_positions_more_than_four():
    """Two: half the wobble times the uncertainty of the half turn; four tell their turns."""
    loose = np.radians(3.0)
    two, sure = (one(Scene(4, noise=0.0).references(), u_turn=u).angles for u in (loose, 1e-4))
    cost = two.toe.u**2 + two.camber.u**2 - sure.toe.u**2 - sure.camber.u**2
    expected = (np.radians(0.5) * np.sqrt(2) * loose / 2.0) ** 2
    assert cost == pytest.approx(expected, rel=0.05)
    four = one(Scene(4, noise=0.0).references(), turns=QUARTERS, u_turn=loose).angles
    assert four.toe.u < 0.5 * max(two.toe.u, two.camber.u)
    shown = QUARTERS + np.array([0.0, 0.1, -0.08, 0.05])
    found = one(Scene(4, noise=0.0).references(), turns=QUARTERS, stated=shown, u_turn=0.1)
    spread = np.ptp(np.array(found.turns_rad) - QUARTERS)
    assert spread < 0.05 * np.ptp(shown - QUARTERS)  # the turns were found, not believed


def test_what_sits_with_the_plate_cancels():
    plain = one(Scene(5, noise=0.0).references(), u_turn=1e-4)
    loose = rolled(Scene(5, noise=0.0).references(), "FL", HALF, wobble=WOBBLE, u_turn=1e-4)
    for i, seen in enumerate(loose.seen[4:], 4):
        n = seen.fitted.normal
        extra = (flatness_component(1e-3, 0.125, n), mounting_component(0.01, 0.003, n))
        target = replace(seen.fitted, components=(*seen.fitted.components, *extra))
        loose.seen[i] = replace(seen, evidence=replace(seen.evidence, target=target))
    (found,) = loose.measure().runouts
    assert found.angles.toe.u == pytest.approx(plain.angles.toe.u, rel=1e-3)


def test_tyre_run_out_rotates_with_the_wheel_whatever_its_degrees_of_freedom():
    """A flatness that a fit observed in each scan stays in the axle."""
    tilt, u = np.vstack([0.002 * np.eye(3), np.zeros((3, 3))]), {}
    for name in ("tyre run-out", "flatness"):
        extra = (UncertaintyComponent(name, tilt, dof=6.0),)
        u[name] = one(Scene(5, noise=0.0, extra=extra).references()).angles.toe.u
    plain = one(Scene(5, noise=0.0).references()).angles.toe.u
    assert u["tyre run-out"] == pytest.approx(plain, rel=1e-3)
    assert u["flatness"] > 0.001


def test_a_plate_stands_as_far_off_its_wheel_in_all_scans_and_moves_the_axle_s_centre():
    """All centres of a wheel move by 5 mm along its axle alike: tracks by both, no axle's angle."""
    aside = Scene(5).R.apply([0.0, 0.005, 0.0])
    far = (UncertaintyComponent("stand-off", np.append(np.zeros(3), aside)[:, None]),)
    plain, off = (all_round(5, 0.0, ECCENTRIC, extra=extra).measure() for extra in ((), far))
    for name in ("rear_track", "front_track"):
        u, of_plates = (each.uncertainty.vehicle_standard[name] for each in (off, off.plates))
        assert u == pytest.approx(0.005 * 2.0**0.5, rel=1e-3)
        assert u == pytest.approx(of_plates, rel=1e-3)
    for one_way, other in zip(plain.runouts, off.runouts, strict=True):
        assert other.angles.toe.value == one_way.angles.toe.value
        assert other.angles.toe.u == pytest.approx(one_way.angles.toe.u, rel=0.05)


@pytest.mark.parametrize("moves", [(0.0, 5e-4, 0.0), (0.0, -5e-4, 0.0)])
def test_a_vehicle_that_moves_along_the_axle_is_reported(moves):
    still = one(Scene(6).references(), moves=[(0, 0, 0), (0, 0, 0)])
    assert still.status == "ok"
    found = one(Scene(6).references(), moves=[(0, 0, 0), moves])
    assert found.status == "moved"
    assert "vehicle moved" in found.reason


def test_a_vehicle_that_moves_across_the_axle():
    """By three positions or more it shows; two take it for eccentricity, up to what is possible."""
    shift = (0.002, 0.0, 0.0)
    four = one(Scene(7).references(), turns=QUARTERS, moves=[(0, 0, 0)] * 3 + [shift])
    assert four.status == "moved"
    across = np.cross([0.0, 0.0, 1.0], facing("FL", TOE, CAMBER))
    far = one(Scene(7).references(), moves=[(0, 0, 0), 0.06 * across])
    assert far.status == "moved"
    assert "from the axle" in far.reason


def test_turns_shown_backwards_are_reported():
    found = one(Scene(8).references(), turns=QUARTERS, stated=-QUARTERS)
    assert found.status == "moved"
    assert "are reversed: change them" in found.reason
    wrong = one(Scene(8).references(), turns=QUARTERS, stated=QUARTERS[[0, 2, 1, 3]])
    assert "are reversed: change them" not in wrong.reason


def test_too_little_turn_is_said_never_a_wild_number():
    for turns in (np.radians([0.0, 5.0]), np.radians([0.0, 360.0])):
        scene = Scene(9).references()
        found = one(scene, turns=turns)
        assert (found.status, found.angles) == ("turn-too-small", None)
        assert found.reason in runout_text(scene.measure())


def all_round(seed, noise, eccentric, wheels=WHEELS, extra=()):
    """Every wheel turned, its reference scan the first of its run-out."""
    scene, turns = (Scene(seed, noise=noise, extra=extra) for _ in range(2))
    for wheel, off in zip(WHEELS, eccentric, strict=True):
        rolled(turns, wheel, HALF, wobble=WOBBLE, eccentric_m=off, u_turn=1e-3)
    for wheel in WHEELS:
        first = next(s for s in turns.seen if s.wheel == wheel)
        seen = replace(first, name=wheel, role="reference", source=f"{wheel}.ply", turn=None)
        scene.seen.append(seen)
    scene.seen += [
        replace(s, source=f"{s.wheel}.ply") if s.name.endswith("turn 0") else s
        for s in turns.seen
        if s.wheel in wheels
    ]
    return scene


ECCENTRIC = ((0.002, 0.001), (-0.001, 0.002), (0.0, -0.002), (0.002, -0.001))


def test_plates_off_centre_turn_the_frame_and_axles_set_it_right():
    result = all_round(10, 0.0, ECCENTRIC).measure()
    found = result.runouts
    assert [runout.frame for runout in found] == ["axle centres"] * 4
    for runout in found:
        assert runout.compensates
        assert runout.angles.toe.value == pytest.approx(TOE, abs=2e-7)
        assert runout.angles.camber.value == pytest.approx(CAMBER, abs=2e-7)
        # two scans a wheel: normals and centres both halve their variance
        spread = np.hypot(NORMAL_RAD, np.sqrt(2) * CENTRE_M / 1.5) / np.sqrt(2)
        assert runout.angles.toe.u == pytest.approx(spread, rel=0.02)
        assert runout.angles.camber.u == pytest.approx(spread, rel=0.02)
    for wheel, runout in zip(result.wheels, found, strict=False):
        assert wheel.compensated
        assert wheel.angles.toe_rad == pytest.approx(runout.angles.toe.value, abs=1e-15)
        assert wheel.angles.camber_rad == pytest.approx(runout.angles.camber.value, abs=1e-15)
        assert wheel.u_toe_rad == pytest.approx(runout.angles.toe.u, rel=1e-9)
        assert wheel.u_camber_rad == pytest.approx(runout.angles.camber.u, rel=1e-9)
        # that of the target as mounted stands beside: 0.4 degrees of axial run-out
        assert abs(wheel.plate.angles.toe_rad - TOE) > 0.5 * WOBBLE[0]
    skewed = [wheel_angles(result.plates.frame, r.axis, r.wheel).toe_rad for r in found]
    assert max(abs(toe - TOE) for toe in skewed) > 1e-3  # targets 3 mm off, over the track


def true_clock(wheel, off):
    """Direction of an offset across the axle, in the car's own axes."""
    fore, top = across_axle(wheel, TOE, CAMBER)
    ahead, _, up = off[0] * fore + off[1] * top
    return np.arctan2(ahead, up)


def test_clock_angles_are_in_the_frame_that_is_named():
    """Exact scans of targets 3 mm off centre: their own frame is pitched by a milliradian."""
    exact = all_round(10, 0.0, ECCENTRIC)
    for found, off in zip(exact.measure().runouts, ECCENTRIC, strict=True):
        assert found.frame == "axle centres"
        assert found.axial_clock.value == pytest.approx(true_clock(found.wheel, WOBBLE), abs=3e-5)
        assert found.radial_clock.value == pytest.approx(true_clock(found.wheel, off), abs=3e-5)


@pytest.mark.parametrize("turns", [HALF, QUARTERS])
def test_errors_of_clock_angles_are_as_large_as_stated(turns):
    rows = []
    for i in range(60):
        u_turn = 0.02
        wheel = "FL" if i % 2 else "RR"
        jitter = u_turn * np.random.default_rng([i, 3]).normal(size=len(turns))
        scene = Scene(400 + i).references()
        found = one(scene, wheel, turns + jitter, stated=turns, u_turn=u_turn)
        rows.append([
            (clock.value - true_clock(wheel, off)) / clock.u
            for clock, off in ((found.axial_clock, WOBBLE), (found.radial_clock, OFF))
        ])  # fmt: skip
        tangential = found.radial_runout.u / found.radial_runout.value
        assert found.radial_clock.u > 0.5 * tangential
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(rows)) / len(rows)
    means = np.mean(np.square(rows), axis=0)
    assert np.all((low < means) & (means < high))


@pytest.mark.slow
def test_errors_in_the_frame_of_the_axles_are_as_large_as_stated():
    rows = []
    for seed in range(40):
        result = all_round(200 + seed, 1.0, ECCENTRIC).measure()
        for runout in result.runouts:
            if result.complete:
                known = runout.angles
                rows.append([(known.toe.value - TOE) / known.toe.u,
                             (known.camber.value - CAMBER) / known.camber.u])  # fmt: skip
    count = len(rows) / 2  # wheels share the frame
    low, high = stats.chi2.ppf([0.0005, 0.9995], count) / count
    means = np.mean(np.square(rows), axis=0)
    assert np.all((low < means) & (means < high))


def test_one_wheel_that_moved_keeps_its_target_and_the_others_their_axles():
    scene = all_round(11, 1.0, ECCENTRIC)
    last = scene.seen[-1]
    n = last.fitted.normal
    target = replace(last.fitted, centre_m=last.fitted.centre_m + 1e-3 * n)
    scene.seen[-1] = replace(last, evidence=replace(last.evidence, target=target))
    result = scene.measure()
    assert result.runouts[-1].status == "moved"
    assert not result.complete
    assert [wheel.compensated for wheel in result.wheels[:4]] == [True, True, True, False]
    assert {runout.frame for runout in result.runouts} == {"axle and plate centres"}
    target = result.wheels[3].observation.fitted
    np.testing.assert_allclose(np.abs(result.wheels[3].normal), np.abs(target.normal), atol=1e-15)
    assert result.wheels[3].plate.angles != result.wheels[3].angles  # in another frame


def test_a_plate_that_shows_its_turn_tells_it():
    """The cost of a badly stated angle for two positions is gone; other periods are reported."""
    loose, scene = np.radians(3.0), {"noise": 0.0, "u_turn": 7.5e-5}
    shown = HALF + np.array([0.0, 0.05])
    found = one(Scene(4, **scene).references(), u_turn=loose, stated=shown)
    sure = one(Scene(4, noise=0.0).references(), u_turn=1e-4)
    assert (found.status, found.dof) == ("ok", 5 * 2 - 9 + 1)
    assert found.angles.toe.value == pytest.approx(TOE, abs=1e-8)
    assert np.diff(found.turns_rad) == pytest.approx(np.pi, abs=1e-4)
    assert found.angles.toe.u == pytest.approx(sure.angles.toe.u, rel=0.01)
    assert found.angles.camber.u == pytest.approx(sure.angles.camber.u, rel=0.01)
    disc = one(Scene(4, noise=0.0).references(), u_turn=loose, stated=shown)
    assert abs(disc.angles.toe.value - TOE) + abs(disc.angles.camber.value - CAMBER) > 1e-4
    wrong = one(Scene(4, **scene).references(), stated=HALF + np.array([0.0, np.radians(30.0)]))
    assert (wrong.status, "angle_deg is wrong" in wrong.reason) == ("moved", True)
    slipped = one(Scene(4, **scene).references(), stated=HALF + np.array([0.0, 0.1]))
    assert slipped.status == "moved"


def test_a_reference_that_does_not_stand_as_the_run_out_is_not_compensated():
    """Steered by 0.3 degrees, or lifted by 5 mm, or its target mounted anew."""
    lifted, still = (0.0, 0.0, 0.005), {"wobble": WOBBLE, "eccentric_m": OFF}
    for changed, more in (
        (still, {"toe": TOE + 0.005}),
        (still, {"moves": [lifted]}),
        (still | {"wobble": (0.0, 0.0)}, {}),
    ):
        scene = Scene(12).references()
        mounted(scene, "FL", **changed, **more)
        result = rolled(scene, "FL", HALF, **still).measure()
        (found,) = result.runouts
        assert (found.status, found.compensates) == ("moved", False)
        assert "reference scan one of the run-out" in found.reason
        assert (result.plates, result.wheels[3].compensated) == (None, False)
