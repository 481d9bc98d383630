"""Bare wheels of the generator: the rim's own axis, run-out, bulge, and what is written."""

import json

import numpy as np
import pytest

from tests.support.bare_wheels import CONFIGS, draw_bay, recipes
from tests.support.made import IDEAL, changed, read_ply
from wheelplane_synth.errors import SynthError
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.whole import write_whole
from wheelplane_synth.parameters.parameters import Body
from wheelplane_synth.wheel.bare_wheel import draw_bare_wheel
from wheelplane_synth.wheel.runout import draw_wave
from wheelplane_synth.wheel.scan import rim_axis
from wheelplane_synth.wheel.tyre import flange_radius_m


@pytest.mark.parametrize("reading_m", [0.0, 0.0005, 0.002])
def test_a_run_out_has_its_total_reading(reading_m):
    wave = draw_wave(reading_m, np.random.default_rng(1))
    turn = np.linspace(0.0, 2.0 * np.pi, 3601)
    assert abs(np.ptp(wave.at(turn)) - reading_m) < 1e-6
    first, rest = wave.first, wave.beyond_first
    whole = first[0] * np.cos(turn) + first[1] * np.sin(turn) + rest.at(turn)
    assert np.allclose(whole, wave.at(turn))


def test_the_flange_s_edge_lies_square_to_the_rim_s_own_axis_and_about_its_centre():
    bay = draw_bay(3, rim_runout_m=0.001)
    placed = [s.placed(bay.wheel.T_vehicle_target) for s in bay.drawn.solids(bay.wheel)]
    axis = rim_axis(bay.drawn, bay.wheel)
    ring = placed[1].vertices_m.reshape(1440, -1, 3) - axis.centre_m
    height = ring @ axis.direction
    edge = ring[np.arange(1440), np.argmax(height, axis=1)]
    plane = np.linalg.svd(edge - edge.mean(axis=0))[2][2]
    tilt = np.linalg.norm(np.cross(plane, axis.direction))
    of_spin = np.linalg.norm(np.cross(plane, bay.wheel.normal_vehicle))
    assert tilt < np.radians(0.1 / 60.0)  # harmonics 2 and 3 tilt no plane
    assert of_spin > 10.0 * tilt
    centre = edge.mean(axis=0)
    assert np.linalg.norm(centre - (centre @ axis.direction) * axis.direction) < 2e-5
    assert abs(centre @ axis.direction) < 2e-5


def test_the_tyre_is_flat_on_the_floor_and_bulges_there():
    bay = draw_bay(4, bulge_m=0.01, letters_m=0.0, tyre_runout_m=0.0)
    tyre = bay.drawn.solids(bay.wheel)[0]
    down = -bay.wheel.T_vehicle_target[2, :2]
    down = down / np.linalg.norm(down)
    depth = tyre.vertices_m[:, :2] @ down
    assert abs(depth.max() - (bay.car.body.tyre_radius_m - 0.01)) < 1e-6
    angle = np.arccos(np.clip(depth / np.hypot(*tyre.vertices_m[:, :2].T), -1.0, 1.0))
    top, low = (tyre.vertices_m[mask, 2].max() for mask in (angle > 3.0, angle < 0.1))
    assert 0.007 < low - top < 0.011


def test_a_tyre_too_low_for_its_rim_is_refused():
    body = Body(tyre_radius_m=0.24, tyre_width_m=0.2, rim_diameter_m=0.45, spokes=5,
                arch_radius_m=0.3)  # fmt: skip
    with pytest.raises(SynthError, match="side wall"):
        draw_bare_wheel(body, recipes()[0], np.random.default_rng(0))
    assert flange_radius_m(body, draw_bay(1).drawn.form) > body.rim_diameter_m / 2.0


def test_a_real_wheel_is_as_bright_as_the_scanner_file_states(tmp_path, monkeypatch):
    """Black tyres on a black floor return no light; the car's other parts do."""
    for ring in ("tyre", "rim"):  # coarse, which changes no albedo
        monkeypatch.setattr(f"wheelplane_synth.wheel.{ring}.SECTIONS", 60)
    values = {"grid.spacing_m": 0.04, "surfaces": {"tyre": 0.0, "floor": 0.0}}
    files = {"scanner": changed(IDEAL, tmp_path, values), "target": CONFIGS / "targets/wheel.toml"}
    car = CONFIGS / "vehicles" / "saloon-bare-wheels.toml"
    write_capture(tmp_path / "c", seed=5, trials=0, vehicle=car, **files)
    _, intensity = read_ply(tmp_path / "c" / "fl.ply")
    assert 0.2 < np.mean(intensity == 0.0) < 0.8


@pytest.mark.slow
def test_a_capture_states_both_axes_and_is_the_same_again(tmp_path):
    scanner = tmp_path / "coarse.toml"
    usual = (CONFIGS / "scanners" / "default.toml").read_text(encoding="utf-8")
    scanner.write_text(usual.replace("spacing_m = 0.0009", "spacing_m = 0.02"), encoding="utf-8")
    kit = {
        "seed": 5,
        "vehicle": CONFIGS / "vehicles" / "saloon-bare-wheels.toml",
        "scanner": scanner,
        "target": CONFIGS / "targets" / "wheel.toml",
    }
    write_capture(tmp_path / "a", trials=0, **kit)
    write_capture(tmp_path / "b", trials=0, **kit)
    assert (tmp_path / "a" / "fl.ply").read_bytes() == (tmp_path / "b" / "fl.ply").read_bytes()
    truth = json.loads((tmp_path / "a" / "truth.json").read_text(encoding="utf-8"))
    off = [np.linalg.norm(np.cross(w["normal"], w["rim_normal"])) for w in truth["wheels"]]
    assert all(0.0 < one < 0.001 / 0.2 for one in off)


@pytest.mark.slow
@pytest.mark.parametrize("site", ["bay", "trailer"])
def test_a_whole_vehicle_of_bare_wheels_has_the_noise_of_its_surfaces(tmp_path, site):
    car = tmp_path / "car.toml"
    usual = (CONFIGS / "vehicles" / "saloon-bare-wheels.toml").read_text(encoding="utf-8")
    car.write_text(f'{usual}\n[site]\nkind = "{site}"\n', encoding="utf-8")
    kit = {"scanner": CONFIGS / "scanners" / "ideal.toml",
           "target": CONFIGS / "targets" / "wheel.toml"}  # fmt: skip
    found = write_whole(tmp_path / "a", seed=5, vehicle=car, points=20_000, **kit)
    truth = json.loads((tmp_path / "a" / "truth.json").read_text(encoding="utf-8"))
    assert [wheel["name"] for wheel in truth["wheels"]] == ["RR", "RL", "FR", "FL"]
    off = [np.linalg.norm(np.cross(w["normal"], w["rim_normal"])) for w in truth["wheels"]]
    assert all(0.0 < one < 0.001 / 0.2 for one in off)
    assert len(found.rims) == 4
