"""What is particular to text and NPY: delimiters, names, comments; shapes, dtypes, pickles."""

import itertools
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.sources import opened, table
from wheelplane.errors import InputError
from wheelplane.readers import ReadOptions, read_scan
from wheelplane.readers.formats.text import read_text


def read(folder, name, data):
    path = folder / name
    path.write_bytes(data)
    return read_scan(path, name=name)


def refuse(folder, name, data, pattern):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, name, data)
    assert str(caught.value).startswith(f"{name}: ")
    assert len(str(caught.value).splitlines()) == 1


@given(
    rows=st.lists(st.tuples(*[st.floats(-1e10, 1e10)] * 3), min_size=1),  # no site is larger
    delimiter=st.sampled_from([",", ", ", ";", " ; ", "\t", " ", "   "]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
)
def test_any_delimiter_and_line_end_keeps_every_digit(tmp_path_factory, rows, delimiter, end):
    text = "".join(delimiter.join(map(repr, row)) + end for row in rows)
    scan = read(tmp_path_factory.mktemp("text"), "rr.txt", text.encode())
    assert scan.points_m.tobytes() == np.array(rows).tobytes()
    assert scan.intensity is None


@pytest.mark.parametrize(
    "text",
    [
        "# made by hand\n\n1 2 3 9\n// between\n4 5 6 9 # behind\n",
        "// made by hand\n1;2;3;9\n4;5;6;9 // behind\n\n",
        "2\n1 2 3 9\n4 5 6 9\n",
        "Intensity,Z,nx,Y,X\n9,3,0,2,1\n9,6,0,5,4\n",
        '"x" "y" "z" "reflectance"\n1 2 3 9\n4 5 6 9\n',
        "\ufeff2\r\n\r\nX\tY\tZ\tINTENSITY\r\n1\t2\t3\t9\r\n4\t5\t6\t9\r\n",
        "# caf\u00e9\n  1   2 3 9  \n+4. 5e0 60E-1 9.\n",
    ],
)
def test_comments_counts_and_names(tmp_path, text):
    scan = read(tmp_path, "rr.txt", text.encode())
    assert scan.points_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert scan.intensity.tolist() == [9, 9]


@pytest.mark.parametrize("delimiter", [";", "; ", "\t", " ", "   "])
@pytest.mark.parametrize("ahead", ["", "# v1.2\n", "X{0}Y{0}Z\n", "3\n"])
def test_a_comma_is_decimal_where_something_else_separates(tmp_path, delimiter, ahead):
    rows = [(1.0, 2.5, -3.125), (1e7 + 1 / 3, -0.1, 5e-5), (4.0, 5.0, 6.0)]
    cells = [
        [f"{value:g}" if value == int(value) else repr(value) for value in row] for row in rows
    ]
    text = "".join(delimiter.join(row).replace(".", ",") + "\n" for row in cells)
    scan = read(tmp_path, "rr.txt", (ahead.format(delimiter) + text).encode())
    assert scan.points_m.tolist() == [list(row) for row in rows]


def test_where_only_commas_stand_they_separate(tmp_path):
    scan = read(tmp_path, "rr.csv", b"1,5,2,5\n3,5,4,5\n")
    assert scan.points_m.tolist() == [[1, 5, 2], [3, 5, 4]]
    assert scan.intensity.tolist() == [5, 5]


def test_a_fifth_column_leaves_no_intensity(tmp_path):
    assert read(tmp_path, "rr.xyz", b"1 2 3 4 5\n").intensity is None
    assert read(tmp_path, "rr.xyz", b"x y z u v\n1 2 3 4 5\n").intensity is None


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("1 2 3\n4 5\n", "line 2 has 2 columns instead of 3: '4 5'"),
        ("# a\n\n1 2 3\n4 5 6 7\n", "line 4 has 4 columns instead of 3"),
        ("1,2,3\n4 5 6\n", "line 2 has 1 columns"),
        ("1 2 3\n4,5,6\n", "line 2 has 1 columns"),
        ("1 2 3\n4 5 6x\n", "line 2 holds '6x', which is not a number: '4 5 6x'"),
        ("1 2 3\n4 5 0x10\n", "line 2 holds '0x10'"),
        ("1 2 3\n4 5 1_0\n", "line 2 holds '1_0'"),
        ("1 2 3\nx y z\n", "line 2 holds 'x'"),
        ("1,5;2,5;3.5\n", "line 1 holds '1,5'"),
        ("1,5;2,5;3,5\n1.5;2;3\n", "line 2 has decimal points, those above it have commas"),
        ("1.5;2;3\n1,5;2;3\n", "line 2 holds '1,5'"),
        ("1,000,000;2;3\n", "line 1 holds '1,000,000'"),
        ("1,5,2,5\n1,5,2\n", "line 2 has 3 columns instead of 4"),
        ("1 2\n3 4\n", "line 1 has 2 columns, a point needs 3: '1 2'"),
        ("a b c\n1 2 3\n", "x is missing among the columns a, b, c"),
        ("x x y z\n1 2 3 4\n", "x is there 2 times"),
        ("x,y,z\n1,2,3,4\n", "3 columns are named .* line 2 has 4"),
        ("3\n1 2 3\n4 5 6\n", "declares 3 points, the file holds 2: the copy is incomplete"),
        ("1\n1 2 3\n4 5 6\n", "declares 1 points, the file holds 2"),
        ("0\n1 2 3\n", "declares 0 points, the file holds 1"),
        ("1000000000000\n1 2 3\n", "declares 1000000000000 points, the file holds 1"),
        ("# nothing\n\n", "0 points"),
        ("x y z\n", "0 points"),
        ("5\n", "declares 5 points, the file holds 0"),
        ("1.25 2.25 3.25\n" * 6 + "4.25 5.25 6.2", "ends in the middle of a number"),
        ("1 2 1e400\n", "all its 1 points are invalid"),
    ],
)
def test_text_that_is_refused(tmp_path, text, pattern):
    refuse(tmp_path, "rr.txt", text.encode(), pattern)


def test_a_bad_line_far_down_is_named(tmp_path):
    good = "1.5 2.5 3.5\n" * 100_000
    refuse(
        tmp_path, "rr.xyz", (good + "1.5 2.5 oops\n" + good).encode(), "line 100001 holds 'oops'"
    )


@pytest.mark.parametrize("kind", ["f2", "f4", "f8", "g", "i1", "u2", "i4", "u8"])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("fortran", [False, True])
@pytest.mark.parametrize("columns", [3, 4])
def test_npy_of_any_number(tmp_path, kind, order, fortran, columns):
    table = np.arange(5 * columns).reshape(5, columns)
    path = tmp_path / "rr.npy"
    np.save(path, table.astype(order + kind, order="F" if fortran else "C"))
    scan = read_scan(path)
    assert scan.points_m.tolist() == table[:, :3].tolist()
    assert (scan.intensity is None) == (columns == 3)
    assert scan.points_m.flags.c_contiguous


@pytest.mark.parametrize(
    ("array", "pattern"),
    [
        (np.zeros((5, 2)), r"shape '\(5, 2\)'"),
        (np.zeros(9), "shape"),
        (np.zeros((3, 3, 2)), "shape"),
        (np.zeros((3, 40)), r"shape '\(3, 40\)': .* give --pitch DX,DY"),
        (np.zeros((2, 3, 3, 3)), "shape"),
        (np.zeros((0, 3)), "0 points"),
        (np.zeros((5, 3), complex), "type '<c16'"),
        (np.zeros((5, 3), bool), "type"),
        (np.zeros(5, [("x", "f8"), ("y", "f8")]), "z is missing among the columns x, y"),
        (np.zeros(5, [("x", "f8"), ("y", "f8"), ("z", "U8")]), "of the type '<U8'"),
        (np.zeros(5, [("x", "f8"), ("y", "f8"), ("z", "f8", 2)]), "of the type"),
        (np.zeros(5, [("x", "f8"), ("y", "f8"), ("z", "O")]), "type"),
        (np.zeros((1, 3), object), "type '|O'"),
    ],
)
def test_npy_that_is_refused(tmp_path, array, pattern):
    path = tmp_path / "rr.npy"
    np.save(path, array)
    refuse(tmp_path, "rr.npy", path.read_bytes(), pattern)


@pytest.mark.parametrize("kind", ["<f4", ">f8", "<i4"])
@pytest.mark.parametrize("fortran", [False, True])
@pytest.mark.parametrize("columns", [3, 4, 6])
def test_npy_of_a_raster(tmp_path, kind, fortran, columns):
    """(H, W, 3), as cameras hand it out; the order of the points is that of the array."""
    rng = np.random.default_rng(columns)
    table = rng.integers(-500, 500, (5, 7, columns)).astype(kind, order="F" if fortran else "C")
    np.save(tmp_path / "rr.npy", table)
    scan = read_scan(tmp_path / "rr.npy")
    assert scan.points_m.tolist() == table[..., :3].reshape(-1, 3).tolist()
    assert (scan.intensity is not None) == (columns == 4)
    shade = table[..., 0].astype("f4", order="F" if fortran else "C")
    if columns == 3:
        np.savez(tmp_path / "rr.npz", xyz=table, intensity=shade)
        packed = read_scan(tmp_path / "rr.npz")
        assert packed.points_m.tobytes() == scan.points_m.tobytes()
        assert packed.intensity.tolist() == shade.ravel().tolist()


@pytest.mark.parametrize("columns", [5, 6, 7, 9, 12])
def test_npy_of_more_columns(tmp_path, columns):
    table = np.random.default_rng(1).normal(size=(30, columns))
    np.save(tmp_path / "rr.npy", table)
    scan = read_scan(tmp_path / "rr.npy")
    assert scan.points_m.tolist() == table[:, :3].tolist()
    assert scan.intensity is None
    names = ("-", "z", "i", "y", "x", *["-"] * (columns - 5))
    named = read_scan(tmp_path / "rr.npy", options=ReadOptions(names))
    assert named.points_m.tolist() == table[:, [4, 3, 1]].tolist()
    assert named.intensity.tolist() == table[:, 2].astype("f4").tolist()
    with pytest.raises(InputError, match=f"has {columns} columns, --columns names 3"):
        read_scan(tmp_path / "rr.npy", options=ReadOptions(("x", "y", "z")))


def test_npy_whose_first_columns_count_is_refused(tmp_path):
    row, column = np.mgrid[:6, :8].reshape(2, -1)
    points = np.random.default_rng(2).normal(size=(48, 3))
    np.save(tmp_path / "rr.npy", np.column_stack([row, column, points]))
    with pytest.raises(InputError, match="its first two columns are whole numbers"):
        read_scan(tmp_path / "rr.npy")
    names = ("row", "col", "x", "y", "z")
    scan = read_scan(tmp_path / "rr.npy", options=ReadOptions(names))
    assert scan.points_m.tolist() == points.tolist()


FIELDS = [
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4")],
    [("label", "U5"), ("Z", ">f8"), ("Intensity", "<u2"), ("Y", "<f8"), ("X", "<i4")],
    [("X [m]", "<f8"), ("rgb", "u1", 3), ("Y [m]", "<f8"), ("Z [m]", "<f8")],
    np.dtype([("x", "<f4"), ("a", "u1"), ("y", "<f4"), ("z", "<f4")], align=True),
]


@pytest.mark.parametrize("fields", FIELDS)
@pytest.mark.parametrize("shape", [(9,), (3, 4)])
def test_npy_of_named_fields(tmp_path, fields, shape):
    rng = np.random.default_rng(4)
    table = np.zeros(shape, fields)
    names = {name[0].lower(): name for name in table.dtype.names if name[0].lower() in "xyzi"}
    for name in names.values():
        table[name] = rng.integers(0, 99, shape)
    np.save(tmp_path / "rr.npy", table)
    np.savez_compressed(tmp_path / "rr.npz", points=table)
    for path in (tmp_path / "rr.npy", tmp_path / "rr.npz"):
        scan = read_scan(path)
        expected = np.stack([table[names[axis]].ravel() for axis in "xyz"], axis=1)
        assert scan.points_m.tolist() == expected.tolist()
        assert (scan.intensity is None) == ("i" not in names)
        if "i" in names:
            assert scan.intensity.tolist() == table[names["i"]].ravel().tolist()


def test_a_unit_in_the_name_of_a_field_is_heeded(tmp_path):
    np.save(tmp_path / "rr.npy", np.zeros(4, [("x_mm", "f8"), ("y_mm", "f8"), ("z_mm", "f8")]))
    refuse(tmp_path, "rr.npy", (tmp_path / "rr.npy").read_bytes(), "states lengths in mm")


def test_an_object_array_is_never_unpickled(tmp_path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("unpickled",))

    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (1, 3), }\n"
    prefix = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little")
    refuse(tmp_path, "rr.npy", prefix + header + pickle.dumps(Trap()), "type")


@pytest.mark.parametrize("rows", [4, 6, 10**12])
def test_an_npy_header_that_lies_is_refused(tmp_path, rows):
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, 3), }}\n".encode()
    for version, width in ((1, 2), (2, 4)):
        prefix = b"\x93NUMPY" + bytes([version, 0]) + len(header).to_bytes(width, "little")
        refuse(tmp_path, "rr.npy", prefix + header + bytes(5 * 24), f"declares {rows} points")
    refuse(tmp_path, "rr.npy", b"\x93NUMPY\x04\x00" + bytes(40), "version 4.0")


def test_the_last_line_may_lack_its_end(tmp_path):
    for text in (
        "1 2 3\n4 5 6",
        "x,y,z\n1.5,2.5,3.25\n4.5,5.5,6.125",
        "1.25 2.25 3.25\n" * 5 + "1 2 3.75",
    ):
        path = tmp_path / "rr.csv"
        path.write_text(text)
        last = [float(field) for field in text.replace(",", " ").split()[-3:]]
        assert read_scan(path).points_m[-1].tolist() == last


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "  "])
def test_columns_are_found_by_name_in_any_order_and_case(tmp_path, delimiter):
    names = ["x", "y", "z", "intensity"]
    rows = np.round(np.random.default_rng(2).normal(0.0, 9.0, (20, 4)), 4)
    for order in itertools.permutations(range(4)):
        head = delimiter.join(names[i].upper() if i % 2 else names[i] for i in order)
        body = "".join(delimiter.join(f"{row[i]:.4f}" for i in order) + "\n" for row in rows)
        for declared in ("", "20\n"):
            with opened(tmp_path, f"# a\n{declared}{head}\n{body}".encode()) as source:
                assert table(read_text(source)).tobytes() == rows.tobytes()


def rows_of_numbers(columns, count=5):
    return "".join(" ".join(f"{r}.{c:02d}5" for c in range(columns)) + "\n" for r in range(count))


def test_twelve_columns_may_be_a_point_and_thirteen_are_none(tmp_path):
    pitch = "X pitch: 0.5\nY pitch: 0.5\n"
    assert len(read(tmp_path, "a.txt", rows_of_numbers(12).encode()).points_m) == 5
    refuse(tmp_path, "a.txt", rows_of_numbers(13).encode(), "13 columns without names")
    heights = read(tmp_path, "a.txt", (pitch + rows_of_numbers(13)).encode())
    assert len(heights.points_m) == 5 * 13
    refuse(tmp_path, "a.txt", (pitch + rows_of_numbers(12)).encode(), "12 columns below a pitch")


FOOTER = "\nEnd of the export\n"


@pytest.mark.parametrize(
    ("text", "pitch", "points"),
    [
        (rows_of_numbers(5), (0.5, 0.5), 25),
        ("X pitch: 0.5\nY pitch: 0.5\n" + rows_of_numbers(13), None, 65),
        ("P1 1 2 3\nP2 4 5 6\n", None, 2),
        ("P1 1 2 3 0.5\nP2 4 5 6 0.5\n", None, 2),
    ],
)
def test_text_may_follow_rows_of_any_kind(tmp_path, text, pitch, points):
    for end in ("", FOOTER):
        (tmp_path / "a.txt").write_text(text + end)
        scan = read_scan(tmp_path / "a.txt", options=ReadOptions(pitch=pitch))
        assert len(scan.points_m) == points


def test_an_npy_raster_with_its_row_and_column_in_front_is_refused(tmp_path):
    row, column = np.mgrid[:6, :7]
    points = np.random.default_rng(3).normal(size=(6, 7, 3))
    np.save(tmp_path / "a.npy", np.dstack([row, column, points]))
    with pytest.raises(InputError, match="two columns are whole numbers"):
        read_scan(tmp_path / "a.npy")
