"""Headers and binary records: the same as independent readers find, and refused when cut."""

import io
import itertools
import struct

import numpy as np
import pytest

from tests.support.paths import CERTIFIED
from tests.support.sources import opened, table
from wheelplane.errors import InputError
from wheelplane.readers.formats import npy as npy_format
from wheelplane.readers.formats.npy import read_npy
from wheelplane.readers.formats.npz import read_npz
from wheelplane.readers.formats.pcd import read_header as pcd_header
from wheelplane.readers.formats.pcd import read_pcd
from wheelplane.readers.formats.ply import read_header as ply_header
from wheelplane.readers.formats.ply import read_ply
from wheelplane.readers.parsing import binary
from wheelplane.readers.parsing.binary import read_exactly, record_blocks
from wheelplane.readers.source import Layout

RNG = np.random.default_rng(8)
ROWS = RNG.normal(0.0, 10.0, (13, 4))


def npy(array, version=None):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, version)
    return stream.getvalue()


def npz(**arrays):
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def ply():
    head = ["ply", "format binary_big_endian 1.0", "comment x", "element camera 2"]
    head += ["property int id", f"element vertex {len(ROWS)}", "property uchar red"]
    head += [f"property double {name}" for name in "zyx"]
    head += ["property float intensity", "element face 2"]
    head += ["property list uchar int vertex_indices", "end_header", ""]
    body = struct.pack(">2i", 1, 2)
    body += b"".join(struct.pack(">B3df", 7, z, y, x, i) for x, y, z, i in ROWS)
    return "\n".join(head).encode() + body + struct.pack(">B3iB4i", 3, 0, 1, 2, 4, 0, 1, 2, 3)


def pcd():
    head = ["VERSION .7", "FIELDS rgb x y z intensity", "SIZE 1 8 8 8 4", "TYPE U F F F F"]
    head += ["COUNT 3 1 1 1 1", f"WIDTH {len(ROWS)}", "HEIGHT 1", f"POINTS {len(ROWS)}"]
    body = b"".join(struct.pack("<3B3df", 1, 2, 3, *row) for row in ROWS)
    return "\n".join([*head, "DATA binary", ""]).encode() + body


WHOLE = {
    "rr.npy": (npy(ROWS), read_npy),
    "fortran.npy": (npy(np.asfortranarray(ROWS)), read_npy),
    "rr.npz": (npz(points=ROWS[:, :3], intensity=ROWS[:, 3]), read_npz),
    "rr.ply": (ply(), read_ply),
    "rr.pcd": (pcd(), read_pcd),
}
SINGLE = {"rr.ply", "rr.pcd"}  # whose intensity is a float32


@pytest.mark.parametrize("chunk", [1, 100, 1 << 20])
@pytest.mark.parametrize("name", sorted(WHOLE))
def test_all_formats_give_the_same_rows_in_chunks_of_any_size(tmp_path, monkeypatch, name, chunk):
    monkeypatch.setattr(binary, "CHUNK_BYTES", chunk)
    monkeypatch.setattr(npy_format, "CHUNK_BYTES", max(chunk, 8))
    data, read = WHOLE[name]
    with opened(tmp_path, data, name) as source:
        cloud = read(source)
        found = table(cloud)
    assert cloud.rows == len(ROWS)
    assert found[:, :3].tobytes() == ROWS[:, :3].tobytes()
    shade = ROWS[:, 3].astype(np.float32) if name in SINGLE else ROWS[:, 3]
    assert found[:, 3].tolist() == shade.tolist()


@pytest.mark.parametrize("name", sorted(WHOLE))
def test_a_file_cut_at_any_byte_or_one_byte_longer_is_refused_in_one_line(tmp_path, name):
    data, read = WHOLE[name]
    ends = range(len(data)) if name != "rr.npz" else range(0, len(data), 7)
    for cut in [*(data[:end] for end in ends), *([data + b"x"] if name != "rr.npz" else [])]:
        with opened(tmp_path, cut, name) as source, pytest.raises(InputError) as caught:
            table(read(source))
        assert str(caught.value).startswith(f"{name}: "), len(cut)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("version", [(1, 0), (2, 0)])
@pytest.mark.parametrize("form", ["<f8", ">f4", "<i2", ">u8", "|i1", "<f2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_an_npy_header_is_what_numpy_wrote(tmp_path, version, form, order):
    array = np.array(np.arange(33).reshape(11, 3), form, order=order)
    data = npy(array, version)
    with opened(tmp_path, data) as source:
        found = npy_format.read_header(source)
        assert source.remaining() == array.nbytes
    assert (found.dtype, found.shape, found.fortran_order) == (
        array.dtype,
        array.shape,
        order == "F",
    )
    with opened(tmp_path, data) as source:
        assert table(read_npy(source)).tolist() == array.astype(np.float64).tolist()


def test_records_are_those_of_a_memory_map(tmp_path):
    """Any subset of the fields of a packed record, from any start."""
    form = np.dtype([("a", "u1"), ("x", "<f4"), ("y", ">f8"), ("b", "<i2"), ("z", "<i4")])
    records = np.frombuffer(RNG.bytes(form.itemsize * 500), form).copy()
    records["x"], records["y"] = RNG.normal(size=(2, 500))
    offsets = [form.fields[name][1] for name in form.names]
    formats = [form[name].str for name in form.names]
    with opened(tmp_path, b"head!" + records.tobytes()) as source:
        mapped = np.memmap(source.path, form, "r", 5, (500,))
        for xyz in itertools.permutations((1, 2, 4)):
            source.stream.seek(5)
            blocks = list(
                record_blocks(source, 500, formats, offsets, form.itemsize, Layout(xyz, 3))
            )
            assert len(blocks) == 1
            for column, index in zip((*blocks[0].xyz, blocks[0].intensity), (*xyz, 3), strict=True):
                assert column.tolist() == mapped[form.names[index]].tolist()
        source.stream.seek(source.size - 3)
        with pytest.raises(InputError, match="cut while it was read"):
            read_exactly(source, memoryview(bytearray(4)))


def test_a_ply_header_tells_where_its_vertices_begin(tmp_path):
    data = ply()
    with opened(tmp_path, data) as source:
        header = ply_header(source)
        assert source.stream.tell() == data.index(b"end_header\n") + len(b"end_header\n")
    assert header.lines == data[: data.index(b"end_header\n")].count(b"\n") + 1
    assert [element.name for element in (*header.before, header.vertex, *header.after)] == [
        *("camera", "vertex", "face")
    ]
    assert header.vertex.itemsize == struct.calcsize(">B3df")
    assert [element.has_list for element in (header.vertex, *header.after)] == [False, True]


def test_a_pcd_header_adds_up_to_the_size_of_the_file(tmp_path):
    certified = sorted((CERTIFIED / "pcl").glob("*.pcd"))
    assert certified
    for data in (pcd(), *(path.read_bytes() for path in certified)):
        with opened(tmp_path, data) as source:
            header = pcd_header(source)
            left = source.remaining()
        assert header.lines == data[: len(data) - left].count(b"\n")
        width = sum(field.size * field.count for field in header.fields)
        if header.encoding == "binary":
            assert header.points * width == left
        else:
            assert header.points == data[len(data) - left :].count(b"\n")


def described(text, version=1, encoding="latin-1", declared=None):
    """An NPY file of a header with any text."""
    head = text.encode(encoding)
    length = len(head) if declared is None else declared
    form = "<H" if version == 1 else "<I"
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack(form, length) + head


@pytest.mark.parametrize(
    ("shape", "order"),
    [
        *((shape, "False") for shape in ("()", "[3, 3]", "3", "(3.0, 3)", "(-3, 3)", "(3, -3)")),
        *(("(True, 3)", "False"), ("(3, 3)", "0"), ("(3, 3)", "None"), ("None", "None")),
    ],
)
def test_a_shape_is_whole_numbers_and_an_order_true_or_false(tmp_path, shape, order):
    text = f"{{'descr': '<f8', 'fortran_order': {order}, 'shape': {shape}}}"
    with opened(tmp_path, described(text)) as source, pytest.raises(InputError, match="the shape"):
        npy_format.read_header(source)


@pytest.mark.parametrize(
    ("version", "encoding", "name"), [(1, "latin-1", "é"), (2, "latin-1", "é"), (3, "utf-8", "ж")]
)
def test_names_of_fields_are_in_the_encoding_of_their_version(tmp_path, version, encoding, name):
    fields = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (name, "<f4")]
    text = f"{{'descr': {fields}, 'fortran_order': False, 'shape': (2,)}}"
    with opened(tmp_path, described(text, version, encoding)) as source:
        assert npy_format.read_header(source).dtype.names == ("x", "y", "z", name)


def test_records_without_fields_are_refused(tmp_path):
    text = "{'descr': [], 'fortran_order': False, 'shape': (2,)}"
    with opened(tmp_path, described(text)) as source, pytest.raises(InputError, match="the type '"):
        npy_format.read_header(source)


def test_a_header_as_long_as_it_says_and_no_longer_than_any(tmp_path):
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3)}"
    for data in (described(text, declared=2000), described(text.ljust(70_000), 2)):
        with opened(tmp_path, data) as source, pytest.raises(InputError, match="bytes of itself"):
            npy_format.read_header(source)
    with opened(tmp_path, described(text.ljust(65_536), 2)) as source:
        assert npy_format.read_header(source).shape == (2, 3)
