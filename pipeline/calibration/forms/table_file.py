"""Tables that people fill in, CSV or XLSX: their cells by row and column, with all faults."""

from __future__ import annotations

import csv
import difflib
import importlib
import io
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError, MissingDependencyError

Cell = str | float
MAX_BYTES, MAX_UNPACKED, MAX_ROWS = 16 << 20, 256 << 20, 20_000
DELIMITERS = (";", ",", "\t")


@dataclass(frozen=True)
class Row:
    """Row of a table: its number in the file, from 1, and its cells that are not empty."""

    number: int
    cells: dict[str, Cell]

    def text(self, column: str) -> str:
        """Return a cell as text, a whole number without decimals; "" where it is empty."""
        cell = self.cells.get(column, "")
        whole = isinstance(cell, float) and cell.is_integer()
        return str(int(cell)) if whole else str(cell)


class FaultyTableError(InputError):
    """A table with faults, each one line: file, row, column, fact and what to do."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = tuple(faults)


class Faults:
    """Collector of the faults of one file."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.found: list[str] = []

    def add(self, row: int | None, column: str | None, fact: str) -> None:
        """Note a fault at a row and column."""
        places = [f"row {row}"] * (row is not None) + [f"column {column}"] * (column is not None)
        self.found.append(": ".join([self.name, *([", ".join(places)] if places else []), fact]))

    def check(self) -> None:
        """Raise FaultyTableError where there are any."""
        if self.found:
            raise FaultyTableError(self.found)


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
        raise InputError(f"{path}: cannot be read: {error.strerror}: check the path") from error
    if content is None:
        raise InputError(f"{path}: it is larger than {MAX_BYTES >> 20} MB: give readings only")
    known = (*required, *optional)
    if content.startswith(b"PK\x03\x04"):
        grid = _xlsx_cells(content, faults)
    else:
        grid = _csv_cells(content, known, faults)
    return _rows(grid, required, known, faults)


def _rows(
    grid: Iterable[tuple[int, list[Cell]]],
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
    names = [str(head).strip().casefold() for head in heads]
    for name in dict.fromkeys(names):
        if name and name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            faults.add(top, name, f"unknown column: {hint}known are {', '.join(known)}")
        elif name and names.count(name) > 1:
            faults.add(top, name, "the heading has it twice: leave out one")
    for name in required:
        if name not in names:
            faults.add(top, name, "the heading lacks it: add the column")
    faults.check()
    found = []
    for number, cells in below:
        for index, cell in enumerate(cells[len(names) :], len(names) + 1):
            if cell != "":
                hint = "in a table separated by commas, put values with a decimal comma in quotes"
                faults.add(number, str(index), f"{cell!r} stands beyond the heading: {hint}")
        named = zip(names, cells, strict=False)
        found.append(Row(number, {name: cell for name, cell in named if name and cell != ""}))
    return found


def _csv_cells(
    content: bytes, known: Sequence[str], faults: Faults
) -> list[tuple[int, list[Cell]]]:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{faults.name}: not UTF-8 text ({error}): save it as CSV UTF-8, or as XLSX"
        ) from error
    if "\0" in text:
        raise InputError(f"{faults.name}: not text: save the table as CSV UTF-8, or as XLSX")
    heading = next((line for line in text.splitlines() if line.strip(" ;,\t")), "")
    fits = [
        sum(part.strip(' "').casefold() in known for part in heading.split(d)) for d in DELIMITERS
    ]
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=DELIMITERS[fits.index(max(fits))], strict=True
    )
    found: list[tuple[int, list[Cell]]] = []
    start = 1
    try:
        for cells in reader:
            found.append((start, [cell.strip() for cell in cells]))
            start = reader.line_num + 1
    except csv.Error as error:
        raise InputError(f"{faults.name}: row {start}: {error}: check its quotes") from error
    return found


def _xlsx_cells(content: bytes, faults: Faults) -> list[tuple[int, list[Cell]]]:
    """Return the cells of the only sheet with content; formulas and merged cells are faults."""
    try:
        openpyxl: Any = importlib.import_module("openpyxl")
    except ImportError as error:
        raise MissingDependencyError(
            f"{faults.name}: openpyxl, which reads XLSX, is not installed: run pip install "
            "'wheelplane[tables]', or save the table as CSV"
        ) from error
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            unpacked = sum(entry.file_size for entry in packed.infolist())
        if unpacked > MAX_UNPACKED:
            raise InputError(
                f"{faults.name}: it unpacks to {unpacked >> 20} MB: give readings only"
            )
        book = openpyxl.load_workbook(io.BytesIO(content))
    except InputError:
        raise
    except Exception as error:  # openpyxl raises whatever its parsers raise
        raise InputError(
            f"{faults.name}: not a readable XLSX file ({error}): save it again, or as CSV"
        ) from error
    sheets = [sheet for sheet in book.worksheets if sheet.max_row > 1]
    if len(sheets) != 1:
        raise InputError(
            f"{faults.name}: {len(sheets)} sheets have content: keep the readings in one"
        )
    (sheet,) = sheets
    for merged in sheet.merged_cells.ranges:
        place = f"{merged.min_row}-{merged.max_row}"
        faults.add(None, None, f"rows {place}: {merged} are merged: unmerge and fill in each cell")
    return [
        (number, [_xlsx_value(cell, faults) for cell in cells])
        for number, cells in enumerate(sheet.iter_rows(max_row=MAX_ROWS + 2), 1)
    ]


def _xlsx_value(cell: Any, faults: Faults) -> Cell:
    value = cell.value
    if value is None:
        return ""
    where = (cell.row, getattr(cell, "column_letter", None))
    if cell.data_type == "f":
        faults.add(*where, "a formula: paste it as a value")
        return ""
    if cell.data_type == "e":
        faults.add(*where, f"the error {value}: enter the reading")
        return ""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        faults.add(*where, f"{value} is a date or a truth value: format the cell as text or number")
        return ""
    return value.strip() if isinstance(value, str) else float(value)
