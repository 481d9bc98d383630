"""Terms planted in field tests come out within their u; what tests cannot show is left out."""

import numpy as np
import pytest
from scipy import stats

from wheelplane.errors import InputError
from wheelplane.uncertainty.field_tables import FACES, LENGTHS
from wheelplane.uncertainty.field_tests import evaluate_tests, fit_terms
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


def two_faces(
    path,
    seed=0,
    count=60,
    steep_deg=60.0,
    near_m=1.0,
    far_m=12.0,
    noise=ANGLE_SIGMA_ARCSEC,
    phase_deg=0.0,
    reversed_cosine=True,
    planted=PLANTED,
):
    """Targets all round, in both faces, by the generator's own formulas.

    phase_deg: of the elevation's eccentricity. reversed_cosine: whether face 2 reverses its cosine
    part as well, as it does not in the generator.
    """
    rng = np.random.default_rng(seed)
    azimuth, elevation = (
        rng.uniform(-np.pi, np.pi, count),
        np.radians(steep_deg) * rng.uniform(-1, 1, count),
    )
    range_m = rng.uniform(near_m, far_m, count)
    cosine = -planted["elevation_eccentricity_arcsec"] * np.sin(np.radians(phase_deg))
    lines = [",".join(FACES)]
    for face in (1, 2):
        errors = Calibration(
            **planted,
            face=face,
            azimuth_eccentricity_at_deg=40.0,
            elevation_eccentricity_at_deg=phase_deg,
        )
        a, e = measured_angles(azimuth, elevation, range_m, errors)
        if face == 2 and reversed_cosine:
            e = e - 2.0 * np.radians(cosine / 3600.0) * np.cos(elevation)
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
            assert key == "vertical_index_arcsec" or found[key].u < 0.5 * abs(value)
            assert found[key].stated == pytest.approx(np.hypot(found[key].value, found[key].u))
        for axis, size in (("azimuth", 9.0), ("elevation", 14.0)):
            assert found[f"{axis}_eccentricity_arcsec"].value == pytest.approx(size, abs=6.0)
    offs = np.array(offs)
    rms = np.sqrt(np.mean(offs**2, axis=0))
    assert np.all(rms < 1.0 + 4.0 / np.sqrt(2 * tests))
    # The u of the index allows for a cosine of the elevation's eccentricity: nothing, in phase 0.
    seen = [key != "vertical_index_arcsec" for key in WANTED]
    assert np.all(rms[seen] > 1.0 - 4.0 / np.sqrt(2 * tests))
    assert 0.9 < np.mean(np.abs(offs[:, seen]) < 1.96) <= 1.0


@pytest.mark.parametrize("reversed_cosine", [True, False])
@pytest.mark.parametrize("steep_deg", [30.0, 75.0])
@pytest.mark.parametrize("phase_deg", [0.0, 23.0, 90.0, -90.0])
def test_index_and_eccentricity_hold_in_every_phase(
    tmp_path, phase_deg, steep_deg, reversed_cosine
):
    """Two faces do not separate the eccentricity's cosine, which they need not reverse.

    Circles are as eccentric as one another: what else could be known of a part that is not seen?
    """
    offs, planted = [], PLANTED | {"elevation_eccentricity_arcsec": 9.0}
    for seed in range(20):
        path = two_faces(
            tmp_path / "f.csv",
            seed,
            steep_deg=steep_deg,
            phase_deg=phase_deg,
            reversed_cosine=reversed_cosine,
            planted=planted,
        )
        found = evaluate_tests([path])
        terms = {term.key: term for term in found.terms}
        for key in ("vertical_index_arcsec", "elevation_eccentricity_arcsec"):
            assert terms[key].u < 20.0
            offs.append((terms[key].value - planted[key]) / terms[key].u)
    assert np.sqrt(np.mean(np.reshape(offs, (-1, 2)) ** 2, axis=0)).max() < 1.2


@pytest.mark.parametrize(("near_m", "far_m"), [(2.0, 2.5), (8.0, 9.0)])
def test_the_collimation_allows_for_a_beam_offset_that_no_ranges_show(tmp_path, near_m, far_m):
    """Left out, the offset adds itself over the range to the collimation; nothing to the rest."""
    offs, us = [], []
    for seed in range(20):
        path = two_faces(tmp_path / "f.csv", seed, count=12, near_m=near_m, far_m=far_m)
        found = evaluate_tests([path])
        assert "beam_offset_m" in found.left_out
        terms = {term.key: term for term in found.terms}
        us.append(terms["collimation_arcsec"].u)
        for key in ("collimation_arcsec", "trunnion_arcsec"):
            offs.append((terms[key].value - PLANTED[key]) / terms[key].u)
    rms = np.sqrt(np.mean(np.reshape(offs, (-1, 2)) ** 2, axis=0))
    assert rms.max() < 1.0 + 4.0 / np.sqrt(2 * 20)
    by_offset = np.degrees(5e-4 / (0.5 * (near_m + far_m))) * 3600.0
    assert np.mean(us) == pytest.approx(by_offset, rel=0.25)


@pytest.mark.parametrize("length_m", [5.0, 10.0])
def test_the_range_bias_allows_for_a_scale_that_lengths_of_one_size_do_not_show(tmp_path, length_m):
    """A scale of 10 ppm (k = 1) adds half of itself over the length to the bias."""
    bias_m, offs, path = 3e-4, [], tmp_path / "l.csv"
    for seed in range(60):
        rng = np.random.default_rng(seed)
        scale = 1.0 + 1e-6 * rng.normal(0.0, 10.0)
        reference = length_m * rng.uniform(0.9, 1.1, 10)
        near, noise = reference * rng.uniform(0.3, 0.7, 10), rng.normal(0.0, U_M, 10)
        measured = reference * scale + 2.0 * bias_m + noise
        columns = (measured, reference, np.full(10, U_M), near, reference - near)
        table = np.column_stack(columns)
        rows = [f"L{k}," + ",".join(f"{x:.7f}" for x in row) for k, row in enumerate(table)]
        path.write_text("\n".join([",".join(LENGTHS), *rows]) + "\n")
        found = evaluate_tests([path])
        assert found.left_out == ("range_scale_ppm",)
        (term,) = found.terms
        offs.append((term.value - bias_m) / term.u)
    assert term.u == pytest.approx(1e-5 * length_m / 2.0, rel=0.1)
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], len(offs))
    assert low < np.sum(np.square(offs)) < high


@pytest.mark.parametrize(("seen", "between"), [(15.0, True), (20.0, True), (20.0, False)])
def test_lengths_seen_at_an_angle_show_a_part_of_the_range_bias(tmp_path, seen, between):
    """Points 15 to 20 degrees apart: 5 to 9 % of the bias, which are no error of the scale."""
    offs, path = [], tmp_path / "l.csv"
    for seed in range(60):
        rng = np.random.default_rng(seed)
        bias_m, scale_ppm = rng.normal(0.0, 6e-4), rng.normal(0.0, 30.0)
        p = rng.uniform(1.0, 3.0, 12)
        q = p + rng.uniform(4.0, 9.0, 12)
        turn = np.radians(np.where(between & (np.arange(12) % 2 == 1), 180.0, seen))
        scale = 1.0 + 1e-6 * scale_ppm
        true, measured = (
            np.sqrt(a**2 + b**2 - 2.0 * a * b * np.cos(turn))
            for a, b in ((p, q), (scale * p + bias_m, scale * q + bias_m))
        )
        reference = true + rng.normal(0.0, U_M, 12)
        table = np.column_stack([measured, reference, np.full(12, U_M), p.round(2), q.round(2)])
        rows = [f"L{k}," + ",".join(f"{x:.7f}" for x in row) for k, row in enumerate(table)]
        path.write_text("\n".join([",".join(LENGTHS), *rows]) + "\n")
        found = [one for one in evaluate_tests([path]).terms if one.key == "range_scale_ppm"]
        offs += [(term.value - scale_ppm) / term.u for term in found]
    assert len(offs) > 50
    assert np.sqrt(np.mean(np.square(offs))) < 1.0 + 4.0 / np.sqrt(2 * len(offs))


@pytest.mark.parametrize("seed", range(4))
def test_lengths_in_line_show_no_range_bias_however_their_ranges_are_rounded(tmp_path, seed):
    rng, path = np.random.default_rng(seed), tmp_path / "l.csv"
    p, length = rng.uniform(0.5, 3.0, 12), rng.uniform(1.0, 9.0, 12)
    table = np.column_stack([
        length + rng.normal(0.0, U_M, 12), length, np.full(12, U_M), p.round(2),
        (p + length).round(2)])  # fmt: skip
    rows = [f"L{k}," + ",".join(f"{x:.7f}" for x in row) for k, row in enumerate(table)]
    path.write_text("\n".join([",".join(LENGTHS), *rows]) + "\n")
    assert evaluate_tests([path]).left_out == ("range_bias_m",)


def test_what_the_tests_cannot_tell_apart_is_left_out(tmp_path):
    """All targets at one range: no beam offset. No length from between its ends: no offset."""
    faces = two_faces(tmp_path / "f.csv", steep_deg=15.0, near_m=11.9)
    found = evaluate_tests([faces, lengths(tmp_path / "l.csv", between=False)])
    assert {"beam_offset_m", "range_bias_m"} <= set(found.left_out)
    assert not {"beam_offset_m", "range_bias_m"} & {term.key for term in found.terms}
    scale = next(term for term in found.terms if term.key == "range_scale_ppm")
    assert abs(scale.value - 60.0) < 4.0 * scale.u


def test_only_what_a_test_could_have_shown_is_left_out(tmp_path):
    """Lengths alone say nothing of the axes, neither terms nor what is missing."""
    found = evaluate_tests([lengths(tmp_path / "l.csv", between=False)])
    assert [term.key for term in found.terms] == ["range_scale_ppm"]
    assert found.left_out == ("range_bias_m",)


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
    "few": (
        ",".join(FACES) + f"\n{ROW}\nT1,2,10.01,5.0,3.0\nT2,1,60,20,3\nT2,2,60,20.01,3\n",
        "are too few",
    ),
    "negative": (",".join(LENGTHS) + "\nL,1.0,1.0,0.0,2.0,3.0\n", "must be above 0"),
    "in mm": (",".join(LENGTHS) + "\nL,1135.5,1135.4,0.03,7050,5910\n", "are in metres"),
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


def test_both_parts_of_eccentricities_are_found_without_noise(tmp_path):
    """Seen over all azimuths and 80 degrees of elevation: sine and cosine, in any phase."""
    found = evaluate_tests([two_faces(tmp_path / "f.csv", count=200, steep_deg=80.0, noise=0.0)])
    values = {term.key: term.value for term in found.terms}
    assert found.left_out == ()
    assert values["azimuth_eccentricity_arcsec"] == pytest.approx(9.0, abs=1e-3)
    assert values["elevation_eccentricity_arcsec"] == pytest.approx(14.0, abs=1e-3)
    assert values["vertical_index_arcsec"] == pytest.approx(12.0, abs=1e-3)


def faces_file(path, rows):
    lines = [f"T{k},{face},{a:.9f},{e:.9f},0.4" for k, face, a, e in rows]
    path.write_text("\n".join([",".join(FACES), *lines]) + "\n")
    return path


@pytest.mark.parametrize("offset", [0.0, 180.0, -180.0, 720.0, -359.9])
def test_azimuths_count_in_any_turn_and_from_any_zero(tmp_path, offset):
    """Each reading in a turn of its own, targets at elevations 180 degrees off the azimuth too."""
    rng = np.random.default_rng(1)
    a, e, turns = rng.uniform(-180, 180, 30), rng.uniform(-60, 60, 30), rng.integers(-2, 3, (30, 2))
    a[:10] = e[:10] + 180.0
    apart = np.array([[-5.0, 5.0], [-3.0, 3.0]]) / 3600.0  # of azimuth, elevation; by face
    rows = [
        (k, face, a[k] + offset + 360.0 * turns[k, face - 1] + apart[0, face - 1],
         e[k] + apart[1, face - 1])
        for k in range(30) for face in (1, 2)
    ]  # fmt: skip
    terms = {t.key: t.value for t in evaluate_tests([faces_file(tmp_path / "f.csv", rows)]).terms}
    assert terms["vertical_index_arcsec"] == pytest.approx(-3.0)
    assert "trunnion_arcsec" in terms


@pytest.mark.parametrize(
    ("elevation", "azimuth_apart", "elevation_apart", "refused"),
    [
        (60.0, 0.9, 0.0, False),  # half of it across the beam
        (60.0, 1.1, 0.0, True),
        (60.0, -1.1, 0.0, True),
        (0.0, 0.45, 0.0, False),
        (0.0, 0.55, 0.0, True),
        (60.0, 0.0, 0.45, False),
        (60.0, 0.0, 0.55, True),
        (60.0, 0.0, -0.55, True),
    ],
)
def test_faces_half_a_degree_apart_across_the_beam_are_two_targets(
    tmp_path, elevation, azimuth_apart, elevation_apart, refused
):
    noise = np.random.default_rng(0).normal(0.0, 1e-3, (12, 3))
    rows = [
        (k, face, 30.0 * k + face * noise[k, 0], elevation + 6.0 * (k > 5) + face * noise[k, 1])
        for k in range(12) for face in (1, 2)
    ]  # fmt: skip
    k, face, a, e = rows[5]
    rows[5] = (k, face, a + azimuth_apart, e + elevation_apart)
    path = faces_file(tmp_path / "f.csv", rows)
    if refused:
        with pytest.raises(InputError, match="both faces of target 'T2'"):
            evaluate_tests([path])
    else:
        with pytest.raises(InputError, match=r"target 'T2' .* as far off as the others scatter"):
            evaluate_tests([path])


def pairs_file(path, rows):
    lines = [f"L{k}," + ",".join(f"{x:.12g}" for x in row) for k, *row in rows]
    path.write_text("\n".join([",".join(LENGTHS), *lines]) + "\n")
    return path


@pytest.mark.parametrize("repeated", [False, True])
def test_terms_of_the_range_are_those_of_weighted_least_squares(tmp_path, repeated):
    """Pairs at any angle, of unlike u and number; an offset's effect by moving the points."""
    rng, rows, columns, means, counts, us, scatters = (
        np.random.default_rng(4),
        [],
        [],
        [],
        [],
        [],
        [],
    )
    for k in range(20):
        p, q = rng.uniform(2, 4, 2) * (1 + 3 * (k % 2))
        angle = rng.uniform(0.5, 1.0) if k % 2 else rng.uniform(2.0, 3.0)
        sides = [
            np.hypot(p + o - (q + o) * np.cos(angle), (q + o) * np.sin(angle)) for o in (0, 1e-6)
        ]
        by_offset, u = (sides[1] - sides[0]) / 1e-6, rng.uniform(1e-5, 2e-4)
        count = 1 + k % 4 if repeated else 1
        errors = 8e-4 * by_offset + 6e-5 * sides[0] + rng.normal(0, 3e-4, 4)[:count]
        rows += [(k, sides[0] + error, sides[0], u, p, q) for error in errors]
        columns.append([by_offset, 1e-6 * sides[0]])
        means.append(errors.mean())
        scatters.append(np.sum((errors - errors.mean()) ** 2))
        counts.append(count)
        us.append(u)
    (fit,) = evaluate_tests([pairs_file(tmp_path / "l.csv", rows)]).fits
    pooled = sum(scatters) / max(len(rows) - 20, 1)
    weight = 1.0 / np.sqrt(np.square(us) + pooled / np.array(counts))
    design = weight[:, None] * np.array(columns)
    wanted, (square,), *_ = np.linalg.lstsq(design, weight * means)
    np.testing.assert_allclose(fit.values, wanted, rtol=1e-5)
    by_scatter, by_stated = square / 16, 1.0  # of Student's t with 18 degrees of freedom
    inverse = np.linalg.inv(design.T @ design)
    np.testing.assert_allclose(fit.covariance, max(by_scatter, by_stated) * inverse, rtol=1e-4)


@pytest.mark.parametrize(("off_m", "refused"), [(0.0115, False), (0.019, True)])
def test_a_length_lies_between_difference_and_sum_of_ranges_to_the_centimetre(
    tmp_path, off_m, refused
):
    """With a thousandth besides. Ranges of 7.05 and 5.91 m were refused for a length of 1.13552."""
    rows = [(k, 1.0 + k, 1.0 + k, 1e-4, 2.0, 3.0 + k) for k in range(8)]
    for length in (2.0 - off_m, 8.0 + off_m):  # ranges 3 and 5
        path = pairs_file(tmp_path / "l.csv", [*rows, (8, length, length, 1e-4, 3.0, 5.0)])
        if refused:
            with pytest.raises(InputError, match="cannot lie between points"):
                evaluate_tests([path])
        else:
            evaluate_tests([path])


@pytest.mark.parametrize(
    "row", ["T1,1,,5.0,3.0", "T1,1,10.0,5.0,0.0", "T1,1,10.0,5.0,", "T1,1,1e6,5,3"]
)
def test_an_empty_cell_or_no_range_is_refused_with_its_line(tmp_path, row):
    path = tmp_path / "f.csv"
    path.write_text(f"{','.join(FACES)}\n{ROW}\n,,,,\n# note\n{row}\n")
    with pytest.raises(InputError, match="line 5: "):
        evaluate_tests([path])


def changed(path, change):
    """Write a table anew, its cells changed by `change(index of the row, cells)`."""
    heading, *rows = [line.split(",") for line in path.read_text().splitlines() if line[0] != "#"]
    rows = [change(index, row) for index, row in enumerate(rows)]
    path.write_text("\n".join(",".join(row) for row in [heading, *rows]) + "\n")
    return path


def scaled(columns, factor):
    """Return the change of these columns by a factor."""
    return lambda _, row: [
        f"{float(cell) * factor:.9f}" if column in columns else cell
        for column, cell in enumerate(row)
    ]


def moved(line, column, by):
    """Return the change of one cell by an amount."""
    return lambda index, row: [
        f"{float(cell) + by:.9f}" if (index, at) == (line - 2, column) else cell
        for at, cell in enumerate(row)
    ]


def radians(_, row):
    """Change the angles of a row to radians, of one turn."""
    return [*row[:2], f"{np.radians(float(row[2]) % 360.0):.9f}",
            f"{np.radians(float(row[3])):.9f}", row[4]]  # fmt: skip


def level(elevation):
    """Return the change of all elevations to about one."""
    return lambda index, row: [*row[:3], f"{elevation + 1e-3 * (index % 7):.6f}", row[4]]


SLIPS = {  # of 20 targets, face 1 in lines 2 to 21, or of 24 lengths
    "radians": (two_faces, radians, "as radians do: give degrees"),
    "millimetres": (two_faces, scaled((4,), 1000.0), "are in metres"),
    "ranges of faces": (two_faces, moved(7, 4, 0.2), "lines 7 and 27: the ranges of target 'T5'"),
    "outlier": (two_faces, moved(4, 2, 0.1), "target 'T2' (lines 4 and 24) is"),
    "outlier upwards": (two_faces, moved(4, 3, 0.1), "target 'T2' (lines 4 and 24) is"),
    "one elevation": (two_faces, level(2.0), "at elevations of 2 to 2.00"),
    "outlier of lengths": (lengths, moved(6, 1, 0.5), "pair 'L4' (line 6) is"),
    "references": (lengths, lambda k, row: ["L0" if k < 2 else row[0], *row[1:]], "lines 2 and 3"),
}


@pytest.mark.parametrize("name", SLIPS)
def test_a_slip_in_a_table_is_refused_with_its_lines(tmp_path, name):
    write, change, message = SLIPS[name]
    options = {"count": 20} if write is two_faces else {"repeats": 1}
    path = write(tmp_path / "t.csv", **options)
    turn = changed(path, lambda _, row: row)
    evaluate_tests([turn])
    with pytest.raises(InputError) as error:
        evaluate_tests([changed(path, change)])
    assert message in str(error.value)
    assert str(error.value).startswith(str(path))


def test_azimuths_of_a_turn_of_400_are_in_gon(tmp_path):
    rows = [(k, face, 13.0 * k, 2.0 * k + 1e-3 * face) for k in range(30) for face in (1, 2)]
    evaluate_tests([faces_file(tmp_path / "f.csv", [r for r in rows if r[2] < 361.0])])
    with pytest.raises(InputError, match=r"line 60: an azimuth of 377 .* 400 gon: give degrees"):
        evaluate_tests([faces_file(tmp_path / "f.csv", rows)])


def test_a_second_face_that_is_a_copy_of_the_first_is_refused(tmp_path):
    path = two_faces(tmp_path / "f.csv", count=20)
    first = [line.split(",") for line in path.read_text().splitlines()[1:21]]
    with pytest.raises(InputError, match="face 2 has the very angles of face 1 on 20 of 20"):
        evaluate_tests([changed(path, lambda k, row: [*row[:2], *first[k % 20][2:]])])


def test_two_targets_of_one_name_are_refused(tmp_path):
    path = two_faces(tmp_path / "f.csv", count=20)
    path = changed(path, lambda _, row: ["T0" if row[0] == "T1" else row[0], *row[1:]])
    with pytest.raises(InputError, match=r"lines 2 and 3: rows of target 'T0' in face 1 .* apart"):
        evaluate_tests([path])


@pytest.mark.parametrize("write", [two_faces, lengths])
@pytest.mark.parametrize("delimiter", [";", "\t", ","])
def test_a_table_of_a_spreadsheet_says_the_same(tmp_path, write, delimiter):
    """Semicolons or tabs with decimal commas, and a heading in capitals."""
    path = write(tmp_path / "t.csv")
    terms = evaluate_tests([path]).terms
    text = path.read_text()
    if delimiter != ",":
        text = text.replace(",", delimiter).replace(".", ",")
    heading, rest = text.split("\n", 1)
    path.write_text(f"{heading.title()}\n{rest}")
    assert evaluate_tests([path]).terms == terms


@pytest.mark.parametrize(
    ("factor", "note"), [(1.0, None), (0.2, "u follows the scatter"), (1e3, "that it is in metres")]
)
def test_lengths_that_scatter_otherwise_than_stated_are_noted(tmp_path, factor, note):
    path = changed(lengths(tmp_path / "l.csv", noise=1e-6), scaled((3,), factor))
    notes = evaluate_tests([path]).notes
    assert len(notes) == (note is not None)
    assert note is None or note in notes[0]


def test_observations_without_an_outlier_are_rarely_refused():
    """Normal noise of few degrees of freedom: the level is that of the whole table."""
    rng, labels = np.random.default_rng(0), tuple("abcdef")
    for _ in range(500):
        fit_terms({"one": np.ones(6)}, rng.normal(size=6), np.ones(6), "here", labels)
    observed = rng.normal(size=6)
    observed[3] += 1e4
    with pytest.raises(InputError, match="here: d is"):
        fit_terms({"one": np.ones(6)}, observed, np.ones(6), "here", labels)
