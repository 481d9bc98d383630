"""STL and OBJ: vertices, or points of the surface; damage that the mesh library does not tell."""

from __future__ import annotations

import io
import json
import logging
import struct
import zipfile

import numpy as np
import pytest
import trimesh

from tests.support.sources import opened, table
from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.arrays import scan_of_points
from wheelplane.readers.formats.mesh import each_once
from wheelplane.readers.formats.obj import read_obj
from wheelplane.readers.formats.stl import read_stl, sample_stl

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


def off(corners=CORNERS, faces=FACES, counts=None, word="OFF"):
    counts = counts or f"{len(corners)} {len(faces)} 0"
    lines = [f"{word} # made by hand", counts, ""]
    lines += [" ".join(map(repr, row)) for row in corners.tolist()]
    lines += [f"3 {' '.join(map(str, face))}" for face in faces]
    return ("\n".join(lines) + "\n").encode()


def glb(corners=CORNERS, faces=FACES, shift=None, **changes):
    """A binary glTF of one mesh; shift: of its node."""
    flat = np.asarray(corners, "<f4").tobytes()
    index = np.asarray(faces, "<u4").tobytes()
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": len(flat)},
        {"buffer": 0, "byteOffset": len(flat), "byteLength": len(index)},
    ]
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **({} if shift is None else {"translation": shift})}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(corners), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * len(faces), "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(flat + index)}],
        **changes,
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(flat + index), b"BIN\0") + flat + index
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model{unit} xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>
<object id="1" type="model"><mesh><vertices>{vertices}</vertices>
<triangles>{triangles}</triangles></mesh></object></resources>
<build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 6 7"/></build></model>
"""


def three_mf(corners=CORNERS, faces=FACES, unit=' unit="millimeter"'):
    """A 3MF of one object, shifted by 5, 6, 7."""
    vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in corners.tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces.tolist())
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        text = MODEL.format(unit=unit, vertices=vertices, triangles=triangles)
        archive.writestr("3D/3dmodel.model", text)
    return stream.getvalue()


def exported(name):
    return {".off": off, ".glb": glb, ".3mf": three_mf}[name[1:]]()


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


def ply(joined, element="face"):
    rows = [" ".join(map(repr, row)) for row in CORNERS.tolist()]
    faces = [f"3 {' '.join(map(str, face))}" for face in FACES] if joined else []
    head = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    head += [f"property double {axis}" for axis in "xyz"]
    head += [f"element {element} {len(faces)}", "property list uchar int vertex_indices"]
    return "\n".join([*head, "end_header", *rows, *faces, ""]).encode()


@pytest.mark.parametrize(
    ("name", "data", "joined"),
    [
        ("a.ply", ply(joined=True), True),
        ("a.ply", ply(joined=True, element="tristrips"), True),
        ("a.ply", ply(joined=True, element="edge"), False),
        ("a.ply", ply(joined=False), False),
        ("a.obj", obj(), True),
        ("a.obj", obj(faces=FACES[:0]), False),
        ("a.stl", stl(), True),
        ("a.off", off(), True),
    ],
)
def test_corners_that_faces_join_are_those_of_a_mesh(tmp_path, name, data, joined):
    assert read(tmp_path, name, data).is_mesh == joined


@pytest.mark.parametrize(
    ("points", "joined"),
    [
        (trimesh.Trimesh(CORNERS, FACES, process=False), True),
        (trimesh.PointCloud(CORNERS), False),
        (CORNERS, False),
    ],
)
def test_so_are_those_of_other_libraries(points, joined):
    scan = scan_of_points(points)
    assert scan.is_mesh == joined
    np.testing.assert_array_equal(scan.points_m, CORNERS)


@pytest.mark.parametrize("before", ["  ", "\t"])
def test_obj_whose_lines_are_indented_has_the_same_vertices(tmp_path, before):
    lines = obj().decode().splitlines(keepends=True)
    for every in (1, 2):
        text = "".join(before * (at % every == 0) + line for at, line in enumerate(lines))
        scan = read(tmp_path, "a.obj", text.encode())
        assert scan.points_m.tolist() == CORNERS.tolist()
        assert scan.is_mesh


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
    ("name", "data"),
    [("a.stl", stl()), ("b.stl", stl_text()), ("a.obj", obj()), ("a.off", off()), ("a.glb", glb())],
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
    refuse(
        tmp_path,
        "a.xyz",
        b"0 0 0\n",
        "the points are read, and no surface: leave out --sample",
        sample=10,
    )
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
        ("a.stl", stl(np.full((4, 3), np.inf)), "points are invalid"),
        ("a.obj", b"v 0 0\nv 1 1\n", "a vertex has 2 numbers"),
        ("a.obj", b"v 0 0 0\nv 1 1\n", "line 2 has 2 columns instead of 3"),
        ("a.obj", b"# a\nv 0 0 0\nvn 1 1 1\nv 1 1 x\n", "line 4 holds 'x'"),
        ("a.obj", b"f 1 2 3\n", "0 points"),
    ],
)  # fmt: skip
def test_meshes_that_are_refused(tmp_path, name, data, pattern):
    refuse(tmp_path, name, data, pattern)


@pytest.mark.parametrize("name", ["a.off", "a.glb"])
def test_vertices_that_the_library_lost_are_missed(tmp_path, name, monkeypatch):
    """It was seen to return an empty scene for a file that was cut, without a word."""
    data = exported(name)
    monkeypatch.setattr("trimesh.load", lambda *_, **__: trimesh.Scene())
    refuse(tmp_path, name, data, "0 of its 4 vertices could be read")


@pytest.mark.parametrize("word", ["OFF", "COFF", "NOFF", "STOFF"])
def test_vertices_of_off(tmp_path, word):
    assert read(tmp_path, "a.off", off(word=word)).points_m.tolist() == CORNERS.tolist()
    coloured = off().replace(b"0.3\n", b"0.3 255 0 0\n")
    assert read(tmp_path, "a.off", coloured).points_m.tolist() == CORNERS.tolist()
    crlf = off().replace(b"\n", b"\r\n")
    assert read(tmp_path, "a.off", crlf).points_m.tolist() == CORNERS.tolist()


def test_vertices_of_glb_where_its_scene_puts_them(tmp_path):
    single = np.float64(np.float32(CORNERS))
    assert read(tmp_path, "a.glb", glb()).points_m.tolist() == single.tolist()
    moved = read(tmp_path, "a.glb", glb(shift=[1.0, 2.0, 3.0])).points_m
    np.testing.assert_allclose(moved, single + np.array([1.0, 2.0, 3.0]), rtol=0, atol=1e-15)
    double = glb(np.vstack([CORNERS, CORNERS]))
    assert read(tmp_path, "a.glb", double).points_m.tolist() == single.tolist()


def test_vertices_of_3mf_where_its_build_puts_them(tmp_path):
    pytest.importorskip("lxml")
    expected = (CORNERS + np.array([5.0, 6.0, 7.0])) / 1000
    for unit in (' unit="millimeter"', ""):  # which is what the format means by no unit
        scan = read(tmp_path, "a.3mf", three_mf(unit=unit), length_unit="mm")
        np.testing.assert_allclose(scan.points_m, expected, rtol=0, atol=1e-15)
        refuse(tmp_path, "a.3mf", three_mf(unit=unit), "states lengths in mm, but they would be")
        refuse(tmp_path, "a.3mf", three_mf(unit=unit), "states lengths in mm", sample=9)
    refuse(tmp_path, "a.3mf", three_mf(unit=' unit="micron"'), "in µm, .*: export them in m, mm")
    sampled = read(tmp_path, "a.3mf", three_mf(), length_unit="mm", sample=500).points_m
    assert len(sampled) == 500
    assert (sampled >= expected.min(axis=0) - 1e-12).all()
    assert (sampled <= expected.max(axis=0) + 1e-12).all()


def test_3mf_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    from wheelplane.errors import MissingDependencyError
    from wheelplane.readers.sandbox import client

    monkeypatch.setattr(client.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[mesh\]'"):
        read(tmp_path, "a.3mf", three_mf())


@pytest.mark.parametrize("name", ["a.off", "a.glb"])
def test_every_cut_of_a_mesh_is_refused(tmp_path, name):
    data = exported(name)
    end = len(data.rstrip()) if name == "a.off" else len(data)
    for length in range(end - (name == "a.off") * 1):
        refuse(tmp_path, name, data[:length], ".")


TREE = {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]}
DRACO = {"extensionsRequired": ["KHR_draco_mesh_compression"]}
FLOAT, UINT = {"componentType": 5126, "type": "VEC3"}, {"componentType": 5125, "type": "SCALAR"}
INDEX = {**UINT, "bufferView": 1, "count": 12}
SPARSE = {"accessors": [{**FLOAT, "count": 4}, INDEX]}
FAR = {"accessors": [{**FLOAT, "bufferView": 0, "count": 9}, INDEX]}


@pytest.mark.parametrize(
    ("name", "data", "pattern"),
    [
        ("a.glb", glb() + b"\0", "the header declares .* bytes, the file has"),
        ("a.glb", glb(**DRACO), "needs what is not read here, 'KHR_draco_mesh_compression': exp"),
        ("a.glb", glb(**SPARSE), "needs what is not read here, 'a sparse accessor'"),
        ("a.glb", glb(**TREE), "needs what is not read here, 'mode 6'"),
        ("a.glb", glb(**FAR), "the mesh cannot be read"),
        ("a.glb", glb(meshes=[{}]), "its description is damaged"),
        ("a.glb", glb(scenes=[{"nodes": []}], nodes=[]), "0 points"),
        ("a.glb", b"glTF\2\0\0\0", "the glTF header is cut"),
        ("a.off", off(counts="5 4 0"), "declares 9 vertices and faces, the file holds 8"),
        ("a.off", off(counts="3 4 0"), "but 1 lines follow"),
        ("a.off", off(counts="four 4 0"), "its counts are 'four 4 0'"),
        ("a.off", off(word="4OFF"), "it begins with '4OFF'"),
        ("a.off", off().replace(b"1.1", b"x.1"), "the mesh cannot be read"),
        ("a.off", off(faces=FACES + 9), "the mesh cannot be read"),
    ],
)  # fmt: skip
def test_other_meshes_that_are_refused(tmp_path, name, data, pattern):
    refuse(tmp_path, name, data, pattern)


def test_ascii_stl_of_several_solids(tmp_path):
    """The library reads them as a scene; its vertices were missed."""
    more = CORNERS + np.array([3.0, 0.0, 0.0])
    data = stl_text() + stl_text(more).replace(b"solid a", b"Solid B").replace(b"endS", b"ends")
    scan = read(tmp_path, "a.stl", data)
    assert sorted(scan.points_m.tolist()) == sorted([*CORNERS.tolist(), *more.tolist()])
    sampled = read(tmp_path, "a.stl", data, sample=4000).points_m
    assert abs((sampled[:, 0] > 2.0).mean() - 0.5) < 5 * np.sqrt(0.25 / 4000)
    refuse(tmp_path, "a.stl", data[: data.rfind(b"endsolid")], "or no `endsolid` for a `solid`")


def test_faces_that_name_no_vertex_are_no_traceback(tmp_path):
    refuse(tmp_path, "a.obj", obj(faces=FACES + 9), "the mesh cannot be read", sample=9)


def test_points_that_stand_above_are_left_out_in_their_order():
    rows = np.array([[3.0, 1, 2], [0, 0, 0], [3, 1, 2], [1, 1, 1], [0, 0, 0]])
    assert each_once(rows).tolist() == [[3, 1, 2], [0, 0, 0], [1, 1, 1]]


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


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_mesh_of_any_size_is_sampled(tmp_path, size):
    points = read(tmp_path, "a.off", off(size * CORNERS), sample=300).points_m
    assert len(points) == 300
    assert (points >= size * CORNERS.min(axis=0) * (1.0 - 1e-12)).all()
    assert (points <= size * CORNERS.max(axis=0) * (1.0 + 1e-12)).all()


def test_a_mesh_of_infinite_area_is_refused(tmp_path):
    refuse(tmp_path, "a.off", off(1e200 * CORNERS), "no faces to sample", sample=10)


PYRAMID = np.vstack([CORNERS, [[1.1, 1.3, 0.3]]])
SIDES = np.array([[0, 1, 3], [1, 4, 3], [4, 2, 3], [2, 0, 3], [0, 2, 4], [0, 4, 1]])


@pytest.mark.parametrize("counts", [None, "5 6"])
def test_vertices_of_off_are_no_faces(tmp_path, counts):
    data = off(PYRAMID, SIDES, counts)
    assert read(tmp_path, "a.off", data).points_m.tolist() == PYRAMID.tolist()
    for face in SIDES:
        row = f"3 {' '.join(map(str, face))}"
        cut = data.replace(row.encode(), row[:-2].encode())
        refuse(tmp_path, "a.off", cut, f"one of its faces is cut, '{row[:-2]}'")


def test_a_glb_without_anything_but_its_description_has_no_points(tmp_path):
    text = json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{}]}).encode()
    text += b" " * (-len(text) % 4)
    data = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text
    refuse(tmp_path, "a.glb", data, "0 points|cannot be read")


def test_obj_with_a_weight_and_a_colour_declares_its_vertices(tmp_path):
    rows = "".join(f"v {' '.join(map(repr, row))} 1 0.5 0.5 0.5\n" for row in CORNERS.tolist())
    with opened(tmp_path, rows.encode(), "rr.obj") as source:
        cloud = read_obj(source)
        assert table(cloud).tolist() == CORNERS.tolist()
        assert cloud.rows == len(CORNERS)
    refuse(tmp_path, "a.obj", b"v 1 2 3 1 0.5 0.5 0.5 9\n", "a vertex has 8 numbers")


def test_keywords_of_stl_are_whole_words(tmp_path):
    data = stl_text()
    assert len(read(tmp_path, "a.stl", data).points_m) == 4
    refuse(tmp_path, "a.stl", data.replace(b"solid", b"solids"), "no `endsolid` for a `solid`")
    refuse(tmp_path, "a.stl", b"solid a\nendsolid a\n", "0 points")


def test_a_wrong_corner_is_named_by_its_line(tmp_path):
    data = stl_text().replace(b"vertex 1.1", b"vertex x.1", 1)
    number = 1 + data[: data.index(b"x.1")].count(b"\n")
    refuse(tmp_path, "a.stl", data, f"line {number} holds 'x.1'")


@pytest.mark.parametrize("mode", [0, 1, 4])
def test_points_and_lines_of_a_glb_are_read(tmp_path, mode):
    drawn = {"attributes": {"POSITION": 0}, "mode": mode} | ({"indices": 1} if mode == 4 else {})
    data = glb(meshes=[{"primitives": [drawn]}])
    assert read(tmp_path, "a.glb", data).points_m.tolist() == np.float32(CORNERS).tolist()


def test_the_library_says_nothing_to_the_log_of_others(tmp_path, monkeypatch):
    logger, heard, others = logging.getLogger("trimesh"), [], logging.Handler()
    others.emit = lambda record: heard.append(record.message)
    monkeypatch.setattr(logging.getLogger(), "handlers", [others])
    monkeypatch.setattr(logger, "propagate", True)

    def noisy(*_, **__):
        logger.warning("a traceback")
        return trimesh.Trimesh(CORNERS, FACES, process=False)

    monkeypatch.setattr("trimesh.load", noisy)
    assert len(read(tmp_path, "a.off", off()).points_m) == 4
    assert heard == []
