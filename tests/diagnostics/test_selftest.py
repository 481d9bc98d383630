"""The certified data as tests, and that the selftest fails when it should."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from decimal import Decimal, getcontext
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import wheelplane.commands.selftest as command
from wheelplane import __version__
from wheelplane.diagnostics import selftest
from wheelplane.diagnostics.selftest import (
    BOUND,
    PLANE_FITS,
    Figure,
    certified_folder,
    digest,
    run_selftest,
)
from wheelplane.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
PACKED = "wheelplane/diagnostics/certified"  # in the wheel
CHECKS = tuple(run_selftest())
PLANES = [f"pla{k}" for k in range(1, 31)]


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: f"{check.kind}-{check.name}")
def test_certified_answer(check):
    assert check.passed
    assert check.points >= 4
    if check.kind != "scene":
        assert all(0.0 <= figure.value <= BOUND == figure.bound == 1e-9 for figure in check.figures)


def test_every_set_is_there_once_in_order():
    assert [(check.kind, check.name) for check in CHECKS] == [
        *(("plane", name) for name in PLANES),
        *(("clipped-plane", name) for name in PLANES),
        *(("circle", f"cir{k}") for k in (7, 10, 20, 25)),
        ("scene", "sac_plane_test"),
    ]
    assert [[f.name for f in c.figures] for c in (CHECKS[0], CHECKS[30], CHECKS[60])] == [
        ["angle", "offset"],
        ["angle", "offset"],
        ["centre", "normal", "diameter"],
    ]


def test_bounds_of_pcl_are_its_own():
    plane, inliers = CHECKS[-1].figures
    assert (plane.bound, plane.above) == (0.1, False)
    assert (inliers.bound, inliers.above) == (2000, True)
    assert CHECKS[-1].points == 3283
    assert not replace(plane, value=0.11).passed
    assert not replace(inliers, value=2000).passed


@pytest.mark.parametrize("value", [np.nan, np.inf, 1.1e-9])
def test_a_figure_above_its_bound_or_not_finite_fails(value):
    assert not Figure("angle", "deg", value, BOUND).passed
    assert Figure("angle", "deg", BOUND, BOUND).passed


def spoilt(kind, change):
    """The fits under test, the planes of one of them changed."""
    return PLANE_FITS | {kind: lambda points: change(PLANE_FITS[kind](points))}


def tilted(angle_deg):
    """Tilt a plane by a small angle about a direction in it."""

    def change(plane):
        aside = np.linalg.svd(plane.normal[None])[2][1]
        normal = plane.normal + np.radians(angle_deg) * aside
        return replace(plane, normal=normal / np.linalg.norm(normal))

    return change


@pytest.mark.parametrize("kind", PLANE_FITS)
def test_a_tilted_fit_fails_by_its_angle(kind):
    circles = ["circle"] if kind == "clipped-plane" else []  # projected on that plane
    for check in run_selftest(plane_fits=spoilt(kind, tilted(1e-8))):
        assert check.passed == (check.kind not in (kind, *circles))
        if not check.passed:
            angle = next(f for f in check.figures if f.unit == "deg")
            assert angle.value == pytest.approx(1e-8, abs=1e-10 + BOUND / 100)
    assert all(check.passed for check in run_selftest(plane_fits=spoilt(kind, tilted(1e-10))))


@pytest.mark.parametrize("kind", PLANE_FITS)
def test_a_shifted_fit_fails_by_its_offset(kind):
    def shifted(plane):
        return replace(plane, centroid_m=plane.centroid_m + 1e-8 * plane.normal)

    for check in run_selftest(plane_fits=spoilt(kind, shifted)):
        if check.kind == kind:
            assert check.figures[1].value == pytest.approx(1e-8, rel=1e-4)
            assert not check.passed


@pytest.mark.parametrize("kind", PLANE_FITS)
def test_single_precision_fails(kind):
    def fit(points):
        origin = points.mean(axis=0)
        plane = PLANE_FITS[kind]((points - origin).astype(np.float32).astype(float))
        return replace(plane, centroid_m=plane.centroid_m + origin)

    checks = run_selftest(plane_fits=PLANE_FITS | {kind: fit})
    assert sum(not check.passed for check in checks if check.kind == kind) > 20


def test_nothing_is_clipped_of_certified_points():
    """With a point of 400 far off, the certified fit follows it as least squares do."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(400, 3)) * [1.0, 1.0, 1e-3]
    points[7, 2] = 0.5  # 20 sigma of the whole set
    fits = [fit(points) for fit in PLANE_FITS.values()]
    clipped, least = fits[1].normal * np.sign(fits[1].normal[2]), fits[0].normal
    np.testing.assert_allclose(clipped, least, atol=1e-12)
    assert abs((points[7] - fits[1].centroid_m) @ clipped) > 0.4
    without = PLANE_FITS["plane"](np.delete(points, 7, axis=0))
    assert np.linalg.norm(np.cross(without.normal, least)) > 1e-5


def test_circles_are_fitted_as_the_edges_of_targets(monkeypatch):
    """An error of the edge fit shows, although the certified diameter is given to it."""
    fit = selftest.fit_edge_points
    off = (np.array([3e-9 * selftest.CIRCLE_UNIT_M, 0.0]), 2e-9 * selftest.CIRCLE_UNIT_M)

    def moved(*arguments):
        found = fit(*arguments)
        return replace(found, centre_m=found.centre_m + off[0], growth_m=found.growth_m + off[1])

    monkeypatch.setattr(selftest, "fit_edge_points", moved)
    for check in run_selftest():
        if check.kind == "circle":
            assert check.figures[0].value == pytest.approx(3e-9, rel=0.01)
            assert check.figures[2].value == pytest.approx(4e-9, rel=0.02)
            assert not check.passed


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(certified_folder(), tmp_path / "certified")
    return tmp_path / "certified"


@pytest.mark.parametrize(
    ("file", "old", "new", "names"),
    [
        ("nist/plane/pla3.ds", "116.28589", "116.28588", ["pla3", "pla3"]),
        ("nist/plane/pla3.fit", "0.00057991943628", "0.00057991953628", ["pla3", "pla3"]),
        ("nist/plane/pla3.fit", "116.285968333", "116.285968433", ["pla3", "pla3"]),
        ("nist/circle/cir25.ds", "-1.17061", "-1.17062", ["cir25"]),
        ("nist/circle/cir25.fit", "1.05314799998", "1.05314899998", ["cir25"]),
        ("nist/circle/cir7.fit", "2.18978987", "2.18978988", ["cir7"]),
    ],
)
def test_a_changed_digit_fails(copy, file, old, new, names):
    text = (copy / file).read_text()
    assert old in text
    (copy / file).write_text(text.replace(old, new, 1))
    assert [check.name for check in run_selftest(copy) if not check.passed] == names
    assert digest(copy) != digest()


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_text(path.read_text()[:-30]),
        lambda path: path.write_text(path.read_text().replace(".", "x", 1)),
        lambda path: path.write_bytes(b"\xff" + path.read_bytes()),
        lambda path: path.write_text(""),
        lambda path: path.unlink(),
    ],
    ids=["cut", "letter", "byte", "empty", "gone"],
)
@pytest.mark.parametrize("file", ["pla5.fit", "pla5.ds"])
def test_a_damaged_file_is_one_line(copy, file, damage):
    path = copy / "nist" / "plane" / file
    damage(path)
    with pytest.raises(InputError, match=r"pla5.* certified data are damaged .*install") as caught:
        list(run_selftest(copy))
    assert len(str(caught.value).splitlines()) == 1


def test_decimals_of_the_files_are_read_to_the_last_bit():
    """The certified answers hold 20 digits; what a float loses of them is far below 1e-9."""
    getcontext().prec = 60
    for path in sorted((certified_folder() / "nist").rglob("*.fit")):
        for word in path.read_text().split():
            lost = abs(Decimal(word) - Decimal(float(word)))
            assert lost <= abs(Decimal(word)) * Decimal(2) ** -53
            assert lost < Decimal(BOUND) / 1000


def run(*arguments):
    return CliRunner().invoke(command.selftest, arguments, standalone_mode=False)


def test_command_prints_a_table_to_file(tmp_path):
    result = run()
    assert result.return_value == 0
    lines = result.output.splitlines()
    assert lines[0] == f"wheelplane {__version__} selftest"
    assert lines[-1] == "selftest: 65 of 65 passed"
    assert sum(line.endswith(" pass") for line in lines) == 65
    assert "eps 2.220446049250313e-16" in result.output
    assert digest() in result.output
    assert result.output.isascii()
    assert run().output == result.output  # no date, no time, no path
    assert str(ROOT) not in result.output
    assert run("-o", str(tmp_path / "filed.txt")).return_value == 0
    assert (tmp_path / "filed.txt").read_text() == result.output


def test_command_prints_json():
    tree = json.loads(run("--json").output)
    assert (tree["schema"], tree["passed"], tree["total"]) == ("wheelplane/selftest/1", 65, 65)
    assert {check["name"] for check in tree["checks"]} == {check.name for check in CHECKS}
    assert all(f["passed"] for check in tree["checks"] for f in check["figures"])


def test_command_fails_when_a_check_does(monkeypatch):
    angle, offset = CHECKS[0].figures
    bad = replace(CHECKS[0], figures=(replace(angle, value=2e-9), offset))
    monkeypatch.setattr(command, "run_selftest", lambda: iter((bad, *CHECKS[1:])))
    result = run()
    assert result.return_value == 1
    assert result.output.splitlines()[-1] == "selftest: 64 of 65 passed"
    assert next(line for line in result.output.splitlines() if " pla1 " in line).endswith("FAIL")
    assert json.loads(run("--json").output)["passed"] == 64


def test_nan_is_null_and_failed(monkeypatch):
    angle, offset = CHECKS[0].figures
    bad = replace(CHECKS[0], figures=(replace(angle, value=np.nan), offset))
    monkeypatch.setattr(command, "run_selftest", lambda: iter((bad, *CHECKS[1:])))
    result = run("--json")
    assert result.return_value == 1
    tree = json.loads(result.output, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))
    assert tree["checks"][0]["figures"][0]["value"] is None
    assert not tree["checks"][0]["figures"][0]["passed"]


def test_built_wheel_holds_the_data(tmp_path):
    build = "from hatchling.build import build_wheel; print(build_wheel({!r}))"
    environment = os.environ | {"SOURCE_DATE_EPOCH": "315532800"}
    code = build.format(str(tmp_path))
    subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, env=environment
    )
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        held = set(wheel.namelist())
    for path in certified_folder().rglob("*"):
        if path.is_file():
            assert f"{PACKED}/{path.relative_to(certified_folder()).as_posix()}" in held
    assert {f"{PACKED}/README.md", f"{PACKED}/pcl/LICENSE.txt"} <= held
