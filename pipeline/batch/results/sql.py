"""SQL queries of the user: read-only."""

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
REACHING = ("load_extension", "fts3_tokenizer")  # code from a file, or an address in memory
TABLES = "captures, wheels, quantities, calibrations"
STEPS = 100_000  # instructions of SQLite between two checks for Ctrl-C


@dataclass(frozen=True)
class Answer:
    """Column names and rows, the rows as an iterator."""

    columns: tuple[str, ...]
    rows: Iterator[tuple[object, ...]]


def ask(catalogue: Catalogue, question: str) -> Answer:
    """Run one SELECT. Raises InputError for any other statement and for SQL errors.

    The file is opened read-only, and SQLite's authorizer denies everything but reading: no
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
        raise InputError(f"--sql: the statement returns nothing: write a SELECT from {TABLES}")
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


def _allowed(action: int, _: str | None, function: str | None, *__: str | None) -> int:
    denied = action not in READING or (action == sqlite3.SQLITE_FUNCTION and function in REACHING)
    return sqlite3.SQLITE_DENY if denied else sqlite3.SQLITE_OK


def _refused(error: Exception) -> InputError:
    if "not authorized" in str(error):
        return InputError(f"--sql: read-only: write a SELECT from {TABLES}")
    return InputError(f"--sql: {error}: check the statement; the tables are {TABLES}")
