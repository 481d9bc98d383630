"""What is particular to PCD: fields, older headers, pages of PCL, and LZF."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.formats import pcd as pcd_format
from wheelplane.readers.parsing.lzf import decompress

MANUAL = Path(pcd_format.__file__).parents[2] / "manual"


def read(folder, data):
    path = folder / "rr.pcd"
    path.write_bytes(data)
    return read_scan(path, name="rr.pcd")


def refuse(folder, data, pattern):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, data)
    assert str(caught.value).startswith("rr.pcd: ")
    assert len(str(caught.value).splitlines()) == 1


def head(encoding, width=2, height=1, points=2, **changes):
    entries = {
        "VERSION": "0.7",
        "FIELDS": "x y z",
        "SIZE": "4 4 4",
        "TYPE": "F F F",
        "COUNT": "1 1 1",
        "WIDTH": width,
        "HEIGHT": height,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": points,
        "DATA": encoding,
    } | changes
    return "".join(f"{k} {v}\n" for k, v in entries.items() if v is not None).encode()


def test_the_viewpoint_moves_no_point_and_the_manual_names_no_position_of_a_pcd(tmp_path):
    """Programs write it as the sensor's pose or by default, moved points or not."""
    rows = b"1 2 3\n4 5 6\n"
    scan = read(tmp_path, head("ascii", VIEWPOINT="7 8 9 0.5 0.5 0.5 0.5") + rows)
    assert scan.points_m.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert scan.parts == ()
    manual = " ".join(" ".join(p.read_text("utf-8").split()) for p in sorted(MANUAL.glob("*.md")))
    named = re.findall(r"file states (?:its|the scanner's) position \(([^)]*)\)", manual)
    assert named == ["E57, PTX"] * 2


def lzf(data):
    """Greedy LZF of our own, quadratic: the longest earlier match of at least 3 bytes."""
    out, literals, at = bytearray(), bytearray(), 0

    def flush():
        for start in range(0, len(literals), 32):
            piece = literals[start : start + 32]
            out.extend(bytes([len(piece) - 1]) + piece)
        literals.clear()

    while at < len(data):
        best, where = 0, 0
        first = data.find(data[at : at + 3], max(0, at - 8192), at + 2)
        for start in range(first, at) if first >= 0 else ():
            length = 0
            while (
                at + length < len(data)
                and length < 264
                and data[start + length] == data[at + length]
            ):
                length += 1
            if length > best:
                best, where = length, start
        if best < 3:
            literals.append(data[at])
            at += 1
            continue
        flush()
        high, low = divmod(at - where - 1, 256)
        short = min(best - 2, 7)
        out.append(short << 5 | high)
        if short == 7:
            out.append(best - 9)
        out.append(low)
        at += best
    flush()
    return bytes(out)


FIELDS = {
    "FIELDS": "_ intensity z rgb y x hist _",
    "SIZE": "1 2 8 4 8 4 4 1",
    "TYPE": "U U F F F I F U",
    "COUNT": "3 1 1 1 1 1 2 5",
}
ROWS = [(9, 9, 9, 65535, 1 / 3, 0.0, 1e7 + 1 / 3, -7, 0.5, 0.25, 9, 9, 9, 9, 9), (0,) * 15]
POINTS = [[-7, 1e7 + 1 / 3, 1 / 3], [0, 0, 0]]


def packed_rows():
    return b"".join(struct.pack("<3BHdfdi2f5B", *row) for row in ROWS)


def packed_planes():
    planes, columns = b"", list(zip(*ROWS, strict=True))
    for kind, start, count in [
        *(("B", 0, 3), ("H", 3, 1), ("d", 4, 1), ("f", 5, 1)),
        *(("d", 6, 1), ("i", 7, 1), ("f", 8, 2), ("B", 10, 5)),
    ]:
        for row in zip(*columns[start : start + count], strict=True):
            planes += struct.pack(f"<{count}{kind}", *row)
    return planes


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_fields_in_any_order_with_padding_and_counts(tmp_path, encoding):
    planes = packed_planes()
    packed = lzf(planes)
    body = {
        "ascii": "".join(" ".join(map(repr, row)) + "\n" for row in ROWS).encode(),
        "binary": packed_rows(),
        "binary_compressed": struct.pack("<II", len(packed), len(planes)) + packed,
    }[encoding]
    data = head(encoding, **FIELDS) + body
    scan = read(tmp_path, data)
    assert scan.points_m.tolist() == POINTS
    assert scan.intensity.tolist() == [65535, 0]
    last = 1 + len(data.split()[-1]) if encoding == "ascii" else 0
    for length in range(len(data) - last):
        refuse(tmp_path, data[:length], ".")


def test_organized_clouds_older_headers_and_comments(tmp_path):
    body = b"1 2 3\nnan nan nan\n# between\n\n4 5 6\n7 8 9\n"
    scan = read(tmp_path, b"# first\n\n" + head("ascii # last", 2, 2, 4) + body)
    assert scan.points_m.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert scan.invalid_points == 1
    old = b"# .PCD v.5\nCOLUMNS x y z\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n"
    assert read(tmp_path, old).points_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    no_points = head("ascii", VERSION=".6", POINTS=None) + b"1 2 3\n4 5 6\n"
    assert len(read(tmp_path, no_points.replace(b"\n", b"\r\n")).points_m) == 2


def test_blank_and_comment_lines_are_no_points(tmp_path):
    refuse(tmp_path, head("ascii") + b"1 2 3\n\n# 4 5 6\n", "declares 2 points, the file holds 1")


def test_the_zeros_of_the_last_page_of_pcl_are_no_points(tmp_path):
    body = struct.pack("<6f", 1, 2, 3, 4, 5, 6)
    data = (head("binary") + body).ljust(4096 + len(body), b"\0")
    assert read(tmp_path, data).points_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    refuse(tmp_path, data[:-1], "bytes follow")
    refuse(tmp_path, data[:-1] + b"\1", "bytes follow")


@pytest.mark.parametrize("page", [4096, 16384, 65536])
@pytest.mark.parametrize("points", [2, 340, 1000])
def test_whole_pages_of_pcl_s_compressed_files_are_read(tmp_path, page, points):
    """pcl::PCDWriter::writeBinaryCompressed seeks to the end of the last page and writes a zero."""
    rows = np.random.default_rng(points).normal(size=(points, 3)).astype("<f4")
    planes = rows.T.tobytes()
    packed = lzf(planes)
    body = struct.pack("<II", len(packed), len(planes)) + packed
    plain = head("binary_compressed", points, 1, points) + body
    padded = plain.ljust(-(-len(plain) // page) * page, b"\0")
    assert read(tmp_path, padded).points_m.tolist() == rows.astype(float).tolist()
    older = plain.ljust(page + len(body), b"\0")  # one page beyond the data, as of PCL 1.7
    assert read(tmp_path, older).points_m.tolist() == rows.astype(float).tolist()
    refuse(tmp_path, padded[:-1], "bytes follow")
    refuse(tmp_path, padded[:-1] + b"\1", "bytes follow")
    refuse(tmp_path, padded + bytes(65536), "bytes follow")


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_an_intensity_of_several_values_is_not_needed(tmp_path, encoding):
    fields = {"FIELDS": "x y z intensity", "SIZE": "4 4 4 4", "TYPE": "F F F F"}
    data = head(encoding, COUNT="1 1 1 4", **fields)
    rows = [(1, 2, 3, 9, 9, 9, 9), (4, 5, 6, 9, 9, 9, 9)]
    packed = b"".join(struct.pack("<7f", *row) for row in rows)
    text = "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
    scan = read(tmp_path, data + (text if encoding == "ascii" else packed))
    assert scan.points_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert scan.intensity is None


@pytest.mark.parametrize(
    ("data", "pattern"),
    [
        (head("ascii", 3, 1, 2), "3 x 1 is not the declared 2 points"),
        (head("ascii", SIZE="4 4"), "3 FIELDS, but 2 values of SIZE"),
        (head("ascii", SIZE="4 4 2"), "unknown type 'F' of 2 bytes"),
        (head("ascii", TYPE="F F Q"), "unknown type 'Q'"),
        (head("ascii", COUNT="1 1 2"), "the field z has 2 values"),
        (head("ascii", COUNT="1 1 -1"), "not a whole number"),
        (head("ascii", FIELDS="x y y"), "there twice"),
        (head("ascii", FIELDS="x y a"), "z is missing"),
        (head("ascii", FIELDS=None), "0 FIELDS"),
        (head("ascii", WIDTH=None, POINTS=None), "neither POINTS nor WIDTH"),
        (head("ascii", points="many"), "'many', not a whole number"),
        (head("zip"), "encoding 'zip' is none of ascii, binary"),
        (head("ascii", COLOR="1"), "line 11 holds 'COLOR'|columns"),
        (b"COLOR 1\n" + head("ascii"), "line 1 is not of a PCD header"),
        (b"SIZE 4\n" + head("ascii"), "repeats the header entry SIZE"),
        (head("ascii", DATA=None), "line 10 is not of a PCD header"),
        (head("binary", 10**12, 1, 10**12), "declares 1000000000000 points, the file holds"),
        (head("binary_compressed") + bytes(8), "0 bytes for 0"),
        (head("binary_compressed") + struct.pack("<II", 9, 24) + bytes(8), "holds 8"),
        (head("ascii", 10**12, 1, 10**12), "declares 1000000000000 points"),
    ],
)
def test_headers_that_are_refused(tmp_path, data, pattern):
    refuse(tmp_path, data if data.endswith(b"\0") else data + b"1 2 3\n4 5 6\n", pattern)


@given(st.lists(st.binary(min_size=1, max_size=40), max_size=8), st.data())
def test_lzf_unpacks_what_an_independent_packer_made(words, data):
    picks = data.draw(st.lists(st.sampled_from(words), max_size=30)) if words else []
    plain = b"".join(picks)
    packed = lzf(plain)
    assert decompress(packed, len(plain)) == plain
    for length in range(len(packed)):
        with pytest.raises(ValueError, match=r"unpack|back reference"):
            decompress(packed[:length], len(plain))


@pytest.mark.parametrize("runs", [7, 8, 9, 72, 73, 400])
def test_lzf_long_literals_and_a_repeated_byte(runs):
    plain = bytes((i * i // 7 + i) % 251 for i in range(32 * runs))
    packed = b"".join(b"\x1f" + plain[at : at + 32] for at in range(0, len(plain), 32))
    assert decompress(packed, len(plain)) == plain
    tail = b"".join(bytes([4]) + plain[at : at + 5] for at in range(10))
    after = b"".join(plain[at : at + 5] for at in range(10))
    repeated = packed + b"\xe0\xff\x00" + tail
    expected = plain + plain[-1:] * 264 + after
    assert decompress(repeated, len(expected)) == expected
    assert decompress(packed + tail, len(plain + after)) == plain + after


@given(st.binary(max_size=200), st.integers(0, 300))
def test_lzf_of_junk_gives_the_declared_size_or_a_value_error(junk, size):
    try:
        out = decompress(junk, size)
    except ValueError:
        return
    assert len(out) == size


@pytest.mark.parametrize(
    ("packed", "size"),
    [
        (b"\x20\x00", 3),
        (b"\x00a\x20\x01", 4),
        (b"\x03abcd\x20\x08", 6),
        (b"\xe0", 4),
        (b"\x00a\xe0\x05", 15),
        (b"\x05ab", 2),
        (b"\x01ab", 3),
        (b"\x01ab", 1),
    ],
)
def test_lzf_refuses_what_leaves_its_bounds(packed, size):
    with pytest.raises(ValueError, match=r"unpack|back reference"):
        decompress(packed, size)


def test_a_wrong_row_is_named_by_its_line(tmp_path):
    refuse(tmp_path, head("ascii") + b"1 2 3\n4 5 x\n", "line 12 holds 'x'")


def test_a_binary_cloud_that_is_cut_says_how_many_points_it_holds(tmp_path):
    refuse(tmp_path, head("binary", 9, 1, 9) + bytes(8 * 12 + 11), "9 points, the file holds 8")


def test_a_width_without_a_height_is_the_number_of_points(tmp_path):
    data = head("ascii", HEIGHT=None, POINTS=None) + b"1 2 3\n4 5 6\n"
    assert read(tmp_path, data).points_m.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_the_longest_header_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(pcd_format, "_MOST_LINES", 10)
    assert len(read(tmp_path, head("ascii") + b"1 2 3\n4 5 6\n").points_m) == 2
    refuse(tmp_path, b"# more\n" + head("ascii") + b"1 2 3\n4 5 6\n", "more than 10 lines in its")


@pytest.mark.parametrize("page", [4096, 16384, 65536])
def test_a_compressed_cloud_that_fills_its_pages_is_followed_by_no_other(tmp_path, page):
    planes = struct.pack("<6f", 1, 4, 2, 5, 3, 6)
    packed = lzf(planes)
    body = struct.pack("<II", len(packed), len(planes)) + packed
    plain = head("binary_compressed") + body
    full = b"#" * (page - len(plain) - 1) + b"\n" + plain
    assert len(full) == page
    assert read(tmp_path, full).points_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    refuse(tmp_path, full + bytes(page), f"{page} bytes follow")


@pytest.mark.parametrize(
    ("kind", "form"),
    [
        *(("F4", "f"), ("F8", "d"), ("I1", "b"), ("I2", "h"), ("I4", "i"), ("I8", "q")),
        *(("U1", "B"), ("U2", "H"), ("U4", "I"), ("U8", "Q")),
    ],
)
def test_any_type_of_number(tmp_path, kind, form):
    data = head("binary", SIZE=" ".join(kind[1] * 3), TYPE=" ".join(kind[0] * 3))
    scan = read(tmp_path, data + struct.pack(f"<6{form}", 1, 2, 3, 4, 5, 6))
    assert scan.points_m.tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize("runs", [8, 9, 80])
def test_lzf_long_literals_end_where_a_shorter_one_begins(runs):
    """Whose bytes are what the first byte of a long one is."""
    plain = bytes(i % 251 for i in range(32 * runs)) + b"\x1f" * 100
    packed = b"".join(b"\x1f" + plain[at : at + 32] for at in range(0, 32 * runs, 32))
    assert decompress(packed + b"\x04\x1f\x1f\x1f\x1f\x1f" * 20, len(plain)) == plain
