"""A vehicle whose targets are dark in one half, where ranges follow the brightness."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from tests.bench.intervals import SCENE
from tests.support.scenes import make
from wheelplane.cli import cli
from wheelplane.config import config_file
from wheelplane_synth.output.files import capture_toml, ply, scan_file
from wheelplane_synth.parameters.parameters import VehicleFile
from wheelplane_synth.parameters.recipe import read_recipe
from wheelplane_synth.parameters.target_file import read_target
from wheelplane_synth.vehicle.vehicle import WHEELS, draw_vehicle, draw_wheel

BIAS_M = 0.4e-3
DARK, BRIGHT = 0.2, 0.8


def measure(folder, bias_m, dark=DARK, seed=3):
    """Measure a vehicle; what the command prints, and its wheels."""
    rng = np.random.default_rng(seed)
    recipe = read_recipe(config_file("vehicles", "saloon"), VehicleFile)
    plate = read_target(config_file("targets", "disc-250"))
    vehicle = draw_vehicle(recipe, rng)
    wheels = tuple(draw_wheel(vehicle, recipe, name, rng) for name in WHEELS)
    for wheel in wheels:
        setup = SCENE.but(
            thickness_m=plate.thickness,
            distance_m=2.5,
            incidence_deg=15.0,
            azimuth_deg=rng.uniform(0.0, 360.0),
            background_m=0.1,
            noise_m=3e-4,
        )
        cloud = make(setup, rng, wheel.T_vehicle_target)
        off = cloud.points_m - cloud.centre_m
        on_target = np.abs(off @ cloud.normal) < 0.01
        bright = off[:, 0] + 0.3 * off[:, 2] > 0.0
        points = cloud.points_m + np.outer(bias_m * (on_target & bright), cloud.normal)
        intensity = np.where(on_target, np.where(bright, BRIGHT, dark), 0.5).astype(np.float32)
        intensity *= (1.0 + 0.05 * rng.standard_normal(len(points))).astype(np.float32)
        (folder / scan_file(wheel)).write_bytes(ply(points, intensity))
    (folder / "capture.toml").write_text(capture_toml("", plate, wheels))
    outcome = CliRunner().invoke(cli, ["measure", str(folder), "--json", "--no-pictures"])
    assert outcome.exit_code == 0, outcome.output
    return json.loads(outcome.stdout), wheels


def worst(tree, wheels):
    """The largest error of toe and camber over its u."""
    return max(
        abs(found[f"{name}_deg"] - np.degrees(getattr(wheel, f"{name}_rad")))
        / found[f"u_{name}_deg"]
        for found, wheel in zip(tree["wheels"], wheels, strict=True)
        for name in ("toe", "camber")
    )


def test_it_is_removed_noted_and_counted(tmp_path):
    tree, wheels = measure(tmp_path, BIAS_M)
    assert worst(tree, wheels) < 3.5
    for found in tree["wheels"]:
        assert found["brightness_step_m"] == pytest.approx(BIAS_M, abs=0.05 * BIAS_M)
        assert 0.0 < found["u_brightness_deg"] < found["u_plane_deg"]
    for found, wheel in zip(tree["wheels"], wheels, strict=True):
        off_m = np.linalg.norm(np.subtract(found["centre_m"], wheel.T_vehicle_target[:3, 3]))
        assert 0.3 < off_m / found["u_centre_m"] < 3.0  # half the step is off, one way or the other
        assert off_m > 0.4 * BIAS_M
    note = next(note for note in tree["notes"] if note.startswith("Ranges follow brightness"))
    assert all(f"mm ({name})" in note for name in WHEELS)
    assert "brightness" in json.dumps(tree["uncertainty"])


def test_a_dark_half_without_it_is_counted_and_not_noted(tmp_path):
    tree, wheels = measure(tmp_path, 0.0)
    assert worst(tree, wheels) < 3.5
    assert all(found["u_brightness_deg"] > 0.0 for found in tree["wheels"])
    assert not any("brightness" in note for note in tree["notes"])


def test_one_brightness_shows_it_as_a_step_of_the_face_and_has_no_such_keys(tmp_path):
    """By the points alone it is known that a line parts the face, not which side is right."""
    tree, wheels = measure(tmp_path, BIAS_M, dark=BRIGHT)
    assert worst(tree, wheels) < 3.0
    assert any("has a step along a line" in note for note in tree["notes"])
    for found in tree["wheels"]:
        assert found["brightness_step_m"] is found["u_brightness_deg"] is None
    assert "scanner: range by brightness" not in json.dumps(tree)
