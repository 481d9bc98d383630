"""Tables of catalogue.sqlite, and writing of records into them."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path

from ...errors import InputError
from .calibration_row import TABLE as CALIBRATIONS
from .columns import TABLES as COLUMNS
from .columns import kind_id
from .rows import CaptureRow, Record, WheelRow

APPLICATION = 0x77706C09  # "wpl" and a number to raise with every change of the tables
KEY_DIGITS = 15  # of the key make the row's number: 60 bits, in the order of the keys
CAPTURE_COLUMNS = tuple(field.name for field in fields(CaptureRow))
WHEEL_COLUMNS = tuple(field.name for field in fields(WheelRow))
KEY = "(SELECT key FROM captures AS c WHERE c.id = w.id) AS key"  # looked up only where it is asked

TABLES = f"""
CREATE TABLE captures(
  id INTEGER PRIMARY KEY, key TEXT NOT NULL, name TEXT NOT NULL, kind TEXT NOT NULL,
  vehicle TEXT NOT NULL, date TEXT, day REAL, status TEXT NOT NULL, stage TEXT NOT NULL,
  reason TEXT NOT NULL, wheels INTEGER NOT NULL, wheels_ok INTEGER NOT NULL,
  points_total INTEGER NOT NULL, version TEXT NOT NULL, config_sha256 TEXT NOT NULL,
  vertical TEXT NOT NULL, doubted INTEGER NOT NULL, scans INTEGER, size INTEGER NOT NULL,
  md5 TEXT NOT NULL);
CREATE INDEX captures_by_name ON captures(name);
CREATE INDEX captures_by_status ON captures(status, name);
CREATE INDEX captures_by_day ON captures(day, status);
CREATE INDEX captures_by_vehicle ON captures(vehicle, status);
CREATE INDEX captures_by_vertical ON captures(vertical, status);
CREATE INDEX captures_in_doubt ON captures(id) WHERE doubted;
CREATE TABLE wheel_rows(
  id INTEGER NOT NULL, place INTEGER NOT NULL, name TEXT NOT NULL, role TEXT NOT NULL, wheel TEXT,
  status TEXT NOT NULL, toe_deg REAL, camber_deg REAL, u_toe_deg REAL, u_camber_deg REAL,
  points_on_target INTEGER, plane_rms_m REAL, PRIMARY KEY(id, place)) WITHOUT ROWID;
CREATE TABLE quantity_rows(
  kind_id INTEGER NOT NULL, id INTEGER NOT NULL, value REAL, u REAL,
  PRIMARY KEY(kind_id, id)) WITHOUT ROWID;
{COLUMNS}CREATE VIEW wheels AS SELECT {KEY}, {", ".join(f"w.{name}" for name in WHEEL_COLUMNS)}
  FROM wheel_rows AS w;
CREATE VIEW quantities AS SELECT {KEY}, k.kind, value, u, unit
  FROM kinds AS k CROSS JOIN quantity_rows AS w USING(kind_id);
{CALIBRATIONS}
PRAGMA application_id = {APPLICATION};
"""  # noqa: S608


def create(path: Path) -> sqlite3.Connection:
    """Create an empty catalogue."""
    connection = open_draft(path)
    connection.executescript(TABLES)
    return connection


def open_draft(path: Path) -> sqlite3.Connection:
    """Open a draft for fast writing, without protection against a crash."""
    connection = sqlite3.connect(path, isolation_level=None)
    connection.executescript("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;")
    return connection


def number_of(key: str) -> int:
    """Return the row number of a key."""
    return int(key[:KEY_DIGITS], 16)


def identity(key: str) -> tuple[int, str]:
    """Return row number and key, by which a text is looked up that need not be a key."""
    try:
        return number_of(key), key
    except ValueError:
        return -1, key


def put(connection: sqlite3.Connection, records: Iterable[Record]) -> int:
    """Insert or replace records and return how many differed from those before.

    Raises InputError if two keys share their first KEY_DIGITS (at a million results: once in
    2,000,000).
    """
    kinds: set[int] = set()
    return sum(_put(connection, record, kinds) for record in records)


def _put(connection: sqlite3.Connection, record: Record, kinds: set[int]) -> bool:
    """Put one record. kinds: quantities that are entered already."""
    key, number = record.capture.key, number_of(record.capture.key)
    present = connection.execute("SELECT key, md5 FROM captures WHERE id = ?", (number,)).fetchone()
    if present == (key, record.capture.md5):
        return False
    if present is not None and present[0] != key:
        raise InputError(f"keys {present[0]} and {key} collide: move one to another folder")
    if present is not None:
        drop(connection, [number])
    marks = ", ".join("?" * (1 + len(CAPTURE_COLUMNS)))
    columns = ", ".join(("id", *CAPTURE_COLUMNS))
    connection.execute(
        f"INSERT INTO captures({columns}) VALUES ({marks})",  # noqa: S608
        (number, *vars(record.capture).values()),
    )
    connection.executemany(
        f"INSERT INTO wheel_rows VALUES ({', '.join('?' * (2 + len(WHEEL_COLUMNS)))})",  # noqa: S608
        [(number, place, *vars(wheel).values()) for place, wheel in enumerate(record.wheels)],
    )
    quantities = [(kind_id(q.kind, q.unit), q) for q in record.quantities]
    new = [(kind, q.kind, q.unit) for kind, q in quantities if kind not in kinds]
    if new:
        connection.executemany("INSERT OR IGNORE INTO kinds VALUES (?, ?, ?)", new)
        kinds.update(kind for kind, *_ in new)
    connection.executemany(
        "INSERT OR REPLACE INTO quantity_rows VALUES (?, ?, ?, ?)",
        [(kind, number, q.value, q.u) for kind, q in quantities],
    )
    if record.calibration is not None:
        cells = (number, *vars(record.calibration).values())
        marks = ", ".join("?" * len(cells))
        connection.execute(f"INSERT INTO calibration_rows VALUES ({marks})", cells)  # noqa: S608
    return True


def drop(connection: sqlite3.Connection, numbers: Iterable[int]) -> None:
    """Delete captures."""
    for number in numbers:
        connection.execute("DELETE FROM captures WHERE id = ?", (number,))
        connection.execute("DELETE FROM wheel_rows WHERE id = ?", (number,))
        connection.execute("DELETE FROM calibration_rows WHERE id = ?", (number,))
        connection.execute(
            "DELETE FROM quantity_rows WHERE id = ? AND kind_id IN (SELECT kind_id FROM kinds)",
            (number,),
        )
