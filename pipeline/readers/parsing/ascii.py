"""Parser of tables of numbers in text, which accounts for every line."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterator
from functools import partial
from itertools import takewhile

import numpy as np

from ...system import MemoryFile, frozen, memory_file
from ...vectors import Array
from ..faults import fault
from ..source import Source, shown
from .lines import Lines, count_of_lines, is_number

NumberTable = Array
Converters = dict[int | str, Callable[[str], float]]

_COMMA_NUMBER = re.compile(
    r"[+-]?(\d+(,\d+)?(e[+-]?\d+)?|nan|inf(inity)?)", re.IGNORECASE | re.ASCII
)
# A number sign that begins no comment: NaN and infinity of Microsoft's C library, also where it
# rounds them to fewer decimals, and the errors of spreadsheets.
_NUMBER_SIGNS = re.compile(
    r"[+-]?1[.,]#(?:[QS]NAN|[QS]NB|[QS]O|IND|INF|IO|J|R|T)0*(?![\w.])"
    r"|(?<![^\s,;])#(?:N/A|NV|NUM!|VALUE!|DIV/0!|REF!|NAME\?|NULL!)(?=\s*(?:[,;\t\n\"]|$)|\s+[-+.\d])",
    re.IGNORECASE,
)
_MISSING = r"[+-]?nan\(\w*\)|n/?a|null|none|--+"
_MISSING_CELL = re.compile(rf"(?:{_MISSING})?", re.IGNORECASE)
_MISSING_WORD = re.compile(rf"(?<![^\s,;])(?:{_MISSING})(?![^\s,;])", re.IGNORECASE)
_QUOTED_COMMA = re.compile(r'"([+-]?\d+),(\d[\de+-]*)"', re.IGNORECASE)
_QUOTED_WORD = re.compile(r'"[^"]*"|[^\s"]+')
_WORD = re.compile(r"[^\W\d_]{3,}")
_LONGEST_FOOTER = 10_000  # lines
_FIELD_NAME = re.compile(r"[\"'(\[]?[^\W\d][^,;\t]*[:=]")


@frozen
class Cells:
    """What the cells of a table may hold besides numbers.

    needed: columns that must hold numbers, or nothing; others may hold any text. None for all.
    label: the first column must not hold numbers: it is a name.
    footer: lines of text may follow the rows.
    """

    needed: tuple[int, ...] | None = None
    label: bool = False
    footer: bool = False


NUMBERS = Cells()


def has_decimal_comma(line: str, delimiter: str | None) -> bool:
    """Return whether the commas of a data line can only be decimal commas.

    Commas that are the only separators do separate: `1,5,2,5` is four numbers.
    """
    fields = [field.strip(" \t\"'") for field in content(line).split(delimiter)]
    commas = [field for field in fields if "," in field]
    return (
        delimiter != ","
        and len(fields) > 1
        and bool(commas)
        and all(map(_COMMA_NUMBER.fullmatch, commas))
        and not any("." in field and is_number(field) for field in fields)
    )


def signs_as_nan(text: str) -> str:
    """Write `nan` for number signs that begin no comment: 1.#QNAN, -1.#IND, #N/A."""
    return _NUMBER_SIGNS.sub("nan", text) if "#" in text else text


def content(line: str, delimiter: str | None = None) -> str:
    """Return a line without its comment and surrounding blanks, but for tabs that separate."""
    line = signs_as_nan(line)
    data = line.partition("#")[0].partition("//")[0]
    return data.strip(" \r\n") if delimiter == "\t" else data.strip()


def cells_of(data: str, delimiter: str | None) -> list[str]:
    """Split a data line into its cells, without blanks and quotes around them."""
    if '"' not in data:
        return [cell.strip() for cell in data.split(delimiter)]
    if delimiter is None:
        return [word.strip('"') for word in _QUOTED_WORD.findall(data)]
    try:
        row = next(csv.reader([data], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a field of more than 128 KiB
        row = data.split(delimiter)
    return [cell.strip() for cell in row]


def is_missing(cell: str) -> bool:
    """Return whether a cell stands for a missing value: empty, N/A, -nan(ind) and the like."""
    return _MISSING_CELL.fullmatch(cell) is not None


def is_label(cell: str) -> bool:
    """Return whether a cell holds the name of a point: a letter, and no number or missing value."""
    is_value = is_number(cell) or is_missing(cell) or _COMMA_NUMBER.fullmatch(cell)
    return not is_value and re.search(r"[^\W\d_]", cell) is not None


def is_prose(data: str, columns: int | None = None, delimiter: str | None = None) -> bool:
    """Return whether a line around a table of `columns` is text that no damage made of a row.

    It begins with no number and is printable; it has words or nothing but marks, and fewer numbers
    than a point has coordinates, or one at most where it has as many cells as a row.
    """
    if not re.sub(r"[\t\xa0]", " ", data).isprintable():
        return False
    if _FIELD_NAME.match(data):
        return True
    words = re.split(r"[\s,;\"']+", data)
    numbers = sum(map(is_number, words))
    before = takewhile(lambda word: not is_number(word), words)
    if numbers and not _WORD.search(" ".join(before)):
        return False
    if not re.search(r"[^\W\d_]{2}", data) and re.search(r"\w", data):
        return False
    return numbers < (2 if len(cells_of(data, delimiter)) == columns else 3)


def table_blocks(
    lines: Lines,
    columns: int,
    delimiter: str | None,
    source: Source,
    line: int,
    limit: int | None = None,
    cells: Cells = NUMBERS,
) -> Iterator[NumberTable]:
    """Yield tables of rows of `columns` numbers until the end, or until `limit` rows.

    lines: the next one is line number `line` of the file.
    delimiter: None for runs of blanks. Comments and blank lines are not rows; a missing value is
    NaN, and so are the cells that need not be numbers where they are none.
    Raises InputError that names the first line that is no such row.
    """
    left = limit
    with memory_file() as memory:
        parser = _Parser(columns, delimiter, source, cells, memory)
        while left is None or left > 0:
            is_row = partial(content, delimiter=delimiter)
            piece = lines.piece() if left is None else lines.rows(left, is_row)
            if not piece:
                return
            table = parser.parse(piece, line)
            yield table
            line += count_of_lines(piece)
            left = None if left is None else left - len(table)


class _Parser:
    """Parser of successive pieces of a table.

    comma: whether the numbers have decimal commas; None while all are whole numbers.
    end: the first line below the rows, its number and its text; None while rows may follow.
    """

    def __init__(
        self,
        columns: int,
        delimiter: str | None,
        source: Source,
        cells: Cells,
        memory: MemoryFile,
    ) -> None:
        self._columns, self._delimiter, self._source = columns, delimiter, source
        self._cells, self._memory = cells, memory
        needed = range(columns) if cells.needed is None else cells.needed
        self._unneeded: Converters = dict.fromkeys(set(range(columns)) - set(needed), _no_number)
        if cells.label:
            self._unneeded[0] = _name
        self._comma: bool | None = None
        self._end: tuple[int, str] | None = None

    def parse(self, piece: str, line: int) -> NumberTable:
        """Return the rows of a piece whose first line is number `line`."""
        piece = signs_as_nan(piece)
        if self._comma is None:
            self._comma = _decimal_mark(piece, self._delimiter)
        if self._end is None:
            for text, converters in self._attempts(piece):
                table = self._parse_fast(text, converters)
                if table is not None:
                    return table
        return self._parse_slowly(piece, line)

    def _attempts(self, piece: str) -> Iterator[tuple[str, Converters | None]]:
        """Yield the piece as it is, with bare numbers, and with converters of unneeded columns."""
        if not self._cells.label:
            yield piece, None
        bare = self._bare(piece)
        if not self._cells.label and bare != piece:
            yield bare, None
        if self._unneeded:
            yield bare, self._unneeded

    def _parse_fast(self, piece: str, converters: Converters | None) -> NumberTable | None:
        """Parse with numpy's C parser; None when it finds no table of the right width.

        The piece goes through a file: numpy reads a path in blocks, 1.15 times as fast as other
        sources, which it reads line by line.
        """
        if not content(piece[: piece.find("\n")]) and not any(
            content(line) for line in io.StringIO(piece) if not line.isspace()
        ):
            return np.empty((0, self._columns))
        if self._comma:
            if "." in piece:
                return None
            piece = piece.replace(",", ".")
        self._memory.write(piece.encode("utf-8", "replace"))
        try:
            table = np.loadtxt(
                self._memory.path,
                comments="#",
                delimiter=self._delimiter,
                converters=converters,
                ndmin=2,
                encoding="utf-8",
            )
        except ValueError:
            return None
        return table if table.shape[1] == self._columns else None

    def _bare(self, piece: str) -> str:
        """Return the piece without quotes and last delimiters, `nan` for each missing value."""
        if '"' in piece:
            piece = _QUOTED_COMMA.sub(r"\1.\2", piece).replace('"', "")
        piece = _MISSING_WORD.sub("nan", piece)
        mark = self._delimiter
        if mark is None:
            return piece
        first = content(piece[: piece.find("\n")], mark)
        if first.count(mark) == self._columns:
            piece = re.sub(rf"{mark}[ ]*$", "", piece, flags=re.MULTILINE)
        piece = re.sub(rf"(?<={mark})[ ]*(?={mark}|$)", "nan", piece, flags=re.MULTILINE)
        return re.sub(rf"^[ ]*(?={mark})", "nan", piece, flags=re.MULTILINE)

    def _parse_slowly(self, piece: str, line: int) -> NumberTable:
        """Parse line by line: name the first wrong line; take `//` comments, text and a footer."""
        rows = []
        for number, text in enumerate(io.StringIO(piece), start=line):
            data = content(text, self._delimiter)
            if not data.strip():
                continue
            row = self._row(data, number)
            if row is not None:
                rows.append(row)
        return np.array(rows, dtype=np.float64).reshape(len(rows), self._columns)

    def _row(self, data: str, number: int) -> list[float] | None:
        """Return the numbers of a line; None for a line below the rows."""
        cells = cells_of(data, self._delimiter)
        if len(cells) == self._columns + 1 and not cells[-1]:
            cells.pop()
        wrong = self._fault_of(cells, data, number)
        if wrong is None and self._end is None:
            return [self._number(cell) for cell in cells]
        if self._cells.footer and is_prose(data, self._columns, self._delimiter):
            self._end = self._end or (number, data)
            if number - self._end[0] < _LONGEST_FOOTER:
                return None
        if self._end is not None:
            first, text = self._end
            wrong = f"line {first} is no row, but rows follow it: {shown(text)}"
        raise fault(self._source, str(wrong), "correct the line or export again")

    def _fault_of(self, cells: list[str], data: str, number: int) -> str | None:
        if len(cells) != self._columns:
            return (
                f"line {number} has {len(cells)} columns instead of {self._columns}: {shown(data)}"
            )
        needed = range(self._columns) if self._cells.needed is None else self._cells.needed
        values = [cells[column] for column in needed]
        if self._comma and any("." in cell for cell in values):
            return f"line {number} has decimal points, those above it have commas: {shown(data)}"
        for cell in values:
            if math.isnan(self._number(cell)) and not (is_number(cell) or is_missing(cell)):
                return f"line {number} holds {shown(cell)}, which is not a number: {shown(data)}"
        if self._cells.label and not is_label(cells[0]):
            return f"line {number} begins with no name, as the first row does: {shown(data)}"
        return None

    def _number(self, cell: str) -> float:
        """Return the number of a cell, NaN where it holds none."""
        if self._comma or (self._delimiter == "," and _COMMA_NUMBER.fullmatch(cell)):
            cell = cell.replace(",", ".")  # where commas separate, it was quoted
        return float(cell) if is_number(cell) else math.nan


def _no_number(_cell: str) -> float:
    return math.nan


def _name(cell: str) -> float:
    """Return NaN for the name of a point. Raises ValueError if it is none, or a comment."""
    if not is_label(cell.strip()) or cell.lstrip().startswith("//"):
        raise ValueError(cell)
    return math.nan


def _decimal_mark(piece: str, delimiter: str | None) -> bool | None:
    """Return whether the numbers have decimal commas; None if all are integers."""
    if delimiter == ",":
        return False
    for line in io.StringIO(piece):
        if "." in line or "," in line:
            data = content(line)
            if has_decimal_comma(data, delimiter):
                return True
            if "." in data:
                return False
    return None
