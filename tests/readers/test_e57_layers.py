"""Layers of an E57 file, each alone: pages, sections of packets, XML, and what a scan declares."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from tests.support.native_files import (
    PAGE,
    PAYLOAD,
    Double,
    E57Scan,
    paged,
    payload,
    with_bytes,
    with_xml,
    write_e57,
    xml_of,
    xyz,
)
from tests.support.sources import opened
from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.e57 import pages as e57_pages
from wheelplane.readers.e57 import section
from wheelplane.readers.e57 import xml as e57_xml
from wheelplane.readers.e57.pages import Pages
from wheelplane.readers.e57.scans import E57Scan as Declared
from wheelplane.readers.e57.scans import Field, RawPart, find_scans
from wheelplane.readers.e57.section import check_sections

CONTENT = np.random.default_rng(6).integers(0, 256, 4 * PAYLOAD, np.uint8).tobytes()
BYTES_AT, HEAD = 48, 32


def small(folder):
    points = np.random.default_rng(1).normal(size=(50, 3))
    return write_e57(folder / "small.e57", E57Scan(xyz(points))).read_bytes()


def test_physical_offsets_are_logical_ones_with_the_checksums_left_out(tmp_path):
    kept = [at for at in range(4 * PAGE) if at % PAGE < PAYLOAD]
    with opened(tmp_path, paged(CONTENT)) as source:
        pages = Pages(source)
        assert pages.size == len(kept)
        logical = {at: pages.logical(at) for at in range(-PAGE, 5 * PAGE)}
    assert [logical.pop(at) for at in kept] == list(range(len(kept)))
    assert all(value < 0 for value in logical.values())


@pytest.mark.parametrize("damaged", range(4))
def test_only_the_pages_that_are_read_are_checked(tmp_path, damaged):
    data = bytearray(paged(CONTENT))
    data[damaged * PAGE + 7] ^= 1
    held = payload(bytes(data))
    edges = [1, 500, PAYLOAD - 1, PAYLOAD, PAYLOAD + 1, 2 * PAYLOAD, 3 * PAYLOAD, 4 * PAYLOAD]
    with opened(tmp_path, bytes(data)) as source:
        pages = Pages(source)
        for start in [0, *edges[:-1]]:
            for end in (end for end in edges if end > start):
                first, last = start // PAYLOAD, (end - 1) // PAYLOAD
                assert pages.read(start, end - start, checked=False) == held[start:end]
                if first <= damaged <= last:
                    with pytest.raises(InputError, match=f"of its page {damaged + 1} does not"):
                        pages.read(start, end - start, checked=True)
                else:
                    assert pages.read(start, end - start, checked=True) == held[start:end]


@pytest.mark.parametrize("left", [0, 1, 2 * PAGE, 3 * PAGE, 4 * PAGE - 1])
def test_a_file_that_shrinks_while_it_is_read_is_refused(tmp_path, left):
    with opened(tmp_path, paged(CONTENT)) as source:
        source.path.write_bytes(paged(CONTENT)[:left])
        with pytest.raises(InputError, match="cut while it was read"):
            Pages(source).read(0, len(CONTENT), checked=False)


def test_the_xml_may_end_with_the_file_and_no_further(tmp_path, monkeypatch):
    data = small(tmp_path)
    xml = xml_of(data)
    full = with_xml(data, xml + b" " * (-len(xml) % PAYLOAD))
    (tmp_path / "a.e57").write_bytes(full)
    assert len(read_scan(tmp_path / "a.e57").points_m) == 50
    (longer,) = struct.unpack_from("<Q", full, 32)
    (tmp_path / "a.e57").write_bytes(with_bytes(full, 32, struct.pack("<Q", longer + 1)))
    with pytest.raises(InputError, match="is not within its"):
        read_scan(tmp_path / "a.e57")
    monkeypatch.setattr(e57_pages, "MAX_XML_BYTES", len(xml))
    (tmp_path / "a.e57").write_bytes(with_xml(data, xml))
    assert len(read_scan(tmp_path / "a.e57").points_m) == 50


def empty(size=4):
    return struct.pack("<BBH", 2, 0, size - 1).ljust(size, b"\0")


def packet(*streams):
    """A data packet that holds the streams, in whole words of 4 bytes."""
    head = struct.pack(f"<HH{len(streams)}H", 0, len(streams), *map(len, streams))
    body = head[2:] + b"".join(streams)
    size = -(-(4 + len(body)) // 4) * 4
    return (struct.pack("<BBH", 1, 0, size - 1) + body).ljust(size, b"\0")


FLOATS = tuple(Field(name, "Float", 64) for name in ("cartesianX", "cartesianY", "cartesianZ"))


def check(folder, packets, *, at=BYTES_AT, rows=2, fields=FLOATS, longer=0, first=HEAD, cut=False):
    """Check one section at logical byte `at`; `cut`: the file ends with it."""
    body = b"".join(packets)
    content = bytes(at) + struct.pack("<B7xQQQ", 1, HEAD + len(body) + longer, 0, 0) + body
    if cut:  # the section begins later, so that it ends with a page
        shift = -len(content) % PAYLOAD
        at, content = at + shift, bytes(shift) + content
    data_at = (at + first) // PAYLOAD * PAGE + (at + first) % PAYLOAD
    content = content[: at + 16] + struct.pack("<Q", data_at) + content[at + 24 :]
    physical = at // PAYLOAD * PAGE + at % PAYLOAD
    with opened(folder, paged(content), "rr.e57") as source:
        check_sections(Pages(source), [Declared(0, RawPart("s"), rows, physical, fields)])


POINTS = packet(bytes(16), bytes(16), bytes(16))


@pytest.mark.parametrize("cut", [False, True])
def test_a_section_holds_its_packets_and_may_end_with_the_file(tmp_path, cut):
    check(tmp_path, [POINTS, empty()], cut=cut)
    check(tmp_path, [empty(), POINTS], cut=cut)
    for longer in (-4, 4) if cut else (-4,):
        with pytest.raises(InputError, match=r"not of its points|are not within it"):
            check(tmp_path, [POINTS, empty(8)], cut=cut, longer=longer)


@pytest.mark.parametrize("first", [0, HEAD - 4, HEAD + len(POINTS)])
def test_the_first_packet_lies_behind_the_head_of_its_section(tmp_path, first):
    with pytest.raises(InputError, match="are not within it"):
        check(tmp_path, [POINTS], first=first)


def test_a_section_that_begins_where_the_file_ends_is_refused(tmp_path):
    for at in range(PAYLOAD - HEAD + 1, PAYLOAD, 10):
        with (
            opened(tmp_path, paged(bytes(PAYLOAD)), "rr.e57") as source,
            pytest.raises(InputError, match="are not within it"),
        ):
            check_sections(Pages(source), [Declared(0, RawPart("s"), 2, at, FLOATS)])


@pytest.mark.parametrize("at", [BYTES_AT, 5 * PAYLOAD])
def test_packets_are_as_many_as_a_small_file_has_or_as_their_bytes_may_be(
    tmp_path, monkeypatch, at
):
    monkeypatch.setattr(section, "SMALLEST_NUMBER", 10)
    check(tmp_path, [POINTS, *[empty()] * 9], at=at)
    check(tmp_path, [POINTS, empty(1024 - len(POINTS)), *[empty()] * 12], at=at)
    for packets in ([empty()] * 10, [empty(1024 - len(POINTS)), *[empty()] * 13]):
        with pytest.raises(InputError, match="is not of its points"):
            check(tmp_path, [POINTS, *packets], at=at)


def texts(folder):
    """Fields of a scan whose points have a name each, as its XML declares them."""
    xml = SCAN.format(more='<label type="String"/>', name="s")
    with opened(folder, b"?", "rr.e57") as source:
        return find_scans(e57_xml.parse_xml(xml.encode(), source), source)[0].fields


SCAN = """<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">
<data3D type="Vector"><vectorChild type="Structure"><guid>{{one}}</guid><name>{name}</name>
<points type="CompressedVector" fileOffset="48" recordCount="2"><prototype type="Structure">
<cartesianX type="Float"/><cartesianY type="Float"/><cartesianZ type="Float"/>{more}
</prototype></points></vectorChild></data3D></e57Root>"""


def test_texts_of_points_may_be_empty_or_of_any_length(tmp_path):
    fields = texts(tmp_path)
    for text in (b"\0\0", b"\x06abc\x02d", bytes(300)):
        check(tmp_path, [packet(bytes(16), bytes(16), bytes(16), text)], fields=fields)
    with pytest.raises(InputError, match="declares 2 points, the file holds 1"):
        check(tmp_path, [packet(bytes(16), bytes(16), bytes(16), b"\0")], fields=fields)


def scan_of(folder, text):
    with opened(folder, b"?", "rr.e57") as source:
        return find_scans(e57_xml.parse_xml(text.encode(), source), source)[0]


@pytest.mark.parametrize(
    ("name", "shown"),
    [("front  left", "front left"), ("", "{one}"), ("a\u202eb", "{one}"), (" \n ", "{one}")],
)
def test_a_scan_without_a_name_that_can_be_printed_is_called_by_its_guid(tmp_path, name, shown):
    assert scan_of(tmp_path, SCAN.format(more="", name=name)).part.name == shown


@pytest.mark.parametrize(
    ("limits", "bits"),
    [("", 64), ('minimum="0"', 63), ('minimum="-1"', 64), ('maximum="0"', 64)],
)
def test_an_integer_without_a_limit_reaches_to_those_of_64_bits(tmp_path, limits, bits):
    field = f'<rowIndex type="Integer" {limits}/>'
    scan = scan_of(tmp_path, SCAN.format(more=field, name="s"))
    assert scan.fields[-1] == Field("rowIndex", "Integer", bits)


def test_a_scan_without_points_needs_no_fields(tmp_path):
    text = SCAN.format(more="", name="s").replace('"2"', '"0"')
    assert scan_of(tmp_path, text).rows == 0
    fields = text[text.index("<cartesianX") : text.index("</prototype>")]
    assert scan_of(tmp_path, text.replace(fields, "")).fields == ()


def test_the_limits_of_the_xml_are_the_last_that_pass(tmp_path, monkeypatch):
    monkeypatch.setattr(e57_xml, "MAX_ELEMENTS", 20)
    monkeypatch.setattr(e57_xml, "MAX_DEPTH", 5)
    with opened(tmp_path, b"?", "rr.e57") as source:
        root = e57_xml.parse_xml(b"<a>" * 5 + b"</a>" * 5, source)
        assert root.find("a", "a", "a", "a") is not None
        assert len(e57_xml.parse_xml(b"<a>" + b"<b/>" * 19 + b"</a>", source).children) == 19
        with pytest.raises(InputError, match="deeper than 5"):
            e57_xml.parse_xml(b"<a>" * 6 + b"</a>" * 6, source)
        with pytest.raises(InputError, match="more than 20"):
            e57_xml.parse_xml(b"<a>" + b"<b/>" * 20 + b"</a>", source)


def test_scans_of_which_some_have_an_intensity_or_a_raster(tmp_path):
    points = np.random.default_rng(2).normal(size=(5, 3))
    more = {
        "intensity": (Double(), np.arange(5.0)),
        "rowIndex": (Double(), np.arange(5.0)),
        "columnIndex": (Double(), np.arange(5.0)),
    }
    path = write_e57(tmp_path / "a.e57", E57Scan(xyz(points) | more), E57Scan(xyz(points)))
    scan = read_scan(path)
    assert scan.intensity[:5].tolist() == [0, 1, 2, 3, 4]
    assert np.isnan(scan.intensity[5:]).all()
    assert scan.grid.tolist() == [[n, n] for n in range(5)] + [[-1, -1]] * 5


def test_the_pages_of_the_header_and_of_the_xml_are_checked(tmp_path):
    data = small(tmp_path)
    data = with_xml(data, xml_of(data))  # on pages of its own
    (xml_at,) = struct.unpack_from("<Q", data, 24)
    with opened(tmp_path, data) as source:
        assert e57_pages.read_xml(Pages(source)) == xml_of(data)
    for at in (PAYLOAD - 1, xml_at + 9):
        broken = bytearray(data)
        broken[at] ^= 1
        with (
            opened(tmp_path, bytes(broken)) as source,
            pytest.raises(InputError, match=f"the checksum of its page {at // PAGE + 1} does not"),
        ):
            e57_pages.read_xml(Pages(source))
