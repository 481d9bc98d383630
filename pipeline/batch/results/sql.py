"""SQL queries of the user: read-only."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator

from ...errors import InputError
from ...system import frozen
from ..catalogue.catalogue import Catalogue

READING = {
    sqlite3.SQLITE_SELECT,
    sqlite3.SQLITE_READ,
    sqlite3.SQLITE_FUNCTION,
    sqlite3.SQLITE_RECURSIVE,
}
REACHING = ("load_extension", "fts3_tokenizer")  # code from a file, or an address in memory
TABLES = "captures, wheels, quantities, calibrations"
STEPS = 100_000  # instructions of SQLite between two checks for signals


@frozen
class Answer:
    """Column names and rows, the rows as an iterator."""

    columns: tuple[str, ...]
    rows: Iterator[tuple[object, ...]]


def ask(catalogue: Catalogue, question: str) -> Answer:
    """Run one SELECT. Raises InputError for any other statement and for SQL errors.

    The file is opened read-only, and SQLite's authorizer denies everything but reading: no
    ATTACH, no PRAGMA, no extension. What a signal raises, as at Ctrl-C, ends the query.
    """
    connection, raised = catalogue.connection, list[BaseException]()
    connection.set_authorizer(_allowed)
    connection.set_progress_handler(_watch(raised).__next__, STEPS)
    try:
        cursor = connection.execute(question)
    except (sqlite3.Error, sqlite3.Warning) as error:
        raise _cause(error, raised) from error
    if cursor.description is None:
        raise InputError(f"--sql: the statement returns nothing: write a SELECT from {TABLES}")
    return Answer(tuple(column[0] for column in cursor.description), _rows(cursor, raised))


def _watch(raised: list[BaseException]) -> Iterator[int]:
    """Yield 0 each time that SQLite asks; keep what a signal raises here, which SQLite drops."""
    try:
        while True:
            yield 0
    except BaseException as error:
        raised.append(error)
        raise


def _rows(cursor: sqlite3.Cursor, raised: list[BaseException]) -> Iterator[tuple[object, ...]]:
    while True:
        try:
            row = next(cursor, None)
        except sqlite3.Error as error:
            raise _cause(error, raised) from error
        if row is None:
            return
        yield row


def _allowed(action: int, _: str | None, function: str | None, *__: str | None) -> int:
    denied = action not in READING or (action == sqlite3.SQLITE_FUNCTION and function in REACHING)
    return sqlite3.SQLITE_DENY if denied else sqlite3.SQLITE_OK


def _cause(error: Exception, raised: list[BaseException]) -> BaseException:
    if raised:
        return raised[0]
    if "not authorized" in str(error):
        return InputError(f"--sql: read-only: write a SELECT from {TABLES}")
    return InputError(f"--sql: {error}: check the statement; the tables are {TABLES}")
