"""Parser of tables of numbers in text, which accounts for every line."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ...vectors import Array
from ..faults import fault
from ..source import Source, shown
from .lines import Lines, count_of_lines, is_number

NumberTable = Array

_COMMA_NUMBER = re.compile(
    r"[+-]?(\d+(,\d+)?(e[+-]?\d+)?|nan|inf(inity)?)", re.IGNORECASE | re.ASCII
)


def has_decimal_comma(line: str, delimiter: str | None) -> bool:
    """Return whether the commas of a data line can only be decimal commas.

    Commas that are the only separators do separate: `1,5,2,5` is four numbers.
    """
    fields = content(line).split(delimiter)
    return (
        delimiter != ","
        and len(fields) > 1
        and any("," in field for field in fields)
        and all(_COMMA_NUMBER.fullmatch(field.strip()) for field in fields)
    )


def content(line: str) -> str:
    """Return a line without its comment and surrounding blanks."""
    return line.partition("#")[0].partition("//")[0].strip()


def table_blocks(
    lines: Lines,
    columns: int,
    delimiter: str | None,
    source: Source,
    line: int,
    limit: int | None = None,
) -> Iterator[NumberTable]:
    """Yield tables of rows of `columns` numbers until the end, or until `limit` rows.

    lines: the next one is line number `line` of the file.
    delimiter: None for runs of blanks. Comments and blank lines are not rows.
    Raises InputError that names the first line that is no such row.
    """
    left, comma = limit, None
    with _memory_file() as memory:
        while (left is None or left > 0) and (piece := lines.piece(left)):
            if comma is None:
                comma = _decimal_mark(piece, delimiter)
            table = _parse_fast(piece, columns, delimiter, bool(comma), memory)
            if table is None:
                table = _parse_slowly(piece, columns, delimiter, source, line, bool(comma))
            yield table
            line += count_of_lines(piece)
            left = None if left is None else left - len(table)


@contextmanager
def _memory_file() -> Iterator[int]:
    """Open a file in memory, by its descriptor."""
    descriptor = os.memfd_create("table")
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _decimal_mark(piece: str, delimiter: str | None) -> bool | None:
    """Return whether the numbers have decimal commas; None if all are integers."""
    if delimiter == ",":
        return False
    for line in io.StringIO(piece):
        if "." in line or "," in line:
            data = content(line)
            if "." in data:
                return False
            if has_decimal_comma(data, delimiter):
                return True
    return None


def _parse_fast(
    piece: str, columns: int, delimiter: str | None, comma: bool, memory: int
) -> NumberTable | None:
    """Parse with numpy's C parser; None when it finds no table of the right width.

    The piece goes through a file: numpy reads a path in blocks, 1.15 times as fast as other
    sources, which it reads line by line.
    """
    if not content(piece[: piece.find("\n")]) and not any(map(content, io.StringIO(piece))):
        return np.empty((0, columns))
    if comma:
        if "." in piece:
            return None
        piece = piece.replace(",", ".")
    data = piece.encode("utf-8", "replace")
    os.ftruncate(memory, os.pwrite(memory, data, 0))
    path = f"/proc/self/fd/{memory}"
    try:
        table = np.loadtxt(path, comments="#", delimiter=delimiter, ndmin=2, encoding="utf-8")
    except ValueError:
        return None
    return table if table.shape[1] == columns else None


def _parse_slowly(
    piece: str,
    columns: int,
    delimiter: str | None,
    source: Source,
    line: int,
    comma: bool,
) -> NumberTable:
    """Parse line by line, to name the first wrong line and to handle '//' comments."""
    rows = []
    for number, text in enumerate(io.StringIO(piece), start=line):
        data = content(text)
        if not data:
            continue
        fields = [field.strip() for field in data.split(delimiter)]
        if len(fields) != columns:
            fact = f"line {number} has {len(fields)} columns instead of {columns}: {shown(data)}"
            raise fault(source, fact, "correct the line or export again")
        if comma and "." in data:
            fact = f"line {number} has decimal points, those above it have commas: {shown(data)}"
            raise fault(source, fact, "export again")
        if comma:
            fields = [field.replace(",", ".") for field in fields]
        for field in fields:
            if not is_number(field):
                fact = f"line {number} holds {shown(field)}, which is not a number: {shown(data)}"
                raise fault(source, fact, "correct the line or export again")
        rows.append([float(field) for field in fields])
    return np.array(rows, dtype=np.float64).reshape(len(rows), columns)
