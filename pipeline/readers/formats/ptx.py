"""PTX reader: posed scans, each a whole raster of rows x y z intensity [red green blue].

Ten lines precede each raster: its columns and rows, the position of the scanner and its axes (4
lines), and a 4x4 whose *rows* act on row vectors (x y z 1); only the 4x4 is applied. The raster is
written column by column; `0 0 0` is a beam without a return.
Format: http://paulbourke.net/dataformats/ptx/
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice

import numpy as np

from ...errors import InputError
from ...system import frozen
from ...vectors import Array
from ..faults import fault, too_many
from ..parsing.ascii import table_blocks
from ..parsing.lines import Lines, count_lines, is_number, pass_lines
from ..source import Block, Layout, RawCloud, RawPart, Source, shown

_COLUMNS = (4, 7, 10)  # x y z intensity, then a colour, then a normal
_NUMBERS_OF_LINE = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
_LONGEST_LINE = 1 << 16
_MOST_SCANS = 10_000


@frozen(eq=False)
class _Raster:
    """One raster: its columns and rows, its pose, and the line number of its first row."""

    columns: int
    rows: int
    T_file_scan: Array
    line: int

    @property
    def points(self) -> int:
        """Number of beams of the raster, with or without a return."""
        return self.columns * self.rows


def read_ptx(source: Source) -> RawCloud:
    """Read all rasters of the file, each a part with its pose."""
    lines = count_lines(source)
    rasters, fields = _index(source, lines)
    source.stream.seek(0)
    parts = tuple(RawPart(str(n), raster.T_file_scan) for n, raster in enumerate(rasters, 1))
    total = sum(raster.points for raster in rasters)
    return RawCloud(total, True, _blocks(rasters, fields, source), has_grid=True, parts=parts)


def _index(source: Source, lines: int) -> tuple[list[_Raster], int]:
    """Return the headers, and the number of columns of the first row; read to the end."""
    rasters: list[_Raster] = []
    fields = line = 0
    while True:
        head = list(islice(source.stream, len(_NUMBERS_OF_LINE)))
        if rasters and not b"".join(head).strip():
            if line + len(head) + sum(1 for _ in source.stream) != lines:
                raise fault(source, "some of its lines end with CR alone", "save it with LF")
            return rasters, fields
        raster = _raster(head, line + 1, source)
        line += len(head)
        start = source.stream.tell()
        held = pass_lines(source.stream, raster.points)
        line += held
        if held < raster.points:
            raise fault(
                source,
                f"scan {len(rasters) + 1} declares {raster.columns} x {raster.rows} points, "
                f"the file holds {held} of them",
                "the copy is incomplete; copy it again",
            )
        if held and not fields:
            fields = _fields(source, start, raster.line)
        rasters.append(raster)
        if len(rasters) > _MOST_SCANS:
            raise too_many(source, _MOST_SCANS, "scans")


def _fields(source: Source, start: int, line: int) -> int:
    """Count the columns of the row at byte `start`; the stream keeps its position."""
    end = source.stream.tell()
    source.stream.seek(start)
    row = source.stream.readline(_LONGEST_LINE)
    source.stream.seek(end)
    fields = len(row.split())
    if fields not in _COLUMNS:
        fact = f"line {line} has {fields} columns, not x y z intensity [red green blue]"
        raise fault(source, f"{fact}: {shown(row)}")
    return fields


def _raster(head: list[bytes], line: int, source: Source) -> _Raster:
    rows = [raw.decode("latin-1").split() for raw in head]
    for at, count in enumerate(_NUMBERS_OF_LINE):
        row = rows[at] if at < len(rows) else []
        if len(row) != count or not all(map(is_number, row)):
            raise _strange(head, at, line, source)
    for at in (0, 1):
        if not re.fullmatch("[0-9]{1,9}", rows[at][0]):
            raise _strange(head, at, line, source)
    matrix = np.array(rows[6:], dtype=np.float64)
    return _Raster(int(rows[0][0]), int(rows[1][0]), matrix.T.copy(), line + len(head))


def _strange(head: list[bytes], at: int, line: int, source: Source) -> InputError:
    if at >= len(head):
        return fault(source, "the file ends within the header of a scan", "copy it again")
    what = ("the number of columns", "the number of rows", *("the scanner's position or axis",) * 4)
    meant = what[at] if at < len(what) else "a row of its 4x4"
    return fault(source, f"line {line + at} is not {meant} of a PTX scan: {shown(head[at])}")


def _blocks(rasters: list[_Raster], fields: int, source: Source) -> Iterator[Block]:
    layout, lines = Layout((0, 1, 2), 3), Lines(source.text)
    for part, raster in enumerate(rasters):
        done = 0
        lines.end_after(None)
        lines.skip(len(_NUMBERS_OF_LINE))
        lines.end_after(raster.points)
        for table in table_blocks(lines, fields, None, source, raster.line):
            column, row = np.divmod(np.arange(done, done + len(table)), raster.rows)
            invalid = (table[:, :3] == 0.0).all(axis=1)
            block = layout.block(table)
            yield Block(block.xyz, block.intensity, (row, column), invalid, part)
            done += len(table)
        if done < raster.points:
            fact = f"scan {part + 1} has {raster.points - done} blank lines among its rows"
            raise fault(source, fact)
