"""PTS reader: blocks of rows x y z [intensity] [red green blue], each after its count.

A single block may lack its count, and may have names of the columns, comments or commas: then it
is read as other text. Intensities are kept as they are; Leica's run from -2048 to 2047.
Format: the text that Leica Cyclone exports; all blocks are in one frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from ...system import frozen
from ..faults import fault, too_long, too_many, too_short
from ..parsing.ascii import signs_as_nan, table_blocks
from ..parsing.columns import unnamed_layout
from ..parsing.lines import Lines, count_lines, pass_blank_lines, pass_lines
from ..source import Block, Layout, RawCloud, RawPart, Source, shown
from .text import read_text

# Columns of a row: x y z, then an intensity, a colour, both, or both and a normal.
_LAYOUTS = {
    **{count: Layout((0, 1, 2), 3) for count in (4, 7, 10)},
    **{3: Layout((0, 1, 2), None), 6: Layout((0, 1, 2), None, colour=(3, 4, 5))},
}
# What other text holds besides numbers, NaN among them.
_OTHER_TEXT = re.compile(r"[^\s\d.+\-einfaty]", re.IGNORECASE)
_HEAD_BYTES = 1 << 14
_LONGEST_LINE = 1 << 16
_MOST_BLOCKS = 10_000


@frozen
class _Run:
    """Rows of one block, an upper bound if it has no count; line: number of its first row."""

    rows: int
    line: int
    counted: bool


def read_pts(source: Source) -> RawCloud:
    """Read all blocks; several blocks are parts without a pose."""
    head = source.stream.read(_HEAD_BYTES).decode("latin-1")
    source.stream.seek(0)
    if source.options.columns or _OTHER_TEXT.search(signs_as_nan(head)):
        return read_text(source, lambda columns: _LAYOUTS.get(columns) or unnamed_layout(columns))
    lines = count_lines(source)
    runs, first = _index(source, lines)
    columns = len(first.split())
    if columns not in _LAYOUTS:
        fact = f"a row has {columns} columns, not x y z [intensity] [red green blue]"
        raise fault(source, f"{fact}: {shown(first)}")
    source.stream.seek(0)
    parts = tuple(RawPart(str(n)) for n in range(1, len(runs) + 1)) if len(runs) > 1 else ()
    layout = _LAYOUTS[columns]
    blocks = _blocks(runs, columns, layout, source)
    return RawCloud(sum(r.rows for r in runs), layout.has_intensity, blocks, parts=parts)


def _index(source: Source, lines: int) -> tuple[list[_Run], bytes]:
    """Return the position of each block, and the first row of numbers."""
    stream, line = source.stream, 0
    runs: list[_Run] = []
    first = b""
    while raw := stream.readline(_LONGEST_LINE):
        line += 1
        if not raw.strip():
            line += pass_blank_lines(stream)
            continue
        if not re.fullmatch(rb"\s*[0-9]{1,18}\s*", raw):
            if runs:
                raise too_long(source, runs[-1].rows, f"rows from line {line} on")
            return [_Run(lines - line + 1, line, counted=False)], raw
        count, start = int(raw), stream.tell()
        held = pass_lines(stream, count)
        if held < count:
            raise too_short(source, count, held)
        if count and not first:
            end = stream.tell()
            stream.seek(start)
            first = stream.readline(_LONGEST_LINE)
            stream.seek(end)
        runs.append(_Run(count, line + 1, counted=True))
        if len(runs) > _MOST_BLOCKS:
            raise too_many(source, _MOST_BLOCKS, "blocks")
        line += count
    if line != lines:
        raise fault(source, "some of its lines end with CR alone", "save it with LF")
    if not first:
        raise fault(source, "it holds 0 points")
    return runs, first


def _blocks(runs: list[_Run], columns: int, layout: Layout, source: Source) -> Iterator[Block]:
    line, lines = 1, Lines(source.text)
    for part, run in enumerate(runs):
        lines.end_after(None)
        lines.skip(run.line - line)
        lines.end_after(run.rows)
        rows, line = 0, run.line + run.rows
        for table in table_blocks(lines, columns, None, source, run.line):
            rows += len(table)
            block = layout.block(table)
            yield Block(block.xyz, block.intensity, part=part)
        if run.counted and rows < run.rows:
            raise too_short(source, run.rows, rows)
