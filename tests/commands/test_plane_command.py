"""`wheelplane plane`: meshes, units and coordinates that it tells about; progress on a terminal."""

from __future__ import annotations

import json
import os
import sys
from unittest import mock

import numpy as np
import pytest

from wheelplane.cli import main
from wheelplane.commands.shared.progress import Reading
from wheelplane.errors import InputError
from wheelplane.library.single_scan import find_planes, fit_plane


@pytest.fixture
def plane(capsys, monkeypatch):
    """Exit code, standard output and standard error of the command."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["wheelplane", "plane", *map(str, arguments)])
        with mock.patch.dict(os.environ), pytest.raises(SystemExit) as left:
            main()
        return left.value.code, *capsys.readouterr()

    return call


def plate(spread=1.0, count=3000):
    rng = np.random.default_rng(0)
    return (
        np.column_stack([rng.uniform(0, spread, (count, 2)), rng.normal(0, 1e-3 * spread, count)])
        @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    )


def test_a_mesh_is_sampled_when_asked(tmp_path, plane):
    file = tmp_path / "roof.obj"
    file.write_text("v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    code, out, _ = plane(file, "--sample", 30_000, "--json", "--max-planes", 2)
    tree = json.loads(out)
    assert (code, tree["points_total"]) == (0, 30_000)
    assert [np.round(np.abs(p["normal"]), 9).tolist() for p in tree["planes"]] == [
        [0, 0, 1],
        [0, 1, 0],
    ]
    assert plane(file, "--sample", 30_000, "--json", "--max-planes", 2)[1] == out
    code, out, err = plane(tmp_path / "roof.obj", "--sample", 0)
    assert code == 2
    np.savetxt(tmp_path / "a.xyz", plate())
    code, out, err = plane(tmp_path / "a.xyz", "--sample", 5)
    assert (code, out) == (2, "")
    assert "the points are read, and no surface" in err


@pytest.mark.parametrize(
    ("change", "sound"),
    [
        (np.eye(3), True),
        (1e-3 * np.eye(3), True),
        (np.diag([1.0, 1.0, 1.05]), False),
        (np.eye(3) + 0.05 * np.eye(3, k=1), False),
    ],
    ids=["rotation", "millimetres", "stretched", "sheared"],
)
def test_a_pose_that_changes_angles_shows_no_plane(tmp_path, plane, change, sound):
    """Neither to the command nor to the library, as `measure` refuses it."""
    file, R = tmp_path / "a.ptx", np.linalg.qr(np.arange(9.0).reshape(3, 3) ** 2 + 1.0)[0]
    axes = (R * np.sign(np.linalg.det(R)) @ change).T
    head = ["3000", "1", "0 0 0", *(" ".join(map(str, row)) for row in axes)]
    head += [" ".join(map(str, [*row, 0.0])) for row in axes] + ["0 0 0 1"]
    points = plate() / np.cbrt(np.linalg.det(change))
    rows = [" ".join(map(str, [*row, 0.5])) for row in points]
    file.write_text("\n".join([*head, *rows]) + "\n")
    code, out, err = plane(file, "--max-planes", 1)
    assert (code, bool(out)) == ((0, True) if sound else (2, False))
    assert sound or "the pose of its scan 1 is no rotation: it scales the axes by" in err
    for find in (find_planes, fit_plane):
        if sound:
            find(file)
            continue
        with pytest.raises(InputError, match="the pose of its scan 1 is no rotation"):
            find(file)


def test_the_vertices_of_a_mesh_that_show_no_plane_name_the_option(tmp_path, plane):
    rng = np.random.default_rng(1)
    file = tmp_path / "ball.obj"
    ball = rng.normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    file.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in ball))
    code, out, err = plane(file)
    assert (code, out) == (2, "")
    assert "it is a mesh of 400 vertices: add --sample 100000" in err


def test_a_size_that_no_scan_has_is_refused(tmp_path, plane):
    np.savetxt(tmp_path / "a.xyz", plate(30_000.0))
    code, out, err = plane(tmp_path / "a.xyz")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "give --length-unit mm" in err
    assert plane(tmp_path / "a.xyz", "--length-unit", "mm")[0] == 0
    np.savetxt(tmp_path / "b.xyz", plate(0.5))
    code, _, err = plane(tmp_path / "b.xyz", "--length-unit", "mm")
    assert code == 2
    assert "give --length-unit m" in err


def test_coordinates_that_float32_spoilt_are_reported(tmp_path, plane):
    points = (plate(40.0) + np.array([5e4, 6e4, 100.0])).astype(np.float32).astype(float)
    np.save(tmp_path / "a.npy", points)
    code, out, _ = plane(tmp_path / "a.npy")
    assert code == 0
    assert "note: its coordinates are float32, which at 50" in out
    assert json.loads(plane(tmp_path / "a.npy", "--json")[1])["notes"] != []
    np.save(tmp_path / "b.npy", plate(40.0))
    assert json.loads(plane(tmp_path / "b.npy", "--json")[1])["notes"] == []


@pytest.mark.parametrize("terminal", [True, False])
def test_a_long_read_shows_its_share_on_a_terminal_alone(terminal, monkeypatch, capsys):
    clock = iter(np.arange(0.0, 100.0, 0.3).tolist())
    monkeypatch.setattr("wheelplane.commands.shared.progress.time.monotonic", lambda: next(clock))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    with Reading("a.ply") as progress:
        for done in range(0, 1001, 10):
            progress(done, 1000)
    out, err = capsys.readouterr()
    assert out == ""
    if not terminal:
        assert err == ""
        return
    contributions = [int(part.split(" %")[0]) for part in err.split("a.ply: ")[1:]]
    assert contributions == sorted(set(contributions))
    assert contributions[-1] == 100
    assert contributions[0] > 2  # nothing in the first second
    assert err.endswith("\r\x1b[K")


def test_a_short_read_shows_nothing(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with Reading("a.ply") as progress:
        progress(10, 10)
    assert capsys.readouterr().err == ""
