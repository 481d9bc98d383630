"""XYZ, CSV and TXT reader: one point per line.

Columns are separated by commas, semicolons, tabs or blanks. A comma is a decimal comma where
there is another separator (`1,5;2,5;3,5`), else it separates (`1,5,2,5`). A first
line may hold the number of points, the next one the names of the columns; '#' and '//' begin
comments.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass

from ..faults import fault, too_many, too_short
from ..parsing.ascii import content, has_decimal_comma, table_blocks
from ..parsing.lines import Lines, count_lines, is_number
from ..source import Block, Layout, RawCloud, Source, find_layout, shown

_MOST_LINES_BEFORE = 100_000


@dataclass(frozen=True)
class _Preamble:
    """The lines before the rows.

    first: the first data line; line: its number in the file; declared: the count, if given.
    """

    declared: int | None
    columns: int
    delimiter: str | None
    layout: Layout
    first: str
    line: int


def read_text(source: Source) -> RawCloud:
    """Read three or more columns: x y z and optionally an intensity, or as the header says."""
    if source.stream.read(3) != codecs.BOM_UTF8:
        source.stream.seek(0)
    lines = count_lines(source)
    preamble = _read_preamble(source)
    return RawCloud(lines, preamble.layout.intensity is not None, _blocks(preamble, source))


def _read_preamble(source: Source) -> _Preamble:
    declared: int | None = None
    names: str | None = None
    for number, line in enumerate(source.text, start=1):
        data = content(line)
        if number > _MOST_LINES_BEFORE:
            raise too_many(source, _MOST_LINES_BEFORE, "lines before its points")
        if not data:
            continue
        if declared is None and names is None and re.fullmatch(r"[0-9]{1,18}", data):
            declared = int(data)
        elif names is None and not any(map(is_number, re.split(r"[\s,;]+", data))):
            names = data
        else:
            delimiter = _delimiter(data)
            columns = len(data.split(delimiter))
            layout = _find_columns(names, columns, delimiter, source, f"line {number}", data)
            return _Preamble(declared, columns, delimiter, layout, line, number)
    raise too_short(source, declared, 0) if declared else fault(source, "it holds 0 points")


def _delimiter(data: str) -> str | None:
    """Return the separator of the fields of a data line; None for blanks."""
    for mark in ";\t":
        if mark in data:
            return mark
    return "," if "," in data and not has_decimal_comma(data, None) else None


def _find_columns(
    names: str | None, columns: int, delimiter: str | None, source: Source, where: str, data: str
) -> Layout:
    if columns < 3:
        fact = f"{where} has {columns} columns, a point needs 3: {shown(data)}"
        raise fault(source, fact, "export x y z")
    if names is None:
        return Layout((0, 1, 2), 3 if columns == 4 else None)
    named = [name.strip().strip("\"'") for name in names.split(delimiter)]
    if len(named) != columns:
        fact = f"{len(named)} columns are named in {shown(names)}, but {where} has {columns}"
        raise fault(source, fact, "use the same delimiter and number of columns in both")
    try:
        return find_layout(named)
    except ValueError as error:
        raise fault(source, str(error), "name the columns x, y, z and intensity") from None


def _blocks(preamble: _Preamble, source: Source) -> Iterator[Block]:
    rows = 0
    lines = Lines(source.text, preamble.first)
    tables = table_blocks(lines, preamble.columns, preamble.delimiter, source, preamble.line)
    for table in tables:
        rows += len(table)
        yield preamble.layout.block(table)
    if preamble.declared is not None and rows < preamble.declared:
        raise too_short(source, preamble.declared, rows)
    if preamble.declared is not None and rows > preamble.declared:
        fact = f"the first line declares {preamble.declared} points, the file holds {rows}"
        raise fault(source, fact)
