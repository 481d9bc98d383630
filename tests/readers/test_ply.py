"""What is particular to PLY: types, orders, and elements that are not vertices."""

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.formats import ply as ply_format

TYPES = {
    **{"char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h"},
    **{"ushort": "H", "uint16": "H", "int": "i", "int32": "i", "uint": "I", "uint32": "I"},
    **{"float": "f", "float32": "f", "double": "d", "float64": "d"},
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def read(folder, data, **options):
    path = folder / "rr.ply"
    path.write_bytes(data)
    return read_scan(path, name="rr.ply", **options)


def refuse(folder, data, pattern):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, data)
    assert str(caught.value).startswith("rr.ply: ")
    assert len(str(caught.value).splitlines()) == 1


def head(form, *declarations):
    return "\n".join(["ply", f"format {form} 1.0", *declarations, "end_header", ""]).encode()


XYZ = ("property float x", "property float y", "property float z")
FACES = "property list uchar int vertex_indices"


@given(st.data())
def test_any_type_and_order_of_properties(tmp_path_factory, data):
    names = data.draw(st.permutations(["x", "y", "z", "Reflectance", "red", "nx"]))
    kinds = data.draw(st.lists(st.sampled_from(sorted(TYPES)), min_size=6, max_size=6))
    form = data.draw(st.sampled_from(["ascii", *ORDERS]))
    row = st.lists(st.integers(0, 127), min_size=6, max_size=6)
    rows = data.draw(st.lists(row, min_size=1, max_size=5))
    text = head(
        form,
        f"element vertex {len(rows)}",
        *(f"property {kind} {name}" for kind, name in zip(kinds, names, strict=True)),
    )
    if form == "ascii":
        body = "".join(" ".join(map(str, row)) + " \n" for row in rows).encode()
    else:
        record = ORDERS[form] + "".join(TYPES[kind] for kind in kinds)
        body = b"".join(struct.pack(record, *row) for row in rows)
    scan = read(tmp_path_factory.mktemp("ply"), text + body)
    expected = [[row[names.index(axis)] for axis in "xyz"] for row in rows]
    assert scan.points_m.tolist() == expected
    assert scan.intensity.tolist() == [row[names.index("Reflectance")] for row in rows]


@pytest.mark.parametrize("form", ORDERS)
@pytest.mark.parametrize("lengths", [[3, 3, 3], [3, 4, 0, 3], [0], []])
@pytest.mark.parametrize("faces_first", [True, False])
def test_faces_before_and_after_are_skipped(tmp_path, form, lengths, faces_first):
    order = ORDERS[form]
    faces = b"".join(struct.pack(f"{order}hB{n}ih1d", 7, n, *range(n), 1, 0.5) for n in lengths)
    face_head = [
        *(f"element face {len(lengths)}", "property short flag", FACES),
        "property list short double weights",
    ]
    vertices = struct.pack(order + "6f", 1, 2, 3, 4, 5, 6)
    vertex_head = ["element vertex 2", *XYZ]
    camera = struct.pack(order + "dB", 1.5, 2)
    camera_head = ["element camera 1", "property double f", "property uchar k"]
    if faces_first:
        data = head(form, *camera_head, *face_head, *vertex_head) + camera + faces + vertices
    else:
        data = head(form, *vertex_head, *face_head, *camera_head) + vertices + faces + camera
    assert read(tmp_path, data).points_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    for length in range(len(data)):
        refuse(tmp_path, data[:length], ".")
    refuse(tmp_path, data + b"\0", "declares 2 vertices, but 1 bytes follow")


def test_ascii_elements_before_and_after_are_skipped(tmp_path):
    data = head("ascii", "element face 2", FACES, "element vertex 1", *XYZ, "element e 1", FACES)
    body = b"3 0 1 2\n4 0 1 2 3\n1 2 3\n1 0\n"
    assert read(tmp_path, data + body).points_m.tolist() == [[1, 2, 3]]
    refuse(tmp_path, data + body[: -len("1 0\n")], "declares 1 rows after the vertices")
    refuse(tmp_path, data + body + b"1 2 3\n", "declares 1 vertices, but 1 rows follow")


def test_crlf_headers_comments_and_obj_info(tmp_path):
    text = head("binary_little_endian", "comment a  b", "obj_info x", "element vertex 1", *XYZ)
    data = text.replace(b"\n", b"\r\n") + struct.pack("<3f", 10, 13, 3)
    assert read(tmp_path, data).points_m.tolist() == [[10, 13, 3]]


def test_the_sentence_about_a_truncated_file(tmp_path):
    data = head("binary_little_endian", "element vertex 1000", *XYZ) + bytes(412 * 12 + 5)
    shown = "the header declares 1000 vertices, the file holds 412: the copy is incomplete"
    refuse(tmp_path, data, f"^rr.ply: {shown}; copy it again$")
    text = head("ascii", "element vertex 1000", *XYZ) + b"0 0 0\n" * 412
    refuse(tmp_path, text, f"^rr.ply: {shown}; copy it again$")
    refuse(tmp_path, text + b"\n" * 588, f"^rr.ply: {shown}; copy it again$")


@pytest.mark.parametrize("form", ["ascii", *ORDERS])
def test_a_lying_count_fails_before_anything_is_allocated(tmp_path, form):
    vertex, faces = ["element vertex 1000000000000", *XYZ], ["element face 1000000000000", FACES]
    refuse(tmp_path, head(form, *vertex) + bytes(24), "declares 1000000000000 vertices")
    few = ["element vertex 1", *XYZ]
    refuse(tmp_path, head(form, *faces, *few) + b"1 2 3\n" * 99, ".")
    refuse(tmp_path, head(form, *few, *faces) + b"1 2 3\n" * 99, "1000000000000")


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        (head("ascii", "element vertex 1", *XYZ[:2]), "z is missing"),
        (head("ascii", "element vertex 1", *XYZ, XYZ[0]), "line 7 declares the property x"),
        (head("ascii", "element vertex 1", *XYZ, "property float X"), "x is there 2 times"),
        (head("ascii", "element vertex 1", "property half x"), "unknown type 'half'"),
        (head("ascii", "element vertex 1", *XYZ, "element vertex 1"), "vertex again"),
        (head("ascii", "element vertex -1", *XYZ), "'-1' of vertex, which is not a count"),
        (head("ascii", "element vertex 1.5", *XYZ), "not a count"),
        (head("ascii", "element vertex 0", *XYZ), "0 points"),
        (head("ascii", "element vertex 1", *XYZ, FACES), "list property"),
        (head("ascii", "element face 1", FACES), "no vertex element"),
        (head("ascii", "element face 1", "property list float int v"), "counts a list"),
        (head("ascii", "element vertex 1", *XYZ).replace(b"end_header", b"end"), "line 7"),
        (head("ascii", "element vertex 1", *XYZ).replace(b"end_header\n", b""), "end_header"),
        (head("binary", "element vertex 1", *XYZ), "line 2"),
        (head("ascii", "property float x"), "line 3"),
        (b"ply\nelement vertex 1\nend_header\n", "no format line"),
        (b"ply\nformat ascii 1.0\n" + b"x" * 100_000, "line 3"),
    ],
)
def test_headers_that_are_refused(tmp_path, text, pattern):
    refuse(tmp_path, text + (b"0 0 0\n" if text.endswith(b"end_header\n") else b""), pattern)


def test_an_ascii_row_that_is_wrong_is_named(tmp_path):
    text = head("ascii", "element vertex 2", *XYZ)
    refuse(tmp_path, text + b"0 0 0\n0 0\n", "line 9 has 2 columns instead of 3: '0 0'")
    refuse(tmp_path, text + b"0 0 0\n0 0 1_0\n", "line 9 holds '1_0', which is not a number")


def test_a_list_with_a_negative_length_is_refused(tmp_path):
    text = head("binary_little_endian", "element face 2", "property list char int v")
    text = text.replace(
        b"end_header",
        b"element vertex 1\nproperty int x\nproperty int y\nproperty int z\nend_header",
    )
    refuse(tmp_path, text + struct.pack("<bb", 0, -1) + bytes(12), "ends within")


def test_memory_stays_near_the_result(tmp_path):
    rows = 200_000
    body = np.arange(rows * 4, dtype="<f4").reshape(rows, 4)
    text = head("binary_little_endian", f"element vertex {rows}", *XYZ, "property float intensity")
    path = tmp_path / "rr.ply"
    path.write_bytes(text + body.tobytes())
    read_scan(path)  # modules and kernels are loaded once
    tracemalloc.start()
    scan = read_scan(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    result = scan.points_m.nbytes + scan.intensity.nbytes
    # One chunk of 1 MiB and what its conversion needs.
    assert result <= peak < result + 2 * (1 << 20)
    assert scan.points_m.tolist() == body[:, :3].tolist()


def test_rows_of_other_elements_are_no_vertices_and_are_counted_first(tmp_path):
    """The file is too short for what precedes the vertices and these: said before any is read."""
    text = head("ascii", "element group 400", "property int a", "element vertex 500", *XYZ)
    refuse(tmp_path, text + b"1\n" * 400 + b"1 2 3\n" * 200, "500 vertices, the file holds 200")
    refuse(tmp_path, text + b"1\n" * 300 + b"x y z\n" * 250, "500 vertices, the file holds 150")


def test_a_wrong_row_below_other_elements_is_named_by_its_line(tmp_path):
    text = head("ascii", "element group 2", "property int a", "element vertex 2", *XYZ)
    refuse(tmp_path, text + b"1\n\n2\n1 2 3\n1 2 x\n", "line 14 holds 'x'")


def test_the_longest_header_is_read(tmp_path, monkeypatch):
    text = head("ascii", "element vertex 1", *XYZ)
    monkeypatch.setattr(ply_format, "_MOST_LINES", text.count(b"\n") - 1)
    assert len(read(tmp_path, text + b"1 2 3\n").points_m) == 1
    longer = text.replace(b"end_header", b"comment more\nend_header")
    refuse(tmp_path, longer + b"1 2 3\n", "more than 6 lines in its header")


@pytest.mark.parametrize("form", ORDERS)
@pytest.mark.parametrize("lengths", [[0], [3], [3, 0], [0, 3], [3, 3, 3], [1, 0, 0]])
def test_lists_may_end_the_file_and_no_later(tmp_path, form, lengths):
    text = head(form, "element vertex 1", *XYZ, f"element face {len(lengths)}", FACES)
    order = ORDERS[form]
    faces = b"".join(struct.pack(f"{order}B{n}i", n, *range(n)) for n in lengths)
    data = text + struct.pack(order + "3f", 1, 2, 3) + faces
    assert read(tmp_path, data).points_m.tolist() == [[1, 2, 3]]
    for cut in range(1, len(faces) + 1):
        refuse(tmp_path, data[:-cut], "ends within")
