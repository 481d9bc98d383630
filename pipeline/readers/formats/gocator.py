"""Reader of the CSV that Gocator's tools write: sections from a line with their name to `End`.

A surface is a row of x, then rows of y and the heights; a point cloud, rows of x, y, z of each
point. Heights that are missing are empty cells; lengths are in millimetres.
Format: LMI Technologies, Gocator Line Profile Sensors: User Manual, CSV File Format.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from ..faults import fault, too_short
from ..parsing.ascii import NumberTable, cells_of, content, table_blocks
from ..parsing.lines import Lines, count_lines, is_number
from ..source import Block, RawCloud, Source, shown

UNIT = "mm"
_HEAD = re.compile(rb"\s*Info[ ,]*\r?\n\s*CSV Version")
_SURFACES = ("part", "surface", "uniformsurface")
_CLOUDS = ("surfacepointcloud",)
_HEAD_BYTES = 4096


def is_gocator(source: Source) -> bool:
    """Return whether the text from here on begins as Gocator's CSV; the stream keeps its place."""
    start = source.stream.tell()
    head = source.stream.read(_HEAD_BYTES)
    source.stream.seek(start)
    return _HEAD.match(head) is not None


def read_gocator(source: Source) -> RawCloud:
    """Read the surface, or the cloud, of the file."""
    count_lines(source)
    section, line = _find_section(source)
    attributes, line = _attributes(source, line)
    rows, columns = (_whole(attributes, name, source) for name in ("row count", "column count"))
    if rows * columns > source.size:
        raise too_short(source, rows * columns, source.size, "points, and for their bytes")
    heading = cells_of(content(source.text.readline()), ",")
    lines = Lines(source.text)
    if section in _CLOUDS:
        tables = _tables(lines, 3 * columns, line + 1, rows, source)
        blocks = _cloud_blocks(tables)
    else:
        x = np.array([float(cell) for cell in heading if is_number(cell)])
        if len(x) != columns:
            fact = f"line {line} has {len(x)} positions of x, {columns} columns are declared"
            raise fault(source, fact)
        tables = _tables(lines, columns + 1, line + 1, rows, source)
        blocks = _surface_blocks(tables, x)
    return RawCloud(rows * columns, False, blocks, has_grid=True, unit=UNIT)


def _find_section(source: Source) -> tuple[str, int]:
    """Read past the line of the first section with a surface; return its name and number."""
    for number, text in enumerate(source.text, start=1):
        name = text.strip(" ,\r\n").lower()
        if name in (*_SURFACES, *_CLOUDS):
            return name, number
    raise fault(source, "it holds no section Part or Surface", "export the surface")


def _attributes(source: Source, line: int) -> tuple[dict[str, str], int]:
    """Return the attributes of the section and the number of the line after them."""
    names = [name.lower() for name in cells_of(source.text.readline().strip(), ",")]
    values = cells_of(source.text.readline().strip(), ",")
    return dict(zip(names, values, strict=False)), line + 3


def _whole(attributes: dict[str, str], name: str, source: Source) -> int:
    value = attributes.get(name, "")
    if not re.fullmatch(r"[0-9]{1,9}", value):
        raise fault(source, f"its surface has the {name} {value[:40]!r}")
    return int(value)


def _tables(
    lines: Lines, columns: int, line: int, rows: int, source: Source
) -> Iterator[NumberTable]:
    """Yield the rows of the section, which ends below the declared number of them."""
    done = 0
    lines.end_after(rows)
    for table in table_blocks(lines, columns, ",", source, line):
        yield table
        done += len(table)
    lines.end_after(None)
    if done < rows:
        raise too_short(source, rows, done, "rows")
    if (last := lines.piece(1).strip(" ,\r\n")) != "End":
        fact = f"its surface declares {rows} rows, and {shown(last)} follows, not End"
        raise fault(source, fact, "export it again")


def _surface_blocks(tables: Iterator[NumberTable], x: NumberTable) -> Iterator[Block]:
    done = 0
    for table in tables:
        z = table[:, 1:]
        row, column = np.divmod(np.arange(z.size), len(x))
        y = np.repeat(table[:, 0], len(x))
        yield Block((x[column], y, z.ravel()), None, (row + done, column))
        done += len(table)


def _cloud_blocks(tables: Iterator[NumberTable]) -> Iterator[Block]:
    done = 0
    for table in tables:
        points = table.reshape(-1, 3)
        row, column = np.divmod(np.arange(len(points)), table.shape[1] // 3)
        yield Block((points[:, 0], points[:, 1], points[:, 2]), None, (row + done, column))
        done += len(table)
