"""Verticals: camber, caster and SAI from the floor or gravity, with their uncertainty."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from tests.support.turning import (
    NOWHERE,
    WHEELS,
    Scene,
    facing,
    kingpin,
    mounted,
    rolled,
    side,
    swept,
)
from wheelplane.capture.vertical import StatedVertical
from wheelplane.cli import cli
from wheelplane.config import InstrumentConfig
from wheelplane.errors import InputError
from wheelplane.kinematics.solve import solve
from wheelplane.measurement.assumptions import notes_of_assumptions
from wheelplane.measurement.estimates import joint_covariance, vertical_tilts
from wheelplane.measurement.evaluate import (
    _notes_of_floor,
    align,
    check_by_monte_carlo,
    find_verticals,
)
from wheelplane.measurement.quantities import by_name
from wheelplane.report.json.measurement import to_tree
from wheelplane.targets.registry import load_target
from wheelplane.vehicle.vertical import Floor
from wheelplane_synth.output.whole import write_whole

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
STEERS = np.radians([-20.0, -10.0, 0.0, 10.0, 20.0])
UP = np.array([0.004, 0.003, 1.0]) / np.linalg.norm([0.004, 0.003, 1.0])  # ahead, left, up
U = 2e-4
TOE, CAMBER, CASTER, SAI = 0.002, -0.012, 0.07, 0.2


def scene(seed, noise=1.0, rolls=()):
    found = Scene(seed, noise=noise, centre_m=3e-4).references(dict.fromkeys(WHEELS, (TOE, CAMBER)))
    for wheel in ("FR", "FL"):
        swept(found, wheel, CASTER, SAI, STEERS, camber=CAMBER)
    for wheel in rolls:
        plate = {
            "wobble": (0.004, 0.002),
            "eccentric_m": (0.001, 0.002),
            "camber": CAMBER,
            "toe": TOE,
        }
        rolled(mounted(found, wheel, **plate), wheel, np.array([0.0, np.pi]), u_turn=1e-3, **plate)
    return found


def measured(made, wanted="gravity", up=UP, u=U):
    """Measure with gravity as it is stated: off by what is drawn from its u."""
    rng = np.random.default_rng([made.seed, 5])
    shown = made.R.apply(up + made.noise * u * rng.normal(size=3))
    shown = tuple((shown / np.linalg.norm(shown)).tolist())
    stated = StatedVertical("gravity", shown, u, "gravity = [...]", "the way in which things fall")
    return solve(align(made.seen, NOWHERE, (), find_verticals((stated,), wanted, "test")))


def true_angles(wheel):
    """Camber, caster and SAI from `UP`, by vectors."""
    camber = np.pi / 2 - np.arccos(-facing(wheel, TOE, CAMBER) @ UP)
    axis = kingpin(wheel, CASTER, SAI)
    ahead = np.array([1.0, 0.0, 0.0]) - UP[0] * UP
    ahead /= np.linalg.norm(ahead)
    left = np.cross(UP, ahead)
    return camber, np.arctan2(-axis @ ahead, axis @ UP), np.arctan2(
        -side(wheel) * axis @ left, axis @ UP)  # fmt: skip


@pytest.mark.parametrize("rolls", [(), WHEELS])
def test_exact_scans_give_the_angles_from_gravity(rolls):
    found = measured(scene(1, noise=0.0, rolls=rolls))
    plain = scene(1, noise=0.0, rolls=rolls).measure()
    axes = {axis.wheel: axis for axis in found.steering_axes}
    for before, wheel in zip(plain.wheels[:4], found.wheels, strict=False):
        camber, caster, inclination = true_angles(wheel.wheel)
        assert wheel.angles.camber_rad == pytest.approx(camber, abs=1e-7)
        assert abs(wheel.angles.camber_rad - before.angles.camber_rad) > 0.002
        assert wheel.angles.toe_rad == before.angles.toe_rad
        iso = np.arctan(np.tan(camber) / np.cos(TOE))
        assert wheel.angles.camber_iso_rad == pytest.approx(iso, abs=1e-7)
        if wheel.wheel in axes:
            assert axes[wheel.wheel].caster.value == pytest.approx(caster, abs=1e-7)
            assert axes[wheel.wheel].inclination.value == pytest.approx(inclination, abs=1e-7)
    for runout in found.runouts:
        assert runout.angles.camber.value == pytest.approx(true_angles(runout.wheel)[0], abs=1e-7)
    aside, ahead = vertical_tilts(found, found.verticals[0])
    assert np.tan([aside.value, ahead.value]) == pytest.approx(UP[[1, 0]] / UP[2], abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("rolls", [(), WHEELS])
def test_errors_are_as_large_as_stated(rolls):
    """Camber, caster, SAI of both sides jointly: gravity's error is shared by all."""
    squares, count = [], 30
    for seed in range(count):
        found = measured(scene(40 + seed, rolls=rolls))
        axes, known = {axis.wheel: axis for axis in found.steering_axes}, by_name(found)
        sources, errors = [], []
        for wheel in ("FR", "FL"):
            camber, caster, inclination = true_angles(wheel)
            row, axis = known[f"{wheel}.camber"].row, axes[wheel]
            sources += [row, axis.caster, axis.inclination]
            errors += [found.uncertainty.values[row] - camber, axis.caster.value - caster,
                       axis.inclination.value - inclination]  # fmt: skip
        V = joint_covariance(found, sources)
        squares.append(np.array(errors) @ np.linalg.solve(V, errors))
    low, high = stats.chi2.ppf([0.0005, 0.9995], 6 * count) / count
    assert low < np.mean(squares) < high


def test_draws_agree_and_the_centres_of_the_frame_count_no_longer():
    found = measured(scene(2))
    drawn = check_by_monte_carlo(found, 20_000, 0).monte_carlo
    has = drawn.formula > 1e-9
    assert np.all(drawn.end_difference[has] < 0.09 * drawn.formula[has])  # 4.5 of their spread
    exact = measured(scene(2), u=0.0)
    plain = scene(2).measure()
    assert exact.wheels[0].u_camber_rad < 0.5 * plain.wheels[0].u_camber_rad
    cross = by_name(found)["front_cross_camber"].u
    assert cross == pytest.approx(2.0 * found.wheels[0].u_camber_rad, rel=0.1)


def test_the_default_is_unchanged_and_the_difference_is_noted():
    found, plain = measured(scene(3), "wheels"), scene(3).measure()
    assert found.vertical is None
    for one, other in zip(found.wheels, plain.wheels, strict=True):
        assert one.angles == other.angles
    notes = notes_of_assumptions(found, load_target("disc-250"), InstrumentConfig())
    assert notes[0].startswith("From gravity (gravity = [...]) against the normal")
    roll = np.degrees(UP[1]) * 60
    left, right = (float(x) for x in re.findall(r"camber (\S+)' .* left and (\S+)' ", notes[0])[0])
    assert left == pytest.approx(-roll, abs=2.0)
    assert right == pytest.approx(roll, abs=2.0)
    level = measured(scene(3), "wheels", up=np.array([0.0, 0.0, 1.0]))
    notes = notes_of_assumptions(level, load_target("disc-250"), InstrumentConfig())
    assert not any(note.startswith("From gravity") for note in notes)
    tree = to_tree(found)
    assert tree["vertical_in_use"] == "wheels"
    assert to_tree(measured(scene(3)))["vertical_in_use"] == "gravity"
    (shown,) = tree["verticals"]
    assert shown["tilt_left_deg"] * 60 == pytest.approx(roll, abs=2.0)


@pytest.mark.parametrize("wanted", ["floor", "gravity"])
def test_what_is_not_known_is_refused(wanted):
    made = scene(4)
    with pytest.raises(InputError, match=f"--vertical {wanted}: .*{wanted} = "):
        solve(align(made.seen, NOWHERE, (), find_verticals((), wanted, "test")))
    with pytest.raises(InputError, match="180° off the wheels' upright: give the way"):
        measured(replace(made, noise=0.0, seen=made.seen), up=-UP)


RISE_M = 0.003


@pytest.mark.slow
def test_three_millimetres_of_loaded_radius_are_seven_minutes_of_camber(tmp_path):
    """A car in its bay, whose left tyres lift their wheels 3 mm more."""
    saloon = (CONFIGS / "vehicles" / "saloon.toml").read_text()
    (tmp_path / "saloon.toml").write_text(
        saloon.replace("[body]", f"[body]\nleft_rise_m = {RISE_M}")
    )
    scanner = (CONFIGS / "scanners" / "default.toml").read_text()
    for key, value in (("window_deg", 120.0), ("lowest_deg", -40.0), ("highest_deg", 0.0),
                       ("range_sigma_m", 0.0002)):  # fmt: skip
        scanner = re.sub(f"{key} = .*", f"{key} = {value}", scanner)
    (tmp_path / "narrow.toml").write_text(scanner)
    truth = write_whole(
        tmp_path / "car",
        seed=4,
        vehicle=tmp_path / "saloon.toml",
        scanner=tmp_path / "narrow.toml",
        target=CONFIGS / "targets" / "disc-250.toml",
        points=1_000_000,
    ).to_json()
    front = ",".join(f"{x:.3f}" for x in truth["frame"]["forward"])
    command = ["measure", str(tmp_path / "car" / "vehicle.ply"), "--target", "disc-250"]
    command += [f"--front={front}", "--json"]
    trees = {}
    for vertical in ("wheels", "floor"):
        result = CliRunner().invoke(cli, [*command, "--vertical", vertical])
        assert result.exit_code in (0, None), result.output
        trees[vertical] = json.loads(result.output)
    roll = np.degrees(np.arctan2(RISE_M, truth["frame"]["rear_track_m"]))
    assert 60 * roll == pytest.approx(6.9, abs=0.3)
    for found, plain, true in zip(
        trees["floor"]["wheels"], trees["wheels"]["wheels"], truth["wheels"], strict=True
    ):
        u = found["u_camber_deg"]
        sense = -1.0 if found["wheel"].endswith("L") else 1.0
        assert abs(found["camber_deg"] - true["camber_deg"] - sense * roll) < 4.0 * u
        assert 4.0 * u < 0.5 * roll  # zero would fail
        assert found["toe_deg"] == plain["toe_deg"]
    assert trees["floor"]["vertical_in_use"] == "floor"
    for tree in trees.values():
        (shown,) = tree["verticals"]
        off = abs(shown["tilt_left_deg"] - roll)
        assert off < 4.0 * shown["u_tilt_left_deg"]


@pytest.mark.parametrize(("higher_m", "noted"), [(0.049, False), (0.051, True), (-0.051, True)])
def test_a_wheel_that_stands_unlike_the_others_is_noted(higher_m, noted):
    above_m = 0.3 + higher_m * np.eye(4)[2]
    floor = Floor(np.zeros(2), 1e-8 * np.eye(2), 20, 0.3, above_m=above_m)
    notes = [str(note) for note in _notes_of_floor(floor)]
    low, high = sorted((300.0, 1e3 * (0.3 + higher_m)))
    said = [f"The wheel centres stand {low:.0f} to {high:.0f} mm above the floor"]
    assert [note[: len(said[0])] for note in notes] == (said if noted else [])
