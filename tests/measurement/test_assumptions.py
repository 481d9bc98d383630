"""Notes on the first page: of what the angles are, and what counts as zero in their uncertainty."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.kinematics.test_runout import ECCENTRIC, all_round
from tests.support.shaded_discs import Disc, halves
from tests.support.turning import Scene
from wheelplane.centre.on_wheel import MOST_M
from wheelplane.config import InstrumentConfig, PlaneConfig
from wheelplane.measurement.assumptions import notes_of_assumptions
from wheelplane.plane import fit_plane
from wheelplane.targets.registry import load_target

DISC = load_target("disc-250")
AXES = {
    "collimation_arcsec": 10.0,
    "trunnion_arcsec": 10.0,
    "vertical_index_arcsec": 10.0,
    "azimuth_eccentricity_arcsec": 10.0,
    "elevation_eccentricity_arcsec": 10.0,
    "beam_offset_m": 1e-4,
}
RANGE = {"range_bias_m": 1e-3, "range_scale_ppm": 10.0, "incidence_bias_m": 1e-4}
STATED = InstrumentConfig(**AXES, **RANGE, pointing_urad=50.0, registration_m=1e-3)


@pytest.fixture(scope="module")
def plates():
    return all_round(1, 1.0, ECCENTRIC, wheels=()).measure()


def test_a_capture_without_run_outs_is_of_the_targets_as_mounted(plates):
    mounted, zeros = notes_of_assumptions(plates, DISC, InstrumentConfig())
    assert mounted.startswith("The angles of the wheels are those of the targets as mounted")
    assert "clamp_tilt_deg" in mounted
    for zero in ("range bias", "range by incidence", "axis errors", "pointing", "registration"):
        assert zero in zeros
    assert "flatness" in zeros
    assert "collimation" not in zeros


@pytest.mark.parametrize("key", AXES)
def test_each_axis_error_that_is_not_stated_is_named_beside_those_that_are(plates, key):
    target = DISC.model_copy(update={"clamp_tilt_deg": 0.01, "flatness": 1e-4})
    missing = STATED.model_copy(update={key: 0.0})
    (zeros,) = notes_of_assumptions(plates, target, missing)
    name = key.rpartition("_")[0].replace("_", " ")
    assert zeros.startswith(f"Counted as zero, as no file states them: {name}")


def test_what_the_files_state_is_not_noted(plates):
    target = DISC.model_copy(update={"clamp_tilt_deg": 0.01, "flatness": 1e-4})
    assert notes_of_assumptions(plates, target, STATED) == ()
    flat = DISC.model_copy(update={"clamp_tilt_deg": 0.01})
    (zeros,) = notes_of_assumptions(plates, flat, STATED)
    assert zeros == "Counted as zero, as no file states them: flatness of the target."


@pytest.fixture(scope="module")
def unlike():
    """Discs on one axle that differ in the thickness alone, at distances that nobody states."""
    scene = Scene(2).references()
    thin = DISC.model_copy(update={"thickness": 0.004})
    targets = {"RR": thin, "RL": DISC, "FR": DISC, "FL": DISC}
    scene.seen = [replace(one, target=targets[one.name]) for one in scene.seen]
    return scene.measure()


def test_targets_that_are_described_alike_stand_off_by_distances_of_their_own(unlike):
    u, one = unlike.uncertainty.vehicle_standard, MOST_M / np.sqrt(3.0)
    assert u["rear_track"] == pytest.approx(np.sqrt(2.0) * one, rel=0.01)
    middles = one / np.sqrt(2.0) / unlike.vehicle["wheelbase"]
    assert u["centreline_angle"] == pytest.approx(middles, rel=0.01)


def test_the_skew_that_is_noted_is_by_what_unlike_targets_of_an_axle_differ(unlike):
    notes = notes_of_assumptions(unlike, DISC, InstrumentConfig())
    (note,) = (one for one in notes if "skews the frame" in one)
    assert note.startswith("RR and RL: unlike the other side of the axle")
    shown = [float(part) for part in re.findall(r"by (\d+\.\d)'", note)]
    left, vehicle = unlike.wheels[1].angles, unlike.vehicle
    skewed = [abs(np.sin(left.toe_rad)), abs(np.sin(left.camber_rad))]
    expected = 0.05 * np.array([*(one / vehicle["rear_track"] for one in skewed), 0.0])
    expected[2] = 0.05 / 2.0 / vehicle["wheelbase"]
    assert np.abs(shown - 60.0 * np.degrees(expected)).max() < 0.1


def tilted(measurement, degrees):
    """Return a measurement of a vehicle whose up is turned about x from z of the scans."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    left, forward, up = np.eye(3) @ turn.T
    frame = replace(measurement.frame, left=left, forward=forward, up=up)
    return replace(measurement, frame=frame)


@pytest.mark.parametrize(
    ("degrees", "noted"), [(0.0, False), (15.0, False), (25.0, True), (90.0, True), (180.0, False)]
)
def test_axis_errors_of_scans_whose_z_is_not_vertical_are_noted(plates, degrees, noted):
    """z down is the same axis; without stated axis errors there is nothing to note."""
    turned = tilted(plates, degrees)
    said = [
        [note for note in notes_of_assumptions(turned, DISC, stated) if "count about z" in note]
        for stated in (STATED, InstrumentConfig(**RANGE))
    ]
    assert (len(said[0]), len(said[1])) == (noted, 0)
    assert not noted or f"lies {degrees:.0f}° from the normal to the plane" in said[0][0]


def test_wheels_with_run_out_are_named_and_those_without_have_their_scatter():
    result = all_round(2, 1.0, ECCENTRIC, wheels=("RR", "RL")).measure()
    axles, mounted, _ = notes_of_assumptions(result, DISC, InstrumentConfig())
    assert axles == "The angles of RR and RL are those of the axle, compensated for run-out."
    assert mounted.startswith("The angles of FR and FL are those of the targets as mounted")
    assert "run-outs of the other wheels" in mounted


def test_trials_are_of_their_targets_where_all_wheels_are_compensated():
    scene = all_round(3, 1.0, ECCENTRIC)
    scene.seen.append(replace(scene.seen[0], name="1", role="trial", source="1.ply"))
    axles, mounted, _ = notes_of_assumptions(scene.measure(), DISC, InstrumentConfig())
    assert axles.startswith("The angles of RR, RL, FR and FL are")
    assert mounted.startswith("The angles of the trials are those of the targets as mounted")
    assert "not in the uncertainty" in mounted


def test_a_print_scanned_without_intensities_is_noted(plates):
    target = load_target("pattern-circles")
    known = target.model_copy(update={"clamp_tilt_deg": 0.01, "flatness": 1e-4})
    patch, _ = Disc(halves(0.0)).scan(1)
    shown = with_plane(plates, fit_plane(patch, DISC, PlaneConfig()))
    assert notes_of_assumptions(shown, known, STATED) == ()
    blind = replace(patch, face_intensity=None)
    hidden = with_plane(plates, fit_plane(blind, DISC, PlaneConfig()))
    (zeros,) = notes_of_assumptions(hidden, known, STATED)
    assert zeros == "Counted as zero, as no file states them: range bias of the print."


def with_plane(measurement, plane):
    wheels = []
    for wheel in measurement.wheels:
        evidence = replace(wheel.observation.evidence, plane=plane)
        wheels.append(replace(wheel, observation=replace(wheel.observation, evidence=evidence)))
    return replace(measurement, wheels=tuple(wheels))
