"""PLY reader, ascii and binary: the vertices of a cloud or of a mesh."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from dataclasses import field
from itertools import accumulate
from typing import Any

import numpy as np

from ...errors import InputError
from ...system import frozen
from ..faults import fault, too_long, too_many, too_short
from ..parsing.ascii import table_blocks
from ..parsing.binary import point_record, record_blocks
from ..parsing.columns import find_layout
from ..parsing.lines import Lines, count_lines
from ..source import Block, Layout, RawCloud, Source, shown


def read_ply(source: Source) -> RawCloud:
    """Read the vertices; other elements are only checked for completeness."""
    header = read_header(source)
    vertex = header.vertex
    if vertex.has_list:
        action = "export it without list properties of vertex"
        raise fault(source, "its vertices have a list property", action)
    try:
        layout = find_layout([prop.name for prop in vertex.properties])
    except ValueError as error:
        raise fault(source, str(error)) from None
    others = (*header.before, *header.after)
    joined = any(element.count for element in others if element.name in _FACES)
    read = _binary if header.order else _ascii
    blocks, record = read(header, layout, source)
    return RawCloud(
        vertex.count,
        layout.has_intensity,
        blocks,
        unit=layout.unit,
        is_mesh=joined,
        record=record,
    )


def _binary(
    header: PlyHeader, layout: Layout, source: Source
) -> tuple[Iterator[Block], np.dtype[Any] | None]:
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
    blocks = record_blocks(source, vertex.count, formats, offsets, vertex.itemsize, layout)
    return blocks, point_record(formats, offsets, vertex.itemsize, layout)


def _ascii(header: PlyHeader, layout: Layout, source: Source) -> tuple[Iterator[Block], None]:
    before, after = _rows(header.before), _rows(header.after)
    count = header.vertex.count
    lines = count_lines(source)
    if lines < before + count:
        raise too_short(source, count, max(0, lines - before), "vertices")
    return _ascii_blocks(header, layout, source, before, after), None


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


_SCALARS = {
    **{"char": "i1", "short": "i2", "int": "i4", "float": "f4", "double": "f8"},
    **{"uchar": "u1", "ushort": "u2", "uint": "u4", "float32": "f4", "float64": "f8"},
    **{"int8": "i1", "int16": "i2", "int32": "i4", "int64": "i8"},
    **{"uint8": "u1", "uint16": "u2", "uint32": "u4", "uint64": "u8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FACES = ("face", "tristrips")  # elements that join vertices to a surface
_LONGEST_LINE = 1 << 16
_MOST_LINES = 5000


@frozen
class PlyProperty:
    """A property: numpy scalar type without byte order, and that of a list's length, or None."""

    name: str
    form: str
    count_form: str | None = None

    @property
    def size(self) -> int:
        """Bytes of one value."""
        return int(self.form[1])


@frozen
class PlyElement:
    """An element: `count` records of the same properties."""

    name: str
    count: int
    properties: list[PlyProperty] = field(default_factory=list)

    @property
    def has_list(self) -> bool:
        """True if its records may differ in length."""
        return any(prop.count_form for prop in self.properties)

    @property
    def itemsize(self) -> int:
        """Bytes of a binary record without lists."""
        return sum(prop.size for prop in self.properties)


@frozen
class PlyHeader:
    """A PLY header. order: "<" or ">", "" for ascii; lines: of the header, end_header included."""

    order: str
    before: list[PlyElement]
    vertex: PlyElement
    after: list[PlyElement]
    lines: int


def read_header(source: Source) -> PlyHeader:
    """Read up to and including the end_header line."""
    order: str | None = None
    elements: list[PlyElement] = []
    number = 1
    if source.stream.readline(_LONGEST_LINE).strip() != b"ply":
        raise fault(source, "line 1 is not 'ply'")
    while (words := _next_words(source, number + 1)) != ["end_header"]:
        number += 1
        if number > _MOST_LINES:
            raise too_many(source, _MOST_LINES, "lines in its header")
        match words:
            case ["comment" | "obj_info", *_] | []:
                pass
            case ["format", name, "1.0"] if name in _ORDERS and order is None:
                order = _ORDERS[name]
            case ["element", name, count]:
                if any(name == element.name for element in elements):
                    raise fault(source, f"line {number} declares the element {name} again")
                elements.append(PlyElement(name, _count(count, name, source)))
            case ["property", *declaration] if elements:
                _add_property(elements[-1], declaration, number, source)
            case _:
                raise _strange(number, " ".join(words), source)
    if order is None:
        raise fault(source, "the PLY header has no format line")
    return _split(order, elements, number + 1, source)


def _split(order: str, elements: list[PlyElement], lines: int, source: Source) -> PlyHeader:
    at = next((i for i, element in enumerate(elements) if element.name == "vertex"), None)
    if at is None:
        action = "export a point cloud"
        raise fault(source, "the PLY header declares no vertex element", action)
    return PlyHeader(order, elements[:at], elements[at], elements[at + 1 :], lines)


def _next_words(source: Source, number: int) -> list[str]:
    raw = source.stream.readline(_LONGEST_LINE)
    if not raw.endswith(b"\n"):
        if len(raw) == _LONGEST_LINE:
            raise _strange(number, raw.decode("latin-1"), source)
        raise fault(source, "the PLY header has no whole end_header line", "copy the file again")
    return raw.decode("latin-1").split()


def _add_property(element: PlyElement, declaration: list[str], number: int, source: Source) -> None:
    match declaration:
        case ["list", count_type, value_type, name]:
            types = [value_type, count_type]
        case [value_type, name]:
            types = [value_type]
        case _:
            raise _strange(number, " ".join(["property", *declaration]), source)
    for kind in types:
        if kind not in _SCALARS:
            raise fault(source, f"line {number} has the unknown type {shown(kind)}")
    if any(name == prop.name for prop in element.properties):
        raise fault(source, f"line {number} declares the property {name} of {element.name} again")
    forms = [_SCALARS[kind] for kind in types]
    if len(forms) == 2 and forms[1][0] == "f":
        raise fault(source, f"line {number} counts a list with the type {shown(types[1])}")
    element.properties.append(PlyProperty(name, *forms))


def _count(text: str, name: str, source: Source) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise fault(source, f"the header declares {shown(text)} of {name}, which is not a count")
    return int(text)


def _strange(number: int, line: str, source: Source) -> InputError:
    return fault(source, f"line {number} is not of a PLY header: {shown(line)}")


_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


@frozen
class _Step:
    """A property of a record: a value of `size` bytes, or a counted list of them."""

    size: int
    counter: struct.Struct | None


def skip_elements(source: Source, elements: list[PlyElement], order: str) -> None:
    """Move the stream behind the elements. Raises InputError when the file ends within them."""
    for element in elements:
        start = source.stream.tell()
        # A list takes at least the bytes of its length: a wrong count fails here, at once.
        shortest = sum(int((prop.count_form or prop.form)[1]) for prop in element.properties)
        end = start + element.count * shortest
        if element.has_list and element.count and end <= source.size:
            end = _list_end(source, element, order, start)
        if end > source.size:
            fact = f"the file ends within the {element.count} declared records of {element.name}"
            raise fault(source, fact, "the copy is incomplete; copy it again")
        source.stream.seek(end)


def _list_end(source: Source, element: PlyElement, order: str, start: int) -> int:
    """Return where the records end, beyond the file's size when they do not fit into it."""
    steps = [
        _Step(
            prop.size, struct.Struct(order + _STRUCT[prop.count_form]) if prop.count_form else None
        )
        for prop in element.properties
    ]
    with mmap.mmap(source.stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        size = _next_record(data, steps, start) - start
        if start + element.count * size <= source.size and _regular(
            data, element, steps, start, size
        ):
            return start + element.count * size
        at = start
        for _ in range(element.count):
            at = _next_record(data, steps, at)
        return at


def _next_record(data: mmap.mmap, steps: list[_Step], at: int) -> int:
    for step in steps:
        if step.counter is None:
            at += step.size
        elif at + step.counter.size > len(data):
            return len(data) + 1
        else:
            length = step.counter.unpack_from(data, at)[0]
            # A negative length can only be damage, so the records end nowhere.
            at += step.counter.size + length * step.size if length >= 0 else len(data) + 1
    return at


def _regular(
    data: mmap.mmap, element: PlyElement, steps: list[_Step], start: int, size: int
) -> bool:
    """Return whether all records are as long as the first, as in a mesh of triangles only."""
    at = start
    for step in steps:
        if step.counter is not None:
            kind = np.dtype(step.counter.format)
            lengths = np.ndarray((element.count,), kind, data, at, (size,))
            if (lengths != lengths[0]).any():
                return False
        at = _next_record(data, [step], at)
    return True
