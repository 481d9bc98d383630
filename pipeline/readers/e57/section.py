"""Check that the packets of each scan in an E57 file hold the declared points.

Format: ASTM E2807-11, 9.3. Packets of at most 64 kB carry a piece of one stream per field.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence

from ..faults import fault, too_long, too_short
from .pages import DAMAGED, Pages
from .scans import INTEGERS, STRING, E57Scan, Field

_SECTION = struct.Struct("<B7xQQQ")
INDEX_PACKET, DATA_PACKET, EMPTY_PACKET = 0, 1, 2
SMALLEST_NUMBER, LEAST_MEAN_BYTES = 1000, 256  # packets of 64 kB are usual
REGISTER_BITS = 64  # a writer ends a packed stream with a whole register


def check_sections(pages: Pages, scans: Sequence[E57Scan]) -> None:
    """Add up the streams of all packets of each scan.

    Raises InputError when they do not hold exactly the points that the scan declares.
    """
    left = pages.size
    for scan in scans:
        first, end = _extent(pages, scan)
        left -= end - first
        if left < 0:
            raise fault(pages.source, "several of its scans have the same points", DAMAGED)
        _check_streams(pages, scan, first, end)


def _check_streams(pages: Pages, scan: E57Scan, first: int, end: int) -> None:
    streams = [0] * len(scan.fields)
    for lengths in _packets(pages, scan, first, end):
        streams = [held + more for held, more in zip(streams, lengths, strict=True)]
    # Constants take no bytes: only the file's size bounds their number.
    held = [
        8 * stream // field.bits if field.bits else pages.size
        for field, stream in zip(scan.fields, streams, strict=True)
    ]
    if min(held) < scan.rows:
        raise too_short(pages.source, scan.rows, min(held))
    if any(map(_exceeds, scan.fields, streams, [scan.rows] * len(streams))):
        raise too_long(pages.source, scan.rows, "more points")


def _exceeds(field: Field, stream: int, rows: int) -> bool:
    """Return whether a stream holds a further point, beyond a writer's last register."""
    if not field.bits or field.kind == STRING:
        return False
    slack = REGISTER_BITS if field.kind in INTEGERS else 0
    return 8 * stream >= (rows + 1) * field.bits + slack


def _packets(pages: Pages, scan: E57Scan, at: int, end: int) -> Iterator[list[int]]:
    """Yield the bytes of each stream in each data packet."""
    source = pages.source
    left = SMALLEST_NUMBER + (end - at) // LEAST_MEAN_BYTES
    head = struct.Struct(f"<BBHH{len(scan.fields)}H")
    while at < end:
        start = pages.read(at, min(head.size, end - at), checked=False).ljust(head.size, b"\0")
        kind, _, last, streams, *held = head.unpack(start)
        size = last + 1
        if kind == DATA_PACKET:
            known = streams == len(held) and head.size + sum(held) <= size
        else:
            known = kind in (INDEX_PACKET, EMPTY_PACKET)
        left -= 1
        if not known or size % 4 or size > end - at or left < 0:
            raise fault(source, f"the packet at logical byte {at} is not of its points", DAMAGED)
        if kind == DATA_PACKET:
            yield held
        at += size


def _extent(pages: Pages, scan: E57Scan) -> tuple[int, int]:
    """Return the logical offsets of the first packet and of the end of the section."""
    source, at = pages.source, pages.logical(scan.points_at)
    fact = f"the points of its scan {scan.part.name} are not within it"
    if at < 0 or at + _SECTION.size > pages.size:
        raise fault(source, fact, DAMAGED)
    kind, length, data_at, _ = _SECTION.unpack(pages.read(at, _SECTION.size, checked=False))
    first = pages.logical(data_at)
    if kind != 1 or length > pages.size - at or not at + _SECTION.size <= first < at + length:
        raise fault(source, fact, DAMAGED)
    return first, at + length
