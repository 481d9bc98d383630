"""A user's own question to the catalogue: reading, and nothing else."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass

from ...errors import InputError
from ..catalogue.catalogue import Catalogue

READING = {
    sqlite3.SQLITE_SELECT,
    sqlite3.SQLITE_READ,
    sqlite3.SQLITE_FUNCTION,
    sqlite3.SQLITE_RECURSIVE,
}
TABLES = "captures, wheels, quantities"
STEPS = 100_000  # of SQLite's machine between two looks whether the user interrupted


@dataclass(frozen=True)
class Answer:
    """Names of the columns, and the rows as they come."""

    columns: tuple[str, ...]
    rows: Iterator[tuple[object, ...]]


def ask(catalogue: Catalogue, question: str) -> Answer:
    """Run one SELECT. Raises InputError for anything else, and for what SQLite cannot make out.

    The file is open for reading only, and SQLite itself refuses every act but reading it: no
    ATTACH, no PRAGMA, no extension.
    """
    connection = catalogue.connection
    connection.set_authorizer(_allowed)
    connection.set_progress_handler(lambda: 0, STEPS)
    try:
        cursor = connection.execute(question)
    except (sqlite3.Error, sqlite3.Warning) as error:
        raise _refused(error) from error
    if cursor.description is None:
        raise InputError(f"--sql: that asks nothing: write a SELECT from {TABLES}")
    return Answer(tuple(column[0] for column in cursor.description), _rows(cursor))


def _rows(cursor: sqlite3.Cursor) -> Iterator[tuple[object, ...]]:
    while True:
        try:
            row = next(cursor, None)
        except sqlite3.Error as error:
            raise _refused(error) from error
        if row is None:
            return
        yield row


def _allowed(act: int, *_: str | None) -> int:
    return sqlite3.SQLITE_OK if act in READING else sqlite3.SQLITE_DENY


def _refused(error: Exception) -> InputError:
    if "not authorized" in str(error):
        return InputError(f"--sql: only reading is allowed: write a SELECT from {TABLES}")
    return InputError(f"--sql: {error}: see to the statement; there are {TABLES}")
