"""Queries of a catalogue: captures by filter, failures and their reasons, quantities."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import date
from typing import Literal

import numpy as np

from ...errors import InputError, printable
from ...system import frozen
from ...vehicle import REFERENCE_WHEELS
from ..catalogue.catalogue import Catalogue
from ..catalogue.columns import ANGLES, Numbers, captures_of, column_of
from ..catalogue.history import read_removed
from ..catalogue.rows import CaptureRow, QuantityRow, WheelRow
from ..catalogue.schema import CAPTURE_COLUMNS, WHEEL_COLUMNS, identity

Order = Literal["name", "date", "vehicle", "status"]


@frozen
class ValueRange:
    """Range of a quantity, such as "RR toe" or "rear_total_toe", in its unit."""

    quantity: str
    low: float = float("-inf")
    high: float = float("inf")


@frozen
class Filter:
    """Filter of captures; all given conditions must hold.

    text: part of the capture's name; vehicle: its complete name; since_day, until_day: days since
    1970-01-01, since_day included, until_day excluded; status: any of these; removed: whether the
    capture was missing from the archive at the last run; vertical: from which its cambers are.
    since_date, until_date: first and last date in ISO 8601, by the clock of each capture.
    """

    text: str = ""
    vehicle: str | None = None
    since_day: float | None = None
    until_day: float | None = None
    status: tuple[str, ...] = ()
    ranges: tuple[ValueRange, ...] = ()
    removed: bool | None = None
    vertical: str | None = None
    since_date: str | None = None
    until_date: str | None = None


ALL = Filter()
MEASURED = ("ok", "part")  # statuses of captures that have angles
MOST = 2**63 - 1  # SQLite's largest number
FEW = 0.1  # of all captures, of which each is looked up
REFERENCE_ANGLES = tuple(f"{wheel} {angle}" for wheel in REFERENCE_WHEELS for angle in ANGLES)


@frozen
class FailureGroup:
    """Captures not measured in full, for reasons that are equal except for numbers."""

    status: str
    stage: str
    reason: str
    count: int
    examples: tuple[str, ...]


def count(catalogue: Catalogue, which: Filter = ALL) -> int:
    """Count the captures."""
    where, values = condition(catalogue, which)
    found = catalogue.connection.execute(f"SELECT count(*) FROM captures AS c {where}", values)  # noqa: S608
    return int(found.fetchone()[0])


def by_status(catalogue: Catalogue, which: Filter = ALL) -> dict[str, int]:
    """Count the captures of each status, by its name."""
    found: dict[str, int] = {}
    for (_, status), number in _counts(catalogue, which).items():
        found[status] = found.get(status, 0) + number
    return dict(sorted(found.items()))


def verticals(catalogue: Catalogue, which: Filter = ALL) -> dict[str, int]:
    """Count the captures by the vertical of their cambers, those without any left out."""
    found: dict[str, int] = {}
    for (vertical, _), number in _counts(catalogue, which).items():
        found[vertical] = found.get(vertical, 0) + number
    return {vertical: number for vertical, number in sorted(found.items()) if vertical}


def doubted(catalogue: Catalogue, which: Filter = ALL) -> int:
    """Count the captures in doubt, which statistics leave out."""
    where, values = condition(catalogue, which)
    counted = f"SELECT count(*) FROM captures AS c {where or 'WHERE TRUE'} AND c.doubted"  # noqa: S608
    return int(catalogue.connection.execute(counted, values).fetchone()[0])


def example_in_doubt(catalogue: Catalogue) -> tuple[str, str] | None:
    """Return name and note of the first capture in doubt by name; None without one."""
    question = "SELECT name, reason FROM captures WHERE doubted ORDER BY name, id LIMIT 1"
    row: tuple[str, str] | None = catalogue.connection.execute(question).fetchone()
    return row


def removed(catalogue: Catalogue, which: Filter = ALL) -> int:
    """Count the captures no longer in the archive, unless the filter asks about these."""
    return 0 if which.removed is not None else count(catalogue, replace(which, removed=True))


def copies(catalogue: Catalogue, which: Filter = ALL) -> int:
    """Count the measured captures that are of the same files as another one, but for the first."""
    where, values = condition(catalogue, replace(which, status=which.status or MEASURED))
    counted = "SELECT count(c.scans) - count(DISTINCT c.scans) FROM captures AS c"
    row = catalogue.connection.execute(f"{counted} {where} AND NOT c.doubted", values)
    return int(row.fetchone()[0])


def _counts(catalogue: Catalogue, which: Filter) -> dict[tuple[str, str], int]:
    """Count the captures by vertical and status, once for all questions about them."""
    if which not in catalogue.kept:
        where, values = condition(catalogue, which)
        rows = catalogue.connection.execute(
            f"SELECT vertical, status, count(*) FROM captures AS c {where} "  # noqa: S608
            "GROUP BY vertical, status",
            values,
        )
        catalogue.kept[which] = {(vertical, status): number for vertical, status, number in rows}
    found: dict[tuple[str, str], int] = catalogue.kept[which]
    return found


def captures(
    catalogue: Catalogue,
    which: Filter = ALL,
    order: Order = "name",
    limit: int | None = None,
    offset: int = 0,
) -> Iterator[CaptureRow]:
    """Yield captures in order, then by name; `limit` and `offset` select a page."""
    where, values = condition(catalogue, which)
    rows = catalogue.connection.execute(
        f"SELECT {', '.join(CAPTURE_COLUMNS)} FROM captures AS c {where} "  # noqa: S608
        f"ORDER BY {ORDERS[order]}name, id LIMIT ? OFFSET ?",
        (*values, min(limit or MOST, MOST), offset),
    )
    return (CaptureRow(*row) for row in rows)


ORDERS = {"name": "", "date": "day, ", "vehicle": "vehicle, ", "status": "status, "}


def capture_of(catalogue: Catalogue, key: str) -> CaptureRow | None:
    """Return one capture by its key, None if there is none."""
    columns = f"SELECT {', '.join(CAPTURE_COLUMNS)} FROM captures WHERE id = ? AND key = ?"  # noqa: S608
    row = catalogue.connection.execute(columns, identity(key)).fetchone()
    return None if row is None else CaptureRow(*row)


def wheels_of(catalogue: Catalogue, key: str) -> tuple[WheelRow, ...]:
    """Return the wheels and trials of a capture, in the order of its JSON."""
    rows = catalogue.connection.execute(
        f"SELECT {', '.join(f'w.{name}' for name in WHEEL_COLUMNS)} FROM wheel_rows AS w "  # noqa: S608
        "JOIN captures AS c USING(id) WHERE c.id = ? AND key = ? ORDER BY place",
        identity(key),
    )
    return tuple(WheelRow(*row) for row in rows)


def quantities_of(catalogue: Catalogue, key: str) -> tuple[QuantityRow, ...]:
    """Return the vehicle quantities of a capture, by name."""
    rows = catalogue.connection.execute(
        "SELECT k.kind, value, u, unit FROM kinds AS k CROSS JOIN quantity_rows AS q "
        "USING(kind_id) JOIN captures AS c USING(id) WHERE q.id = ? AND key = ? ORDER BY k.kind",
        identity(key),
    )
    return tuple(QuantityRow(*row) for row in rows)


def failures(
    catalogue: Catalogue, which: Filter = ALL, examples: int = 3
) -> tuple[FailureGroup, ...]:
    """Group the failures, the most frequent first; examples: number of capture names in each.

    A damaged result, which names no capture, is called by its key.
    """
    where, values = condition(catalogue, which)
    rows = catalogue.connection.execute(
        f"SELECT status, stage, reason, name, key FROM captures AS c {where or 'WHERE TRUE'} "  # noqa: S608
        "AND (status < 'ok' OR status > 'ok') ORDER BY +name, id",  # by the status, unlike <>
        values,
    )
    groups: dict[tuple[str, str, str], list[str]] = {}
    first: dict[tuple[str, str, str], str] = {}
    for status, stage, reason, name, key in rows:
        group = status, stage, general(reason, name)
        groups.setdefault(group, []).append(name or key)
        first.setdefault(group, reason)
    found = [
        FailureGroup(group[0], group[1], first[group], len(names), tuple(names[:examples]))
        for group, names in groups.items()
    ]
    return tuple(sorted(found, key=lambda g: (-g.count, g.status, g.stage, g.reason)))


MOST_OF_NAME = 60
NUMBERS = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def general(reason: str, name: str) -> str:
    """Return the reason of a failure with # in the place of the capture's name and of numbers."""
    for form in _forms(name):
        reason = _unnamed(reason, form)
    return NUMBERS.sub("#", reason).removeprefix("#: ").removeprefix("#/")


def _unnamed(reason: str, name: str) -> str:
    """Put # for a name that stands alone before : or / or at the end: elsewhere it is a word."""
    text, *parts = f"{reason}\n".split(name)
    for part in parts:
        is_name = not text[-1:].isalnum() and part[:1] in ("/", ":", "\n")
        text += ("#" if is_name else name) + part
    return text.removesuffix("\n")


def brief(reason: str, name: str) -> str:
    """Return the reason of a failure with a long name of its capture cut, to show the fact."""
    for form in _forms(name) if len(name) > MOST_OF_NAME else ():
        reason = reason.replace(form, f"{name[:57]}...")
    return reason


def _forms(name: str) -> list[str]:
    """Return the forms that the name of a capture may have in a reason, each once."""
    return [*filter(None, dict.fromkeys((name, printable(name), " ".join(name.split()))))]


def quantity_units(catalogue: Catalogue) -> dict[str, str]:
    """Return the quantities of the catalogue with the unit (deg or m) of each, angles first."""
    found = dict(catalogue.connection.execute("SELECT kind, unit FROM kinds ORDER BY kind, unit"))
    angles = [name for name in REFERENCE_ANGLES if name in found]
    return {name: found[name] for name in dict.fromkeys((*angles, *found))}


def known_quantity(catalogue: Catalogue, name: str) -> str:
    """Return the name of an existing quantity. Raises InputError with the nearest one."""
    known = quantity_units(catalogue)
    if name not in known:
        near = difflib.get_close_matches(name, known, 1, 0.0) or ["RR toe"]
        raise InputError(f"quantity '{name}': not in these results: did you mean '{near[0]}'?")
    return name


def condition(catalogue: Catalogue, which: Filter) -> tuple[str, list[object]]:
    """Return the WHERE clause and values of a filter, for captures as c. Raises InputError."""
    terms: list[str] = []
    values: list[object] = []

    def add(term: str, *given: object) -> None:
        terms.append(term)
        values.extend(given)

    if which.text:
        add("instr(c.name, ?)", which.text)
    if which.vehicle is not None:
        add("c.vehicle = ?", which.vehicle)
    if which.since_day is not None:
        add("c.day >= ?", which.since_day)
    if which.until_day is not None:
        add("c.day < ?", which.until_day)
    if which.since_date is not None:  # days by UTC, for the index, are at most one from it
        add(
            "c.day >= ? AND substr(c.date, 1, 10) >= ?",
            _day(which.since_date) - 1,
            which.since_date,
        )
    if which.until_date is not None:
        add(
            "c.day < ? AND substr(c.date, 1, 10) <= ?", _day(which.until_date) + 2, which.until_date
        )
    if which.status:
        add(f"c.status IN ({', '.join('?' * len(which.status))})", *which.status)
    if which.removed is not None:
        names = json.dumps(read_removed(catalogue.store))
        among = "c.name IN" if which.removed else "c.name NOT IN"
        add(f"{among} (SELECT value FROM json_each(?))", names)  # noqa: S608
    if which.vertical is not None:
        add("c.vertical = ?", which.vertical)
    if which.ranges:
        add(_within(catalogue, which.ranges))
    return f"WHERE {' AND '.join(terms)}" if terms else "", values


def _day(iso_date: str) -> int:
    """Return days since 1970-01-01 of a date."""
    return (date.fromisoformat(iso_date) - date(1970, 1, 1)).days


def chosen(catalogue: Catalogue, which: Filter) -> Numbers:
    """Return the numbers (N,) of the captures of a filter."""
    where, values = condition(catalogue, which)
    rows = catalogue.connection.execute(f"SELECT id FROM captures AS c {where}", values)  # noqa: S608
    return np.fromiter((number for (number,) in rows), np.int64)


def in_doubt_of(catalogue: Catalogue) -> Numbers:
    """Return the numbers (N,) of the captures in doubt."""
    rows = catalogue.connection.execute("SELECT id FROM captures WHERE doubted")
    return np.fromiter((number for (number,) in rows), np.int64)


def _within(catalogue: Catalogue, ranges: tuple[ValueRange, ...]) -> str:
    """Return the SQL term for the captures whose quantities all lie in their ranges.

    Those that do, or do not if these are fewer, are in a temporary table. `+` keeps SQLite from
    looking up each of many, where it can go through an index.
    """
    if ranges not in catalogue.kept:
        connection = catalogue.connection
        every, _ = captures_of(connection)
        among = every
        for span in ranges:
            among = _in_range(catalogue, span, among)
        term = "c.id IN" if len(among) < FEW * len(every) else "+c.id IN"
        if 2 * len(among) > len(every):
            term, among = "+c.id NOT IN", np.setdiff1d(every, among, assume_unique=True)
        table = f"within_{len(catalogue.kept)}"
        connection.execute(f"CREATE TEMP TABLE {table}(id INTEGER PRIMARY KEY)")
        rows = json.dumps(among.tolist())
        connection.execute(f"INSERT INTO {table} SELECT value FROM json_each(?)", (rows,))  # noqa: S608
        catalogue.kept[ranges] = f"{term} {table}"
    return str(catalogue.kept[ranges])


def _in_range(catalogue: Catalogue, span: ValueRange, among: Numbers) -> Numbers:
    """Return those captures whose quantity, or angle of a wheel or trial, lies in its range."""
    wheel, _, angle = span.quantity.rpartition(" ")
    units, connection = quantity_units(catalogue), catalogue.connection
    of_wheel = "SELECT id FROM wheel_rows WHERE name = ?"
    is_trial = span.quantity not in units and angle in ANGLES
    if is_trial and connection.execute(of_wheel, (wheel,)).fetchone():
        rows = connection.execute(
            f"{of_wheel} AND {angle}_deg BETWEEN ? AND ?", (wheel, span.low, span.high)
        )
        return np.intersect1d(among, np.fromiter((number for (number,) in rows), np.int64))
    name = known_quantity(catalogue, span.quantity)
    numbers, _ = captures_of(connection)
    values, _ = column_of(connection, name, units[name], numbers)
    inside = numbers[(values >= span.low) & (values <= span.high)]
    return np.intersect1d(among, inside, assume_unique=True)
