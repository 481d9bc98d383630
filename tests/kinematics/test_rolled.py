"""Wheels of a vehicle that has rolled, against their axles; rigid-body geometry alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.kinematics.test_runout import ECCENTRIC, all_round
from tests.support.turning import NOWHERE, PLACES, WHEELS, Scene, facing, side
from wheelplane.capture.entry import Turn
from wheelplane.centre.on_wheel import MOST_M
from wheelplane.errors import InputError
from wheelplane.kinematics.rolled import carried
from wheelplane.kinematics.solve import solve
from wheelplane.measurement import Vertical, align
from wheelplane.targets import load_target
from wheelplane.uncertainty import UncertaintyComponent

HALF = (0.0, np.pi)
MINUTE = np.radians(1.0 / 60.0)
WOBBLE, OFF_M = 12.0 * MINUTE, 0.001


def rolled(seed, turns=HALF, stated=None, u_deg=1.0, **given):
    """A car at several rotations of its wheels, standing otherwise in each; and the true angles."""
    scene, rng = Scene(seed, **given), np.random.default_rng([seed, 11])
    truth, clocks = {}, rng.uniform(0.0, 2.0 * np.pi, (4, 2))
    for wheel in WHEELS:
        truth[wheel] = np.radians(rng.uniform((-0.5, -2.0), (0.5, 1.0)))
    for number, turn in enumerate(turns):
        if number:  # it stands elsewhere, and heads elsewhere
            scene.R = scene.R * Rotation.from_euler("zyx", rng.normal(0.0, [2.0, 0.3, 0.3]), True)
            scene.shift = scene.shift + rng.uniform(-1.0, 1.0, 3)
        for wheel, (tilt, aside) in zip(WHEELS, clocks, strict=True):
            axis = facing(wheel, *truth[wheel])
            first = np.cross([0.0, 0.0, 1.0], axis)
            first /= np.linalg.norm(first)
            across = np.stack([first, np.cross(axis, first)])
            own = turn if np.isscalar(turn) else turn[WHEELS.index(wheel)]
            at = np.array([tilt, aside]) + side(wheel) * own
            off, shift = np.column_stack([np.cos(at), np.sin(at)]) @ across
            normal = np.cos(WOBBLE) * axis + np.sin(WOBBLE) * off
            centre = np.array(PLACES[wheel]) + OFF_M * shift
            angle = (stated or turns)[number]
            pose = Turn(f"{number}", angle, np.radians(u_deg)) if number else None
            name, role = (f"{wheel} {number}", "runout") if number else (wheel, "reference")
            scene.look(name, role, wheel, centre, normal, turn=pose)
    return scene, truth


def measured(scene):
    return solve(align(carried(scene.seen, "test"), NOWHERE))


def errors(found, truth):
    """Errors (4, 2) of toe and camber, and their standard uncertainties."""
    angles = [(w.angles.toe_rad, w.angles.camber_rad) for w in found.wheels[:4]]
    u = [(w.u_toe_rad, w.u_camber_rad) for w in found.wheels[:4]]
    return np.array(angles) - np.array([truth[wheel] for wheel in WHEELS]), np.array(u)


@pytest.mark.parametrize("turns", [HALF, (0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0)])
def test_run_out_of_targets_and_frame_cancels_wherever_the_vehicle_stands(turns):
    for seed in range(5):
        scene, truth = rolled(seed, turns, noise=0.0)
        found = measured(scene)
        off, _ = errors(found, truth)
        before, _ = errors(found.plates, truth)
        assert np.abs(off).max() < 0.05 * MINUTE  # of second order
        assert np.abs(before).max() > 5.0 * MINUTE
        assert all(wheel.compensated for wheel in found.wheels[:4])
        assert "means over" in " ".join(found.notes)


def test_errors_are_as_large_as_stated():
    """Noise alone, and with both scans' components, each at half its weight."""
    ratios, us = [], []
    for seed in range(100):
        scene, truth = rolled(seed, normal_rad=1e-4)
        off, u = errors(measured(scene), truth)
        ratios.append(off / u)
        us.append(u)
    square = np.mean(np.square(ratios))
    assert 0.8 < square < 1.25  # 800 values, shared frames: some 0.08 of scatter
    assert np.mean(us) < 0.85e-4  # one scan alone: 1e-4 and more


def test_rotations_that_are_not_as_stated_count():
    ratios = []
    for seed in range(100):
        rng = np.random.default_rng([seed, 12])
        turns = (0.0, tuple(np.pi + np.radians(6.0) * rng.normal(size=4)))
        scene, truth = rolled(seed, turns, HALF, 6.0, noise=0.0, normal_rad=1e-9, centre_m=1e-9)
        off, u = errors(measured(scene), truth)
        ratios.append(off / u)
    assert 0.75 < np.mean(np.square(ratios)) < 1.3


def test_what_is_left_of_a_first_harmonic_counts():
    """160 degrees instead of 180, known: of the run-out a share stays, which u states."""
    turns = (0.0, np.radians(160.0))
    ratios = []
    for seed in range(60):
        scene, truth = rolled(seed, turns, noise=0.0, u_deg=0.1)
        off, u = errors(measured(scene), truth)
        ratios.append(off / u)
    assert 0.5 < np.mean(np.square(ratios)) < 1.5


def test_a_stated_mounting_turns_with_the_wheel_and_is_not_in_the_mean():
    tilt = UncertaintyComponent("clamp", np.vstack([0.01 * np.eye(3), np.zeros((3, 3))]))
    scene, _ = rolled(1)
    plain = measured(scene).wheels[0].u_toe_rad
    scene, _ = rolled(1, noise=0.0, extra=(tilt,))
    found = measured(scene)
    assert found.wheels[0].u_toe_rad == pytest.approx(plain, rel=0.01)
    assert found.plates.wheels[0].u_toe_rad > 0.009


def test_tyre_run_out_turns_with_the_wheel_whatever_its_degrees_of_freedom():
    """A flatness that a fit observed in each scan stays in the mean."""
    u = {}
    for name in ("tyre run-out", "flatness"):
        tilt = np.vstack([0.002 * np.eye(3), np.zeros((3, 3))])
        scene, _ = rolled(1, noise=0.0, extra=(UncertaintyComponent(name, tilt, dof=6.0),))
        u[name] = measured(scene).wheels[0].u_toe_rad
    scene, _ = rolled(1, noise=0.0)
    assert u["tyre run-out"] == pytest.approx(measured(scene).wheels[0].u_toe_rad, rel=0.01)
    assert u["flatness"] > 0.001


@pytest.mark.parametrize(("name", "left"), [("stand-off", 1.0), ("centre", 0.5**0.5)])
def test_what_is_of_the_plate_is_not_less_in_the_mean(name, left):
    """The same plate stands off the wheel in all positions; what is of a scan is drawn anew."""
    ratios = []
    for seed in range(5):
        aside = Scene(seed).R.apply([0.0, 0.005, 0.0])
        component = UncertaintyComponent(name, np.append(np.zeros(3), aside)[:, None])
        scene, _ = rolled(seed, noise=0.0, normal_rad=1e-9, centre_m=1e-9, extra=(component,))
        found = measured(scene)
        mean, one = (each.uncertainty.vehicle_standard for each in (found, found.plates))
        ratios.append(mean["rear_track"] / one["rear_track"])
    np.testing.assert_allclose(ratios, left, rtol=0.02)


@pytest.mark.parametrize("scene", [rolled(3)[0], all_round(3, 1.0, ECCENTRIC)])
def test_what_an_unlike_target_stands_off_by_is_as_uncertain_without_run_out(scene):
    """A disc on RR and bare wheels beside: no rotation of the wheels shows its stand-off."""
    targets = {wheel: load_target("disc-250" if wheel == "RR" else "wheel") for wheel in WHEELS}
    scene.seen = [replace(one, target=targets[one.wheel]) for one in scene.seen]
    found = measured(scene)
    assert all(wheel.compensated for wheel in found.wheels[:4])
    for name in ("rear_track", "centreline_angle"):
        u, of_plates = (each.uncertainty.vehicle_standard[name] for each in (found, found.plates))
        assert u == pytest.approx(of_plates, rel=0.02)
    track = found.uncertainty.vehicle_standard["rear_track"]
    assert track == pytest.approx(MOST_M / np.sqrt(3.0), rel=0.01)


@pytest.mark.parametrize(
    ("turns", "line"),
    [
        ((0.0, np.pi / 2.0), r"rolled to 0°, 90°, from which .* by half a turn"),
        ((0.0, 0.1, 0.2), r"rolled to 0°, 6°, 11°, from which"),
    ],
)
def test_positions_without_half_a_turn_are_refused(turns, line):
    with pytest.raises(InputError, match=line):
        measured(rolled(2, turns)[0])


def test_a_wheel_that_steered_or_was_not_measured_is_refused():
    scene, _ = rolled(3)
    steered = facing("FL", np.radians(5.0), 0.0)
    scene.seen.pop()
    scene.look("FL 1", "runout", "FL", PLACES["FL"], steered, turn=scene.seen[-1].turn)
    with pytest.raises(InputError, match=r"FL 1: it stands \d\.\d° otherwise than before"):
        measured(scene)
    scene, _ = rolled(3)
    scene.seen[-1] = type(scene.seen[-1])(
        "FL 1", "runout", "FL", "x.ply", "", 1, 0, turn=scene.seen[-1].turn, status="no-target"
    )
    with pytest.raises(InputError, match=r"FL 1 was not measured \(no-target\): .*scan 1 again"):
        measured(scene)


def test_another_vertical_is_refused():
    scene, _ = rolled(4)
    up = Vertical("gravity", scene.R.apply([0.0, 0.0, 1.0]), (), "test")
    found = align(carried(scene.seen, "test"), NOWHERE, (), lambda *_: (up, (up,)))
    with pytest.raises(InputError, match="--vertical gravity with positions of a rolled vehicle"):
        solve(found)
