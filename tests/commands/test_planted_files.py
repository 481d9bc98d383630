"""No command runs, imports or loads a file of the folder that it is called in.

Scans come from others; who measures them stands in the folder where they were delivered.
"""

from __future__ import annotations

import shutil

import pytest

from tests.support.batches import five_points
from tests.support.made import read_ply, write_small_capture
from tests.support.native_files import E57Scan, write_e57, xyz
from tests.support.paths import FIGURE_4
from tests.support.planted import Planted
from tests.support.web_site import Site

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """A capture of four PLY, the same as E57, and its five points a wheel."""
    place = tmp_path_factory.mktemp("captures")
    ply = write_small_capture(place / "ply", trials=0)
    e57 = place / "e57"
    e57.mkdir()
    for wheel in ("rr", "rl", "fr", "fl"):
        write_e57(e57 / f"{wheel}.e57", E57Scan(xyz(read_ply(ply / f"{wheel}.ply")[0])))
    return place


@pytest.fixture
def planted(tmp_path):
    made = Planted(tmp_path)
    yield made
    assert made.ran == []
    assert made.untouched


def test_planted_files_are_seen(tmp_path):
    """So that the others can fail: `python -c` takes modules from the current folder."""
    made = Planted(tmp_path)
    made.run(start=("-c", "import hashlib"))
    assert [name.rpartition("/")[2] for name in made.ran] == ["hashlib.py"]
    assert not made.untouched


@pytest.mark.parametrize("scans", ["ply", "e57"])
def test_measure(planted, captures, tmp_path, scans):
    done = planted.run("measure", captures / scans, "--target", "disc-250", "-o", tmp_path / "out")
    assert (done.returncode, done.stderr) == (0, "")


def test_batch_and_results(planted, captures, tmp_path):
    archive = tmp_path / "archive"
    for name in ("e57", "ply"):
        shutil.copytree(captures / name, archive / name)
        shutil.copytree(captures / name, archive / f"{name} again")
    for k in range(4):
        five_points(archive / f"car-{k}.txt", k)
    arguments = ("-o", tmp_path / "results", "--target", "disc-250", "--workers", "2")
    done = planted.run("batch", archive, *arguments)
    assert "8 ok" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0
    done = planted.run("results", tmp_path / "results", "--summary", "--drift")
    assert (done.returncode, done.stderr.count("\n")) == (0, 1)
    assert done.stderr.startswith("2 captures of the same files as another")


def test_validate(planted, captures):
    points = captures / "ply" / "five-point.txt"
    done = planted.run("validate", captures / "ply", "--five-point", points)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("command", ["five-point", "inspect", "selftest", "targets"])
def test_the_others(planted, command):
    given = [FIGURE_4] if command in ("five-point", "inspect") else []
    assert planted.run(command, *given).returncode == 0


def test_the_page(planted, captures, tmp_path, monkeypatch):
    """Its jobs start in the folder that `view` was called in."""
    monkeypatch.chdir(planted.folder)
    site = Site(tmp_path / "site")
    try:
        for name in ("ply", "e57"):
            site.copy(captures / name, name)
            options = {"target": "disc-250"}
            job = site.measure({"root": 0, "path": name, "options": options})
            assert job["state"] == "done", job
            assert site.get(f"/api/jobs/{job['id']}/report.html").status_code == 200
    finally:
        site.close()


def test_python_m(tmp_path, captures):
    """`-m` looks for the program, and for what it imports first, in the current folder: not we."""
    planted = Planted(tmp_path, ("numpy", "hashlib", "sqlite3", "pydantic", "rich", "pipeline"))
    five_points(tmp_path / "archive" / "car.txt", 1)
    start = ("-m", "wheelplane")
    arguments = (tmp_path / "archive", "-o", tmp_path / "results", "--workers", "2")
    done = planted.run("batch", *arguments, start=start)
    assert done.returncode == 0, done.stderr
    done = planted.run("measure", captures / "ply", "--json", start=start)
    assert done.returncode == 0, done.stderr
    assert planted.ran == []
    done = Planted(tmp_path / "more").run("targets", start=("-P", *start))
    assert done.returncode == 0, done.stderr
