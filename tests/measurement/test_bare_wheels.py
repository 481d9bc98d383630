"""Captures of bare wheels: angles, run-out from turned scans, notes, refusals."""

import re

import numpy as np
import pytest

from tests.support.round_wheels import MERIDIAN, vehicle_points, wheel_points, with_disc
from wheelplane.capture import CaptureOptions, open_capture
from wheelplane.config import Config
from wheelplane.errors import InputError
from wheelplane.measure import measure_capture
from wheelplane.uncertainty import coverage_factor

TOE, CAMBER, WOBBLE = np.radians([0.2, -1.0, 0.1])
CENTRES = {"RR": (0.0, -0.75), "RL": (0.0, 0.75), "FR": (2.6, -0.75), "FL": (2.6, 0.75)}


def outward(wheel, toe=TOE, camber=CAMBER):
    """Outward normal: x forward, y left, z up."""
    side = 1.0 if wheel.endswith("L") else -1.0
    level = np.array([np.sin(toe), side * np.cos(toe), 0.0])
    return np.cos(camber) * level - np.sin(camber) * np.array([0.0, 0.0, 1.0])


def wobbling(wheel, turn):
    """Direction of a rim tilted by WOBBLE against the spin axis, turned as it rolls forwards."""
    axis, side = outward(wheel), 1.0 if wheel.endswith("L") else -1.0
    first = np.cross([0.0, 0.0, 1.0], axis)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    off = np.cos(side * turn) * first + np.sin(side * turn) * second
    return np.cos(WOBBLE) * axis + np.sin(WOBBLE) * off


def write(folder, *, turns=(), target='[target]\nshape = "wheel"\n'):
    rng = np.random.default_rng(11)
    lines = [target, "[reference]"]
    more = []
    for wheel, (x, y) in CENTRES.items():
        for number, turn in enumerate(turns or (None,)):
            direction = outward(wheel) if turn is None else wobbling(wheel, np.radians(turn))
            points = wheel_points(rng, np.array([x, y, 0.3]), direction, count=40_000)
            name = f"{wheel.lower()}{number or ''}.npy"
            np.save(folder / name, points)
            lines += [f'{wheel} = "{name}"'] if number == 0 else []
            if turn is not None:
                more += ["[[runout]]", f'name = "{wheel} {number}"', f'wheel = "{wheel}"',
                         f'file = "{name}"', f"angle_deg = {turn}"]  # fmt: skip
    (folder / "capture.toml").write_text("\n".join([*lines, *more]) + "\n", encoding="utf-8")
    return folder


def measured(folder):
    with open_capture(folder) as capture:
        return measure_capture(capture, Config())


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return measured(write(tmp_path_factory.mktemp("plain")))


def test_toe_and_camber_lie_within_their_uncertainty(plain):
    for wheel in plain.wheels:
        k = 2.0 * coverage_factor(0.95, np.array([wheel.dof_toe]))[0]
        assert wheel.observation.fitted.method == "flange"
        assert abs(wheel.angles.toe_rad - TOE) < k * wheel.u_toe_rad
        assert abs(wheel.angles.camber_rad - CAMBER) < k * wheel.u_camber_rad
        assert wheel.u_toe_rad < np.radians(1.5 / 60.0)


def test_the_first_page_says_what_was_measured_and_what_is_not_included(plain):
    text = " ".join(plain.notes)
    assert "those of the rims" in text
    assert "level with the edge of the rim's flange" in text
    assert "run-out of RR, RL, FR and FL against the spin axis is not in the uncertainty" in text
    assert "as mounted" not in text
    assert "flatness" not in text


SMOOTH = MERIDIAN[(MERIDIAN[:, 0] < 0.228) | (MERIDIAN[:, 0] > 0.252)]  # no groove, no flange


def with_tyres(folder, *wheels):
    """The plain vehicle, some wheels without a flange."""
    write(folder)
    for wheel in wheels:
        x, y = CENTRES[wheel]
        place = np.array([x, y, 0.3])
        points = wheel_points(np.random.default_rng(12), place, outward(wheel), meridian=SMOOTH)
        np.save(folder / f"{wheel.lower()}.npy", points)
    return measured(folder)


def test_a_wheel_by_its_tyre_lies_level_with_the_flange_on_the_other_side(tmp_path, plain):
    """Its widest ring stands out by 11 mm, which would turn the centreline by 7'."""
    found = with_tyres(tmp_path, "RL")
    assert [w.observation.fitted.method for w in found.wheels] == [
        "flange",
        "tyre",
        *["flange"] * 2,
    ]
    off = found.wheels[1].pose.centre_m - np.array([*CENTRES["RL"], 0.3])
    along = np.sqrt(outward("RL") @ found.wheels[1].pose.covariance[3:, 3:] @ outward("RL"))
    assert abs(off @ outward("RL")) < 2.0 * along
    assert along < 0.003
    (note,) = (note for note in found.notes if "in the scan of RL: its axis" in note)
    assert "is carried 1" in note
    assert "(u 1.5 mm)" in note


def test_an_axle_of_tyres_lies_level_with_its_tyres(tmp_path):
    found = with_tyres(tmp_path, "RR", "RL")
    for wheel in found.wheels[:2]:
        name = wheel.observation.name
        off = wheel.pose.centre_m - np.array([*CENTRES[name], 0.3])
        assert abs(off @ outward(name) - 0.011) < 0.001
    assert "scans of RR and RL: their axes are those of the tyres" in " ".join(found.notes)


def test_a_stated_run_out_is_in_the_uncertainty(tmp_path, plain):
    stated = '[target]\nshape = "wheel"\nrim = "17in"\nrim_runout = 0.0005\n'
    found = measured(write(tmp_path, target=stated))
    assert "rim_runout" not in " ".join(found.notes)
    tilt = 0.00025 / np.sqrt(2.0) / (17.0 * 0.0254 / 2.0 + 0.0175)
    for one, other in zip(found.wheels, plain.wheels, strict=True):
        added = one.u_camber_rad**2 - other.u_camber_rad**2
        assert abs(np.sqrt(added) - tilt) < 0.15 * tilt


@pytest.mark.slow
def test_turned_scans_give_the_spin_axis(tmp_path):
    found = measured(write(tmp_path, turns=(0.0, 120.0, 240.0)))
    for wheel in found.wheels[:4]:
        assert wheel.compensated
        assert abs(wheel.angles.toe_rad - TOE) < 0.2 * WOBBLE
        assert abs(wheel.angles.camber_rad - CAMBER) < 0.2 * WOBBLE
    assert all(abs(one.axial_runout.value - WOBBLE) < 0.2 * WOBBLE for one in found.runouts)
    assert "not in the uncertainty" not in " ".join(found.notes)


def cloud(folder, centres, axes):
    points = vehicle_points(np.random.default_rng(12), centres, axes)
    np.save(folder / "car.npy", points)
    text = 'cloud = "car.npy"\nfront = [1.0, 0.0, 0.0]\n[target]\nshape = "wheel"\n'
    (folder / "capture.toml").write_text(text, encoding="utf-8")
    return folder


def test_wheels_in_one_cloud_of_the_vehicle_are_found_named_and_measured(tmp_path):
    centres = [(x, y, 0.32) for x, y in CENTRES.values()]
    found = measured(cloud(tmp_path, centres, [outward(name) for name in CENTRES]))
    for wheel in found.wheels:
        assert np.linalg.norm(wheel.pose.centre_m[:2] - CENTRES[wheel.observation.name]) < 0.03
        k = 2.0 * coverage_factor(0.95, np.array([wheel.dof_toe]))[0]
        assert abs(wheel.angles.toe_rad - TOE) < k * wheel.u_toe_rad
        assert abs(wheel.angles.camber_rad - CAMBER) < k * wheel.u_camber_rad
    assert "those of the rims" in " ".join(found.notes)


DISCS = ("RR", "RL")
OFF_M, TILT = 0.08, np.radians(0.5)


def mixed(folder, own):
    """Cloud of a car with discs on the rear axle, tilted in toe by TILT; front wheels bare."""
    rng = np.random.default_rng(13)
    centres = [np.array([x, y, 0.32]) for x, y in CENTRES.values()]
    axes = [outward(name) for name in CENTRES]
    points = vehicle_points(rng, centres, axes)
    for wheel, centre, axis in zip(CENTRES, centres, axes, strict=True):
        if wheel in DISCS:
            points = with_disc(rng, points, centre, axis, outward(wheel, TOE + TILT), OFF_M)
    np.save(folder / "car.npy", points)
    disc = '{ shape = "disc", diameter = 0.25, stand_off = 0.08, stand_off_u = 0.0005 }'
    lines = ['cloud = "car.npy"', "front = [1.0, 0.0, 0.0]", 'target = "wheel"', "[targets]"]
    lines += [f"{wheel} = {disc}" for wheel in own]
    (folder / "capture.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.mark.slow
def test_one_cloud_shows_targets_on_some_wheels_and_none_on_others(tmp_path):
    found = measured(mixed(tmp_path, DISCS))
    for wheel in found.wheels:
        name = wheel.observation.name
        on_disc = name in DISCS
        assert wheel.observation.fitted.method in (("rim", "outline") if on_disc else ("flange",))
        assert np.linalg.norm(wheel.pose.centre_m[:2] - CENTRES[name]) < 0.03
        k = 2.0 * coverage_factor(0.95, np.array([wheel.dof_toe]))[0]
        assert abs(wheel.angles.toe_rad - TOE - TILT * on_disc) < k * wheel.u_toe_rad
        assert abs(wheel.angles.camber_rad - CAMBER) < k * wheel.u_camber_rad
    assert [w.observation.target.shape for w in found.wheels] == ["disc", "disc", "wheel", "wheel"]


@pytest.mark.slow
def test_chosen_points_are_those_of_each_wheels_own_target(tmp_path):
    folder = mixed(tmp_path, DISCS)
    with open_capture(folder) as capture:
        plain = measure_capture(capture, Config())
    chosen = {name: (x + 0.03, 1.05 * y, 0.33) for name, (x, y) in CENTRES.items()}
    with open_capture(folder, options=CaptureOptions(hints=chosen)) as capture:
        found = measure_capture(capture, Config())
    for one, other in zip(found.wheels, plain.wheels, strict=True):
        assert np.linalg.norm(one.pose.centre_m - other.pose.centre_m) < 0.002
        assert one.observation.target == other.observation.target


@pytest.mark.slow
def test_a_target_where_none_is_mounted_is_refused_with_a_list(tmp_path):
    line = r"FR shows a wheel, and not a disc .* as stated, at \(2\.[56].*target 4 at .*--front"
    with pytest.raises(InputError, match=line):
        measured(mixed(tmp_path, ("FR", "FL")))


@pytest.mark.slow
def test_two_clouds_of_a_vehicle_that_rolled_give_the_spin_axes(tmp_path):
    yaw = np.radians(3.0)
    heading = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    for number, turn in enumerate((0.0, np.pi)):
        moved = heading if number else np.eye(3)
        centres = [moved @ (x, y, 0.32) + [0.9 * number, 0, 0] for x, y in CENTRES.values()]
        axes = [moved @ wobbling(wheel, turn) for wheel in CENTRES]
        points = vehicle_points(np.random.default_rng(14 + number), centres, axes)
        np.save(tmp_path / f"{number}.npy", points)
    text = 'cloud = "0.npy"\nfront = [1.0, 0.0, 0.0]\ntarget = "wheel"\n'
    more = '[[runout]]\nname = "rolled"\nfile = "1.npy"\nangle_deg = 180.0\nu_angle_deg = 3.0\n'
    (tmp_path / "capture.toml").write_text(text + more, encoding="utf-8")
    found = measured(tmp_path)
    names = [wheel.observation.name for wheel in found.wheels]
    assert names == [*CENTRES, *(f"{wheel} rolled" for wheel in CENTRES)]
    assert set(found.provenance.inputs) == {"0.npy", "1.npy"}
    for wheel, plate in zip(found.wheels[:4], found.plates.wheels, strict=False):
        assert wheel.compensated
        k = 2.0 * coverage_factor(0.95, np.array([wheel.dof_toe]))[0]
        for name, true in (("toe", TOE), ("camber", CAMBER)):
            u = getattr(wheel, f"u_{name}_rad")
            assert abs(getattr(wheel.angles, f"{name}_rad") - true) < k * u
            assert u < np.radians(1.5 / 60.0)
        off = [plate.angles.toe_rad - TOE, plate.angles.camber_rad - CAMBER]
        assert np.hypot(*off) > 0.7 * WOBBLE
    us = [[w.u_camber_rad for w in one.wheels[:4]] for one in (found, found.plates)]
    assert np.sqrt(np.mean(np.square(us[0]))) < 0.9 * np.sqrt(np.mean(np.square(us[1])))
    assert "not in the uncertainty" not in " ".join(found.notes)


def with_axles(folder, *more_m):
    """Cloud of a car with further axles, each at a place along it."""
    further = [(x, y) for x in more_m for y in (-0.75, 0.75)]
    centres = [(x, y, 0.32) for x, y in [*CENTRES.values(), *further]]
    return cloud(
        folder, centres, [outward(name) for name in [*CENTRES, *["RR", "RL"] * len(more_m)]]
    )


@pytest.mark.slow
def test_of_two_rear_axles_the_one_nearer_to_the_front_is_measured_and_the_other_named(tmp_path):
    found = measured(with_axles(tmp_path, -1.1))
    for wheel in found.wheels:
        assert np.linalg.norm(wheel.pose.centre_m[:2] - CENTRES[wheel.observation.name]) < 0.03
    (note,) = (note for note in found.notes if "more than two axles" in note)
    assert len(re.findall(r"at \(-1\.(1|09)", note)) == 2


@pytest.mark.slow
def test_axles_that_do_not_show_which_are_the_vehicle_s_are_refused_with_a_list(tmp_path):
    line = r"6 targets found, on axles .* target 6 at \(.*add --front-point"
    with pytest.raises(InputError, match=line):
        measured(with_axles(tmp_path, -2.9))


@pytest.mark.slow
def test_of_two_vehicles_the_one_with_its_front_at_a_stated_point_is_measured(tmp_path):
    own = [(x, y, 0.32) for x, y in CENTRES.values()]
    other = [(x - 1.3, y - 3.2, z) for x, y, z in own]
    folder = cloud(tmp_path, [*other, *own], [outward(name) for name in [*CENTRES, *CENTRES]])
    with pytest.raises(InputError, match=r"8 targets found, on 2 vehicles .* add --front-point"):
        measured(folder)
    options = CaptureOptions(front_point=(3.4, 0.2, 0.5))
    with open_capture(folder, options=options) as capture:
        found = measure_capture(capture, Config())
    for wheel in found.wheels:
        assert np.linalg.norm(wheel.pose.centre_m[:2] - CENTRES[wheel.observation.name]) < 0.03
    assert "Like the target, but at none of the vehicle's wheels" in " ".join(found.notes)


@pytest.mark.slow
def test_three_wheels_are_refused_with_a_list(tmp_path):
    centres = [(x, y, 0.32) for x, y in list(CENTRES.values())[:3]]
    with pytest.raises(InputError, match=r"3 targets found, four are needed: target 1 at"):
        measured(cloud(tmp_path, centres, [outward(name) for name in list(CENTRES)[:3]]))


def test_a_scan_without_a_wheel_is_refused(tmp_path):
    folder = write(tmp_path)
    flat = np.random.default_rng(1).random((20_000, 3)) * [1.0, 1.0, 0.001]
    np.save(folder / "fl.npy", flat)
    with pytest.raises(InputError, match=r"FL was not measured \((wheel-not-found|too-few-points)"):
        measured(folder)
