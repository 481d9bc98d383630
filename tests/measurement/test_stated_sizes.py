"""Tests of thicknesses and sizes that a target's file states: all scans together decide on them."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file
from wheelplane.measure import fit_target, measure_capture
from wheelplane.targets import TargetChoice, load_target
from wheelplane_synth.output.archive import write_capture

COARSE = """
[station]
distance_m = [2.0, 3.0]
incidence_deg = [3.0, 25.0]
height_min_m = 0.2
height_max_m = 1.9
[grid]
spacing_m = 0.003
half_width_m = 0.2
[beam]
range_sigma_m = 0.0008
angle_sigma_urad = 20.0
spot_radius_m = 0.0015
dropout_fraction = 0.01
stray_fraction = 0.0005
intensity_sigma = 0.03
[total_station]
distance_m = [5.0, 8.0]
height_m = [1.4, 1.7]
pentagon_radius_m = 0.088
aiming_sigma_m = 0.002
range_sigma_m = 0.0006
range_sigma_ppm = 1.0
angle_sigma_arcsec = 1.0
[panorama]
points = 1000000
window_deg = 100.0
"""


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Discs of 250 mm and 10 mm, scanned coarsely."""
    folder = tmp_path_factory.mktemp("coarse")
    (folder / "coarse.toml").write_text(COARSE, encoding="utf-8")
    vehicle, target = config_file("vehicles", "saloon"), config_file("targets", "disc-250")
    write_capture(
        folder / "capture",
        seed=13,
        vehicle=vehicle,
        scanner=folder / "coarse.toml",
        target=target,
        trials=2,
    )
    return folder / "capture"


def measured(capture, folder, fit=None, **stated):
    """The measurement with a disc as stated."""
    file = folder / "target.toml"
    lines = [f"{key} = {value}" for key, value in ({"diameter": 0.25} | stated).items()]
    file.write_text("\n".join(['shape = "disc"', *lines]), encoding="utf-8")
    with open_capture(capture, str(file)) as opened:
        return measure_capture(opened, Config(), fit=fit)


def off(found, capture):
    """Errors of the centres over their u."""
    truth = json.loads((capture / "truth.json").read_text(encoding="utf-8"))["wheels"]
    true = {wheel["name"]: np.array(wheel["centre_m"]) for wheel in truth}
    fits = {wheel.observation.name: wheel.observation.fitted for wheel in found.wheels}
    return {
        name: np.linalg.norm(fit.centre_m - true[name])
        / np.sqrt(np.trace(fit.centre_covariance_m2))
        for name, fit in fits.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0.005, 0.007, 0.015])
def test_a_wrong_thickness_is_used_in_no_scan(capture, tmp_path, thickness):
    """None of these scans contradicts 5 mm alone; results are those without any."""
    found, free = measured(capture, tmp_path, thickness=thickness), measured(capture, tmp_path)
    (note,) = [note for note in found.notes if "mm thick" in note]
    assert f"its file says {thickness * 1e3:.3g} mm: RR, RL, FR, FL, 1, 2." in note
    for one, other in zip(found.wheels, free.wheels, strict=True):
        np.testing.assert_array_equal(
            one.observation.fitted.centre_m, other.observation.fitted.centre_m
        )
    assert max(off(found, capture).values()) < 3.0
    assert found.provenance.config["target"]["thickness"] == thickness


def test_each_wheel_keeps_the_thickness_that_its_own_file_states(capture, tmp_path):
    """Discs of files that differ in the thickness alone, two of them wrong and one without."""
    files = {}
    for name, line in (("thin", "thickness = 0.005"), ("thick", "thickness = 0.016"), ("free", "")):
        files[name] = tmp_path / f"{name}.toml"
        files[name].write_text(f'shape = "disc"\ndiameter = 0.25\n{line}\n', encoding="utf-8")
    of = {"RR": "thin", "RL": "thin", "FR": "thick", "FL": "free", "1": "thick", "2": "thin"}
    choice = TargetChoice(None, {name: load_target(str(files[of[name]])) for name in of})
    with open_capture(capture, choice) as opened:
        found = measure_capture(opened, Config())
    stated = {one.observation.name: one.observation.target.thickness for one in found.wheels}
    assert stated == {name: {"thin": 0.005, "thick": 0.016, "free": None}[of[name]] for name in of}
    thin, thick = [note for note in found.notes if "mm thick" in note]
    assert "its file says 5 mm: RR, RL, 2." in thin
    assert "its file says 16 mm: FR, 1." in thick
    assert any(note.startswith("FR and FL: unlike the other side") for note in found.notes)


@pytest.mark.slow
def test_a_fit_that_looks_at_the_points_measures_the_same(capture, tmp_path):
    """As five points are picked for a validation: of scans that contradict a thickness, too."""
    seen = []

    def fit(patch, target, config):
        seen.append(fit_target(patch, target, config))
        return seen[-1]

    found = measured(capture, tmp_path, fit, thickness=0.005)
    plain = measured(capture, tmp_path, thickness=0.005)
    assert found.notes == plain.notes
    for one, other in zip(found.wheels, plain.wheels, strict=True):
        assert one.angles == other.angles
        assert any(one.observation.evidence.plane is evidence.plane for evidence in seen)


def test_the_right_thickness_is_used_in_all_scans(capture, tmp_path):
    found = measured(capture, tmp_path, thickness=0.01)
    assert not [note for note in found.notes if "mm thick" in note or "by their edges" in note]
    edges = [wheel.observation.fitted.edge_fit for wheel in found.wheels]
    assert all(edge.thickness_u < 0.03 for edge in edges)
    assert np.abs([edge.thickness_pull for edge in edges]).max() < 3.0


@pytest.mark.parametrize(("diameter", "side"), [(0.249, "larger"), (0.251, "smaller")])
def test_sizes_that_all_scans_contradict_together_are_noted(capture, tmp_path, diameter, side):
    """Half a millimetre of radius, by which no scan is refused."""
    found = measured(capture, tmp_path, diameter=diameter, thickness=0.01)
    (note,) = [note for note in found.notes if "By their edges" in note]
    assert f"are {side} all round" in note
    assert "by 0.4 mm" in note or "by 0.5 mm" in note


@pytest.mark.slow
def test_boards_that_name_their_wheels_are_measured_too(tmp_path):
    """Their files hold tables, by which targets are compared, not looked up."""
    (tmp_path / "coarse.toml").write_text(COARSE, encoding="utf-8")
    target = config_file("targets", "pattern-aruco")
    write_capture(
        tmp_path / "capture",
        seed=3,
        vehicle=config_file("vehicles", "saloon"),
        scanner=tmp_path / "coarse.toml",
        target=target,
        trials=0,
    )
    thin = tmp_path / "thin.toml"
    text = target.read_text(encoding="utf-8")
    thickness = re.search(r"^thickness = (\S+)", text, re.MULTILINE)[0]
    thin.write_text(text.replace(thickness, "thickness = 0.003"), encoding="utf-8")
    for stated, wrong in ((target, False), (thin, True)):
        with open_capture(tmp_path / "capture", str(stated)) as opened:
            found = measure_capture(opened, Config())
        assert any("mm thick" in note for note in found.notes) == wrong
        assert max(off(found, tmp_path / "capture").values()) < 4.0
