"""Laws that hold for every format a scan can be read from."""

import bz2
import gzip
import io
import lzma
import random
import re
import struct
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import DATA
from wheelplane.capture.folder import capture_folder
from wheelplane.errors import InputError
from wheelplane.readers import RAW_FORMATS, READERS, read_scan

# Rows of doubles whose last bits float32, or six decimals, would lose.
FAR = [
    (1e7 + 1 / 3, -1e7 - 1 / 7, 0.1, 0.25),
    (1e7 + 2 / 3, -1e7 + 1e-9, 170.58, 17.0),
    (1e7 + 5 / 7, -1e7 + 2 / 3, -1e-300, 255.0),
    (1e7 + 1 / 9, -1e7 + 1 / 11, 1.5e-05, 0.5),
    (1e7 + 1 / 3, -1e7 - 1 / 7, 2.25, 0.125),
]


def ply_text(rows):
    head = f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n"
    head += "".join(f"property double {name}\n" for name in ("x", "y", "z", "intensity"))
    return (head + "end_header\n" + lines(rows, " ")).encode()


def ply_binary(rows, order, word):
    head = f"ply\nformat binary_{word}_endian 1.0\ncomment by hand\nelement vertex {len(rows)}\n"
    head += "property float Scalar_Intensity\nproperty double z\nproperty uchar red\n"
    head += "property double x\nproperty double y\nend_header\n"
    packed = (struct.pack(order + "fdBdd", i, z, 7, x, y) for x, y, z, i in rows)
    return head.encode() + b"".join(packed)


def pcd_head(rows, encoding):
    return (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 8 8 8 4\nTYPE F F F F\n"
        f"COUNT 1 1 1 1\nWIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(rows)}\nDATA {encoding}\n"
    ).encode()


def pcd_compressed(rows):
    columns = list(zip(*rows, strict=True))
    planes = b"".join(struct.pack(f"<{len(rows)}d", *column) for column in columns[:3])
    planes += struct.pack(f"<{len(rows)}f", *columns[3])
    packed = b"".join(
        bytes([len(piece) - 1]) + piece
        for piece in (planes[at : at + 32] for at in range(0, len(planes), 32))
    )
    sizes = struct.pack("<II", len(packed), len(planes))
    return pcd_head(rows, "binary_compressed") + sizes + packed


def npy(rows, fortran):
    order = ">" if fortran else "<"
    values = zip(*rows, strict=True) if fortran else rows
    flat = [value for row in values for value in row]
    head = f"{{'descr': '{order}f8', 'fortran_order': {fortran}, 'shape': ({len(rows)}, 4), }}\n"
    prefix = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head))
    return prefix + head.encode() + struct.pack(f"{order}{len(flat)}d", *flat)


def npz(rows):
    """A zip of arrays that numpy itself writes."""
    table, file = np.array(rows), io.BytesIO()
    np.savez(file, points=table[:, :3], intensity=table[:, 3])
    return file.getvalue()


def ptx(rows):
    """One raster of a column, in the scanner's own frame; a beam without return is 0 0 0."""
    head = f"1\n{len(rows)}\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    missing = [np.isnan(row[:3]).any() and not np.isinf(row[:3]).any() for row in rows]
    gone = [(0.0, 0.0, 0.0, 0.5) if m else row for row, m in zip(rows, missing, strict=True)]
    return (head + lines(gone, " ")).encode()


def lines(rows, delimiter):
    return "".join(delimiter.join(repr(value) for value in row) + "\n" for row in rows)


COUNTED = {
    "text.ply": ply_text,
    "little.ply": lambda rows: ply_binary(rows, "<", "little"),
    "big.ply": lambda rows: ply_binary(rows, ">", "big"),
    "text.pcd": lambda rows: pcd_head(rows, "ascii") + lines(rows, " ").encode(),
    "binary.pcd": lambda rows: (
        pcd_head(rows, "binary") + b"".join(struct.pack("<dddf", *row) for row in rows)
    ),
    "compressed.pcd": pcd_compressed,
    "counted.xyz": lambda rows: f"{len(rows)}\n{lines(rows, ' ')}".encode(),
    "rows.npy": lambda rows: npy(rows, fortran=False),
    "columns.npy": lambda rows: npy(rows, fortran=True),
    "raster.ptx": ptx,
    "counted.pts": lambda rows: f"{len(rows)}\n{lines(rows, ' ')}".encode(),
}
FREE = {
    "blanks.xyz": lambda rows: lines(rows, "  ").encode(),
    "commas.csv": lambda rows: b"\xef\xbb\xbfx,y,z,intensity\n" + lines(rows, ",").encode(),
    "bare.pts": lambda rows: lines(rows, " ").encode(),
    "tabs.txt": lambda rows: b"# scan\n" + lines(rows, "\t").replace("\n", "\r\n").encode(),
}
PACKED = {
    "arrays.npz": npz,
    "little.ply.gz": lambda rows: gzip.compress(ply_binary(rows, "<", "little")),
    "blanks.xyz.bz2": lambda rows: bz2.compress(FREE["blanks.xyz"](rows)),
    "raster.ptx.xz": lambda rows: lzma.compress(ptx(rows), preset=0),
    "alone.zip": lambda rows: zipped({"in/a.pcd": pcd_compressed(rows), "in/photo.jpg": b"\xff"}),
    "alone.tgz": lambda rows: tarred({"b.csv.gz": gzip.compress(FREE["commas.csv"](rows))}),
}
DECIMAL = {"comma.csv": lambda rows: lines(rows, ";").replace(".", ",").encode()}
WRITERS = COUNTED | FREE | PACKED | DECIMAL

each = pytest.mark.parametrize("name", WRITERS)
each_counted = pytest.mark.parametrize("name", COUNTED)


def zipped(files):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def tarred(files):
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as archive:
        for name, data in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return buffer.getvalue()


def read_bytes(folder, file, data, **options):
    path = folder / file
    path.write_bytes(data)
    return read_scan(path, **options)


def refuse(folder, name, data, pattern, **options):
    """Read what must be refused in one line that begins with the name."""
    with pytest.raises(InputError, match=pattern) as caught:
        read_bytes(folder, name, data, name=name, **options)
    assert_one_line(caught.value, name)


def assert_one_line(error, name):
    assert str(error).startswith(f"{name}: ")
    assert len(str(error).splitlines()) == 1
    assert str(error).count(": ") >= 2


@each
def test_doubles_at_1e7_m_survive_bit_for_bit(tmp_path, name):
    scan = read_bytes(tmp_path, name, WRITERS[name](FAR))
    expected = np.array(FAR)
    assert scan.points_m.dtype == np.float64
    assert scan.points_m.flags.c_contiguous
    assert scan.points_m.tobytes() == expected[:, :3].tobytes()
    assert scan.intensity.dtype == np.float32
    assert scan.intensity.tolist() == expected[:, 3].tolist()
    assert scan.invalid_points == 0


@each_counted
def test_every_cut_is_refused_unless_nothing_is_lost(tmp_path, name):
    data = COUNTED[name](FAR)
    whole = np.array(FAR)
    refused = 0
    for length in range(len(data)):
        try:
            scan = read_bytes(tmp_path, name, data[:length], name=name)
        except InputError as error:
            assert_one_line(error, name)
            refused += 1
        else:
            assert scan.points_m.tobytes() == whole[:, :3].tobytes()
            if not in_last_number(data, length):
                assert scan.intensity.tolist() == whole[:, 3].tolist()
    assert refused >= len(data) - 1 - len(data.split()[-1])


def in_last_number(data: bytes, length: int) -> bool:
    """Whether text is cut where nothing can tell: in the digits of a row's last number."""
    row = data[:length].splitlines()[-1]
    return b"\0" not in data and re.fullmatch(rb"[^ ,;\t]+([ ,;\t]+[^ ,;\t]+){3}", row) is not None


@pytest.mark.parametrize("name", PACKED)
def test_every_cut_of_a_packed_scan_is_refused(tmp_path, name):
    data = PACKED[name](FAR)
    for length in range(len(data)):
        refuse(tmp_path, name, data[:length], ".")


@pytest.mark.parametrize("name", FREE)
def test_a_cut_of_uncounted_text_passes_only_between_lines(tmp_path, name):
    data = FREE[name](FAR)
    passed = []
    for length in range(len(data)):
        try:
            scan = read_bytes(tmp_path, name, data[:length], name=name)
        except InputError as error:
            assert_one_line(error, name)
        else:
            count = len(scan.points_m)
            assert data[:length].endswith((b"\n", b"\r")) or in_last_number(data, length)
            assert scan.points_m.tolist() == [list(row[:3]) for row in FAR[:count]]
            passed.append(count)
    assert set(passed) >= {1, 2, 3, 4}


@pytest.mark.parametrize("name", COUNTED)
@pytest.mark.parametrize("count", [0, 1, 4, 6, 100, 10**12, 10**30, -1, "many", "5x"])
def test_a_count_that_lies_is_refused(tmp_path, name, count):
    if count == "many" and name.startswith("counted."):
        pytest.skip("a word above the rows of a text is prose")
    data = COUNTED[name](FAR)
    shown = re.sub(
        rb"(?m)(vertex |WIDTH |POINTS |\(|^)5\b", rb"\g<1>%b" % str(count).encode(), data
    )
    assert shown != data
    refuse(tmp_path, name, shown, ".")


@each_counted
def test_what_follows_the_declared_points_is_refused(tmp_path, name):
    data = COUNTED[name](FAR)
    is_text = name in ("text.ply", "text.pcd", "counted.xyz", "counted.pts", "raster.ptx")
    says = "line 16 is not the number of columns" if name == "raster.ptx" else "declares 5"
    refuse(tmp_path, name, data + (b"1 2 3 4\n" if is_text else b"\0"), says)


@each
def test_missing_returns_are_dropped_and_counted(tmp_path, name):
    hole = (float("nan"), 1.0, 2.0, 3.0)
    rows = [FAR[0], hole, FAR[1], (0.0, 0.0, float("nan"), 1.0), hole, FAR[2]]
    scan = read_bytes(tmp_path, name, WRITERS[name](rows))
    assert scan.points_m.tolist() == [list(row[:3]) for row in FAR[:3]]
    assert scan.intensity.tolist() == [row[3] for row in FAR[:3]]
    assert scan.points_m.flags.c_contiguous
    assert scan.invalid_points == 3
    refuse(tmp_path, name, WRITERS[name]([hole, hole]), "2 points are invalid")


@each
@pytest.mark.parametrize("bad", [float("inf"), float("-inf"), 1e30])
def test_an_infinite_coordinate_is_a_missing_return_as_others_are(tmp_path, name, bad):
    hole, rows = (float("nan"), 1.0, 2.0, 3.0), [(1.0, 2.0, bad, 1.0), (bad, bad, bad, 1.0)]
    data = WRITERS[name]([FAR[0], hole, rows[0], FAR[1], rows[1], FAR[2]])
    scan = read_bytes(tmp_path, name, data)
    assert scan.points_m.tolist() == [list(row[:3]) for row in FAR[:3]]
    assert scan.intensity.tolist() == [row[3] for row in FAR[:3]]
    assert scan.invalid_points == 3
    refuse(tmp_path, name, WRITERS[name](rows), "2 points are invalid")


@each
def test_units_scale_with_one_rounding(tmp_path, name):
    data = WRITERS[name](FAR)
    expected = np.array(FAR)[:, :3]
    in_mm = read_bytes(tmp_path, name, data, length_unit="mm")
    assert in_mm.points_m.tobytes() == (expected / 1000).tobytes()
    assert (in_mm.points_m != expected * 0.001).any()
    in_inches = read_bytes(tmp_path, name, data, length_unit="in")
    assert in_inches.points_m.tobytes() == (expected * 0.0254).tobytes()
    in_cm = read_bytes(tmp_path, name, data, length_unit="cm")
    assert in_cm.points_m.tobytes() == (expected / 100).tobytes()
    in_feet = read_bytes(tmp_path, name, data, length_unit="ft")
    assert in_feet.points_m.tobytes() == (expected * 0.3048).tobytes()
    refuse(tmp_path, name, data, "'km' is unknown: use m, mm, in, cm, ft", length_unit="km")


@each
def test_damaged_bytes_never_escape_as_another_error(tmp_path, name):
    data = WRITERS[name](FAR)
    rng = random.Random(name)
    for _ in range(400):
        broken = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            broken[rng.randrange(len(data))] = rng.choice(b"\0\n 05-x'\xff" + rng.randbytes(1))
        try:
            scan = read_bytes(tmp_path, name, bytes(broken), name=name)
        except InputError as error:
            assert_one_line(error, name)
        else:
            assert np.isfinite(scan.points_m).all()
            assert scan.invalid_points + len(scan.points_m) > 0


@each
def test_many_blocks_are_one_cloud(tmp_path, name):
    rng = np.random.default_rng(3)
    expected = rng.normal(size=(70_001, 4)).astype(np.float32).astype(np.float64)
    expected[[0, 40_000, 70_000], 1] = np.nan
    scan = read_bytes(tmp_path, name, WRITERS[name](expected.tolist()))
    there = expected[~np.isnan(expected[:, 1])]
    assert scan.invalid_points == 3
    assert scan.points_m.tobytes() == there[:, :3].tobytes()
    assert scan.intensity.tolist() == there[:, 3].tolist()


@pytest.mark.parametrize(
    ("file", "count", "first", "last"),
    [
        ("formats/simple_text.ply", 3, (-1, 0, 0), (1, 0, 0)),
        ("formats/simple_binary.ply", 3, (-1, 0, 0), (1, 0, 0)),
        (
            "formats/utm17_space.pcd",
            10,
            (289814.15, 4320978.61, 170.76),
            (289818.50, 4320980.59, 170.58),
        ),
        (
            "../../pipeline/diagnostics/certified/pcl/sac_plane_test.pcd",
            3283,
            (1.068, 0.094720997, -0.016231),
            (1.2798001, -0.41073, -0.18623),
        ),
    ],
)
def test_files_of_other_programs_are_read_whole(file, count, first, last):
    scan = read_scan(DATA / file)
    assert len(scan.points_m) == count
    assert tuple(scan.points_m[0]) == first
    assert tuple(scan.points_m[-1]) == last
    assert scan.intensity is None


def test_the_door_names_what_is_wrong_with_a_file(tmp_path):
    (tmp_path / "folder.ply").mkdir()
    for name, pattern in [
        ("none.ply", "no such file"),
        ("folder.ply", "it is a folder"),
        ("none.ply/x.ply", "no such file"),
    ]:
        with pytest.raises(InputError, match=pattern) as caught:
            read_scan(tmp_path / name, name="rr")
        assert_one_line(caught.value, "rr")
    refuse(tmp_path, "empty.ply", b"", "the file is empty")
    refuse(tmp_path, "cloud.step", b"v 0 0 0\n", " ".join(READERS))
    with pytest.raises(InputError, match=re.escape(f"{tmp_path}/none.ply: ")):
        read_scan(tmp_path / "none.ply")


def test_a_file_without_read_permission_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "rr.ply"
    path.write_bytes(ply_text(FAR))

    # Permissions do not stop the superuser, whom tests may run as.
    def denied(*_args, **_options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)
    with pytest.raises(InputError, match="no permission to read") as caught:
        read_scan(path, name="rr.ply")
    assert_one_line(caught.value, "rr.ply")


@pytest.mark.parametrize(
    ("name", "data", "kind"),
    [
        ("rr.ply", b"# .PCD v0.7\nVERSION 0.7\n", "PCD file"),
        ("rr.pcd", b"ply\nformat ascii 1.0\n", "PLY file"),
        ("rr.xyz", b"PK\x03\x04zip", "zip archive"),
        ("rr.npy", b"1 2 3\n", "text"),
        ("rr.ply", b"\xff\xfe1\x00,\x002\x00", "UTF-16"),
        ("rr.ply", b"<!DOCTYPE html><html>", "web page"),
        ("rr.ply", b"version https://git-lfs.github.com/spec/v1\n", "Git LFS"),
        ("rr.txt", b"\x01\x02\x00", "binary data"),
    ],
)
def test_a_wrong_suffix_is_refused_with_what_the_file_looks_like(tmp_path, name, data, kind):
    refuse(tmp_path, name, data, f"looks like .*{kind}")


@pytest.mark.parametrize("suffix", [*RAW_FORMATS, ".FLS"])
def test_a_raw_format_of_a_maker_says_what_to_export(tmp_path, suffix):
    program, formats = RAW_FORMATS[suffix.lower()]
    refuse(tmp_path, f"rr{suffix}", b"raw", f"raw format of {re.escape(program)}, which others")
    refuse(tmp_path, f"rr{suffix}", b"raw", f": export {formats} from it$")
    with (
        pytest.raises(InputError, match=f"export {formats}"),
        capture_folder(tmp_path / f"rr{suffix}"),
    ):
        pass


def test_a_file_without_points_is_not_called_one_of_missing_returns(tmp_path):
    for name, data in (("a.obj", b"f 1 2 3\n"), ("b.ply", ply_text([])), ("c.npy", npy([], False))):
        refuse(tmp_path, name, data, "it declares 0 points")


def test_suffixes_are_read_in_either_case(tmp_path):
    assert len(read_bytes(tmp_path, "RR.PLY", ply_text(FAR)).points_m) == len(FAR)


def test_importing_the_readers_brings_numpy_only():
    code = "import sys, wheelplane.readers; print(*{m.partition('.')[0] for m in sys.modules})"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, text=True
    )
    heavy = {"open3d", "scipy", "trimesh", "cv2", "pydantic", "click"}
    assert "numpy" in loaded.stdout.split()
    assert not heavy & set(loaded.stdout.split())
