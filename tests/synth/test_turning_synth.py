"""Made sweeps and run-outs: rigid bodies about the axis that truth.json states, and measured so."""

import json

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests.support.made import DISC, IDEAL, changed
from tests.support.paths import CONFIGS
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.parameters.parameters import Sweep, VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.scene.target import Mount
from wheelplane_synth.vehicle.rolling import draw_runouts
from wheelplane_synth.vehicle.steering import draw_kingpin, swept, toe_out
from wheelplane_synth.vehicle.turning import draw_turning
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel

RECIPE = read_recipe(CONFIGS / "vehicles" / "saloon-turning.toml", VehicleFile)


def made(seed, positions=5):
    rng = np.random.default_rng(seed)
    car = draw_vehicle(RECIPE, rng)
    wheels = [draw_wheel(car, RECIPE, name, rng) for name in WHEELS]
    pins = [draw_kingpin(car, wheels[i], RECIPE, rng) for i in (2, 3)]
    sweep = Sweep(positions=positions)
    return car, wheels, pins, sweep, swept(wheels, pins, sweep, car)


def test_a_sweep_turns_each_wheel_about_the_axis_that_was_set():
    for seed in range(5):
        _, wheels, pins, _, scans = made(seed)
        for pin in pins:
            rest = next(w for w in wheels if w.name == pin.wheel)
            lean = np.degrees(np.arctan2(pin.axis[:2], pin.axis[2]))
            assert -lean[0] == pytest.approx(pin.stated.caster_deg, abs=1e-9)
            assert -rest.side * lean[1] == pytest.approx(pin.stated.inclination_deg, abs=1e-9)
            for scan in (s for s in scans if s.wheel == pin.wheel):
                turn = scan.T_vehicle_target[:3, :3] @ rest.T_vehicle_target[:3, :3].T
                rotation = Rotation.from_matrix(turn).as_rotvec()
                off = np.linalg.norm(np.cross(rotation, pin.axis))
                assert off < 1e-8 + 1e-9 * np.linalg.norm(rotation)
                moved = pin.floor_point_m + turn @ (rest.centre_vehicle_m - pin.floor_point_m)
                np.testing.assert_allclose(scan.centre_vehicle_m, moved, atol=1e-12)


def test_the_axis_meets_the_floor_by_the_scrub_radius_inboard_of_the_tyre_s_middle_plane():
    for seed in range(5):
        car, wheels, pins, *_ = made(seed)
        for pin in pins:
            wheel = next(w for w in wheels if w.name == pin.wheel)
            inboard_m = wheel.stand_off_m + car.body.tyre_width_m / 2
            hub_m = wheel.centre_vehicle_m - inboard_m * wheel.normal_vehicle
            level = wheel.normal_vehicle @ [0.0, wheel.side, 0.0]
            aside_m = (hub_m - pin.floor_point_m) @ wheel.normal_vehicle / level
            assert aside_m == pytest.approx(pin.stated.scrub_m, abs=1e-12)
            assert pin.floor_point_m[2] == pytest.approx(car.floor_m)
            ahead = pin.axis / pin.axis[2] * (hub_m[2] - car.floor_m)
            assert pin.floor_point_m[0] + ahead[0] == pytest.approx(hub_m[0], abs=1e-12)


def test_steps_run_from_lock_to_lock_of_the_inner_wheel():
    _, wheels, _, sweep, scans = made(1)
    for wheel in wheels[2:]:
        toes = [np.degrees(s.toe_rad - wheel.toe_rad) for s in scans if s.wheel == wheel.wheel]
        inner = toes[-1] if wheel.side > 0 else toes[0]
        assert inner == pytest.approx(-sweep.lock_deg, abs=1e-6)
        assert np.all(np.diff(toes) * wheel.side < 0)  # to the left a left wheel loses toe


def test_toe_out_on_turns_is_that_of_ackermann():
    car, wheels, _, sweep, _ = made(2)
    for shown, inner, outer in zip(toe_out(wheels, sweep, car), (3, 2), (2, 3), strict=True):
        steer = np.radians(20.0) + wheels[inner].toe_rad
        ratio = car.axles.front_track_m / car.axles.wheelbase_m
        other = np.arctan(np.tan(steer) / (1.0 + ratio * np.tan(steer)))
        true = 20.0 - np.degrees(other + wheels[outer].toe_rad)
        assert shown["difference_deg"] == pytest.approx(true, abs=1e-9)


def test_a_run_out_rolls_forwards_and_keeps_the_axle():
    rng = np.random.default_rng(3)
    _, wheels, *_ = made(3)
    for rolled, wheel in zip(draw_runouts(RECIPE, WHEELS, rng), wheels, strict=True):
        (half,) = rolled.scans(wheel)
        np.testing.assert_allclose(half.normal_vehicle, wheel.normal_vehicle, atol=1e-12)
        assert half.toe_rad == wheel.toe_rad
        turn = half.T_vehicle_target[:3, :3] @ wheel.T_vehicle_target[:3, :3].T
        assert np.trace(turn) == pytest.approx(-1.0)  # half a turn
        mounted = rolled.on(Mount()).on(wheel)
        assert rolled.to_json(wheel, mounted)["wobble_deg"] == pytest.approx(0.5)


def test_the_run_out_stated_is_that_of_the_target_as_it_was_clamped():
    """Half of what normals and centres differ by, half a turn apart, clamping included."""
    _, wheels, *_ = made(3)
    clamp = Mount(tilt_rad=(0.004, -0.003), shift_m=(-0.002, 0.001))
    for rolled, wheel in zip(
        draw_runouts(RECIPE, WHEELS, np.random.default_rng(3)), wheels, strict=True
    ):
        mount = rolled.on(clamp)
        (half,) = rolled.scans(wheel)
        one, other = mount.on(wheel), mount.on(half)
        apart = np.linalg.norm(one.normal_vehicle - other.normal_vehicle)
        aside_m = np.linalg.norm(one.centre_vehicle_m - other.centre_vehicle_m) / 2
        stated = rolled.to_json(wheel, one)
        assert stated["wobble_deg"] == pytest.approx(np.degrees(np.arcsin(apart / 2)), abs=1e-9)
        assert stated["eccentricity_m"] == pytest.approx(aside_m, abs=1e-12)
        assert abs(stated["wobble_deg"] - 0.5) > 0.01


@pytest.mark.slow
def test_what_one_scan_draws_moves_no_other_station(tmp_path):
    turning, stations = CONFIGS / "vehicles" / "saloon-turning.toml", []
    for spacing_m in (0.03, 0.04):
        scanner = changed(IDEAL, tmp_path, {"grid.spacing_m": spacing_m})
        files = {"vehicle": turning, "scanner": scanner, "target": DISC}
        write_capture(tmp_path / f"{spacing_m}", seed=3, trials=0, **files)
        tree = json.loads((tmp_path / f"{spacing_m}" / "truth.json").read_text())
        stations.append([scan["station_m"] for scan in tree["used"]["scans"]])
    assert len(stations[0]) == 14
    assert stations[0] == stations[1]


@pytest.mark.slow
def test_the_clamping_stated_of_a_scan_is_the_drawn_one_alone(tmp_path):
    """Without a clamp's tilt the run-outs of one seed are 0.5 degrees; they are no clamp's."""
    scanner = changed(IDEAL, tmp_path, {"grid.spacing_m": 0.02})
    clamp = changed(DISC, tmp_path, {"clamp_tilt_deg": 0.001, "clamp_shift": 1e-6})
    turning = CONFIGS / "vehicles" / "saloon-turning.toml"
    write_capture(tmp_path / "c", seed=3, trials=1, vehicle=turning, scanner=scanner, target=clamp)
    tree = json.loads((tmp_path / "c" / "truth.json").read_text())
    for scan in tree["used"]["scans"]:
        assert np.hypot(*scan["clamp_tilt_deg"]) < 0.005
        assert np.hypot(*scan["clamp_shift_m"]) < 5e-6
    for one in tree["runouts"]:
        assert one["wobble_deg"] == pytest.approx(0.5, abs=0.005)
        assert one["wobble_deg"] != pytest.approx(0.5, abs=1e-6)


def test_normal_mounting_has_the_stated_scatter_along_each_axis(tmp_path):
    text = (CONFIGS / "vehicles" / "saloon-turning.toml").read_text()
    path = tmp_path / "normal.toml"
    path.write_text(text.replace("[0.0, 0.003]", '0.003\nscatter = "normal"'))
    recipe, rng = read_recipe(path, VehicleFile), np.random.default_rng(0)
    found = [one for _ in range(500) for one in draw_runouts(recipe, WHEELS, rng)]
    for values, sigma in (
        ([np.degrees(one.tilt_rad) for one in found], 0.5 / np.sqrt(2.0)),
        ([one.shift_m for one in found], 0.003 / np.sqrt(2.0)),
    ):
        for along in np.transpose(values):
            assert stats.kstest(along / sigma, "norm").pvalue > 0.01


def test_nothing_turns_unless_asked():
    plain = read_recipe(CONFIGS / "vehicles" / "saloon.toml", VehicleFile)
    turning = draw_turning(plain, 0)
    rng = np.random.default_rng(0)
    car = draw_vehicle(plain, rng)
    wheels = [draw_wheel(car, plain, name, rng) for name in WHEELS]
    more = turning.scanned(car, plain, wheels, wheels)
    assert (more.wheels, more.toml, more.truth) == ((), (), {})


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A coarse capture with a sweep of three positions and half turns."""
    folder = tmp_path_factory.mktemp("turning")
    text = (CONFIGS / "scanners" / "default.toml").read_text()
    text = text.replace("0.0009", "0.004").replace("incidence_deg = [3.0", "incidence_deg = [10.0")
    (folder / "coarse.toml").write_text(text)
    write_capture(
        folder / "capture",
        seed=2,
        vehicle=CONFIGS / "vehicles" / "saloon-turning.toml",
        scanner=folder / "coarse.toml",
        target=CONFIGS / "targets" / "disc-250.toml",
        trials=0,
    )
    return folder / "capture"


@pytest.mark.slow
def test_from_files_to_axes(capture):
    shown = json.loads((capture / "truth.json").read_text())
    with open_capture(capture) as opened:
        measurement = measure_capture(opened, Config())
    wheels = {wheel["name"]: wheel for wheel in shown["wheels"]}
    for found in measurement.runouts:
        assert found.frame == "axle centres"
        for angle, name in ((found.angles.toe, "toe"), (found.angles.camber, "camber")):
            true = np.radians(wheels[found.wheel][f"{name}_deg"])
            assert abs(angle.value - true) < 4.5 * angle.u
            assert angle.u < 0.05 * found.axial_runout.value
    for found, pin in zip(measurement.steering_axes, shown["kingpins"], strict=True):
        assert found.frame == "axle centres"
        for angle, name in ((found.caster, "caster"), (found.inclination, "inclination")):
            assert abs(angle.value - np.radians(pin[f"{name}_deg"])) < 4.5 * angle.u
    for found, turn in zip(measurement.toe_out, shown["toe_out_on_turns"], strict=True):
        assert found.of == "axles"
        off = found.difference.value - np.radians(turn["difference_deg"])
        assert abs(off) < 4.5 * found.difference.u < 0.7 * np.radians(0.5)  # of the plates' lean
    assert measurement.complete


def test_wrong_recipes_are_refused(tmp_path):
    text = (CONFIGS / "vehicles" / "saloon-turning.toml").read_text()
    wrong = tmp_path / "car.toml"
    wrong.write_text(text.replace("positions = 3", "positions = -3").replace("scrub_m", "skrub_m"))
    with pytest.raises(SynthError, match=r"(?s)sweep\.positions|skrub_m") as error:
        read_recipe(wrong, VehicleFile)
    assert "scrub_m" in str(error.value)
    assert "\n" not in str(error.value)
