"""Tables that people fill in, CSV or XLSX: their cells by row and column, with all faults."""

from __future__ import annotations

import codecs
import csv
import difflib
import importlib
import io
import re
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ...errors import InputError, MissingDependencyError, Wording, fact_of, remedy_of
from ...system import frozen
from .fault import Fault, summed_up

MAX_BYTES, MAX_UNPACKED, MAX_ROWS, MAX_COLUMNS = 16 << 20, 256 << 20, 20_000, 256
MAX_MERGED = 100_000  # cells; openpyxl makes an object of each
MERGED = "{area} are merged: unmerge and fill in each cell"
DELIMITERS = (";", ",", "\t")
STATED_DELIMITER = re.compile("sep=([;,\t])\r?\n", re.IGNORECASE)  # as spreadsheets write it
BEYOND = (
    "{value} stands beyond the heading: in a table separated by commas, put values with a decimal "
    "comma in quotes"
)


@frozen
class Unusable:
    """Cell of a spreadsheet that holds no text and no number; fact: "" where another says it."""

    fact: str


Cell = str | float
AnyCell = Cell | Unusable


@frozen
class Row:
    """Row of a table: its number in the file, from 1, and its cells that are not empty.

    unusable: columns of cells with a fault that is noted already.
    """

    number: int
    cells: dict[str, Cell]
    unusable: frozenset[str] = frozenset()

    def text(self, column: str) -> str:
        """Return a cell as text, a whole number without decimals; "" where it is empty."""
        cell = self.cells.get(column, "")
        whole = isinstance(cell, float) and cell.is_integer()
        return str(int(cell)) if whole else str(cell)


class FaultyTableError(InputError):
    """A table with faults, each one line: file, row, column, fact and what to do.

    A fault that many rows have is one line.
    """

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = tuple(faults)


class Faults:
    """Collector of the faults of one file."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.found: list[Fault] = []

    def add(self, row: int | None, column: str | None, fact: str) -> None:
        """Note a fault at a row and column."""
        self.found.append(Fault(self.name, row, column, fact))

    def check(self) -> None:
        """Raise FaultyTableError where there are any."""
        if self.found:
            raise FaultyTableError(summed_up(self.name, self.found))


def read_table(
    path: Path, required: Sequence[str], optional: Sequence[str], faults: Faults
) -> list[Row]:
    """Read the rows of a CSV or XLSX file below its heading; note every fault.

    Raises InputError for a file that is no table, FaultyTableError for a heading that cannot be
    used, MissingDependencyError for XLSX without openpyxl.
    """
    try:
        content = path.read_bytes() if path.stat().st_size <= MAX_BYTES else None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}: {remedy_of(error)}") from error
    if content is None:
        raise InputError(f"{path}: it is larger than {MAX_BYTES >> 20} MB: give readings only")
    known = (*required, *optional)
    if content.startswith(b"PK\x03\x04"):
        grid = _xlsx_cells(content, faults.name)
    else:
        grid = _csv_cells(content, known, faults)
    return _rows(grid, required, known, faults)


def _rows(
    grid: Iterable[tuple[int, Sequence[AnyCell]]],
    required: Sequence[str],
    known: Sequence[str],
    faults: Faults,
) -> list[Row]:
    """Return the rows below the heading, cells by column."""
    lines = [(number, cells) for number, cells in grid if any(cell != "" for cell in cells)]
    if not lines:
        raise InputError(f"{faults.name}: it is empty: fill in a form of --template")
    if len(lines) > MAX_ROWS:
        raise InputError(f"{faults.name}: it has more than {MAX_ROWS} rows: give readings only")
    (top, heads), *below = lines
    names = [_head(top, index, head, faults) for index, head in enumerate(heads, 1)]
    for name in dict.fromkeys(names):
        if name and name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            columns = ", ".join(known)
            fact = Wording("unknown column: known are {columns}", columns=columns)
            if close:
                fact = Wording(
                    "unknown column: did you mean {close}? known are {columns}",
                    close=repr(close[0]),
                    columns=columns,
                )
            faults.add(top, name, fact)
        elif name and names.count(name) > 1:
            faults.add(top, name, Wording("the heading has it twice: leave out one"))
    for name in required:
        if name not in names:
            faults.add(top, name, Wording("the heading lacks it: add the column"))
    faults.check()
    found = []
    for number, cells in below:
        for index, cell in enumerate(cells[len(names) :], len(names) + 1):
            if cell != "" and not isinstance(cell, Unusable):
                fact = Wording(BEYOND, value=repr(cell))
                faults.add(number, str(index), fact)
        named = [pair for pair in zip(names, cells, strict=False) if pair[0]]
        for name, cell in named:
            if isinstance(cell, Unusable) and cell.fact:
                faults.add(number, name, cell.fact)
        unusable = frozenset(name for name, cell in named if isinstance(cell, Unusable))
        usable = [(n, c) for n, c in named if not isinstance(c, Unusable) and c != ""]
        found.append(Row(number, dict(usable), unusable))
    return found


def _head(row: int, index: int, cell: AnyCell, faults: Faults) -> str:
    """Return the name of a column; note a cell that can be none."""
    if not isinstance(cell, Unusable):
        return str(cell).strip().casefold()
    if cell.fact:
        faults.add(row, str(index), cell.fact)
    return ""


def _csv_cells(
    content: bytes, known: Sequence[str], faults: Faults
) -> list[tuple[int, list[AnyCell]]]:
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{faults.name}: not UTF-8 text ({fact_of(error)}): save it as CSV UTF-8, or as XLSX"
        ) from error
    if "\0" in text:
        raise InputError(f"{faults.name}: not text: save the table as CSV UTF-8, or as XLSX")
    stated = STATED_DELIMITER.match(text)
    delimiter = stated[1] if stated else _delimiter(text, known)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    found: list[tuple[int, list[AnyCell]]] = []
    start = 1
    try:
        for cells in reader:
            if not (stated and start == 1):
                found.append((start, [cell.strip() for cell in cells]))
            start = reader.line_num + 1
    except csv.Error as error:
        raise InputError(f"{faults.name}: row {start}: {error}: check its quotes") from error
    return found


def _delimiter(text: str, known: Sequence[str]) -> str:
    """Return the character between cells by which the heading has most of the known columns."""
    heading = next((line for line in text.splitlines() if line.strip(" ;,\t")), "")
    fits = [
        sum(part.strip(' "').casefold() in known for part in heading.split(d)) for d in DELIMITERS
    ]
    return DELIMITERS[fits.index(max(fits))]


def _xlsx_cells(content: bytes, name: str) -> list[tuple[int, list[AnyCell]]]:
    """Return the cells of the only sheet with content; formulas and merged cells are unusable."""
    try:
        openpyxl: Any = importlib.import_module("openpyxl")
    except ImportError as error:
        raise MissingDependencyError(
            f"{name}: openpyxl, which reads XLSX, is not installed: run pip install "
            "'wheelplane[tables]', or save the table as CSV"
        ) from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            unpacked = sum(entry.file_size for entry in packed.infolist())
        if unpacked > MAX_UNPACKED:
            raise InputError(f"{name}: it unpacks to {unpacked >> 20} MB: give readings only")
        _check_merged(openpyxl, content, name)
        book = openpyxl.load_workbook(io.BytesIO(content))
    except InputError:
        raise
    except Exception as error:  # openpyxl raises whatever its parsers raise
        raise InputError(
            f"{name}: not a readable XLSX file ({error}): save it again, or as CSV"
        ) from error
    sheets = [sheet for sheet in book.worksheets if sheet.max_row > 1]
    if len(sheets) != 1:
        raise InputError(f"{name}: {len(sheets)} sheets have content: keep the readings in one")
    (sheet,) = sheets
    if sheet.max_column > MAX_COLUMNS:
        raise InputError(f"{name}: it has {sheet.max_column} columns: give readings only")
    merged: dict[tuple[int, int], Unusable] = {}
    for area in sheet.merged_cells.ranges:
        fact = Wording(MERGED, area=area.coord)
        for row in range(area.min_row, min(area.max_row, sheet.max_row, MAX_ROWS) + 1):
            for column in range(area.min_col, min(area.max_col, sheet.max_column) + 1):
                merged[row, column] = Unusable("")
        merged[area.min_row, area.min_col] = Unusable(fact)
    return [
        (
            number,
            [merged.get((number, index)) or _xlsx_value(c) for index, c in enumerate(cells, 1)],
        )
        for number, cells in enumerate(sheet.iter_rows(max_row=MAX_ROWS + 2), 1)
    ]


def _check_merged(openpyxl: Any, content: bytes, name: str) -> None:
    """Raise FaultyTableError with the merged areas where they have too many cells to be opened."""
    faults, merged = Faults(name), 0
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        for sheet in packed.namelist():
            if not sheet.startswith("xl/worksheets/") or not sheet.endswith(".xml"):
                continue
            with packed.open(sheet) as stream:
                for _, element in ElementTree.iterparse(stream):  # noqa: S314 - as openpyxl does
                    if element.tag.endswith("}mergeCell"):
                        area = element.get("ref", "")
                        left, top, right, bottom = openpyxl.utils.range_boundaries(area)
                        merged += (right - left + 1) * (bottom - top + 1)
                        faults.add(top, str(left), Wording(MERGED, area=area))
                    element.clear()
    if merged > MAX_MERGED:
        faults.check()


def _xlsx_value(cell: Any) -> AnyCell:
    value = cell.value
    if value is None:
        return ""
    if cell.data_type == "f":
        return Unusable(Wording("a formula: paste it as a value"))
    if cell.data_type == "e":
        return Unusable(Wording("the error {value}: enter the reading", value=value))
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return Unusable(
            Wording(
                "{value} is a date or a truth value: format the cell as text or number", value=value
            )
        )
    return value.strip() if isinstance(value, str) else float(value)
