"""LAS and LAZ: every point format to the last bit, and every lie of a header refused."""

from __future__ import annotations

import importlib.util
import io
import random
import re
import struct

import laspy
import lazrs
import numpy as np
import pytest

from tests.support.native_files import write_las
from tests.support.paths import FORMATS
from wheelplane.errors import InputError, MissingDependencyError
from wheelplane.readers import read_scan
from wheelplane.readers.formats import las
from wheelplane.readers.formats.las import POINT_BYTES

SCALE, SHIFT = (0.001, 0.0001, 0.25), (1e7, -4.5e6, 0.125)
COUNT = 300
SUFFIXES = (".las", ".laz")

each_suffix = pytest.mark.parametrize("suffix", SUFFIXES)


def cloud(count=COUNT):
    rng = np.random.default_rng(7)
    integers = rng.integers(-(2**31), 2**31, (count, 3))
    return integers, rng.integers(0, 2**16, count)


def make(path, count=COUNT, **options):
    options = {"point_format": 3, "version": "1.2", "scale": SCALE, "shift": SHIFT} | options
    return write_las(path, *cloud(count), **options)


def expected(count=COUNT):
    integers, intensity = cloud(count)
    return integers * np.array(SCALE) + np.array(SHIFT), intensity


def doctored(path, changes):
    """The file with other bytes: by place, a struct format and the new value."""
    data = bytearray(path.read_bytes())
    for at, (form, value) in changes.items():
        struct.pack_into(form, data, at, value)
    path.write_bytes(data)
    return path


def refusal(path):
    with pytest.raises(InputError) as caught:
        read_scan(path, name="rr.las")
    return one_line(caught.value)


def one_line(error):
    text = str(error)
    assert text.startswith("rr.las: ")
    assert text.isprintable()
    assert text.count(": ") >= 2
    return text


@each_suffix
@pytest.mark.parametrize(
    ("point_format", "version"),
    [(form, "1.4") for form in range(11) if form not in (4, 5, 9, 10)]
    + [(form, version) for form in (0, 1, 2, 3) for version in ("1.2", "1.3")],
)
def test_every_point_format_keeps_every_bit(tmp_path, suffix, point_format, version):
    path = make(tmp_path / f"rr{suffix}", point_format=point_format, version=version)
    scan = read_scan(path)
    points, intensity = expected()
    assert scan.points_m.tobytes() == points.tobytes()
    assert scan.intensity.tolist() == intensity.tolist()
    assert scan.invalid_points == 0
    assert scan.grid is None
    assert scan.points_m.tobytes() == np.ascontiguousarray(laspy.read(path).xyz).tobytes()


@pytest.mark.parametrize("point_format", [4, 5, 9, 10])
@pytest.mark.parametrize("version", ["1.3", "1.4"])
def test_points_with_waveforms_are_read(tmp_path, point_format, version):
    path = make(tmp_path / "rr.las", point_format=point_format % 6, version=version)
    data = path.read_bytes()
    start, old = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<H", data, 105)[0]
    new = POINT_BYTES[point_format]
    rows = [data[at : at + 14].ljust(new, b"w") for at in range(start, len(data), old)]
    path.write_bytes(data[:start] + b"".join(rows[:COUNT]))
    doctored(path, {104: ("<B", point_format), 105: ("<H", new)})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


@each_suffix
def test_extra_bytes_of_a_point_are_passed_over(tmp_path, suffix):
    path = tmp_path / f"rr{suffix}"
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.add_extra_dim(laspy.ExtraBytesParams(name="deviation", type=np.float64))
    header.scales, header.offsets = np.array(SCALE), np.array(SHIFT)
    content = laspy.LasData(header)
    content.X, content.Y, content.Z = cloud()[0].T
    content.intensity = cloud()[1]
    content["deviation"] = np.arange(COUNT) * 0.1
    content.write(str(path))
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


def test_version_1_0_is_read(tmp_path):
    path = doctored(make(tmp_path / "rr.las", point_format=1), {25: ("<B", 0)})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


def test_flagged_points_are_points(tmp_path):
    path = make(tmp_path / "rr.las", point_format=6, version="1.4")
    content = laspy.read(path)
    content.withheld[:100] = content.synthetic[50:150] = 1
    content.write(str(path))
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


@pytest.mark.parametrize(("point_format", "version"), [(1, "1.2"), (6, "1.4")])
@pytest.mark.parametrize("parallel", [True, False])
def test_many_chunks_and_blocks_are_one_cloud(
    tmp_path, monkeypatch, point_format, version, parallel
):
    """Chunks of 50,000 points, blocks that end within them."""
    count = 120_001
    path = make(tmp_path / "rr.laz", count, point_format=point_format, version=version)
    monkeypatch.setattr(las, "SLOT_BYTES", 7_001 * 28)
    monkeypatch.setattr(las, "LARGEST_CHUNK_BYTES", 1 << 25 if parallel else 1)
    scan = read_scan(path)
    points, intensity = expected(count)
    assert scan.points_m.tobytes() == points.tobytes()
    assert scan.intensity.tolist() == intensity.tolist()


@pytest.mark.parametrize(("point_format", "version"), [(1, "1.2"), (6, "1.4")])
def test_chunks_of_different_sizes_are_read(tmp_path, point_format, version):
    """As in cloud-optimised files, whose chunks are the cells of an octree."""
    data = make(tmp_path / "rr.las", point_format=point_format, version=version).read_bytes()
    start, length = struct.unpack_from("<I", data, 96)[0], POINT_BYTES[point_format]
    how = lazrs.LazVlr.new_for_compression(point_format, 0, True)
    record = bytes(how.record_data())
    head = struct.pack("<2x16sHH32x", b"laszip encoded", 22204, len(record)) + record
    packed = io.BytesIO()
    packed.write(data[:start] + head)
    compressor = lazrs.LasZipCompressor(packed, how)
    for first, last in [(0, 1), (1, 250), (250, COUNT)]:
        compressor.compress_many(data[start + first * length : start + last * length])
        compressor.finish_current_chunk()
    compressor.done()
    path = tmp_path / "rr.laz"
    path.write_bytes(packed.getvalue())
    doctored(path, {96: ("<I", start + len(head)), 100: ("<I", 1), 104: ("<B", point_format | 128)})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


def test_files_of_other_programs_are_read_whole():
    plain, packed = (read_scan(FORMATS / f"simple{suffix}") for suffix in SUFFIXES)
    assert len(plain.points_m) == 1065
    assert plain.points_m[0].tolist() == pytest.approx([637012.24, 849028.31, 431.66], abs=1e-9)
    assert plain.intensity[:3].tolist() == [143.0, 18.0, 118.0]
    assert plain.points_m.tobytes() == packed.points_m.tobytes()
    assert plain.intensity.tobytes() == packed.intensity.tobytes()


@each_suffix
def test_every_cut_is_refused(tmp_path, suffix):
    """At every byte of the header and of what surrounds the points, and at some between."""
    path = make(tmp_path / f"rr{suffix}")
    data = path.read_bytes()
    start = struct.unpack_from("<I", data, 96)[0]
    edges = [*range(4, start, 9), *(start + n for n in (0, 1, 7, 8, 9, 500)), len(data) - 1]
    for length in edges:
        path.write_bytes(data[:length])
        refusal(path)


# Of a packed chunk nothing says whether more points follow than the header declares.
LIES = [(".las", n) for n in (1, COUNT - 1)]
LIES += [(s, n) for s in SUFFIXES for n in (0, COUNT + 1, 10 * COUNT, 60_000, 2**32 - 1)]


@pytest.mark.parametrize(("suffix", "shown"), LIES)
def test_a_count_that_lies_is_refused(tmp_path, suffix, shown):
    text = refusal(doctored(make(tmp_path / f"rr{suffix}"), {107: ("<I", shown)}))
    assert str(shown) in text or "cannot be decoded" in text


@pytest.mark.parametrize(
    ("changes", "fact"),
    [
        ({24: ("<B", 2)}, "LAS version 2.2 is not"),
        ({25: ("<B", 5)}, "LAS version 1.5 is not"),
        ({94: ("<H", 100)}, "the header takes 100 bytes"),
        ({94: ("<H", 60_000)}, "the header takes 60000 bytes"),
        ({96: ("<I", 2**32 - 1)}, "its points begin at 4294967295"),
        ({96: ("<I", 226)}, "its points begin at 226"),
        ({104: ("<B", 11)}, "points of the format 11"),
        ({104: ("<B", 63)}, "points of the format 63"),
        ({104: ("<B", 0x83)}, "it is compressed, and has 0 LASzip records"),
        ({105: ("<H", 33)}, "points of the format 3 in 33 bytes"),
        ({105: ("<H", 0)}, "points of the format 3 in 0 bytes"),
        ({105: ("<H", 35)}, "declares 300 points, the file holds 291"),
        ({131: ("<d", 0.0)}, "its scales and offsets are"),
        ({139: ("<d", float("nan"))}, "its scales and offsets are"),
        ({171: ("<d", float("inf"))}, "its scales and offsets are"),
        ({131: ("<d", 1e300)}, "beyond any site|infinite coordinate"),
    ],
)
def test_a_header_that_contradicts_itself_is_refused(tmp_path, changes, fact):
    assert re.search(fact, refusal(doctored(make(tmp_path / "rr.las"), changes)))


@pytest.mark.parametrize("records", [0, 3, 2**32 - 1])
def test_a_wrong_count_of_records_is_no_matter_where_none_is_needed(tmp_path, records):
    """As in PDAL's bad_vlr_count.las: the points are where the header says."""
    plain = doctored(make(tmp_path / "rr.las"), {100: ("<I", records)})
    assert read_scan(plain).points_m.tobytes() == expected()[0].tobytes()
    if records > 3:
        packed = doctored(make(tmp_path / "rr.laz"), {100: ("<I", records)})
        assert f"of {records} in its header reaches beyond it" in refusal(packed)


@pytest.mark.parametrize(
    ("changes", "fact"),
    [
        ({247: ("<Q", COUNT + 1)}, "declares 301 points, the file holds 300"),
        ({107: ("<I", COUNT - 1)}, "declares 300 points, and 299 for old readers"),
        ({107: ("<I", 0), 247: ("<Q", 2**63)}, "declares 9223372036854775808 points, the file"),
        ({243: ("<I", 1)}, "not all its 1 extended records are there"),
        ({235: ("<Q", 400), 243: ("<I", 2**32 - 1)}, "extended records are there"),
        ({235: ("<Q", 2**64 - 1), 243: ("<I", 1)}, "extended records are there"),
    ],
)
def test_a_header_of_1_4_that_contradicts_itself_is_refused(tmp_path, changes, fact):
    path = make(tmp_path / "rr.las", point_format=6, version="1.4")
    assert fact in refusal(doctored(path, changes))


def test_extended_records_after_the_points_are_no_points(tmp_path):
    path = make(tmp_path / "rr.las", point_format=6, version="1.4")
    end = path.stat().st_size
    record = struct.pack("<2x16sHQ32x", b"someone", 1, 500) + bytes(500)
    path.write_bytes(path.read_bytes() + record)
    assert "declares 300 points, but 1" in refusal(path)
    doctored(path, {235: ("<Q", end), 243: ("<I", 1)})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


@pytest.mark.parametrize("version", ["1.3", "1.4"])
def test_waveforms_after_the_points_are_no_points(tmp_path, version):
    path = make(tmp_path / "rr.las", point_format=1, version=version)
    end = path.stat().st_size
    path.write_bytes(path.read_bytes() + b"w" * 5000)
    assert "declares 300 points, but 1" in refusal(path)
    doctored(path, {227: ("<Q", end)})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()


def laszip_at(data):
    return data.index(b"laszip encoded") + 52


def test_a_record_on_the_compression_that_is_cut_is_refused(tmp_path):
    path = make(tmp_path / "rr.laz")
    length_at = laszip_at(path.read_bytes()) - 34
    for length in (0, 33, 34, 37, 51):
        text = refusal(doctored(path, {length_at: ("<H", length)}))
        assert "does not fit its points" in text


@pytest.mark.parametrize(
    ("where", "change", "fact"),
    [
        ("record", {0: ("<H", 1)}, "does not fit its points"),
        ("record", {2: ("<H", 1)}, "does not fit its points"),
        ("record", {32: ("<H", 0)}, "does not fit its points"),
        ("record", {32: ("<H", 65_535)}, "does not fit its points"),
        ("record", {36: ("<H", 21)}, "does not fit its points"),
        ("record", {12: ("<I", 1)}, "the table 1 chunks of 1"),
        ("record", {12: ("<I", 0)}, "the table 1 chunks of 0"),
        ("record", {34: ("<H", 77)}, "cannot be decoded|crashes"),
        ("points", {0: ("<q", 10**15)}, "its table of chunks should be at byte 1000000000000000"),
        ("points", {0: ("<q", -7)}, "its table of chunks should be at byte -7"),
        ("points", {0: ("<q", -1)}, "its table of chunks should be at|do not fit in"),
        ("table", {4: ("<I", 0)}, "the table 0 chunks"),
        ("table", {4: ("<I", 2)}, "the table 2 chunks"),
        ("table", {4: ("<I", 2**32 - 1)}, "its 4294967295 chunks do not fit"),
        ("table", {0: ("<I", 9)}, "chunks do not fit"),
    ],
)
def test_a_compression_that_contradicts_itself_is_refused(tmp_path, where, change, fact):
    path = make(tmp_path / "rr.laz")
    data = path.read_bytes()
    points = struct.unpack_from("<I", data, 96)[0]
    table = struct.unpack_from("<q", data, points)[0]
    base = {"record": laszip_at(data), "points": points, "table": table}[where]
    doctored(path, {base + at: to for at, to in change.items()})
    assert re.search(fact, refusal(path))


def test_points_that_no_compression_could_hold_are_refused(tmp_path):
    path = make(tmp_path / "rr.laz")
    at = laszip_at(path.read_bytes())
    doctored(path, {107: ("<I", 2**32 - 2), at + 12: ("<I", 2**32 - 2)})
    assert "declares 4294967294 points" in refusal(path)


@each_suffix
def test_damaged_bytes_end_in_points_or_in_one_line(tmp_path, suffix):
    path = make(tmp_path / f"rr{suffix}", 40)
    data = path.read_bytes()
    rng = random.Random(suffix)
    for _ in range(300 if suffix == ".las" else 40):
        broken = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            broken[rng.randrange(94, len(data))] = rng.choice([0, 255, rng.randrange(256)])
        path.write_bytes(broken)
        try:
            scan = read_scan(path, name="rr.las")
        except InputError as error:
            one_line(error)
        else:
            assert np.isfinite(scan.points_m).all()
            legacy = struct.unpack_from("<I", broken, 107)[0]
            assert len(scan.points_m) + scan.invalid_points == legacy


def test_without_its_library_laz_says_what_to_install_and_las_is_read(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'wheelplane\[las\]'"):
        read_scan(FORMATS / "simple.laz")
    assert len(read_scan(FORMATS / "simple.las").points_m) == 1065


def chunked(path, point_format=3):
    """A LAZ file, the byte of its points, and the byte of its table of chunks."""
    data = make(path, point_format=point_format).read_bytes()
    points = struct.unpack_from("<I", data, 96)[0]
    return data, points, struct.unpack_from("<q", data, points)[0]


def test_a_compression_written_to_a_pipe_is_read(tmp_path):
    """LASzip then puts -1 for the table's offset, and the offset behind the table."""
    path = tmp_path / "rr.laz"
    data, points, table = chunked(path)
    piped = data[:points] + struct.pack("<q", -1) + data[points + 8 :] + struct.pack("<q", table)
    path.write_bytes(piped)
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()
    for cut in (1, 4, 8):
        path.write_bytes(piped[:-cut])
        refusal(path)


def test_the_table_of_chunks_lies_between_its_offset_and_the_end(tmp_path):
    path = tmp_path / "rr.laz"
    data, points, _ = chunked(path)
    for wrong in (0, points, points + 7, len(data) - 7, len(data), 2**63 - 1):
        path.write_bytes(data)
        doctored(path, {points: ("<q", wrong)})
        assert f"its table of chunks should be at byte {wrong}" in refusal(path)
    for wrong in (points + 8, len(data) - 8):
        path.write_bytes(data)
        assert "chunks do not fit in" in refusal(doctored(path, {points: ("<q", wrong)}))


def test_no_more_chunks_than_their_first_points_fill(tmp_path):
    path = tmp_path / "rr.laz"
    _, points, table = chunked(path)
    held = table - points - 8
    doctored(path, {table + 4: ("<I", held // POINT_BYTES[3] + 1)})
    assert f"do not fit in {held} bytes" in refusal(path)


@pytest.mark.parametrize(
    ("points", "chunks", "fits"),
    [(COUNT, 1, True), (COUNT - 1, 1, False), (COUNT, 2, False), (COUNT // 2, 1, False)],
)
def test_chunks_hold_the_declared_points(tmp_path, points, chunks, fits):
    path = tmp_path / "rr.laz"
    data, _, table = chunked(path)
    doctored(path, {laszip_at(data) + 12: ("<I", points), table + 4: ("<I", chunks)})
    if fits:
        assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()
    else:
        assert f"declares 300 points, the table {chunks} chunks of {points}" in refusal(path)


def test_a_file_of_a_header_alone_has_no_points(tmp_path):
    path = make(tmp_path / "rr.las", 1, point_format=0)
    data = path.read_bytes()[:227]
    path.write_bytes(data)
    doctored(path, {96: ("<I", 227), 100: ("<I", 0)})
    assert "declares 1 points, the file holds 0" in refusal(path)
    assert "it declares 0 points" in refusal(doctored(path, {107: ("<I", 0)}))


@pytest.mark.parametrize("lengths", [(0,), (0, 0), (500, 0), (7, 500, 30)])
def test_every_extended_record_is_where_the_one_before_it_ends(tmp_path, lengths):
    path = make(tmp_path / "rr.las", point_format=6, version="1.4")
    plain = path.read_bytes()
    records = [struct.pack("<2x16sHQ32x", b"someone", 1, n) + bytes(n) for n in lengths]
    data = plain + b"".join(records)
    path.write_bytes(data)
    doctored(path, {235: ("<Q", len(plain)), 243: ("<I", len(lengths))})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()
    whole = path.read_bytes()
    for cut in {1, 59, len(records[-1])}:
        path.write_bytes(whole[:-cut])
        assert "extended records are there" in refusal(path)
    path.write_bytes(whole)
    assert "extended records are there" in refusal(doctored(path, {243: ("<I", len(lengths) + 1)}))


def test_records_of_a_header_end_where_the_points_begin(tmp_path):
    """The last one may be empty; none may reach a byte further."""
    path = tmp_path / "rr.laz"
    data, points, table = chunked(path)
    (records,) = struct.unpack_from("<I", data, 100)
    more = struct.pack("<2x16sHH32x", b"someone", 1, 0)
    path.write_bytes(data[:points] + more + data[points:])
    moved = {96: ("<I", points + 54), 100: ("<I", records + 1)}
    moved |= {points + 54: ("<q", table + 54)}
    assert read_scan(doctored(path, moved)).points_m.tobytes() == expected()[0].tobytes()
    doctored(path, {points + 20: ("<H", 1)})
    assert f"record {records + 1} of {records + 1} in its header reaches" in refusal(path)


def test_points_take_as_many_bytes_as_laspy_finds():
    assert [laspy.PointFormat(number).size for number in range(11)] == list(POINT_BYTES)


def test_version_1_1_is_read(tmp_path):
    path = doctored(make(tmp_path / "rr.las", point_format=1), {25: ("<B", 1)})
    assert read_scan(path).points_m.tobytes() == expected()[0].tobytes()
