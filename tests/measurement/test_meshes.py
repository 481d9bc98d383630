"""Scans that are meshes: measured as clouds, with a note that their u is too small."""

from __future__ import annotations

import shutil

import pytest

from tests.support.made import as_one_cloud, write_small_capture
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture

NOTE = "are the corners of a mesh"


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    return write_small_capture(tmp_path_factory.mktemp("made") / "capture", trials=0)


def join(path):
    """Join the first three points of a binary PLY by a face."""
    head, _, points = path.read_bytes().partition(b"end_header\n")
    face = b"element face 1\nproperty list uchar int vertex_indices\n"
    row = bytes([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])
    path.write_bytes(head + face + b"end_header\n" + points + row)


def notes(folder):
    with open_capture(folder) as capture:
        measured = measure_capture(capture, Config())
    return measured, [str(note) for note in measured.notes if NOTE in str(note)]


def test_a_mesh_is_measured_as_its_corners_with_a_note(capture, tmp_path):
    plain, none = notes(capture)
    assert not none
    meshed = tmp_path / "meshed"
    shutil.copytree(capture, meshed)
    join(meshed / "rr.ply")
    join(meshed / "fl.ply")
    found, (note,) = notes(meshed)
    assert note.startswith("The points of RR, FL are")
    for one, other in zip(plain.wheels, found.wheels, strict=True):
        assert other.angles == one.angles
        assert other.u_toe_rad == one.u_toe_rad


def test_so_is_a_mesh_of_the_whole_vehicle(capture, tmp_path):
    join(as_one_cloud(capture, tmp_path / "cloud.ply"))
    lines = 'target = "disc-250"', 'cloud = "cloud.ply"', "front = [0.54, -0.84, 0.02]"
    (tmp_path / "capture.toml").write_text("\n".join(lines))
    _, (note,) = notes(tmp_path)
    assert note.startswith("The points of RR, RL, FR, FL are")
