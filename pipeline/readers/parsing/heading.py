"""Lines above the rows of a text: prose, the number of rows, names of columns and their units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from ...system import frozen
from ..faults import fault, too_many, too_short
from ..source import Layout, Source, shown
from .ascii import cells_of, content, has_decimal_comma, is_missing, is_prose
from .columns import are_known, find_layout, unit_of
from .lines import is_number

_MOST_LINES_BEFORE = 100_000
_NAMES_WITHIN = 100  # lines above the rows
# A name in quotes, or a word with the unit in brackets that may follow it.
_WORDS = re.compile(r'"[^"]*"|[^\s,;\[(][^\s,;]*(?:[ \t]+[\[(][^\[\]()]*[\])])?|[^\s,;]+')
_NAMES_FOLLOW = re.compile(
    r"\s*(?:[^\W\d]+\s+)?(?:columns?|fields?|names?|format|order|layout|header)\s*[:=]\s+",
    re.IGNORECASE,
)

Line = tuple[int, str]  # its number in the file, its text


@frozen
class Heading:
    """Lines above the rows, without the blank ones, and the first row that holds a number.

    declared: number of rows, if given. rows_from: the first row and those above it that hold no
    value, as they stand in the file, from line number `line` on.
    """

    lines: tuple[Line, ...]
    comments: tuple[str, ...]
    declared: int | None
    first: Line
    delimiter: str | None
    cells: tuple[str, ...]
    rows_from: str
    line: int

    @property
    def where(self) -> str:
        """The first row's line and number of columns, for messages."""
        return f"line {self.first[0]} has {len(self.cells)} columns"

    @property
    def widths(self) -> list[int]:
        """Possible numbers of columns: a delimiter may end the row."""
        count = len(self.cells)
        return [count] if self.cells[-1] else [count, count - 1]


def read_heading(source: Source) -> Heading:
    """Read up to and including the first row. Raises InputError if there is none."""
    lines: list[Line] = []
    comments: list[str] = []
    declared: int | None = None
    gaps: list[Line] = []  # rows without a value, and what is blank among them
    for number, text in enumerate(source.text, start=1):
        if number > _MOST_LINES_BEFORE:
            raise too_many(source, _MOST_LINES_BEFORE, "lines before its points")
        data = content(text)
        if not data:
            comments.append(text.strip("#/ \t\r\n"))
            gaps += [(number, text)] if gaps else []
        elif declared is None and re.fullmatch(r"[0-9]{1,18}", data):
            declared, gaps = int(data), []
        elif _is_gap(data):
            gaps.append((number, text))
        elif not any(map(is_number, re.split(r'[\s,;"]+', data))) or is_prose(data):
            lines.append((number, data))
            gaps = []
        else:
            delimiter = _delimiter(data)
            return Heading(
                lines=tuple(lines),
                comments=tuple(filter(None, comments)),
                declared=declared,
                first=(number, data),
                delimiter=delimiter,
                cells=tuple(cells_of(content(text, delimiter), delimiter)),
                rows_from="".join([*(gap for _, gap in gaps), text]),
                line=gaps[0][0] if gaps else number,
            )
    if declared:
        raise too_short(source, declared, 0)
    raise fault(source, "it holds 0 points, no line of three numbers", "export x y z")


def _is_gap(data: str) -> bool:
    """Return whether a line has three cells or more, and no value in any."""
    cells = cells_of(data, _delimiter(data))
    return len(cells) > 2 and all(map(is_missing, cells))


def _delimiter(data: str) -> str | None:
    """Return the separator of the fields of a data line; None for blanks."""
    for mark in ";\t":
        if mark in data:
            return mark
    return "," if "," in data and not has_decimal_comma(data, None) else None


def named_layout(heading: Heading, source: Source) -> tuple[int, Layout] | None:
    """Return the number of columns, and those that a line or a comment above the rows names.

    Raises InputError for names that do not fit the rows, or lack x, y or z.
    """
    wrong = None
    first = max(0, len(heading.lines) - _NAMES_WITHIN)
    for at, (_, text) in reversed(list(enumerate(heading.lines[first:], first))):
        for columns in heading.widths:
            names = _names(text, heading.delimiter, columns)
            try:
                layout = find_layout(names)
            except ValueError as error:
                if _may_be_names(cells_of(text, heading.delimiter), columns):
                    wrong = wrong or str(error)
                continue
            if len(names) != columns:
                wrong = f"{len(names)} columns are named in {shown(text)}, but {heading.where}"
                continue
            unit, below = _units(heading.lines[at + 1 :], layout, columns, heading.delimiter)
            check_prose((*heading.lines[:at], *below), heading, source)
            return columns, replace(layout, unit=layout.unit or unit)
    if wrong:
        raise fault(source, wrong, "name each column, x, y and z among them, here or by --columns")
    return _named_in_comment(heading, source)


def _may_be_names(cells: Sequence[str], columns: int) -> bool:
    """Return whether the cells can be the names of as many columns: words, and no number."""
    words = [cell for cell in cells if re.search(r"\w", cell)]
    return bool(words) and len(cells) == columns and not any(map(is_number, cells))


def _named_in_comment(heading: Heading, source: Source) -> tuple[int, Layout] | None:
    for comment in reversed(heading.comments[-_NAMES_WITHIN:]):
        for columns in heading.widths:
            names = _names(comment, heading.delimiter, columns)
            if not any(name.endswith(":") for name in names) and len(names) == columns:
                try:
                    return columns, find_layout(names)
                except ValueError:
                    continue
        if are_known(names) and [name.lower() for name in names[:3]] != ["x", "y", "z"]:
            fact = f"{len(names)} columns are named in {shown(comment)}, but {heading.where}"
            raise fault(source, fact, "name each column by --columns")
    return None


def _names(text: str, delimiter: str | None, columns: int) -> list[str]:
    """Split a line of names as the rows are split, or else at blanks, commas and semicolons.

    Before them may stand what they are: `columns: x y z`.
    """
    if follow := _NAMES_FOLLOW.match(text):
        text = text[follow.end() :]
    names = cells_of(text, delimiter)
    if len(names) == columns and not any(name.endswith((",", ";")) for name in names):
        return names
    return [name.strip('"') for name in _WORDS.findall(text)]


def _units(
    below: Sequence[Line], layout: Layout, columns: int, delimiter: str | None
) -> tuple[str | None, list[Line]]:
    """Return the unit that a row of units below the names gives x, y and z; and the other lines."""
    for at, (_, text) in enumerate(below):
        cells = cells_of(text, delimiter)
        units = {unit_of(cells[k]) for k in layout.xyz} if len(cells) == columns else set()
        if len(units) == 1 and None not in units:
            return units.pop(), [*below[:at], *below[at + 1 :]]
    return None, list(below)


def check_prose(lines: Sequence[Line], heading: Heading, source: Source) -> None:
    """Raise InputError for one of the lines above the rows that may be a damaged row.

    Names of columns, which are no prose, pass where the user names the columns or gives a pitch.
    """
    for number, text in lines:
        if source.options.stated() and not re.search(r"\d", text) and text.isprintable():
            continue
        if not is_prose(text, len(heading.cells), heading.delimiter):
            fact = f"line {number} is neither a row of numbers nor a heading: {shown(text)}"
            raise fault(source, fact, "correct or delete the line, or export again")
