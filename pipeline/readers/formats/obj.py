"""OBJ reader: the vertices of a mesh, used by a face or not."""

from __future__ import annotations

import io
from collections.abc import Iterator

from ..faults import fault
from ..parsing.ascii import table_blocks
from ..parsing.lines import Lines, check_lines
from ..source import Block, Layout, RawCloud, Source, shown

_BLANKS = " \t"
_VERTEX, _FACE = ("v ", "v\t"), ("f ", "f\t")


def read_obj(source: Source) -> RawCloud:
    """Read every `v` line."""
    check_lines(source)
    count, first, joined = 0, "", False
    for text in source.text:
        line = text.lstrip(_BLANKS)
        if line.startswith(_VERTEX):
            count, first = count + 1, first or line
        elif not joined:
            joined = line.startswith(_FACE)
    if not count:
        return RawCloud(0, False, iter(()))
    source.text.seek(0)
    columns = len(first.split()) - 1
    if columns not in (3, 4, 6, 7):
        fact = f"a vertex has {columns} numbers, not x y z [w] [red green blue]: {shown(first)}"
        raise fault(source, fact)
    blocks = _vertex_lines(columns, source)
    return RawCloud(count, False, blocks, is_mesh=joined, may_mark=False)


def _vertex_lines(columns: int, source: Source) -> Iterator[Block]:
    layout = Layout((0, 1, 2), None)
    lines = Lines(source.text, edit=_only_vertices)
    for table in table_blocks(lines, columns, None, source, 1):
        yield layout.block(table)


def _only_vertices(piece: str) -> str:
    """Return the numbers of `v` lines, other lines blank, so that lines keep their number."""
    lines = (line.lstrip(_BLANKS) for line in io.StringIO(piece))
    return "".join(line[1:] if line[:2] in _VERTEX else "\n" for line in lines)
