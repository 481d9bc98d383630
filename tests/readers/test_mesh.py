"""STL and OBJ: vertices, or points of the surface; damage that the mesh library does not tell."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh

from tests.support.sources import opened, table
from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.formats.mesh import read_obj, read_stl, sample_stl

# A tetrahedron whose corners are no float32 numbers of few digits.
CORNERS = np.array([[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.1, 1.3, 0.3], [0.1, 0.2, 1.4]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def stl(corners=CORNERS, faces=FACES, declared=None):
    count = len(faces) if declared is None else declared
    triangles = (struct.pack("<12fH", 0, 0, 1, *corners[face].ravel(), 0) for face in faces)
    return b"solid but binary".ljust(80, b"\0") + struct.pack("<I", count) + b"".join(triangles)


def stl_text(corners=CORNERS, faces=FACES):
    out = ["solid a"]
    for face in faces:
        out += ["facet normal 0 0 1", " outer loop"]
        out += [f"  vertex {' '.join(map(repr, corners[i].tolist()))}" for i in face]
        out += [" endloop", "endfacet"]
    return ("\n".join([*out, "endsolid a"]) + "\n").encode()


def obj(corners=CORNERS, faces=FACES):
    lines = ["# made by hand", "mtllib none.mtl", "o thing"]
    lines += [f"v {' '.join(map(repr, row))}" for row in corners.tolist()]
    lines += ["vt 0 0", "vn 0 0 1", *(f"f {'/1/1 '.join(map(str, f + 1))}/1/1" for f in faces)]
    return ("\n".join(lines) + "\n").encode()


def read(folder, name, data, **options):
    path = folder / name
    path.write_bytes(data)
    return read_scan(path, name=name, **options)


def refuse(folder, name, data, pattern, **options):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, name, data, **options)
    assert str(caught.value).startswith(f"{name}: ")
    assert len(str(caught.value).splitlines()) == 1


def test_corners_are_points_each_once(tmp_path):
    single = np.float64(np.float32(CORNERS))
    assert read(tmp_path, "a.obj", obj()).points_m.tolist() == CORNERS.tolist()
    for name, data, expected in (("a.stl", stl(), single), ("b.stl", stl_text(), CORNERS)):
        scan = read(tmp_path, name, data)
        assert len(scan.points_m) == 4
        assert sorted(scan.points_m.tolist()) == sorted(expected.tolist())
        assert scan.intensity is None


@pytest.mark.parametrize("extra", ["", " 1.0", " 0.5 0.5 0.5"])
def test_obj_of_vertices_alone_at_1e7_m(tmp_path, extra):
    rows = CORNERS + 1e7
    text = "".join(f"v {' '.join(map(repr, row))}{extra}\n" for row in rows.tolist())
    scan = read(tmp_path, "a.obj", text.encode())
    assert scan.points_m.tobytes() == rows.tobytes()
    assert (
        read(tmp_path, "a.obj", text.replace("\n", "\r\n").encode()).points_m.tolist()
        == rows.tolist()
    )


@pytest.mark.parametrize(
    ("name", "data"), [("a.stl", stl()), ("b.stl", stl_text()), ("a.obj", obj())]
)
def test_points_are_sampled_by_area(tmp_path, name, data):
    count = 20_000
    scan = read(tmp_path, name, data, sample=count)
    assert scan.points_m.shape == (count, 3)
    again = read(tmp_path, name, data, sample=count)
    assert again.points_m.tobytes() == scan.points_m.tobytes()
    edges = CORNERS[FACES]
    normals = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    offsets = np.einsum("pk,fk->pf", scan.points_m, normals) - np.sum(normals * edges[:, 0], axis=1)
    distance = np.abs(offsets) / (2 * areas)
    assert distance.min(axis=1).max() < 1e-6  # STL's float32
    share = np.bincount(distance.argmin(axis=1), minlength=4) / count
    expected = areas / areas.sum()
    assert np.abs(share - expected).max() < 5 * np.sqrt(0.25 / count)
    assert np.abs(share - 0.25).max() > 5 * np.sqrt(0.25 / count)  # not a face, a share


def test_what_cannot_be_sampled(tmp_path):
    refuse(tmp_path, "a.obj", b"v 0 0 0\nv 1 1 1\n", "no faces to sample", sample=10)
    refuse(tmp_path, "a.xyz", b"0 0 0\n", "it is a cloud, not a mesh", sample=10)
    flat = stl(np.zeros((4, 3)))
    refuse(tmp_path, "a.stl", flat, "no faces to sample", sample=10)


@pytest.mark.parametrize("data", [stl(), stl_text()])
def test_every_cut_of_an_stl_is_refused(tmp_path, data):
    end = data.rfind(b"endsolid") + len(b"endsolid") if b"endsolid" in data else len(data)
    for length in range(end):
        refuse(tmp_path, "a.stl", data[:length], ".")


@pytest.mark.parametrize(
    ("name", "data", "pattern"),
    [
        ("a.stl", stl() + b"\0", "declares 4 triangles, but 1 bytes follow"),
        ("a.stl", stl(declared=5), "declares 5 triangles, the file holds 4"),
        ("a.stl", stl(declared=4_000_000_000), "declares 4000000000 triangles"),
        ("a.stl", stl(faces=FACES[:0]), "0 points"),
        ("a.stl", stl_text().replace(b"vertex 1.1", b"vertex x.1", 1), "."),
        ("a.stl", stl_text().replace(b"  vertex", b"  vortex", 1), "11 corners for 4 triangles"),
        ("a.stl", stl(np.full((4, 3), np.inf)), "infinite coordinate"),
        ("a.obj", b"v 0 0\nv 1 1\n", "a vertex has 2 numbers"),
        ("a.obj", b"v 0 0 0\nv 1 1\n", "line 2 has 2 columns instead of 3"),
        ("a.obj", b"# a\nv 0 0 0\nvn 1 1 1\nv 1 1 x\n", "line 4 holds 'x'"),
        ("a.obj", b"f 1 2 3\n", "0 points"),
    ],
)  # fmt: skip
def test_meshes_that_are_refused(tmp_path, name, data, pattern):
    refuse(tmp_path, name, data, pattern)


@pytest.mark.parametrize("data", [stl(), stl_text()])
def test_triangles_that_the_library_lost_are_missed(tmp_path, data, monkeypatch):
    """It was seen to return an empty scene for a file that was cut, without a word."""
    monkeypatch.setattr("trimesh.load", lambda *_, **__: trimesh.Scene())
    refuse(tmp_path, "a.stl", data, "0 of its 4 triangles could be read")


def test_faces_that_name_no_vertex_are_no_traceback(tmp_path):
    refuse(tmp_path, "a.obj", obj(faces=FACES + 9), "the mesh cannot be read", sample=9)


def test_the_library_does_not_speak(tmp_path, capfd):
    read(tmp_path, "a.stl", stl_text().replace(b"normal 0 0 1", b"normal 0 0 --1", 1))
    assert capfd.readouterr() == ("", "")


def test_a_mesh_of_the_same_triangles_has_the_same_vertices_in_any_file_and_order(tmp_path):
    rng = np.random.default_rng(6)
    corners = rng.normal(0.0, 1.0, (30, 3)).astype(np.float32).astype(np.float64)
    faces = rng.permuted(np.tile(np.arange(30), (12, 1)), axis=1)[:, :3]
    used = sorted(corners[np.unique(faces)].tolist())
    for shown in (faces, faces[::-1], faces[:, [1, 2, 0]]):
        for data in (stl(corners, shown), stl_text(corners, shown)):
            with opened(tmp_path, data, "rr.stl") as source:
                assert sorted(table(read_stl(source)).tolist()) == used
    with opened(tmp_path, obj(corners, faces), "rr.obj") as source:
        assert table(read_obj(source)).tolist() == corners.tolist()  # unused ones too


def test_samples_lie_on_the_surface_in_proportion_to_its_area(tmp_path):
    """Two rectangles of areas 1 and 9 in the planes z = 0 and z = 5: binomial, 5 sigma."""
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    corners = np.vstack([flat, 3 * flat + [4, 0, 5]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    count = 4000
    with opened(tmp_path, stl(corners, faces), "rr.stl") as source:
        points = table(sample_stl(source, count))
    low = points[:, 2] < 1.0
    assert len(points) == count
    np.testing.assert_allclose(points[:, 2], np.where(low, 0.0, 5.0), rtol=0, atol=1e-12)
    assert abs(low.sum() - count / 10) < 5 * np.sqrt(count * 0.1 * 0.9)
    assert np.all((points[low, :2] >= 0) & (points[low, :2] <= 1))
    assert np.all((points[~low, :2] >= [4, 0]) & (points[~low, :2] <= [7, 3]))
    half = points[~low, 0] < 5.5
    assert abs(half.sum() - len(half) / 2) < 5 * np.sqrt(len(half) / 4)
