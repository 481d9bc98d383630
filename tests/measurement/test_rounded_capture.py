"""A vehicle square to the axes of its files, whose coordinates are rounded to a millimetre."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from tests.bench.intervals import SCENE
from tests.support.scenes import make
from wheelplane.cli import cli
from wheelplane.config import config_file
from wheelplane.errors import InputError
from wheelplane_synth.output.files import capture_toml, ply, scan_file
from wheelplane_synth.parameters.parameters import VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel

STEP_M = 1e-3


def measure(folder, noise_m, seed=2):
    """Measure a vehicle in its own axes; the command's outcome, and its wheels."""
    rng = np.random.default_rng(seed)
    recipe = read_recipe(config_file("vehicles", "saloon"), VehicleFile)
    plate = read_target(config_file("targets", "disc-250"))
    vehicle = draw_vehicle(recipe, rng)
    wheels = tuple(draw_wheel(vehicle, recipe, name, rng) for name in WHEELS)
    for wheel in wheels:
        setup = SCENE.but(
            thickness_m=plate.thickness,
            distance_m=2.5,
            incidence_deg=rng.uniform(3.0, 25.0),
            azimuth_deg=rng.uniform(0.0, 360.0),
            background_m=0.1,
            background_tilt_deg=3.0,
            noise_m=noise_m,
        )
        points = np.round(make(setup, rng, wheel.T_vehicle_target).points_m / STEP_M) * STEP_M
        (folder / scan_file(wheel)).write_bytes(ply(points, np.ones(len(points), np.float32)))
    (folder / "capture.toml").write_text(capture_toml("", plate, wheels))
    return CliRunner().invoke(cli, ["measure", str(folder), "--json", "--no-pictures"]), wheels


def test_angles_are_right_and_u_says_what_the_steps_add(tmp_path):
    """Least squares were 0.023 degrees off the toe of the right rear wheel, at u = 0.0055."""
    outcome, wheels = measure(tmp_path, 3e-4)
    assert outcome.exit_code == 0, outcome.output
    tree = json.loads(outcome.stdout)
    for found, wheel in zip(tree["wheels"], wheels, strict=True):
        assert found["name"] == wheel.name
        assert abs(found["toe_deg"] - np.degrees(wheel.toe_rad)) < 3.5 * found["u_toe_deg"]
        assert abs(found["camber_deg"] - np.degrees(wheel.camber_rad)) < 3.5 * found["u_camber_deg"]
        assert found["steps_m"] == pytest.approx([STEP_M] * 3, rel=1e-3)
        assert 0.0 < found["u_rounding_deg"] < found["u_plane_deg"]
    assert any("lie in steps of 1 mm" in note for note in tree["notes"])


def test_a_face_that_the_steps_hide_is_refused_with_what_to_export(tmp_path):
    outcome, _ = measure(tmp_path, 1e-4)
    assert isinstance(outcome.exception, InputError)
    line = str(outcome.exception)
    assert "(steps-too-coarse): its coordinates lie in steps of 1 mm" in line
    assert line.endswith("export this scan again with more decimals, or as double")
