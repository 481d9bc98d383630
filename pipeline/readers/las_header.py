"""Headers of LAS and LAZ, checked against the file's size before anything is allocated.

Format: ASPRS LAS 1.0 to 1.4 (R15), public header block and variable length records.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.readers.faults import fault
from pipeline.readers.raw import Source

# By point format 0-10: the bytes of a point; extra bytes may follow them.
POINT_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
HEADER_BYTES = (227, 227, 227, 235, 375)  # by minor version
COMPRESSED = 0xC0  # LASzip marks the point format with the upper bits
INCOMPLETE = "the copy is incomplete; copy it again"
_FRONT = struct.Struct("<HIIBHI")  # at 94: header, points at, records, format, point bytes, count
_SCALES = struct.Struct("<6d")  # at 131
_WAVEFORMS = struct.Struct("<Q")  # at 227, from version 1.3: waveforms at
_LARGE = struct.Struct("<QIQ")  # at 235, version 1.4: long records at, their number, count
_RECORD = struct.Struct("<2x16sHH32x")
_LONG_RECORD = struct.Struct("<2x16sHQ32x")


@dataclass(frozen=True)
class LasHeader:
    """What is needed of a header to find the points.

    points_at, end: bytes of the file between which they lie.
    coordinate = scale * integer + shift, in the file's unit.
    laszip: the record that says how they are compressed, b"" when they are not.
    """

    count: int
    point_format: int
    point_bytes: int
    points_at: int
    end: int
    scale: tuple[float, float, float]
    shift: tuple[float, float, float]
    compressed: bool
    laszip: bytes


def read_header(source: Source) -> LasHeader:
    """The header of a LAS or LAZ file.

    Raises InputError when it contradicts itself or the size of the file.
    """
    head = source.stream.read(HEADER_BYTES[-1])
    if len(head) < HEADER_BYTES[0]:
        raise fault(source, f"the LAS header is cut at {len(head)} bytes", INCOMPLETE)
    major, minor = head[24:26]
    if major != 1 or minor >= len(HEADER_BYTES):
        raise fault(source, f"LAS version {major}.{minor} is not 1.0 to 1.4", "export LAS 1.4")
    header_bytes, points_at, records, kind, point_bytes, count = _FRONT.unpack_from(head, 94)
    if header_bytes < HEADER_BYTES[minor] or not header_bytes <= points_at <= source.size:
        places = f"the header takes {header_bytes} bytes, its points begin at {points_at}"
        raise fault(source, f"{places}, the file has {source.size}", INCOMPLETE)
    point_format = kind & ~COMPRESSED
    if point_format >= len(POINT_BYTES) or point_bytes < POINT_BYTES[point_format]:
        raise fault(source, f"it has points of the format {point_format} in {point_bytes} bytes")
    end = source.size
    if minor >= 3:
        (waveforms_at,) = _WAVEFORMS.unpack_from(head, 227)
        end = waveforms_at if points_at < waveforms_at < end else end
    if minor == 4:
        long_at, longs, large_count = _LARGE.unpack_from(head, 235)
        count = _one_count(source, count, large_count)
        end = min(end, _end_of_points(source, points_at, long_at, longs))
    scales = _SCALES.unpack_from(head, 131)
    if not all(map(math.isfinite, scales)) or 0.0 in scales[:3]:
        raise fault(source, f"its scales and offsets are {scales}")
    laszip = [
        data
        for user, number, data in _records(source, header_bytes, records, points_at)
        if (user, number) == (b"laszip encoded", 22204)
    ]
    compressed = kind & COMPRESSED != 0
    if compressed and len(laszip) != 1:
        raise fault(source, f"it is compressed, and has {len(laszip)} records that say how")
    return LasHeader(
        count,
        point_format,
        point_bytes,
        points_at,
        end,
        scales[:3],
        scales[3:],
        compressed,
        laszip[0] if compressed else b"",
    )


def _one_count(source: Source, legacy: int, count: int) -> int:
    """Version 1.4 states the count twice; the older field is 0 where it cannot hold it."""
    if legacy not in (0, count):
        raise fault(source, f"the header declares {count} points, and {legacy} for old readers")
    return count


def _end_of_points(source: Source, points_at: int, long_at: int, records: int) -> int:
    """Where the extended records, which stand after the points, begin; they must all be there."""
    if not records:
        return source.size
    at = long_at
    for _ in range(records):
        head = b""
        if points_at <= at <= source.size - _LONG_RECORD.size:
            source.stream.seek(at)
            head = source.stream.read(_LONG_RECORD.size)
        if len(head) < _LONG_RECORD.size:
            raise fault(source, f"not all its {records} extended records are there", INCOMPLETE)
        at += _LONG_RECORD.size + _LONG_RECORD.unpack(head)[2]
    if at > source.size:
        raise fault(source, f"not all its {records} extended records are there", INCOMPLETE)
    return long_at


def _records(
    source: Source, start: int, count: int, end: int
) -> Iterator[tuple[bytes, int, bytes]]:
    at = start
    source.stream.seek(start)
    for number in range(count):
        at += _RECORD.size
        if at <= end:
            user, identity, length = _RECORD.unpack(source.stream.read(_RECORD.size))
            at += length
        if at > end:
            fact = f"record {number + 1} of {count} in its header reaches beyond it"
            raise fault(source, fact)
        yield user.rstrip(b"\0"), identity, source.stream.read(length)
