"""XYZ, ASC, CSV and TXT reader: one point per line, or a matrix of heights.

Columns are separated by commas, semicolons, tabs or blanks. A comma is a decimal comma where
there is another separator (`1,5;2,5;3,5`), else it separates (`1,5,2,5`). Above the rows may stand
text, the number of points, the names of the columns, in a comment or not, and their units; below
them, text. '#' and '//' begin comments. A missing value (an empty cell, `N/A`, `1.#QNAN`) is a
missing return.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterator

from ...system import frozen
from ..faults import fault, too_short
from ..parsing.ascii import Cells, NumberTable, is_label, table_blocks
from ..parsing.columns import (
    MOST_UNNAMED,
    check_unnamed,
    find_layout,
    stated_unit,
    unit_of,
    unnamed_layout,
)
from ..parsing.heading import Heading, check_prose, named_layout, read_heading
from ..parsing.heights import Heights, height_blocks, stated_heights
from ..parsing.lines import Lines, count_lines
from ..source import Layout, RawCloud, Source, shown
from .gocator import is_gocator, read_gocator


@frozen
class _Form:
    """Form of the rows: where x, y and z are, or the heights that they are a matrix of."""

    columns: int
    holds: Layout | Heights
    cells: Cells
    is_unnamed: bool = False


def read_text(source: Source, unnamed: Callable[[int], Layout] = unnamed_layout) -> RawCloud:
    """Read three or more columns: x y z and perhaps an intensity, or as the names say.

    unnamed: called with the number of columns without names, returns what they are.
    """
    if source.stream.read(3) != codecs.BOM_UTF8:
        source.stream.seek(0)
    if is_gocator(source):
        return read_gocator(source)
    lines = count_lines(source)
    heading = read_heading(source)
    form = _form(heading, source, unnamed)
    tables = _tables(form, heading, source)
    unit = form.holds.unit or _unit_above(heading, source)
    if isinstance(form.holds, Heights):
        blocks = height_blocks(form.holds, tables, source)
        return RawCloud(lines * form.columns, False, blocks, has_grid=True, unit=unit)
    blocks = map(form.holds.block, tables)
    return RawCloud(lines, form.holds.has_intensity, blocks, unit=unit)


def _unit_above(heading: Heading, source: Source) -> str | None:
    """Return the unit that a line above the rows states. Raises InputError for two."""
    stated = map(stated_unit, [*heading.comments, *(text for _, text in heading.lines)])
    units = {unit for unit in map(unit_of, filter(None, stated)) if unit}
    if len(units) > 1:
        fact = f"the lines above its points state the units {', '.join(sorted(units))}"
        raise fault(source, fact, "state one")
    return next(iter(units), None)


def _form(heading: Heading, source: Source, unnamed: Callable[[int], Layout]) -> _Form:
    """Return what the rows are: as the options say, or the names above them; or unnamed columns."""
    options, columns = source.options, heading.widths[-1]
    if options.stated():
        check_prose(heading.lines, heading, source)
    if options.pitch is not None:
        return _Form(columns, Heights(options.pitch), Cells(footer=True))
    if options.columns is not None:
        if len(options.columns) not in heading.widths:
            fact = f"{heading.where}, --columns names {len(options.columns)}"
            raise fault(source, f"{fact}: {shown(heading.first[1])}", "name each, or - to skip it")
        return _points(len(options.columns), find_layout(options.columns))
    if named := named_layout(heading, source):
        return _points(*named)
    check_prose(heading.lines, heading, source)
    stated = stated_heights([*heading.comments, *(text for _, text in heading.lines)])
    if stated and columns > MOST_UNNAMED:
        return _Form(columns, stated, Cells(footer=True))
    if stated or columns > MOST_UNNAMED:
        what = "below a pitch" if stated else "without names"
        fact = f"{heading.where} {what}: {shown(heading.first[1])}"
        action = "give --pitch DX,DY if they are a matrix of heights, else name them by --columns"
        raise fault(source, fact, action)
    return _unnamed(heading, columns, source, unnamed)


def _unnamed(
    heading: Heading, columns: int, source: Source, unnamed: Callable[[int], Layout]
) -> _Form:
    """Return the form of x y z, perhaps with an intensity, or with a name of the point before."""
    if columns in (4, 5) and is_label(heading.cells[0]):
        layout = Layout((1, 2, 3), 4 if columns == 5 else None)
        return _Form(columns, layout, Cells(tuple(range(1, columns)), label=True, footer=True))
    if columns < 3:
        fact = f"{heading.where}, a point needs 3: {shown(heading.first[1])}"
        raise fault(source, fact, "export x y z")
    return _Form(columns, unnamed(columns), Cells(footer=True), is_unnamed=True)


def _points(columns: int, layout: Layout) -> _Form:
    return _Form(columns, layout, Cells(layout.used, footer=True))


def _tables(form: _Form, heading: Heading, source: Source) -> Iterator[NumberTable]:
    """Yield the rows in tables; check their number, and the first of columns without names."""
    lines = Lines(source.text, heading.rows_from)
    rows = 0
    for table in table_blocks(
        lines, form.columns, heading.delimiter, source, heading.line, cells=form.cells
    ):
        if rows == 0 and form.is_unnamed:
            check_unnamed(table, source)
        rows += len(table)
        yield table
    declared = heading.declared
    if declared is not None and rows < declared:
        raise too_short(source, declared, rows)
    if declared is not None and rows > declared:
        fact = f"the first line declares {declared} points, the file holds {rows}"
        raise fault(source, fact)
