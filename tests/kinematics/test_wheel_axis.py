"""The frame through the axles: what a plate's place on its wheel adds to a sweep, and its end."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tests.support.turning import (
    PLACES,
    WHEELS,
    Scene,
    across_axle,
    facing,
    leaning,
    rolled,
    side,
    swept,
)
from wheelplane.report.json.measurement import to_tree
from wheelplane.report.text.kinematics import steering_text

HALF = np.array([0.0, np.pi])
SWEEP = np.radians([-22.0, -20.0, -10.0, 0.0, 10.0, 20.0, 22.0])
CASTER, INCLINATION = np.radians(4.3), np.radians(12.4)
TOE, CAMBER = 0.003, -0.012
ECCENTRIC = {
    "RR": (0.002, 0.001),
    "RL": (-0.001, 0.002),
    "FR": (0.0, -0.002),
    "FL": (0.002, -0.001),
}
WOBBLE = {"RR": (0.004, 0.002), "RL": (0.001, -0.005), "FR": (-0.008, 0.003), "FL": (0.006, 0.004)}
SQUARE = ON_AXLE = dict.fromkeys(WHEELS, (0.0, 0.0))


def car(seed, noise, turned=WHEELS, wobble=WOBBLE, eccentric=ECCENTRIC, rolled_on=0.0):
    """A car whose wheels were turned, then swept from lock to lock, under plates clamped askew.

    rolled_on: by how much the front wheels rolled on between run-out and sweep, radians.
    """
    scene = Scene(seed, noise=noise)
    for wheel in WHEELS:
        fore, top = across_axle(wheel, TOE, CAMBER)
        centre = PLACES[wheel] + eccentric[wheel][0] * fore + eccentric[wheel][1] * top
        normal = leaning(wheel, TOE, CAMBER, wobble[wheel]).apply(facing(wheel, TOE, CAMBER))
        scene.look(wheel, "reference", wheel, centre, normal)
    for wheel in turned:
        rolled(scene, wheel, HALF, toe=TOE, camber=CAMBER, wobble=wobble[wheel],
               eccentric_m=eccentric[wheel], u_turn=1e-3, with_reference=True)  # fmt: skip
    for wheel in ("FR", "FL"):
        way = np.array([[np.cos(rolled_on), np.sin(rolled_on)],
                        [-np.sin(rolled_on), np.cos(rolled_on)]])  # fmt: skip
        plate = leaning(wheel, TOE, CAMBER, way @ wobble[wheel])
        steers = SWEEP + 0.4 * SWEEP**2 * (SWEEP * side(wheel) < 0) * side(wheel)
        swept(scene, wheel, CASTER, INCLINATION, steers, toe=TOE, camber=CAMBER, plate=plate,
              positions=[f"p{i}" for i in range(len(SWEEP))])  # fmt: skip
    return scene.measure()


def test_the_kingpin_counts_from_the_axles_where_run_outs_show_them():
    for found in car(1, 0.0).steering_axes:
        assert (found.status, found.frame) == ("ok", "axle centres")
        assert found.caster.value == pytest.approx(CASTER, abs=2e-7)
        assert found.inclination.value == pytest.approx(INCLINATION, abs=2e-7)
        assert found.lateral_offset.value == pytest.approx(0.12, abs=2e-7)
        assert found.longitudinal_offset.value == pytest.approx(-0.02, abs=2e-7)


@pytest.mark.parametrize("turned", [(), ("RL",)])
def test_plates_that_no_run_out_compensates_are_named(turned):
    result = car(1, 0.0, turned=turned)
    found = result.steering_axes
    frame = "axle and plate centres" if turned else "plate centres"
    assert [kingpin.frame for kingpin in found] == [frame] * 2
    assert to_tree(result)["steering"]["kingpins"][0]["frame"] == frame
    assert "target centres" in steering_text(result)
    worst = max(abs(kingpin.inclination.value - INCLINATION) for kingpin in found)
    assert worst > 0.5e-3 / 1.5  # millimetres over the track


def test_the_lean_of_the_plates_leaves_toe_out_alone():
    plain = car(2, 0.0, wobble=SQUARE, eccentric=ON_AXLE, turned=()).toe_out
    for found, true in zip(car(2, 0.0).toe_out, plain, strict=True):
        assert (found.status, found.of) == ("ok", "axles")
        assert found.difference.value == pytest.approx(true.difference.value, abs=2e-7)
    for found, true in zip(car(2, 0.0, turned=()).toe_out, plain, strict=True):
        assert found.of == "plates"
        assert abs(found.difference.value - true.difference.value) > 5e-4  # some of the lean


def test_a_wheel_that_rolled_on_is_not_taken_for_its_reference():
    assert [found.of for found in car(3, 1.0).toe_out] == ["axles"] * 2
    on = car(3, 1.0, rolled_on=np.radians(40.0)).toe_out
    assert [found.of for found in on] == ["plates"] * 2


@pytest.mark.slow
def test_errors_are_as_large_as_stated():
    rows = {"inclination": [], "caster": [], "toe-out": []}
    true = car(0, 0.0).toe_out[0].difference.value
    for seed in range(60):
        result = car(100 + seed, 1.0)
        (found, _) = result.steering_axes
        rows["inclination"].append((found.inclination.value - INCLINATION) / found.inclination.u)
        rows["caster"].append((found.caster.value - CASTER) / found.caster.u)
        left = result.toe_out[0]
        noise = np.sqrt(left.difference.u**2 - left.u_interpolation_rad**2)
        rows["toe-out"].append((left.difference.value - true) / noise)
    for errors in rows.values():
        low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], len(errors))
        assert low < np.sum(np.square(errors)) < high


def test_axles_of_two_scans_tell_the_frame_better_than_plates_of_one():
    by_plates, by_axles = (car(5, 0.0, turned=turned) for turned in ((), WHEELS))
    for one, two in zip(by_plates.steering_axes, by_axles.steering_axes, strict=True):
        assert two.caster.u < one.caster.u
        assert two.inclination.u < one.inclination.u
