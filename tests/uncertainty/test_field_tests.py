"""Terms planted in field tests come out within their u; what tests cannot show is left out."""

import numpy as np
import pytest
from scipy import stats

from wheelplane.errors import InputError
from wheelplane.uncertainty.field_tests import FACES, LENGTHS, evaluate_tests, fit_terms
from wheelplane_synth.parameters.parameters import Calibration
from wheelplane_synth.scanner.systematic import measured_angles, measured_range_m

PLANTED = {
    "collimation_arcsec": 21.0,
    "trunnion_arcsec": -34.0,
    "vertical_index_arcsec": 12.0,
    "azimuth_eccentricity_arcsec": 9.0,
    "elevation_eccentricity_arcsec": 14.0,
    "beam_offset_m": 2e-4,
    "range_offset_m": 8e-4,
    "range_scale_ppm": 60.0,
}
ANGLE_SIGMA_ARCSEC = 3.0
U_M = 3e-5


def two_faces(path, seed=0, count=60, steep_deg=60.0, near_m=1.0, noise=ANGLE_SIGMA_ARCSEC):
    """Targets all round, in both faces, by the generator's own formulas."""
    rng = np.random.default_rng(seed)
    azimuth, elevation = (
        rng.uniform(-np.pi, np.pi, count),
        np.radians(steep_deg) * rng.uniform(-1, 1, count),
    )
    range_m = rng.uniform(near_m, 12.0, count)
    lines = [",".join(FACES)]
    for face in (1, 2):
        errors = Calibration(**PLANTED, face=face, azimuth_eccentricity_at_deg=40.0)
        a, e = measured_angles(azimuth, elevation, range_m, errors)
        a = a + rng.normal(0, np.radians(noise / 3600), count) / np.cos(elevation)
        e = e + rng.normal(0, np.radians(noise / 3600), count)
        turn = 360.0 * rng.integers(0, 2, count)  # exporters differ in the turn that they begin at
        for k in range(count):
            numbers = (np.degrees(a[k]) + turn[k], np.degrees(e[k]), range_m[k])
            lines.append(f"T{k},{face},{numbers[0]:.9f},{numbers[1]:.9f},{numbers[2]:.5f}")
    path.write_text("\n".join(lines) + "\n")
    return path


def lengths(path, seed=0, between=True, repeats=3, noise=2e-5):
    """Rods seen from beyond their end, and from between their ends."""
    rng = np.random.default_rng(seed)
    errors = Calibration(**PLANTED)
    lines = [",".join(LENGTHS), "# in line with the scanner"]
    for pair, reference in enumerate(rng.uniform(1.0, 20.0, 24)):
        true = reference + rng.normal(0, U_M)
        one = 2.0 if pair % 2 or not between else -0.4 * true
        p, q = abs(one), abs(one + true)
        ranges = [measured_range_m(np.array([r]), errors)[0] for r in (p, q)]
        measured = ranges[1] + ranges[0] * (1.0 if one < 0 else -1.0)
        for _ in range(repeats):
            row = (measured + rng.normal(0, noise), reference, U_M, p, q)
            lines.append(f"L{pair}," + ",".join(f"{x:.7f}" for x in row))
    path.write_text("\n".join(lines) + "\n")
    return path


WANTED = {
    "collimation_arcsec": 21.0,
    "trunnion_arcsec": -34.0,
    "vertical_index_arcsec": 12.0,
    "beam_offset_m": 2e-4,
    "range_bias_m": 8e-4,
    "range_scale_ppm": 60.0,
}


def test_planted_terms_are_found_within_their_u(tmp_path):
    tests, offs = 20, []
    for seed in range(tests):
        paths = [two_faces(tmp_path / "f.csv", seed), lengths(tmp_path / "l.csv", seed)]
        found = {term.key: term for term in evaluate_tests(paths).terms}
        assert set(WANTED) < set(found)
        offs.append([(found[k].value - value) / found[k].u for k, value in WANTED.items()])
        for key, value in WANTED.items():
            assert found[key].u < 0.5 * abs(value)
            assert found[key].stated == pytest.approx(np.hypot(found[key].value, found[key].u))
        # Of the elevation's, sine alone is seen: its cosine is nearly the index.
        for axis, size in (("azimuth", 9.0), ("elevation", 14.0 * np.sqrt(2.0))):
            assert found[f"{axis}_eccentricity_arcsec"].value == pytest.approx(size, abs=6.0)
    offs = np.array(offs)
    # The index takes the cosine of the elevation's eccentricity, of phase 0: nothing here.
    rms = np.sqrt(np.mean(offs**2, axis=0))
    assert np.all(rms < 1.0 + 4.0 / np.sqrt(2 * tests))
    assert np.all(rms > 1.0 - 4.0 / np.sqrt(2 * tests))
    assert 0.9 < np.mean(np.abs(offs) < 1.96) <= 1.0


def test_what_the_tests_cannot_tell_apart_is_left_out(tmp_path):
    """All targets at one range: no beam offset. No length from between its ends: no offset."""
    faces = two_faces(tmp_path / "f.csv", steep_deg=15.0, near_m=11.9)
    found = evaluate_tests([faces, lengths(tmp_path / "l.csv", between=False)])
    assert {"beam_offset_m", "range_bias_m"} <= set(found.left_out)
    assert not {"beam_offset_m", "range_bias_m"} & {term.key for term in found.terms}
    scale = next(term for term in found.terms if term.key == "range_scale_ppm")
    assert abs(scale.value - 60.0) < 4.0 * scale.u


def test_few_lengths_are_no_better_than_their_references(tmp_path):
    found = evaluate_tests([lengths(tmp_path / "l.csv", 3, repeats=1, noise=0.0)])
    (fit,) = found.fits
    design_limit = U_M / 2.0 / np.sqrt(12)
    assert fit.u[0] > 0.9 * design_limit


def test_columns_alike_are_fitted_once():
    x = np.arange(8.0)
    fit = fit_terms({"one": x + 1.0, "same": 2.0 * x + 2.1}, 3.0 * x + 3.0, np.ones(8), "here")
    assert fit.names == ("one",)
    assert fit.left_out == ("same",)
    assert fit.values == pytest.approx([3.0])


@pytest.mark.parametrize("count", [4, 5, 9])
def test_the_covariance_of_terms_is_that_of_students_t(count):
    rng = np.random.default_rng(count)
    column, weight = rng.uniform(1.0, 2.0, count), rng.uniform(1.0, 3.0, count)
    observed = column + rng.normal(size=count)
    fit = fit_terms({"one": column}, observed, weight, "here")
    (slope,), (square,), *_ = np.linalg.lstsq((weight * column)[:, None], weight * observed)
    scale = square / (count - 1) / np.sum((weight * column) ** 2)
    assert (fit.values[0], fit.dof) == (pytest.approx(slope), count - 1)
    assert fit.covariance[0, 0] == pytest.approx(scale * stats.t(count - 1).var())


def test_as_few_observations_suffice_as_students_t_has_a_variance_for():
    few = np.arange(1.0, 4.0)
    assert np.isfinite(stats.t(len(few)).var())
    assert not np.isfinite(stats.t(len(few) - 1).var())
    with pytest.raises(InputError, match="measure 1 more"):
        fit_terms({"one": few}, few, np.ones(3), "here")


ROW = "T1,1,10.0,5.0,3.0"
BAD = {
    "empty": ("", "its first line is no heading"),
    "heading": ("a,b\n1,2\n", "its first line is no heading"),
    "no rows": (",".join(FACES) + "\n", "no rows"),
    "cells": (",".join(FACES) + "\nT1,1,10.0\n", "line 2: 3 cells, 5 needed"),
    "face": (",".join(FACES) + "\nT1,3,10.0,5.0,3.0\n", "line 2: face is '3'"),
    "number": (",".join(FACES) + "\nT1,1,x,5.0,3.0\n", "line 2: azimuth_deg is 'x'"),
    "nan": (",".join(FACES) + "\nT1,1,nan,5.0,3.0\n", "line 2: azimuth_deg is 'nan'"),
    "zenith": (",".join(FACES) + "\nT1,1,10.0,95.0,3.0\n", "an elevation within 85 degrees"),
    "one face": (",".join(FACES) + f"\n{ROW}\n", "has face 1 alone"),
    "other sense": (",".join(FACES) + f"\n{ROW}\nT1,2,190.0,5.0,3.0\n", "in the sense of face 1"),
    "few": (",".join(FACES) + f"\n{ROW}\nT1,2,10.0,5.0,3.0\n", "are too few"),
    "negative": (",".join(LENGTHS) + "\nL,1.0,1.0,0.0,2.0,3.0\n", "must be above 0"),
    "triangle": (",".join(LENGTHS) + "\nL,9.0,9.0,0.1,2.0,3.0\n", "cannot lie between points"),
    "quote": (",".join(FACES) + '\n"T1,1,10.0\n', "not a CSV file"),
    "binary": (b"\xff\xfe\x00", "not UTF-8"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_tests_are_one_clear_line(tmp_path, name):
    content, message = BAD[name]
    path = tmp_path / "tests.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as error:
        evaluate_tests([path])
    assert message in str(error.value)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_two_files_of_one_kind_are_refused(tmp_path):
    both = [two_faces(tmp_path / "a.csv"), two_faces(tmp_path / "b.csv", 1)]
    with pytest.raises(InputError, match="join both in one file"):
        evaluate_tests(both)
