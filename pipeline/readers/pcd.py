"""PCD: ascii, binary and binary_compressed."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import accumulate

import numpy as np

from pipeline.readers.ascii import table_blocks
from pipeline.readers.binary import record_blocks
from pipeline.readers.faults import fault, too_long, too_short
from pipeline.readers.lines import Lines, count_lines
from pipeline.readers.lzf import LARGEST_RATIO, decompress
from pipeline.readers.memory import check_memory
from pipeline.readers.pcd_header import PcdHeader, read_header
from pipeline.readers.raw import Block, Layout, RawCloud, Source

# PCL's writers stretch a file to one page plus the data, so that up to a page of zeros follows
# (pcl::PCDWriter::writeBinary, writeBinaryCompressed).
_PAGES = (4096, 16384, 65536)


def read_pcd(source: Source) -> RawCloud:
    """The declared points, with the field `intensity` if there is one."""
    header = read_header(source)
    blocks = {"ascii": _ascii, "binary": _binary, "binary_compressed": _compressed}[
        header.encoding
    ](header, source)
    return RawCloud(header.points, header.layout.intensity is not None, blocks)


def _ascii(header: PcdHeader, source: Source) -> Iterator[Block]:
    lines = count_lines(source)
    if lines < header.points:
        raise too_short(source, header.points, lines)
    return _ascii_blocks(header, source)


def _ascii_blocks(header: PcdHeader, source: Source) -> Iterator[Block]:
    starts = [0, *accumulate(field.count for field in header.fields)]
    columns = header.layout
    layout = Layout(
        (starts[columns.xyz[0]], starts[columns.xyz[1]], starts[columns.xyz[2]]),
        None if columns.intensity is None else starts[columns.intensity],
    )
    rows = 0
    for table in table_blocks(Lines(source.text), starts[-1], None, source, header.lines + 1):
        rows += len(table)
        if rows > header.points:
            raise too_long(source, header.points, "more rows")
        yield layout.block(table)
    if rows < header.points:
        raise too_short(source, header.points, rows)


def _binary(header: PcdHeader, source: Source) -> Iterator[Block]:
    offsets = [0, *accumulate(field.size * field.count for field in header.fields)]
    itemsize = offsets.pop()
    held = source.remaining() // itemsize
    if held < header.points:
        raise too_short(source, header.points, held)
    _check_end(header, source, header.points * itemsize)
    formats = [field.form for field in header.fields]
    return record_blocks(source, header.points, formats, offsets, itemsize, header.layout)


def _compressed(header: PcdHeader, source: Source) -> Iterator[Block]:
    """Field after field, all points of each, packed as one piece behind its two sizes."""
    incomplete = "the copy is incomplete; copy it again"
    sizes = source.stream.read(8)
    if len(sizes) < 8:
        raise fault(source, "the sizes of the compressed data are cut", incomplete)
    packed, unpacked = struct.unpack("<II", sizes)
    if packed > source.remaining():
        fact = f"it declares {packed} bytes of compressed data and holds {source.remaining()}"
        raise fault(source, fact, incomplete)
    expected = header.points * sum(field.size * field.count for field in header.fields)
    if unpacked != expected or unpacked > packed * LARGEST_RATIO:
        fact = (
            f"the header declares {header.points} points, {expected} bytes; "
            f"the data are {packed} bytes for {unpacked}"
        )
        raise fault(source, fact)
    _check_end(header, source, packed)
    check_memory(header.points, (packed + unpacked) // max(1, header.points), source)
    return _compressed_blocks(header, source, packed, unpacked)


def _compressed_blocks(
    header: PcdHeader, source: Source, packed: int, unpacked: int
) -> Iterator[Block]:
    try:
        data = decompress(source.stream.read(packed), unpacked)
    except ValueError as error:
        raise fault(source, f"the compressed data are damaged ({error})", "copy it again") from None
    starts = [0, *accumulate(f.size * f.count * header.points for f in header.fields)]
    columns = [
        np.frombuffer(data, field.form, header.points * field.count, start)
        for field, start in zip(header.fields, starts[:-1], strict=True)
    ]
    x, y, z = (columns[index] for index in header.layout.xyz)
    shade = None if header.layout.intensity is None else columns[header.layout.intensity]
    yield Block((x, y, z), shade)


def _check_end(header: PcdHeader, source: Source, size: int) -> None:
    """Nothing may follow `size` bytes from here but the zeros of PCL's last page."""
    start = source.stream.tell()
    extra = source.size - start - size
    # In compressed files the two sizes, 8 bytes, are part of the data.
    data = size + (8 if header.encoding == "binary_compressed" else 0)
    if extra and source.size - data in _PAGES:
        source.stream.seek(start + size)
        extra = len(source.stream.read(extra).rstrip(b"\0"))
        source.stream.seek(start)
    if extra:
        raise too_long(source, header.points, f"{extra} bytes")
