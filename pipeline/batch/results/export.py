"""Export of the catalogue as a table: CSV, Excel, Parquet; byte-identical for equal tables."""

from __future__ import annotations

import csv
import importlib
import io
import math
import re
import shutil
import tempfile
import uuid
import zipfile
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import numpy.typing as npt

from ...errors import InputError, MissingDependencyError
from ..catalogue.catalogue import Catalogue
from ..catalogue.rows import CaptureRow
from ..catalogue.schema import CAPTURE_COLUMNS, number_of
from ..storage.entry import PARTIAL
from .query import ALL, Filter, captures
from .series import series

ExportColumns = dict[str, npt.NDArray[Any]]
Cell = str | float | int | None
LEFT_OUT = ("day", "scans", "size", "md5")
COUNTS = ("wheels", "wheels_ok", "points_total", "doubted")
PARQUET = {"O": "VARCHAR", "i": "BIGINT", "f": "DOUBLE"}  # by the kind of a column's dtype
FORMULA = ("=", "+", "-", "@", "\t", "\r")
EXCEL_ROWS, EXCEL_CHARACTERS = 1_048_576, 32_767
EPOCH = (1980, 1, 1, 0, 0, 0)


def table(catalogue: Catalogue, which: Filter = ALL) -> ExportColumns:
    """Build columns (N,) by name: the fields of each capture, then every quantity and its u.

    Names end in the unit: RR_toe_deg, u_RR_toe_deg, wheelbase_m ...; nan where not measured.
    """
    rows = list(captures(catalogue, which))
    columns = {name: _column(name, rows) for name in CAPTURE_COLUMNS if name not in LEFT_OUT}
    numbers = np.array([number_of(row.key) for row in rows], np.int64)
    order = np.argsort(numbers)
    for one in series(catalogue, None, which, in_doubt=True):
        name = f"{one.quantity.replace(' ', '_')}_{one.unit}"
        indices = order[np.searchsorted(numbers[order], one.numbers)]
        for column, values in ((name, one.values), (f"u_{name}", one.u)):
            columns[column] = np.full(len(rows), np.nan)
            columns[column][indices] = values
    return columns


def _column(name: str, rows: list[CaptureRow]) -> npt.NDArray[Any]:
    return np.array([getattr(row, name) for row in rows], np.int64 if name in COUNTS else object)


def export(
    path: Path, columns: ExportColumns, write: Callable[[Path, ExportColumns], None]
) -> None:
    """Write a table, completely or not at all, by one of the writers below. Raises InputError.

    What is no regular file, such as /dev/stdout or a pipe, is written to, never replaced.
    """
    is_special = path.exists() and not path.is_file()
    folder = Path(tempfile.gettempdir()) if is_special else path.parent
    temporary = folder / f"{PARTIAL}-{uuid.uuid4().hex}{path.suffix}"
    try:
        write(temporary, columns)
        if is_special:
            with temporary.open("rb") as whole, path.open("wb") as stream:
                shutil.copyfileobj(whole, stream)
        else:
            temporary.replace(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}): give another file"
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_csv(path: Path, columns: ExportColumns) -> None:
    """Write RFC 4180 in UTF-8; a text that a spreadsheet would run as a formula is quoted by '."""
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as stream:
        _write_csv(stream, columns)


def as_csv(columns: ExportColumns) -> bytes:
    """Return the content that `write_csv` writes."""
    text = io.StringIO(newline="")
    _write_csv(text, columns)
    return text.getvalue().encode("utf-8", "backslashreplace")


def _write_csv(stream: TextIO, columns: ExportColumns) -> None:
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    for row in _rows(columns):
        writer.writerow([_escaped_formula(cell) for cell in row])


def write_xlsx(path: Path, columns: ExportColumns) -> None:
    """Write one sheet, texts never as formulas. Raises InputError beyond Excel's rows."""
    try:
        openpyxl: Any = importlib.import_module("openpyxl")
    except ImportError as error:
        raise _missing("openpyxl") from error
    count = len(next(iter(columns.values())))
    if count >= EXCEL_ROWS:
        raise InputError(
            f"--xlsx: {count:,} captures exceed the {EXCEL_ROWS - 1:,} rows of Excel below the "
            "heading: filter them, or use --csv or --parquet"
        )
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("captures")
    sheet.freeze_panes = "B2"
    sheet.append(list(columns))
    cell_type = importlib.import_module("openpyxl.cell").WriteOnlyCell
    for row in _rows(columns):
        sheet.append([_excel(cell_type, sheet, cell) for cell in row])
    raw = io.BytesIO()
    book.save(raw)
    _without_dates(raw, path)


def write_parquet(path: Path, columns: ExportColumns) -> None:
    """Write by duckdb: texts, 64-bit integers and floats, null where not measured; zstd.

    A column has the same type whatever is in it, so that the files of many results are read as one
    table. Raises OSError where the file cannot be written.
    """
    try:
        duckdb: Any = importlib.import_module("duckdb")
    except ImportError as error:
        raise _missing("duckdb") from error
    masked = {
        name: np.ma.masked_invalid(column) if column.dtype == np.float64 else column
        for name, column in columns.items()
    }
    typed = ", ".join(_typed(name, column) for name, column in columns.items())
    quoted = str(path).replace("'", "''")
    form = "FORMAT parquet, COMPRESSION zstd"
    with duckdb.connect(config={"threads": 1}) as connection:
        connection.register("captures", masked)
        try:
            connection.execute(f"COPY (SELECT {typed} FROM captures) TO '{quoted}' ({form})")  # noqa: S608
        except duckdb.IOException as error:
            raise OSError(None, str(error).rpartition(": ")[2]) from error


def _typed(name: str, column: npt.NDArray[Any]) -> str:
    """Return the SQL of a column with its type."""
    quoted = name.replace('"', '""')
    return f'CAST("{quoted}" AS {PARQUET[column.dtype.kind]}) AS "{quoted}"'


def _rows(columns: ExportColumns) -> Iterator[list[Cell]]:
    count = len(next(iter(columns.values())))
    for start in range(0, count, 10_000):
        block = [column[start : start + 10_000].tolist() for column in columns.values()]
        for row in zip(*block, strict=True):
            yield [None if isinstance(x, float) and math.isnan(x) else x for x in row]


def _escaped_formula(cell: Cell) -> Cell:
    """Escape formulas; see https://owasp.org/www-community/attacks/CSV_Injection."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def _excel(cell_type: Any, sheet: Any, value: Cell) -> Any:
    if not isinstance(value, str):
        return value
    text = "".join(c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in value)
    if len(text) > EXCEL_CHARACTERS:
        text = f"{text[: EXCEL_CHARACTERS - 1]}…"
    cell = cell_type(sheet, text)
    cell.data_type = "s"
    return cell


def _without_dates(raw: io.BytesIO, path: Path) -> None:
    """Rewrite a workbook with fixed time stamps."""
    fixed = datetime(*EPOCH, tzinfo=UTC).strftime("%Y-%m-%dT%H:%M:%SZ").encode()
    with zipfile.ZipFile(raw) as before, zipfile.ZipFile(path, "w") as after:
        for name in before.namelist():
            content = before.read(name)
            if name == "docProps/core.xml":
                content = re.sub(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", fixed, content)
            after.writestr(zipfile.ZipInfo(name, EPOCH), content, zipfile.ZIP_DEFLATED)


def _missing(name: str) -> MissingDependencyError:
    return MissingDependencyError(f"{name} is not installed: run pip install 'wheelplane[tables]'")
