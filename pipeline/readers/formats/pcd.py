"""PCD reader: ascii, binary and binary_compressed."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import accumulate

import numpy as np

from ...system import frozen
from ..colour import PACKED
from ..faults import fault, too_long, too_many, too_short
from ..memory import check_memory
from ..parsing.ascii import table_blocks
from ..parsing.binary import record_blocks
from ..parsing.columns import find_layout
from ..parsing.lines import Lines, count_lines
from ..parsing.lzf import LARGEST_RATIO, decompress
from ..source import Block, Layout, RawCloud, Source, shown

# PCL's writers stretch a file, binary to one page plus the data, compressed to whole pages (older
# ones: as binary), so that up to a page of zeros follows (pcl::PCDWriter::writeBinary,
# writeBinaryCompressed).
_PAGES = (4096, 16384, 65536)


def read_pcd(source: Source) -> RawCloud:
    """Read the declared points, with the field `intensity`, or a colour, if there is one."""
    header = read_header(source)
    blocks = {"ascii": _ascii, "binary": _binary, "binary_compressed": _compressed}[
        header.encoding
    ](header, source)
    layout = header.layout
    return RawCloud(header.points, layout.has_intensity, blocks, unit=layout.unit)


def _ascii(header: PcdHeader, source: Source) -> Iterator[Block]:
    lines = count_lines(source)
    if lines < header.points:
        raise too_short(source, header.points, lines)
    return _ascii_blocks(header, source)


def _ascii_blocks(header: PcdHeader, source: Source) -> Iterator[Block]:
    starts = [0, *accumulate(field.count for field in header.fields)]
    rows = 0
    for table in table_blocks(Lines(source.text), starts[-1], None, source, header.lines + 1):
        rows += len(table)
        if rows > header.points:
            raise too_long(source, header.points, "more rows")
        columns = [table[:, start] for start in starts[:-1]]
        for index in header.packed:
            columns[index] = columns[index].astype(header.fields[index].form)
        yield header.layout.block_of(columns)
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
    """Return the block: one packed piece behind its two sizes, field after field."""
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
    yield header.layout.block_of(columns)


def _check_end(header: PcdHeader, source: Source, size: int) -> None:
    """Raise InputError if more follows `size` bytes from here than the zeros of PCL's last page."""
    start = source.stream.tell()
    extra = source.size - start - size
    is_packed = header.encoding == "binary_compressed"
    data = size + 8 * is_packed  # the two sizes are part of the compressed data
    if any(
        source.size - data == page or (is_packed and source.size % page == 0 and extra < page)
        for page in _PAGES
    ):
        source.stream.seek(start + size)
        extra = len(source.stream.read(extra).rstrip(b"\0"))
        source.stream.seek(start)
    if extra:
        raise too_long(source, header.points, f"{extra} bytes")


_KEYS = (
    *("VERSION", "FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT"),
    *("WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"),
)
_TYPES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_LONGEST_LINE = 1 << 16
_MOST_LINES = 5000


@frozen
class PcdField:
    """One field: `count` values of a numpy scalar type."""

    name: str
    form: str
    size: int
    count: int


@frozen
class PcdHeader:
    """A PCD header. points: declared; lines: of the header; layout: indices into `fields`."""

    fields: tuple[PcdField, ...]
    points: int
    encoding: str
    lines: int
    layout: Layout

    @property
    def packed(self) -> tuple[int, ...]:
        """Index of the field that packs a colour, in which the bits of the number count."""
        return self.layout.colour if len(self.layout.colour) == 1 else ()


def read_header(source: Source) -> PcdHeader:
    """Read up to and including the DATA line."""
    entries, lines = _read_entries(source)
    fields = _fields(entries, source)
    try:
        layout = find_layout([field.name for field in fields])
    except ValueError as error:
        raise fault(source, str(error)) from None
    for field in (fields[index] for index in layout.xyz):
        if field.count != 1:
            raise fault(source, f"the field {field.name} has {field.count} values a point")
    if layout.intensity is not None and fields[layout.intensity].count != 1:
        layout = replace(layout, intensity=None)
    if not layout.has_intensity:
        layout = replace(layout, colour=_packed_colour(fields))
    if any(fields[index].count != 1 for index in layout.colour):
        layout = replace(layout, colour=())
    encoding = " ".join(entries["DATA"])
    if encoding not in _ENCODINGS:
        raise fault(source, f"the encoding {shown(encoding)} is none of {', '.join(_ENCODINGS)}")
    return PcdHeader(fields, _points(entries, source), encoding, lines, layout)


def _packed_colour(fields: Sequence[PcdField]) -> tuple[int, ...]:
    """Return the index of the field in which PCL packs a colour into four bytes, if any."""
    packs = (
        i for i, field in enumerate(fields) if field.name.lower() in PACKED and field.size == 4
    )
    return tuple(packs)[:1]


def _read_entries(source: Source) -> tuple[dict[str, list[str]], int]:
    entries: dict[str, list[str]] = {}
    lines = 0
    while "DATA" not in entries:
        raw = source.stream.readline(_LONGEST_LINE)
        lines += 1
        if lines > _MOST_LINES:
            raise too_many(source, _MOST_LINES, "lines in its header")
        if not raw.endswith(b"\n"):
            raise fault(source, "the PCD header has no whole DATA line", "copy the file again")
        key, *values = raw.decode("latin-1").partition("#")[0].split() or [""]
        if not key:
            continue
        if key not in _KEYS:
            raise fault(source, f"line {lines} is not of a PCD header: {shown(raw)}")
        if key in entries:
            raise fault(source, f"line {lines} repeats the header entry {key}")
        entries[key] = values
    return entries, lines


def _fields(entries: dict[str, list[str]], source: Source) -> tuple[PcdField, ...]:
    names = entries.get("FIELDS", entries.get("COLUMNS", []))
    sizes = entries.get("SIZE", ["4"] * len(names))
    types = entries.get("TYPE", ["F"] * len(names))
    counts = entries.get("COUNT", ["1"] * len(names))
    for key, values in (("SIZE", sizes), ("TYPE", types), ("COUNT", counts)):
        if len(values) != len(names):
            fact = f"the PCD header has {len(names)} FIELDS, but {len(values)} values of {key}"
            raise fault(source, fact)
    real = [name for name in names if name != "_"]
    if len(set(real)) != len(real):
        raise fault(source, f"a field is there twice: {shown(' '.join(names))}")
    return tuple(
        _field(name, size, kind, count, source)
        for name, size, kind, count in zip(names, sizes, types, counts, strict=True)
    )


def _field(name: str, size: str, kind: str, count: str, source: Source) -> PcdField:
    width = _whole(size, f"the SIZE of {name}", source)
    if width not in _TYPES.get(kind, ()):
        raise fault(source, f"the field {name} has the unknown type {shown(kind)} of {size} bytes")
    return PcdField(name, f"<{kind.lower()}{width}", width, _whole(count, "a COUNT", source))


def _points(entries: dict[str, list[str]], source: Source) -> int:
    """Return POINTS, or WIDTH x HEIGHT; both must agree."""
    found = {
        key: _whole(" ".join(entries[key]), key, source)
        for key in ("WIDTH", "HEIGHT", "POINTS")
        if key in entries
    }
    area = found["WIDTH"] * found.get("HEIGHT", 1) if "WIDTH" in found else None
    points = found.get("POINTS", area)
    if points is None:
        raise fault(source, "the PCD header has neither POINTS nor WIDTH")
    if area is not None and area != points:
        fact = f"{found['WIDTH']} x {found.get('HEIGHT', 1)} is not the declared {points} points"
        raise fault(source, fact)
    return points


def _whole(text: str, what: str, source: Source) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise fault(source, f"{what} in the PCD header is {shown(text)}, not a whole number")
    return int(text)
