"""LAS and LAZ reader: integer coordinates with a scale and an offset.

Format: ASPRS LAS 1.0 to 1.4 (R15). LAS is read as plain records; LAZ is decompressed by laz-rs in
a child. Points flagged synthetic or withheld are kept.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator

import numpy as np

from ...system import frozen
from ..faults import fault, too_long, too_short
from ..parsing.binary import record_blocks
from ..sandbox.client import find_library, run_child
from ..sandbox.process import DAMAGED, Job
from ..source import Block, Layout, PointColumn, RawCloud, Source

# X, Y, Z and the intensity come first in every point format, red, green and blue in some.
FORMATS, OFFSETS = ["<i4", "<i4", "<i4", "<u2"], [0, 4, 8, 12]
LAYOUT = Layout((0, 1, 2), 3)
COLOURED = Layout((0, 1, 2), None, colour=(4, 5, 6))
COLOUR_AT = {2: 20, 3: 28, 5: 28, 7: 30, 8: 30, 10: 30}  # by point format
FIRST_POINTS = 10_000  # whose intensities are all 0 where the file holds none
SLOT_BYTES = 8 << 20  # a point takes at most 65,535
WORKING_BYTES, THREAD_BYTES = 128 << 20, 16 << 20  # of laz-rs; chunks of the file come on top
POINTS_PER_BYTE = 200  # equal points compress to 145 a byte
VARIABLE_CHUNKS = 0xFFFFFFFF
LARGEST_CHUNK_BYTES = 32 << 20  # of points that are decompressed side by side
_LASZIP = struct.Struct("<HH8xI16xH")  # compressor, coder, points of a chunk, items
_ITEM = struct.Struct("<HHH")  # type, bytes, version
_CHUNKS = struct.Struct("<II")  # version of the table, chunks


def read_las(source: Source) -> RawCloud:
    """Read X, Y, Z and the intensity of a LAS or LAZ file of any point format.

    Intensities of 0 stand where there are none: then the colours count.
    """
    header = read_header(source)
    if header.compressed:
        library = find_library("lazrs", "LAZ", "las", source)
        blocks = _decompressed(header, library, source)
    else:
        blocks = _plain(header, source)
    return RawCloud(header.count, True, _scaled(header, blocks))


def _scaled(header: LasHeader, blocks: Iterator[Block]) -> Iterator[Block]:
    scaled = list(zip(header.scale, header.shift, strict=True))
    for block in blocks:
        x, y, z = (
            column * scale + shift for column, (scale, shift) in zip(block.xyz, scaled, strict=True)
        )
        yield Block((x, y, z), block.intensity)


def _plain(header: LasHeader, source: Source) -> Iterator[Block]:
    held = (header.end - header.points_at) // header.point_bytes
    if held < header.count:
        raise too_short(source, header.count, held)
    if held > header.count:
        raise too_long(source, header.count, f"{held - header.count} more")
    size = header.point_bytes
    source.stream.seek(header.points_at)
    first = source.stream.read(min(header.count, FIRST_POINTS) * size)
    rows = np.frombuffer(first, np.uint8, len(first) // size * size).reshape(-1, size)
    layout = _layout(header, rows[:, OFFSETS[3] : OFFSETS[3] + 2])
    source.stream.seek(header.points_at)
    return record_blocks(source, header.count, *_columns(header), size, layout)


def _columns(header: LasHeader) -> tuple[list[str], list[int]]:
    """Return format and offset of each column of a point record that may be used."""
    if not header.has_colour:
        return FORMATS, OFFSETS
    at = COLOUR_AT[header.point_format]
    return [*FORMATS, *["<u2"] * 3], [*OFFSETS, at, at + 2, at + 4]


def _layout(header: LasHeader, intensity: PointColumn) -> Layout:
    """Return the columns to use, by the intensities of the first points, or their bytes."""
    return COLOURED if header.has_colour and not intensity[:FIRST_POINTS].any() else LAYOUT


def _decompressed(header: LasHeader, library: str, source: Source) -> Iterator[Block]:
    chunk_points = _chunk_points(header, source)
    if header.count:
        _check_chunks(header, source, chunk_points)
    cores = os.cpu_count() or 1
    is_small = chunk_points * header.point_bytes <= LARGEST_CHUNK_BYTES
    job = Job(
        task="laz",
        library=library,
        plan={
            "offset": header.points_at,
            "laszip": header.laszip.hex(),
            "record_bytes": header.point_bytes,
            "rows": header.count,
            "colour": header.has_colour,
            "parallel": cores > 1 and (is_small or chunk_points == VARIABLE_CHUNKS),
        },
        rows=(header.count,),
        slot_rows=SLOT_BYTES // header.point_bytes,
        slot_bytes=SLOT_BYTES,
        memory_bytes=WORKING_BYTES + cores * THREAD_BYTES + source.size,
    )
    return _records(header, job, source)


def _records(header: LasHeader, job: Job, source: Source) -> Iterator[Block]:
    layout = None
    for filled in run_child(job, source):
        columns = [
            np.ndarray((filled.rows,), form, filled.memory, offset, (header.point_bytes,))
            for form, offset in zip(*_columns(header), strict=True)
        ]
        layout = layout or _layout(header, columns[3])
        yield layout.block_of(columns)


def _chunk_points(header: LasHeader, source: Source) -> int:
    """Return the points of a chunk, from the LASzip record, whose items must make up a point."""
    record = header.laszip
    if len(record) >= _LASZIP.size:
        compressor, coder, points, items = _LASZIP.unpack_from(record)
        listed = record[_LASZIP.size :][: items * _ITEM.size]
        if len(listed) == items * _ITEM.size and compressor in (2, 3) and coder == 0:
            sizes = [size for _, size, _ in _ITEM.iter_unpack(listed)]
            if sum(sizes) == header.point_bytes:
                return int(points)
    raise fault(source, "its LASzip record does not fit its points")


def _check_chunks(header: LasHeader, source: Source, chunk_points: int) -> None:
    """Check the table of chunks, which follows them: they hold the declared points."""
    first = header.points_at + 8
    table_at = _int_at(source, header.points_at)
    if table_at == -1:  # written to a pipe: the offset is at the end of the file
        table_at = _int_at(source, source.size - 8)
    if not first <= table_at <= source.size - _CHUNKS.size:
        raise fault(source, f"its table of chunks should be at byte {table_at}", DAMAGED)
    source.stream.seek(table_at)
    version, chunks = _CHUNKS.unpack(source.stream.read(_CHUNKS.size))
    held = table_at - first
    if version or chunks * header.point_bytes > held:
        raise fault(source, f"its {chunks} chunks do not fit in {held} bytes", DAMAGED)
    fits = (chunks - 1) * chunk_points < header.count <= chunks * chunk_points
    if chunk_points != VARIABLE_CHUNKS and not fits:
        raise fault(
            source,
            f"the header declares {header.count} points, the table {chunks} chunks of "
            f"{chunk_points}",
            DAMAGED,
        )
    if header.count > held * POINTS_PER_BYTE:
        raise too_short(source, header.count, held, "points, and for their compressed bytes")


def _int_at(source: Source, at: int) -> int:
    source.stream.seek(at)
    return int.from_bytes(source.stream.read(8), "little", signed=True)


# By point format 0-10: the bytes of a point; extra bytes may follow them.
POINT_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
HEADER_BYTES = (227, 227, 227, 235, 375)  # by minor version
COMPRESSED = 0xC0  # LASzip marks the point format with the upper bits
LASZIP = (b"laszip encoded", 22204)
INCOMPLETE = "the copy is incomplete; copy it again"
_FRONT = struct.Struct("<HIIBHI")  # at 94: header, points at, records, format, point bytes, count
_SCALES = struct.Struct("<6d")  # at 131
_WAVEFORMS = struct.Struct("<Q")  # at 227, from version 1.3: waveforms at
_LARGE = struct.Struct("<QIQ")  # at 235, version 1.4: long records at, their number, count
_RECORD = struct.Struct("<2x16sHH32x")
_LONG_RECORD = struct.Struct("<2x16sHQ32x")


@frozen
class LasHeader:
    """The part of a header that is needed to find the points.

    points_at, end: bytes of the file between which the points lie.
    coordinate = scale * integer + shift, in the file's unit.
    laszip: the record that describes the compression, b"" for LAS.
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

    @property
    def has_colour(self) -> bool:
        """Whether every point has red, green and blue."""
        return self.point_format in COLOUR_AT


def read_header(source: Source) -> LasHeader:
    """Read the header of a LAS or LAZ file.

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
        fact = f"the header takes {header_bytes} bytes, its points begin at {points_at}"
        raise fault(source, f"{fact}, the file has {source.size}", INCOMPLETE)
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
    compressed = kind & COMPRESSED != 0
    # The points do not depend on other records, whose count some writers get wrong.
    found = _variable_records(source, header_bytes, records, points_at) if compressed else ()
    laszip = [data for user, number, data in found if (user, number) == LASZIP]
    if compressed and len(laszip) != 1:
        raise fault(source, f"it is compressed, and has {len(laszip)} LASzip records")
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
    """Return the count, stated twice since version 1.4; the older field may be 0."""
    if legacy not in (0, count):
        raise fault(source, f"the header declares {count} points, and {legacy} for old readers")
    return count


def _end_of_points(source: Source, points_at: int, long_at: int, records: int) -> int:
    """Return where the extended records begin, after the points; check that all are there."""
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


def _variable_records(
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
