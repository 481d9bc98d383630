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
from wheelplane.diagnostics.selftest import BOUND, Figure, certified_folder, digest, run_selftest
from wheelplane.errors import InputError
from wheelplane.plane.find_planes import plane_of_all

ROOT = Path(__file__).resolve().parents[2]
PACKED = "wheelplane/diagnostics/certified"  # in the wheel
CHECKS = tuple(run_selftest())


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_certified_answer(check):
    assert check.passed
    assert check.points >= 4
    if check.kind != "scene":
        assert all(0.0 <= figure.value <= BOUND == figure.bound == 1e-9 for figure in check.figures)


def test_every_set_is_there_once_in_order():
    names = [check.name for check in CHECKS]
    assert names == [
        *(f"pla{k}" for k in range(1, 31)),
        *(f"cir{k}" for k in (7, 10, 20, 25)),
        "sac_plane_test",
    ]
    assert [[f.name for f in c.figures] for c in (CHECKS[0], CHECKS[30])] == [
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
def test_what_is_no_small_number_fails(value):
    assert not Figure("angle", "deg", value, BOUND).passed
    assert Figure("angle", "deg", BOUND, BOUND).passed


def tilted(angle_deg):
    """The fit under test, turned by a small angle about a direction in its plane."""

    def fit(points):
        plane = plane_of_all(points)
        aside = np.linalg.svd(plane.normal[None])[2][1]
        normal = plane.normal + np.radians(angle_deg) * aside
        return replace(plane, normal=normal / np.linalg.norm(normal))

    return fit


def test_a_tilted_fit_is_seen_to_its_angle():
    for check in run_selftest(fit_plane=tilted(1e-8)):
        if check.kind != "scene":
            angle = next(f for f in check.figures if f.unit == "deg")
            assert angle.value == pytest.approx(1e-8, abs=1e-10 + BOUND / 100)
            assert not check.passed
    planes = [c for c in run_selftest(fit_plane=tilted(1e-10)) if c.kind == "plane"]
    assert all(check.passed for check in planes)


def test_a_shifted_fit_is_seen():
    def fit(points):
        plane = plane_of_all(points)
        return replace(plane, centroid_m=plane.centroid_m + 1e-8 * plane.normal)

    for check in run_selftest(fit_plane=fit):
        if check.kind == "plane":
            assert check.figures[1].value == pytest.approx(1e-8, rel=1e-4)
            assert not check.passed


def test_single_precision_would_not_do():
    def fit(points):
        origin = points.mean(axis=0)
        plane = plane_of_all((points - origin).astype(np.float32).astype(float))
        return replace(plane, centroid_m=plane.centroid_m + origin)

    planes = [c for c in run_selftest(fit_plane=fit) if c.kind == "plane"]
    assert sum(not check.passed for check in planes) > 20


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(certified_folder(), tmp_path / "certified")
    return tmp_path / "certified"


@pytest.mark.parametrize(
    ("file", "old", "new", "name"),
    [
        ("nist/plane/pla3.ds", "116.28589", "116.28588", "pla3"),
        ("nist/plane/pla3.fit", "0.00057991943628", "0.00057991953628", "pla3"),
        ("nist/plane/pla3.fit", "116.285968333", "116.285968433", "pla3"),
        ("nist/circle/cir25.ds", "-1.17061", "-1.17062", "cir25"),
        ("nist/circle/cir25.fit", "1.05314799998", "1.05314899998", "cir25"),
    ],
)
def test_a_changed_digit_is_seen(copy, file, old, new, name):
    text = (copy / file).read_text()
    assert old in text
    (copy / file).write_text(text.replace(old, new, 1))
    assert [check.name for check in run_selftest(copy) if not check.passed] == [name]
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
    told = run()
    assert told.return_value == 0
    lines = told.output.splitlines()
    assert lines[0] == f"wheelplane {__version__} selftest"
    assert lines[-1] == "selftest: 35 of 35 passed"
    assert sum(line.endswith(" pass") for line in lines) == 35
    assert "eps 2.220446049250313e-16" in told.output
    assert digest() in told.output
    assert told.output.isascii()
    assert run().output == told.output  # no date, no time, no path
    assert str(ROOT) not in told.output
    assert run("-o", str(tmp_path / "filed.txt")).return_value == 0
    assert (tmp_path / "filed.txt").read_text() == told.output


def test_command_prints_json():
    tree = json.loads(run("--json").output)
    assert (tree["schema"], tree["passed"], tree["total"]) == ("wheelplane/selftest/1", 35, 35)
    assert {check["name"] for check in tree["checks"]} == {check.name for check in CHECKS}
    assert all(f["passed"] for check in tree["checks"] for f in check["figures"])


def test_command_fails_when_a_check_does(monkeypatch):
    angle, offset = CHECKS[0].figures
    bad = replace(CHECKS[0], figures=(replace(angle, value=2e-9), offset))
    monkeypatch.setattr(command, "run_selftest", lambda: iter((bad, *CHECKS[1:])))
    told = run()
    assert told.return_value == 1
    assert told.output.splitlines()[-1] == "selftest: 34 of 35 passed"
    assert next(line for line in told.output.splitlines() if " pla1 " in line).endswith("FAIL")
    assert json.loads(run("--json").output)["passed"] == 34


def test_nan_is_null_and_failed(monkeypatch):
    angle, offset = CHECKS[0].figures
    bad = replace(CHECKS[0], figures=(replace(angle, value=np.nan), offset))
    monkeypatch.setattr(command, "run_selftest", lambda: iter((bad, *CHECKS[1:])))
    told = run("--json")
    assert told.return_value == 1
    tree = json.loads(told.output, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))
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
