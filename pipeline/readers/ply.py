"""PLY: ascii and binary, the vertices of a cloud or of a mesh."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate

from pipeline.readers.ascii import table_blocks
from pipeline.readers.binary import record_blocks
from pipeline.readers.faults import fault, too_long, too_short
from pipeline.readers.lines import Lines, count_lines
from pipeline.readers.ply_header import PlyElement, PlyHeader, read_header
from pipeline.readers.ply_skip import skip_elements
from pipeline.readers.raw import Block, Layout, RawCloud, Source, find_layout


def read_ply(source: Source) -> RawCloud:
    """The vertices; other elements are only checked to be there."""
    header = read_header(source)
    vertex = header.vertex
    if vertex.has_list:
        mend = "export it without list properties of vertex"
        raise fault(source, "its vertices have a list property", mend)
    try:
        layout = find_layout([prop.name for prop in vertex.properties])
    except ValueError as error:
        raise fault(source, str(error)) from None
    read = _binary if header.order else _ascii
    return RawCloud(vertex.count, layout.intensity is not None, read(header, layout, source))


def _binary(header: PlyHeader, layout: Layout, source: Source) -> Iterator[Block]:
    vertex = header.vertex
    skip_elements(source, header.before, header.order)
    start = source.stream.tell()
    held = source.remaining() // vertex.itemsize
    if held < vertex.count:
        raise too_short(source, vertex.count, held, "vertices")
    source.stream.seek(start + vertex.count * vertex.itemsize)
    skip_elements(source, header.after, header.order)
    if source.remaining():
        raise too_long(source, vertex.count, f"{source.remaining()} bytes", "vertices")
    source.stream.seek(start)
    offsets = [0, *accumulate(prop.size for prop in vertex.properties)][:-1]
    formats = [header.order + prop.form for prop in vertex.properties]
    return record_blocks(source, vertex.count, formats, offsets, vertex.itemsize, layout)


def _ascii(header: PlyHeader, layout: Layout, source: Source) -> Iterator[Block]:
    before, after = _rows(header.before), _rows(header.after)
    count = header.vertex.count
    lines = count_lines(source)
    if lines < before + count:
        raise too_short(source, count, max(0, lines - before), "vertices")
    return _ascii_blocks(header, layout, source, before, after)


def _ascii_blocks(
    header: PlyHeader, layout: Layout, source: Source, before: int, after: int
) -> Iterator[Block]:
    lines = Lines(source.text)
    line = header.lines + 1 + lines.skip_rows(before)
    count, columns = header.vertex.count, len(header.vertex.properties)
    rows = 0
    for table in table_blocks(lines, columns, None, source, line, limit=count):
        rows += len(table)
        yield layout.block(table)
    if rows < count:
        raise too_short(source, count, rows, "vertices")
    rest = lines.rows_left()
    if rest < after:
        raise too_short(source, after, rest, "rows after the vertices")
    if rest > after:
        raise too_long(source, count, f"{rest - after} rows", "vertices")


def _rows(elements: list[PlyElement]) -> int:
    return sum(element.count for element in elements if element.properties)
