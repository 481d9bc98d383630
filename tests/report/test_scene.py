"""The scene of the 3D view against the truth that the scans were made of."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.support.printed import says_angle
from tests.support.reported import ANGLES, lost, measured, off_m, scan
from tests.support.turning import PLACES, WHEELS, Scene, facing, kingpin, swept
from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.measurement.conformity import assess
from wheelplane.measurement.quantities import by_name
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.view import View
from wheelplane.report.format.writer import Writer
from wheelplane.report.scene.scene import SYMBOL_M, scene
from wheelplane.vehicle import AXES, named

FIGURE_4 = Path(__file__).parents[1] / "data" / "paper" / "figure-4.txt"
SITES = [0, 1, 2]
# Of a board of 300 mm, 8,000 points of 0.8 mm: tilt sqrt(12) s/(a sqrt N) = 0.1 mrad; its centre
# 0.03 mm; the frame's yaw sqrt(2) 0.03/1.5 m. Over 2.7 m that is 0.1 mm; six times as much.
PLACE_M, TILT_RAD = 6e-4, 6e-4


def decoded(cloud: dict) -> tuple[np.ndarray, np.ndarray]:
    grid = np.frombuffer(base64.b64decode(cloud["positions"]), "<i2").reshape(-1, 3)
    kind = np.frombuffer(base64.b64decode(cloud["class"]), np.uint8)
    assert len(grid) == len(kind) == cloud["count"]
    return np.array(cloud["origin"]) + cloud["step_m"] * grid, kind


@pytest.mark.parametrize("site", SITES)
def test_wheels_stand_where_they_truly_stand(site):
    """x forward, y left, z up, wherever the scanner was; the scanner's own axes fail by metres."""
    shown = scene(measured(site))
    assert [wheel["name"] for wheel in shown["wheels"]] == list(ANGLES)
    for wheel in shown["wheels"]:
        true = PLACES[wheel["wheel"]]
        np.testing.assert_allclose(wheel["centre"], true, atol=PLACE_M)
        normal = facing(wheel["wheel"], *ANGLES[wheel["name"]])
        np.testing.assert_allclose(wheel["normal"], normal, atol=TILT_RAD)


def test_the_scene_does_not_hang_on_where_the_scanner_was():
    one, other = (scene(measured(site)) for site in (0, 2))
    for a, b in zip(one["wheels"], other["wheels"], strict=True):
        np.testing.assert_allclose(a["centre"], b["centre"], atol=2e-6)
        np.testing.assert_allclose(a["outline"][0], b["outline"][0], atol=1e-5)
        assert a["toe_text"] == b["toe_text"]
    for a, b in zip(one["lines"], other["lines"], strict=True):
        np.testing.assert_allclose([a["from"], a["to"]], [b["from"], b["to"]], atol=2e-6)


@pytest.mark.parametrize("name", ANGLES)
def test_outlines_are_the_boards(name):
    """A square of 300 mm, turned as it truly was, with holes of 50 mm at 180 mm."""
    wheel = next(w for w in scene(measured(1))["wheels"] if w["name"] == name)
    square, *holes = (off_m(np.array(edge), scan(name, 1)) for edge in wheel["outline"])
    np.testing.assert_allclose(np.abs(square[:, :2]), 0.15, atol=PLACE_M)
    assert len(np.unique(np.sign(square[:, :2]), axis=0)) == 4
    centres = np.array([hole.mean(axis=0)[:2] for hole in holes])
    np.testing.assert_allclose(np.abs(centres), 0.09, atol=PLACE_M)
    for hole, centre in zip(holes, centres, strict=True):
        np.testing.assert_allclose(np.linalg.norm(hole[:, :2] - centre, axis=1), 0.025, atol=1e-5)
    for edge in (square, *holes):
        np.testing.assert_allclose(edge[:, 2], 0.0, atol=PLACE_M)


@pytest.mark.parametrize("site", SITES)
def test_every_point_of_the_cloud_is_a_scanned_one(site):
    """Within half a step of the grid along each axis, and what the measured frame is off."""
    shown = scene(measured(site))
    points, kind = decoded(shown["cloud"])
    step = shown["cloud"]["step_m"]
    assert 0.0 < step < 2e-4
    frame = measured(site).frame
    scanned = np.vstack([scan(name, site).cloud.points_m for name in ANGLES])
    true = frame.to_vehicle(scanned)[:, [1, 0, 2]]
    apart, _ = cKDTree(true).query(points)
    assert apart.max() < np.sqrt(0.75) * step + 1e-6  # float32 holds 1e-7 of half a metre
    assert len(points) > 0.5 * sum(min(8000, len(scan(n, site).cloud.points_m)) for n in ANGLES)
    assert set(np.unique(kind)) == {0, 1}


def test_points_are_reported_on_the_face_from_those_beside_it():
    points, kind = decoded(scene(measured(1))["cloud"])
    nearest = np.argmin(
        [np.linalg.norm(points - PLACES[wheel], axis=1) for wheel in WHEELS], axis=0
    )
    for index, wheel in enumerate(WHEELS[1:], start=1):  # the trial's board is on RR too
        uvw = off_m(points[nearest == index], scan(wheel, 1))
        stated = kind[nearest == index]
        inside = np.abs(uvw[:, :2]).max(axis=1) < 0.145
        clear = np.abs(np.abs(uvw[:, :2]) - 0.09)
        inside &= np.hypot(clear[:, 0], clear[:, 1]) > 0.03
        flat = np.abs(uvw[:, 2]) < 0.004  # five sigma
        assert stated[inside & flat].all()
        assert np.count_nonzero(inside & flat) > 1000
        beside = (np.abs(uvw[:, :2]).max(axis=1) > 0.155) | (np.abs(uvw[:, 2]) > 0.03)
        assert not stated[beside].any()
        assert np.count_nonzero(beside) > 500


def test_same_measurement_same_bytes_and_plain_json():
    one, other = (json.dumps(scene(measured(1)), allow_nan=False) for _ in range(2))
    assert one == other
    assert json.loads(one)["schema"] == "wheelplane/scene/1"


def test_a_trial_that_was_not_measured_has_no_place():
    shown = scene(lost())
    assert [wheel["name"] for wheel in shown["wheels"]] == list(WHEELS)


def test_what_does_not_conform_is_marked():
    """The trial's camber is -20 mrad, -1.15 degrees; the others' are above -0.6."""
    limits = Tolerance.model_validate(
        {axle: {"camber": {"lower_deg": -0.8}} for axle in ("front", "rear")}
    )
    judged = assess(measured(1), limits)
    kinds = {w["name"]: w["colour_class"] for w in scene(measured(1), judged)["wheels"]}
    assert kinds == dict.fromkeys(WHEELS, "reference") | {"1": "bad"}


def test_lines_run_where_their_names_say():
    lines = {line["name"]: line for line in scene(measured(1))["lines"]}
    for name, (one, other) in {"rear axle": ("RR", "RL"), "front axle": ("FR", "FL")}.items():
        ends = [lines[name]["from"], lines[name]["to"]]
        np.testing.assert_allclose(ends, [PLACES[one], PLACES[other]], atol=PLACE_M)
    thrust = np.subtract(lines["thrust line"]["to"], lines["thrust line"]["from"])
    to_right = (ANGLES["RL"][0] - ANGLES["RR"][0]) / 2.0  # -3 mrad: to the left
    assert np.arctan2(-thrust[1], thrust[0]) == pytest.approx(to_right, abs=TILT_RAD)
    for axis, name in enumerate(("front", "left", "up")):
        arrow = np.subtract(lines[name]["to"], lines[name]["from"])
        assert arrow[axis] > 0.3
        assert np.count_nonzero(arrow) == 1


def test_kingpins_lean_as_they_truly_lean():
    made = Scene(seed=3, noise=0.0).references()
    swept(made, "FL", 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    lines = [line for line in scene(made.measure())["lines"] if line["layer"] == "kingpin"]
    assert len(lines) == 1
    way = np.subtract(lines[0]["to"], lines[0]["from"])
    np.testing.assert_allclose(way / np.linalg.norm(way), kingpin("FL", 0.08, 0.2), atol=1e-5)


def test_five_points_show_circles_and_no_cloud():
    shown = scene(measure_five_point(read_five_point(FIGURE_4)))
    assert shown["cloud"] is None
    for wheel in shown["wheels"]:
        reach = np.linalg.norm(np.subtract(wheel["outline"][0], wheel["centre"]), axis=1)
        np.testing.assert_allclose(reach, SYMBOL_M, atol=3e-6)
        assert (
            np.abs(np.subtract(wheel["outline"][0], wheel["centre"]) @ wheel["normal"]).max() < 3e-6
        )


@pytest.mark.parametrize("axis", AXES)
def test_labels_show_the_angles_of_the_report(axis):
    """A toe-in of the rear axle's normal stood beside a toe-out against the thrust line."""
    view = View(axis=axis, angles="deg")
    writer, known = Writer(load_translations("en"), view), by_name(measured(1))
    for wheel in scene(measured(1), view=view)["wheels"]:
        for kind in ("toe", "camber"):
            name = f"{wheel['name']}.{named(kind, axis) if kind == 'toe' else kind}"
            assert writer.value(known[name]) in wheel[f"{kind}_text"]


def test_the_words_are_those_of_the_language():
    shown = scene(measured(1), words=load_translations("pt"))
    assert {line["name"] for line in shown["lines"]} >= {
        "eixo traseiro",
        "linha de impulso",
        "cima",
    }
    assert all(wheel["toe_text"].startswith("convergência ") for wheel in shown["wheels"])
    shown = scene(measured(1), words=load_translations("pt"))
    known = by_name(measured(1))
    for wheel in shown["wheels"]:
        toe = known[f"{wheel['name']}.toe"]
        text = wheel["toe_text"].removeprefix("convergência ")
        assert says_angle(text, math.degrees(toe.value), math.degrees(toe.expanded))
