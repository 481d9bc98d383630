"""Tables of numbers in text, every line accounted for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from typing import TextIO

import numpy as np
import numpy.typing as npt

from pipeline.readers.faults import fault
from pipeline.readers.raw import Source, shown

Table = npt.NDArray[np.float64]

_BLOCK_LINES = 1 << 15
_TAIL_BYTES = 1 << 12
_NUMBER = re.compile(
    r"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?)", re.IGNORECASE | re.ASCII
)


def is_number(text: str) -> bool:
    """Whether the text is one number, nan and inf included."""
    return _NUMBER.fullmatch(text) is not None


def content(line: str) -> str:
    """A line without its comment and the blanks around it."""
    return line.partition("#")[0].partition("//")[0].strip()


def count_lines(source: Source) -> int:
    """Lines from here to the end, at most; a line end is LF, CR or both; the stream is put back.

    The last line may lack its end. Raises InputError where it then is evidently cut: its last
    number has fewer decimals than those above it, which all have as many.
    """
    start, lines, last = source.stream.tell(), 0, b""
    while chunk := source.stream.read(1 << 20):
        lines += chunk.count(b"\n")
        if b"\r" in chunk:
            lines += chunk.count(b"\r") - chunk.count(b"\r\n")
        last = chunk[-1:]
    if last not in (b"\n", b"\r", b""):
        lines += 1
        source.stream.seek(max(start, source.size - _TAIL_BYTES))
        if _is_cut(source.stream.read()):
            raise fault(
                source,
                "its last line ends in the middle of a number",
                "copy the file again or, if it is whole, end the line",
            )
    source.stream.seek(start)
    return lines


def _is_cut(tail: bytes) -> bool:
    """Whether the last number is shorter than those above it, or has none above it to compare."""
    rows = [row.split() for row in re.sub(rb"[,;]", b" ", tail).splitlines()]
    last = [row[-1].decode("latin-1") for row in rows if row and not row[0].startswith(b"#")]
    decimals = [len(number.partition(".")[2]) for number in last if is_number(number)]
    if len(decimals) == 1:
        return True
    return len(decimals) > 4 and len(set(decimals[1:-1])) == 1 and decimals[-1] != decimals[1]


def table_blocks(
    text: Iterator[str],
    columns: int,
    delimiter: str | None,
    source: Source,
    line: int,
    limit: int | None = None,
) -> Iterator[Table]:
    """Rows of `columns` numbers until the end, or until there are `limit` of them.

    text: an iterator over lines, the next one being number `line` of the file.
    delimiter: None for runs of blanks. Comments and blank lines are not rows.
    Raises InputError that names the first line that is not such a row.
    """
    left = limit
    while left is None or left > 0:
        block = list(islice(text, _BLOCK_LINES if left is None else min(left, _BLOCK_LINES)))
        if not block:
            return
        table = _parse_fast(block, columns, delimiter)
        if table is None:
            table = _parse_slowly(block, columns, delimiter, source, line)
        yield table
        line += len(block)
        left = None if left is None else left - len(table)


def skip_rows(text: TextIO, rows: int) -> int:
    """Skip that many lines that are not blank; the number of lines passed."""
    passed = 0
    while rows and (line := text.readline()):
        passed += 1
        rows -= not line.isspace()
    return passed


def _parse_fast(block: list[str], columns: int, delimiter: str | None) -> Table | None:
    """Read with the C parser of numpy; None when it does not find a table of the right width."""
    if all(not content(line) for line in block):
        return np.empty((0, columns))
    try:
        table = np.loadtxt(block, comments="#", delimiter=delimiter, ndmin=2)
    except ValueError:
        return None
    return table if table.shape[1] == columns else None


def _parse_slowly(
    block: list[str], columns: int, delimiter: str | None, source: Source, line: int
) -> Table:
    """Line by line, to name the first one that is wrong; also where '//' comments are read."""
    rows = []
    for number, text in enumerate(block, start=line):
        data = content(text)
        if not data:
            continue
        fields = [field.strip() for field in data.split(delimiter)]
        if len(fields) != columns:
            fact = f"line {number} has {len(fields)} columns instead of {columns}: {shown(data)}"
            raise fault(source, fact, "mend the line or export again")
        for field in fields:
            if not is_number(field):
                fact = f"line {number} holds {shown(field)}, which is not a number: {shown(data)}"
                raise fault(source, fact, "mend the line or export again")
        rows.append([float(field) for field in fields])
    return np.array(rows, dtype=np.float64).reshape(len(rows), columns)
