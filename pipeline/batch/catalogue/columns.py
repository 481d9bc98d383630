"""Numbers of all captures, column by column: one quantity is read without the others.

Captures are divided into parts by the first two digits of their keys, so that an update renews only
the parts in which a result changed.
"""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ...vectors import Array
from ...vehicle import REFERENCE_WHEELS

# ids, days: of the captures of a part, in the order of their keys. numbers: their values, then
# their u, nan where not measured. Little-endian, 64 bits each.
TABLES = """
CREATE TABLE kinds(kind_id INTEGER PRIMARY KEY, kind TEXT NOT NULL, unit TEXT NOT NULL);
CREATE TABLE parts(part INTEGER PRIMARY KEY, ids BLOB NOT NULL, days BLOB NOT NULL);
CREATE TABLE columns(
  kind_id INTEGER NOT NULL, part INTEGER NOT NULL, numbers BLOB NOT NULL,
  PRIMARY KEY(kind_id, part)) WITHOUT ROWID;
"""
SHIFT = 52  # of the 60 bits of a capture's number, to that of its part
ANGLES = ("toe", "camber")
QUANTITY = "SELECT id, value, u FROM quantity_rows WHERE kind_id = ? AND id BETWEEN ? AND ?"
WHEELS = """
SELECT name, id, toe_deg, u_toe_deg, camber_deg, u_camber_deg FROM wheel_rows
WHERE id BETWEEN ? AND ? AND role = 'reference' ORDER BY id, place
"""
Numbers = npt.NDArray[np.int64]
Cells = Sequence[tuple[int, float | None, float | None]]  # of a column: capture, value, u


@lru_cache(maxsize=4096)
def kind_id(kind: str, unit: str) -> int:
    """Return the number of a quantity, the same in every catalogue."""
    return zlib.crc32(f"{kind} {unit}".encode())


def renew_columns(connection: sqlite3.Connection, numbers: Iterable[int]) -> None:
    """Write the parts of these captures anew, from the rows of all captures in them."""
    for part in sorted({number >> SHIFT for number in numbers}):
        connection.execute("DELETE FROM parts WHERE part = ?", (part,))
        connection.execute(
            "DELETE FROM columns WHERE part = ? AND kind_id IN (SELECT kind_id FROM kinds)", (part,)
        )
        _write_part(connection, part)


def _write_part(connection: sqlite3.Connection, part: int) -> None:
    span = part << SHIFT, (part + 1 << SHIFT) - 1
    rows = connection.execute(
        "SELECT id, day FROM captures WHERE id BETWEEN ? AND ? ORDER BY id", span
    ).fetchall()
    if not rows:
        return
    numbers, dates = zip(*rows, strict=True)
    ids, days = np.array(numbers, "<i8"), np.array(dates, "<f8")
    connection.execute("INSERT INTO parts VALUES (?, ?, ?)", (part, ids.tobytes(), days.tobytes()))
    columns = _angles(connection, span)
    for (kind,) in connection.execute("SELECT kind_id FROM kinds ORDER BY kind_id").fetchall():
        cells = columns.get(kind) or connection.execute(QUANTITY, (kind, *span)).fetchall()
        if cells:
            numbers, values, u = zip(*cells, strict=True)
            column = np.full((2, len(ids)), np.nan, "<f8")
            at = np.searchsorted(ids, np.array(numbers, np.int64))
            column[:, at] = np.array((values, u), float)
            row = kind, part, column.tobytes()
            connection.execute("INSERT INTO columns VALUES (?, ?, ?)", row)


def _angles(connection: sqlite3.Connection, span: tuple[int, int]) -> dict[int, Cells]:
    """Return the cells of the reference wheels' angles, by the quantity, and enter its name."""
    found: dict[str, list[tuple[Any, ...]]] = {}
    for wheel, *row in connection.execute(WHEELS, span):
        found.setdefault(wheel, []).append(tuple(row))
    columns: dict[int, Cells] = {}
    for wheel in REFERENCE_WHEELS:
        for at, angle in enumerate(ANGLES):
            name = f"{wheel} {angle}"
            cells = [(row[0], *row[1 + 2 * at : 3 + 2 * at]) for row in found.get(wheel, ())]
            if cells:
                kind = kind_id(name, "deg")
                columns[kind] = cells
                row = kind, name, "deg"
                connection.execute("INSERT OR IGNORE INTO kinds VALUES (?, ?, ?)", row)
    return columns


def captures_of(connection: sqlite3.Connection) -> tuple[Numbers, Array]:
    """Return the numbers (N,) of all captures, ascending, and their days (N,), nan if undated."""
    rows = connection.execute("SELECT ids, days FROM parts ORDER BY part").fetchall()
    ids = np.frombuffer(b"".join(ids for ids, _ in rows), "<i8")
    return ids, np.frombuffer(b"".join(days for _, days in rows), "<f8")


def column_of(connection: sqlite3.Connection, name: str, unit: str, ids: Numbers) -> Array:
    """Return values and u (2, N) of a quantity, of all captures; nan where not measured.

    ids: those of `captures_of`.
    """
    column, filled = np.empty((2, len(ids))), 0
    rows = connection.execute(
        "SELECT part, numbers FROM columns WHERE kind_id = ? ORDER BY part", (kind_id(name, unit),)
    )
    for part, numbers in rows:
        cells = np.frombuffer(numbers, "<f8").reshape(2, -1)
        start = int(np.searchsorted(ids, part << SHIFT))
        column[:, filled:start] = np.nan
        filled = start + cells.shape[1]
        column[:, start:filled] = cells
    column[:, filled:] = np.nan
    return column
