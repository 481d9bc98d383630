"""Wheels with targets and bare ones in one capture: angles, centres, notes, the result's JSON."""

import json
import re

import numpy as np
import pytest

from tests.support.mixed import disc_file, write_mixed
from wheelplane.capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture
from wheelplane.report.json.measurement import to_json

WIDE = ("RL", "FL")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("mixed")
    files = place / "files"
    files.mkdir()
    write_mixed(place / "car", dict.fromkeys(WIDE, disc_file(files)), seed=3)
    return place / "car"


def measured(folder, target=None):
    with open_capture(folder, target) as capture:
        return measure_capture(capture, Config())


@pytest.fixture(scope="module")
def known(folder):
    return measured(folder)


@pytest.fixture(scope="module")
def unstated(folder):
    """The same scans, the targets' stand-off not stated."""
    return measured(folder, "wheel,RL=disc-250,FL=disc-250")


def truth_of(folder):
    return json.loads((folder / "truth.json").read_text(encoding="utf-8"))


def test_every_wheel_is_measured_by_what_it_shows(known):
    methods = [wheel.observation.fitted.method for wheel in known.wheels]
    assert methods == ["flange", "rim", "flange", "rim"]


def test_angles_lie_within_their_uncertainty_of_the_spin_axes(folder, known):
    spin = truth_of(folder)["wheels"]
    runout = np.radians(8.0 / 60.0)  # up to 1 mm of the rims against the spin axes, not stated
    for wheel, true in zip(known.wheels, spin, strict=True):
        for kind in ("toe", "camber"):
            off = getattr(wheel.angles, f"{kind}_rad") - np.radians(true[f"{kind}_deg"])
            mounting = 2.5 * np.radians(0.1) if wheel.observation.name in WIDE else 0.0
            assert abs(off) < runout + mounting


def test_carried_centres_are_those_of_the_wheels(folder, known, unstated):
    for wheel, raw, true in zip(
        known.wheels, unstated.wheels, truth_of(folder)["wheels"], strict=True
    ):
        away = np.linalg.norm(wheel.pose.centre_m - true["centre_m"])
        assert away < 0.005  # mounting of 1 mm and of 0.1 degrees, and run-out
        before = np.linalg.norm(raw.pose.centre_m - true["centre_m"])
        assert (before > 0.08) == (wheel.observation.name in WIDE)


def test_the_frame_is_skewed_no_more_than_its_uncertainty_where_nothing_is_stated(known, unstated):
    for one, other in zip(unstated.wheels, known.wheels, strict=True):
        for kind in ("toe", "camber"):
            off = getattr(one.angles, f"{kind}_rad") - getattr(other.angles, f"{kind}_rad")
            assert abs(off) < 2.0 * getattr(one, f"u_{kind}_rad")
        assert one.u_camber_rad > other.u_camber_rad or one.observation.name in WIDE


def test_the_first_page_says_where_the_centres_lie(known, unstated):
    stated, not_stated = " ".join(known.notes), " ".join(unstated.notes)
    assert "The centres of RL and FL are those of the wheels" in stated
    assert "the targets stand +85.0 mm outwards as stated (u 1.00 mm)" in stated
    assert "skews the frame" not in stated
    assert "The centres of RL and FL are those of the targets, the others those of" in not_stated
    assert "RL and FL: unlike the other side of the axle" in not_stated
    assert "The axes of RR and FR are those of the rims" in stated


def test_the_skew_in_the_note_is_that_of_the_geometry(unstated):
    (note,) = (one for one in unstated.notes if "skews the frame" in one)
    rear_left = unstated.wheels[1]
    track = unstated.frame.rear_track_m - 0.05
    shown = [float(part) for part in re.findall(r"by (\d+\.\d)'", note)]
    angles = rear_left.angles.toe_rad, rear_left.angles.camber_rad
    minutes = [np.degrees(0.05 * np.sin(abs(angle)) / track) * 60.0 for angle in angles]
    assert np.abs(np.subtract(shown[:2], minutes)).max() < 0.07
    assert shown[2] < 0.5  # both targets of one side shift the middles of both axles alike


def test_the_uncertainty_of_an_unstated_distance_is_a_line_of_the_budget(known, unstated):
    assert "stand-off" in unstated.uncertainty.components
    track = unstated.uncertainty.vehicle_standard["rear_track"]
    assert track > 0.08 > 0.003 > known.uncertainty.vehicle_standard["rear_track"]


def test_the_result_names_every_target(known):
    tree = json.loads(to_json(known))
    config = tree["provenance"]["config"]
    assert config["target"]["shape"] == "wheel"
    assert {name: one["shape"] for name, one in config["targets"].items()} == dict.fromkeys(
        WIDE, "disc"
    )
    rear_left = tree["wheels"][1]
    apart = np.subtract(rear_left["plate_centre_m"], rear_left["centre_m"])
    assert np.linalg.norm(apart) == pytest.approx(0.085, abs=1e-9)
    assert apart @ rear_left["normal"] == pytest.approx(0.085, abs=1e-9)
