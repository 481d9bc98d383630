"""`wheelplane inspect`: what it says of a file is true, and what is odd is reported."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.support.scenes import WHEEL, make, rotation
from wheelplane.cli import main
from wheelplane.diagnostics.findings import _nearest_m, findings, spacing_m
from wheelplane.diagnostics.scan_summary import SAMPLE, summarise_scan
from wheelplane.readers import read_scan

ROOT = Path(__file__).resolve().parents[2]
FORMATS = ROOT / "tests" / "data" / "formats"
SITE = np.array([289_814.0, 4_320_978.0, 170.0])
SAMPLES = sorted(p.name for p in FORMATS.iterdir() if p.suffix in (".ply", ".pcd", ".ptx", ".las"))


@pytest.fixture
def inspect(capsys, monkeypatch):
    """Exit code, standard output and standard error of the command."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wheelplane", "inspect", *map(str, arguments)])
        with mock.patch.dict(os.environ), pytest.raises(SystemExit) as left:
            main()
        return left.value.code, *capsys.readouterr()

    return call


def ply(path, points, kind="double"):
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property {kind} {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(head.encode() + points.astype("<f8" if kind == "double" else "<f4").tobytes())
    return path


def raster(count, spacing, seed=0):
    """A wavy square of count x count points, in the order of a scan, somewhere in space."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.arange(count) * spacing, np.arange(count) * spacing, indexing="ij")
    w = 0.02 * np.sin(u * 40) + rng.normal(0, 1e-4, u.shape)
    return np.stack([u, v, w], axis=-1).reshape(-1, 3) @ rotation(rng).T + rng.uniform(-3, 3, 3)


@pytest.mark.parametrize("name", ["a.obj", "a.stl"])
def test_an_empty_mesh_is_not_all_missing_returns(name, tmp_path, inspect):
    (tmp_path / name).write_bytes(b"f 1 2 3\n" if name == "a.obj" else bytes(84))
    code, out, err = inspect(tmp_path / name)
    assert (code, err) == (0, "")
    assert "  warning: it declares 0 points\n" in out


def test_a_coordinate_that_rounds_to_zero_has_no_sign(tmp_path, inspect):
    points = np.random.default_rng(0).uniform(0.0, 1.0, (50, 3))
    points[:, 2] = np.linspace(-2e-5, 3e-5, 50)
    _, out, _ = inspect(ply(tmp_path / "a.ply", points))
    assert re.search(r"^  z +0\.0000 to 0\.0000 m \(0\.05 mm\)$", out, re.MULTILINE)


INTENSITIES = [
    (["nan", "inf", "-inf", "7", "3"], [3.0, 7.0]),
    (["nan", "inf", "-inf", "inf", "nan"], None),
]


@pytest.mark.parametrize(("given", "seen"), INTENSITIES)
def test_what_is_no_number_is_no_end_of_the_intensities(given, seen, tmp_path, inspect):
    """JSON has neither infinity nor nan: other programs refuse a file with them."""

    def refuse(constant):
        raise AssertionError(constant)

    head = "ply\nformat ascii 1.0\nelement vertex 5\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "intensity"))
    rows = [f"{i} {i * i} {i % 2} {text}\n" for i, text in enumerate(given, 1)]
    (tmp_path / "a.ply").write_text(f"{head}end_header\n{''.join(rows)}")
    code, out, err = inspect(tmp_path / "a.ply", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out, parse_constant=refuse)["intensity"] == seen


@pytest.mark.parametrize("name", SAMPLES)
def test_it_agrees_with_what_is_read(name, inspect):
    code, out, err = inspect(FORMATS / name, "--json")
    tree, scan = json.loads(out), read_scan(FORMATS / name)
    assert (code, err) == (0, "")
    assert tree["points"] == len(scan.points_m)
    assert tree["missing_returns"] == scan.invalid_points
    assert tree["low_m"] == scan.points_m.min(axis=0).tolist()
    assert tree["high_m"] == scan.points_m.max(axis=0).tolist()
    assert (tree["intensity"] is None) == (scan.intensity is None)
    if scan.intensity is not None:
        assert tree["intensity"] == [scan.intensity.min(), scan.intensity.max()]
    assert [s["points"] for s in tree["scans"]] == [p.stop - p.start for p in scan.parts]
    if scan.grid is not None:
        assert tree["raster"] == (scan.grid.max(axis=0) + 1).tolist()


def test_the_screen_of_the_posed_sample(inspect):
    code, out, err = inspect(FORMATS / "multiple-and-transform.ptx")
    assert (code, err) == (0, "")
    for piece in (
        "PTX, 557 bytes, coordinates taken as m",
        "8 (0 invalid points besides)",
        "636699.3800 to 637012.2400 m (312.9 m)",
        "0.004395 to 0.034912",
        "2 rows x 4 columns",
        "1: 4 points, scanner at 600000.0000 800000.0000 400.0000 m",
        "warning: the pose of scan 1 is not a rotation: it scales its axes by 1, 1, 2",
    ):
        assert piece in out
    assert len(out.splitlines()) < 25
    assert max(len(line.replace(str(FORMATS), "")) for line in out.splitlines()) <= 100


@pytest.mark.parametrize("count", [60, 500, 900])
@pytest.mark.parametrize("spacing", [0.0012, 0.03])
def test_spacing_of_a_raster_is_found_from_a_sample(tmp_path, count, spacing):
    survey = summarise_scan(ply(tmp_path / "a.ply", raster(count, spacing)), "m")
    assert (survey.stride > 1) == (count**2 >= 2 * SAMPLE)
    # The waves, of slope 0.8, stretch the surface by up to 1.3.
    assert 0.9 < spacing_m(survey) / spacing < 1.35


def test_spacing_of_few_points_is_the_same_among_many_missing_returns(tmp_path):
    """They are all in the sample, however many rows the file declares."""
    points = raster(60, 0.004)
    plain = summarise_scan(ply(tmp_path / "a.ply", points), "m")
    missing = np.vstack([points, np.full((3 * SAMPLE, 3), np.nan)])
    survey = summarise_scan(ply(tmp_path / "b.ply", missing), "m")
    assert survey.stride > 1
    assert spacing_m(survey) == pytest.approx(spacing_m(plain), rel=0.1)


@pytest.mark.parametrize("count", [60, 500])
def test_spacing_is_the_same_where_each_point_is_there_twice(tmp_path, count):
    points = raster(count, 0.004)
    plain, merged = (
        summarise_scan(ply(tmp_path / f"{len(each)}.ply", each), "m")
        for each in (points, np.vstack([points, points]))
    )
    assert spacing_m(merged) == pytest.approx(spacing_m(plain), rel=0.15)


def test_a_sample_is_all_that_is_kept(tmp_path):
    survey = summarise_scan(ply(tmp_path / "a.ply", raster(900, 0.001)), "m")
    assert survey.points == 810_000
    assert SAMPLE / 2 < len(survey.sample_m) < 2 * SAMPLE
    assert len(survey.keys) < 2 * SAMPLE


def shown(folder, points, name="a.ply", unit="m", **options):
    return " | ".join(findings(summarise_scan(ply(folder / name, points, **options), unit)))


def test_few_points_among_many_blank_lines_are_all_looked_at(tmp_path):
    """Missing returns among them are those that a reading drops."""
    points = np.random.default_rng(8).normal(0.0, 1.0, (40, 3))
    points[:15] = 0.0
    path = tmp_path / "rows.xyz"
    rows = [" ".join(f"{x:.6f}" for x in row) + "\n" for row in points]
    path.write_text("".join([*rows[:20], "\n" * 4 * SAMPLE, *rows[20:]]))
    survey = summarise_scan(path, "m")
    scan = read_scan(path)
    assert survey.declared > 2 * SAMPLE
    assert (survey.points, survey.invalid_points) == (len(scan.points_m), scan.invalid_points)
    assert (survey.points, len(survey.sample_m)) == (25, 25)


def test_nothing_is_odd_about_an_ordinary_scan(tmp_path):
    assert shown(tmp_path, make(WHEEL).points_m) == ""
    assert shown(tmp_path, make(WHEEL).points_m + SITE) == ""
    assert shown(tmp_path, make(WHEEL).points_m, kind="float") == ""


def test_what_is_odd_is_reported(tmp_path):
    points = make(WHEEL).points_m
    site = points + SITE
    assert "lie in steps of 500 mm" in shown(tmp_path, site, kind="float")
    assert "lie in steps of 1 mm" in shown(tmp_path, np.round(points, 3))
    assert "give --length-unit mm" in shown(tmp_path, points * 1000)
    assert "give --length-unit m" in shown(tmp_path, points, unit="mm")
    assert "5 points at 0 0 0" in shown(tmp_path, np.vstack([points, np.zeros((5, 3))]))
    assert f"{len(points)} duplicate points" in shown(tmp_path, np.vstack([points] * 2))
    flat = points.copy()
    flat[:, 2] = 0.25
    assert "all points lie on one plane" in shown(tmp_path, flat)
    flat[:, 1] = 0.5
    assert "all points lie on one line" in shown(tmp_path, flat)
    assert "all points have the same position" in shown(tmp_path, flat[:1].repeat(9, axis=0))


def test_points_that_are_doubled_are_counted_in_a_large_cloud(tmp_path):
    points = raster(600, 0.001)
    text = shown(tmp_path, np.vstack([points, points[:180_000]]))
    count = int(text.split("about ")[1].split()[0])
    assert abs(count - 180_000) < 6 * 5**0.5 * 180_000**0.5  # a fifth of them is looked at
    assert "stand" not in shown(tmp_path, raster(600, 0.001))


def test_a_file_of_missing_returns_is_described(tmp_path, inspect):
    file = ply(tmp_path / "a.ply", np.full((7, 3), np.nan))
    code, out, _ = inspect(file)
    assert code == 0
    assert "0 (7 invalid points besides)" in out
    assert "warning: it holds no point" in out
    assert json.loads(inspect(file, "--json")[1])["low_m"] is None


@pytest.mark.parametrize("data", [b"ply\n", b"", b"\0\1\2"])
def test_what_is_refused_is_refused_in_one_line(tmp_path, inspect, data):
    (tmp_path / "a.ply").write_bytes(data)
    code, out, err = inspect(tmp_path / "a.ply")
    assert (code, out) == (2, "")
    assert err.startswith(f"wheelplane: {tmp_path / 'a.ply'}: ")
    assert err.count("\n") == 1


@pytest.fixture
def capture(tmp_path):
    folder = tmp_path / "capture"
    folder.mkdir()
    for index, wheel in enumerate(("rr", "rl", "fr", "fl")):
        ply(folder / f"{wheel}.ply", raster(30 + index, 0.01, index) * 1000)
    ply(folder / "trial-1.ply", np.vstack([raster(20, 0.01) * 1000, np.zeros((2, 3))]))
    (folder / "capture.toml").write_text(
        'length_unit = "mm"\n[reference]\nRR="rr.ply"\nRL="rl.ply"\nFR="fr.ply"\nFL="fl.ply"\n'
        '[[trial]]\nname="1"\nfile="trial-1.ply"\n'
    )
    return folder


def test_a_capture_is_listed_without_its_target(capture, inspect, tmp_path):
    packed = tmp_path / "capture.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for file in capture.iterdir():
            archive.write(file, f"in/{file.name}")
    for source in (capture, packed):
        code, out, err = inspect(source)
        assert (code, err) == (0, "")
        assert out.startswith(f"{source}: a capture of 5 scans, coordinates taken as mm")
        assert "warning: 1: 2 points at 0 0 0" in out
        tree = json.loads(inspect(source, "--json")[1])
        assert [(e["name"], e["role"], e["points"]) for e in tree["entries"]] == [
            *((w, "reference", (30 + i) ** 2) for i, w in enumerate(("RR", "RL", "FR", "FL"))),
            ("1", "trial", 402),
        ]
        assert all(0.005 < e["spacing_m"] < 0.02 for e in tree["entries"])


def test_a_zip_of_one_scan_is_that_scan(tmp_path, inspect):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(FORMATS / "simple_text.ply", "a.ply")
    code, out, _ = inspect(tmp_path / "a.zip", "--json")
    assert code == 0
    assert json.loads(out)["points"] == 3
    code, _, err = inspect(tmp_path / "none.zip")
    assert code == 2
    assert "no such file" in err


def test_progress_stays_out_of_a_pipe(tmp_path):
    ply(tmp_path / "a.ply", raster(100, 0.01))
    run = subprocess.run(
        [sys.executable, "-m", "wheelplane", "inspect", str(tmp_path / "a.ply")],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert run.stderr == ""


def test_a_lone_point_far_off_is_a_finding_and_changes_no_other(tmp_path):
    points = raster(300, 0.003)
    plain = summarise_scan(ply(tmp_path / "plain.ply", points), "m")
    points[777, 0] = 9.9e9
    lone = summarise_scan(ply(tmp_path / "lone.ply", points), "m")
    assert findings(lone) == ["1 of 90000 points lies 9.9e+06 km from the others"]
    assert findings(plain) == []
    assert lone.high_m[0] == 9.9e9
    np.testing.assert_allclose(lone.extent_m, plain.extent_m, atol=0.01)
    assert spacing_m(lone) == pytest.approx(spacing_m(plain), rel=0.1)
    points[777, 0] = 0.0
    points[:, 0] += 1e9 * (np.arange(len(points)) % 2)  # half of them: no lone points
    assert "wide" in findings(summarise_scan(ply(tmp_path / "half.ply", points), "m"))[0]


@pytest.mark.parametrize("equal", [0, 20])
@pytest.mark.parametrize("width", [1e-3, 0.5])
def test_the_nearest_is_found_as_by_a_tree(width, equal):
    points = np.random.default_rng(0).normal(size=(300, 3)) * [1.0, width, 1e-3]
    points[:equal] = points[equal : 2 * equal]
    points = points[np.argsort(points[:, 0])]
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    found = [_nearest_m(points.T, 0, at) for at in range(len(points))]
    assert found == pytest.approx(nearest, rel=1e-12, abs=1e-15)
