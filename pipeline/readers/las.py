"""LAS and LAZ: integer coordinates with a scale and an offset.

Format: ASPRS LAS 1.0 to 1.4 (R15). LAS is read as the plain records that it is; LAZ is
decompressed by laz-rs in a child. Points flagged synthetic or withheld are points like all.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator

import numpy as np

from pipeline.readers.binary import record_blocks
from pipeline.readers.child import find_library, run_child
from pipeline.readers.child_process import DAMAGED, Job
from pipeline.readers.faults import fault, too_long, too_short
from pipeline.readers.las_header import LasHeader, read_header
from pipeline.readers.raw import Block, Layout, RawCloud, Source

# X, Y, Z and the intensity stand first in every point format.
FORMATS, OFFSETS = ["<i4", "<i4", "<i4", "<u2"], [0, 4, 8, 12]
LAYOUT = Layout((0, 1, 2), 3)
SLOT_BYTES = 8 << 20
WORKING_BYTES, THREAD_BYTES = 128 << 20, 16 << 20  # of laz-rs; chunks of the file come on top
POINTS_PER_BYTE = 200  # equal points compress to 145 a byte
VARIABLE_CHUNKS = 0xFFFFFFFF
LARGEST_CHUNK_BYTES = 32 << 20  # of points that are decompressed side by side
_LASZIP = struct.Struct("<HH8xI16xH")  # compressor, coder, points of a chunk, items
_ITEM = struct.Struct("<HHH")  # type, bytes, version
_CHUNKS = struct.Struct("<II")  # version of the table, chunks


def read_las(source: Source) -> RawCloud:
    """X, Y, Z and the intensity of a LAS or LAZ file of any point format."""
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
    source.stream.seek(header.points_at)
    return record_blocks(source, header.count, FORMATS, OFFSETS, header.point_bytes, LAYOUT)


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
            "parallel": cores > 1 and (is_small or chunk_points == VARIABLE_CHUNKS),
        },
        rows=(header.count,),
        slot_rows=max(1, SLOT_BYTES // header.point_bytes),
        slot_bytes=max(SLOT_BYTES, header.point_bytes),
        memory_bytes=WORKING_BYTES + cores * THREAD_BYTES + source.size,
    )
    return _records(header, job, source)


def _records(header: LasHeader, job: Job, source: Source) -> Iterator[Block]:
    for filled in run_child(job, source):
        x, y, z, intensity = (
            np.ndarray((filled.rows,), form, filled.memory, offset, (header.point_bytes,))
            for form, offset in zip(FORMATS, OFFSETS, strict=True)
        )
        yield Block((x, y, z), intensity)


def _chunk_points(header: LasHeader, source: Source) -> int:
    """The points of a chunk, from a record whose items make up the point."""
    record = header.laszip
    if len(record) >= _LASZIP.size:
        compressor, coder, points, items = _LASZIP.unpack_from(record)
        listed = record[_LASZIP.size :][: items * _ITEM.size]
        if len(listed) == items * _ITEM.size and compressor in (2, 3) and coder == 0:
            sizes = [size for _, size, _ in _ITEM.iter_unpack(listed)]
            if sum(sizes) == header.point_bytes:
                return int(points)
    raise fault(source, "its record on the compression does not fit its points")


def _check_chunks(header: LasHeader, source: Source, chunk_points: int) -> None:
    """The table of chunks lies after them, and its chunks hold the declared points."""
    first = header.points_at + 8
    table_at = _int_at(source, header.points_at, first)
    if table_at == -1:  # written to a pipe: the place stands at the end of the file
        table_at = _int_at(source, source.size - 8, source.size)
    if not first <= table_at <= source.size - _CHUNKS.size:
        raise fault(source, f"its table of chunks should be at byte {table_at}", DAMAGED)
    source.stream.seek(table_at)
    version, chunks = _CHUNKS.unpack(source.stream.read(_CHUNKS.size))
    held = table_at - first
    if version or chunks * header.point_bytes > held:
        raise fault(source, f"its {chunks} chunks do not fit in {held} bytes", DAMAGED)
    if chunk_points != VARIABLE_CHUNKS and chunks != -(-header.count // max(chunk_points, 1)):
        raise fault(
            source,
            f"the header declares {header.count} points, the table {chunks} chunks of "
            f"{chunk_points}",
            DAMAGED,
        )
    if header.count > held * POINTS_PER_BYTE:
        raise too_short(source, header.count, held, "points, and for their compressed bytes")


def _int_at(source: Source, at: int, end: int) -> int:
    if at < 0 or end > source.size:
        return 0
    source.stream.seek(at)
    return int.from_bytes(source.stream.read(8), "little", signed=True)
