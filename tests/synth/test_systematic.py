"""Errors of the instrument's axes, encoders and range, and of the registration of stations."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.made import DISC, IDEAL, SALOON, changed, read_ply
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.output.whole import write_whole
from wheelplane_synth.parameters.parameters import Calibration, Registration
from wheelplane_synth.scanner.scanner import directions
from wheelplane_synth.scanner.stations import draw_misplacement
from wheelplane_synth.scanner.systematic import ARCSEC, measured_angles, measured_range_m

ELEVATION = np.repeat(np.radians([-50, -20, 0, 15, 60]), 25)
AZIMUTH = np.tile(np.linspace(-3, 3, 25), 5)
RANGE_M = np.linspace(1.0, 30.0, len(AZIMUTH))
COARSE = {"grid.spacing_m": 0.004, "grid.half_width_m": 0.15}


def turned(axis: str, angle):
    cos, sin = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    if axis == "y":
        return np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


@pytest.mark.parametrize(("collimation", "trunnion"), [(30.0, 0.0), (0.0, 40.0), (-25.0, 15.0)])
def test_axis_errors_are_those_of_a_theodolite_whose_axes_are_not_square(collimation, trunnion):
    """Readings turn a sight, off its square by c, about a trunnion axis that is tilted by i.

    Rotations about z by the azimuth, about x by i, about the trunnion axis y by the elevation.
    The formula is of first order: the rest is below (c + i)^2 / cos^2.
    """
    c, i = collimation * ARCSEC, trunnion * ARCSEC
    reported = measured_angles(AZIMUTH, ELEVATION, RANGE_M, Calibration(
        collimation_arcsec=collimation, trunnion_arcsec=trunnion))  # fmt: skip
    found = np.stack(
        [
            turned("z", a) @ turned("x", i) @ turned("y", -e) @ turned("z", -c) @ [1.0, 0.0, 0.0]
            for a, e in zip(*reported, strict=True)
        ]
    )
    bound = (abs(c) + abs(i)) ** 2 / np.cos(ELEVATION).min() ** 2
    assert np.abs(found - directions(AZIMUTH, ELEVATION)).max() < bound
    nothing = directions(*reported) - directions(AZIMUTH, ELEVATION)
    assert np.abs(nothing).max() > 1000 * bound


def test_index_encoders_and_beam_offset_follow_their_formulae():
    one = Calibration(
        vertical_index_arcsec=20.0,
        azimuth_eccentricity_arcsec=12.0,
        azimuth_eccentricity_at_deg=30.0,
        elevation_eccentricity_arcsec=-8.0,
        elevation_eccentricity_at_deg=-10.0,
        beam_offset_m=0.0002,
    )
    azimuth, elevation = measured_angles(AZIMUTH, ELEVATION, RANGE_M, one)
    level_m = RANGE_M * np.cos(ELEVATION)
    wanted = 12.0 * np.sin(AZIMUTH - np.pi / 6) + 0.0002 / level_m / ARCSEC
    assert (azimuth - AZIMUTH) / ARCSEC == pytest.approx(wanted, abs=1e-9)
    wanted = 20.0 - 8.0 * np.sin(ELEVATION + np.pi / 18)
    assert (elevation - ELEVATION) / ARCSEC == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("at_deg", [0.0, 35.0, 90.0, 200.0])
def test_both_faces_read_circles_that_are_off_their_axes(at_deg):
    """A circle off by E reads w + E sin(w - w0); in face 2 a sight is at a + 180 and 360 - z."""
    size, zero, z = 40.0 * ARCSEC, np.radians(at_deg), np.pi / 2 - ELEVATION

    def read(circle, at):
        return circle + size * np.sin(circle - at)

    azimuths = read(AZIMUTH, zero), read(AZIMUTH + np.pi, zero) - np.pi
    zeniths = read(z, np.pi / 2 - zero), 2 * np.pi - read(2 * np.pi - z, np.pi / 2 - zero)
    for face, azimuth, zenith in zip((1, 2), azimuths, zeniths, strict=True):
        one = Calibration(
            azimuth_eccentricity_arcsec=40.0,
            azimuth_eccentricity_at_deg=at_deg,
            elevation_eccentricity_arcsec=40.0,
            elevation_eccentricity_at_deg=at_deg,
            face=face,
        )
        found = measured_angles(AZIMUTH, ELEVATION, RANGE_M, one)
        assert found[0] == pytest.approx(azimuth, abs=1e-12)
        assert found[1] == pytest.approx(np.pi / 2 - zenith, abs=1e-12)


def test_the_mean_of_both_faces_has_no_error_of_angles():
    """Where the circle of the elevation is off its axis upwards or downwards, in sin e."""
    terms = {
        "collimation_arcsec": 15.0,
        "trunnion_arcsec": -12.0,
        "vertical_index_arcsec": 9.0,
        "azimuth_eccentricity_arcsec": 7.0,
        "elevation_eccentricity_arcsec": 6.0,
        "beam_offset_m": 0.0001,
    }
    faces = [
        measured_angles(AZIMUTH, ELEVATION, RANGE_M, Calibration(**terms, face=k)) for k in (1, 2)
    ]
    mean = np.mean(faces, axis=0)
    assert mean == pytest.approx(np.stack([AZIMUTH, ELEVATION]), abs=1e-14)
    half = np.subtract(*faces) / 2
    assert np.abs(half).max() > 15 * ARCSEC


def ideal_points(tmp_path, values, name, whole=False):
    scanner = changed(IDEAL, tmp_path, COARSE | values)
    files = {"vehicle": SALOON, "scanner": scanner, "target": DISC}
    if whole:
        used = write_whole(tmp_path / name, seed=3, points=20_000, **files).used
        return read_ply(tmp_path / name / "vehicle.ply")[0], used
    used = write_capture(tmp_path / name, seed=3, trials=0, **files).used
    return read_ply(tmp_path / name / "fl.ply")[0], used


def test_a_scan_is_reported_at_the_measured_ranges_and_angles(tmp_path):
    terms = {"range_offset_m": 0.0005, "range_scale_ppm": 50.0, "collimation_arcsec": 30.0}
    terms |= {"trunnion_arcsec": 20.0, "vertical_index_arcsec": -15.0, "beam_offset_m": 0.0003}
    true, used = ideal_points(tmp_path, {}, "true")
    found, stated = ideal_points(tmp_path, {"calibration": terms}, "found")
    sight = true - used["scans"][3]["station_m"]
    range_m = np.linalg.norm(sight, axis=1)
    elevation = np.arcsin(sight[:, 2] / range_m)
    azimuth = np.arctan2(sight[:, 1], sight[:, 0])
    one = Calibration(**terms)
    wanted = directions(*measured_angles(azimuth, elevation, range_m, one))
    wanted *= measured_range_m(range_m, one)[:, None]
    assert measured_range_m(range_m, one) == pytest.approx(range_m * 1.00005 + 0.0005, abs=1e-12)
    assert found - used["scans"][3]["station_m"] == pytest.approx(wanted, abs=1e-9)
    assert stated["calibration"] == terms


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, True])
def test_a_station_is_misplaced_as_a_rigid_body_by_what_the_truth_states(tmp_path, whole):
    values = {"registration": {"shift_sigma_m": 0.001, "turn_sigma_arcsec": 60.0}}
    true, used = ideal_points(tmp_path, {}, "true", whole)
    found, stated = ideal_points(tmp_path, values, "found", whole)
    number = 0 if whole else 3
    scan = stated["scans"][number]
    rows = slice(*scan.get("rows", [0, len(true)]))
    turn = np.array(scan["registration_turn_arcsec"]) * ARCSEC
    sight = true[rows] - used["scans"][number]["station_m"]
    wanted = np.cross(turn, sight) + scan["registration_shift_m"]
    # First order: the rest is half of turn^2 times the range.
    bound_m = np.sum(turn**2) * np.linalg.norm(sight, axis=1).max() + 1e-9
    assert found[rows] - true[rows] == pytest.approx(wanted, abs=bound_m)
    assert np.abs(wanted).max() > 1e-4
    shifts = [one["registration_shift_m"] for one in stated["scans"]]
    assert len(np.unique(np.round(shifts, 9))) == 3 * len(stated["scans"])


def test_misplacements_have_the_stated_deviation_about_and_along_each_axis():
    rng = np.random.default_rng(2)
    registration = Registration(shift_sigma_m=0.0004, turn_sigma_arcsec=12.0)
    drawn = [draw_misplacement(registration, rng) for _ in range(2000)]
    turn = np.std([one.turn_rad for one in drawn], axis=0) / ARCSEC
    shift = np.std([one.shift_m for one in drawn], axis=0)
    bound = 5 / np.sqrt(2 * len(drawn))  # 5 sigma of a standard deviation
    assert turn == pytest.approx(np.full(3, 12.0), rel=bound)
    assert shift == pytest.approx(np.full(3, 0.0004), rel=bound)
