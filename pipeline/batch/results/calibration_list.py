"""Calibrations of a catalogue: as a list, as columns to be exported, and those of one machine."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, fields
from typing import Any

import numpy as np

from ...errors import printable
from ...report.format.layout import paragraph
from ...report.format.view import PAPER, View
from ...report.format.writer import Table, Writer
from ...report.tables.conformity import decided
from ...report.text.plain import plain_writer
from ...system import frozen
from ..catalogue.calibration_row import CalibrationRow
from ..catalogue.catalogue import Catalogue
from ..catalogue.load_records import json_name
from .export import ExportColumns
from .query import ALL, Filter, condition


@frozen
class ListedCalibration:
    """Calibration of a machine by a capture, with the capture's name and date."""

    key: str
    name: str
    date: str | None
    serial: str
    maker: str
    model: str
    decision: str | None
    points: int
    worst: float | None
    worst_at: str
    error: str
    as_found: str | None


OWN = ", ".join(f"k.{field.name}" for field in fields(CalibrationRow))


def calibrations(catalogue: Catalogue, which: Filter = ALL) -> tuple[ListedCalibration, ...]:
    """Return the calibrations of the captures, by serial number, date and name."""
    where, values = condition(catalogue, which)
    rows = catalogue.connection.execute(
        f"SELECT key, c.name, c.date, {OWN} FROM calibration_rows AS k "  # noqa: S608
        f"JOIN captures AS c USING(id) {where} ORDER BY k.serial, c.day, c.name, key",
        values,
    )
    return tuple(ListedCalibration(*row) for row in rows)


def counts(catalogue: Catalogue) -> dict[str | None, int]:
    """Return the number of calibrations with results by their decision."""
    rows = catalogue.connection.execute(
        "SELECT decision, COUNT(*) FROM calibration_rows WHERE error = '' GROUP BY decision"
    )
    return dict(rows)


def unusable(catalogue: Catalogue) -> tuple[int, str, str]:
    """Return how many calibrations have no results; the first one's capture, and why."""
    rows = catalogue.connection.execute(
        "SELECT c.name, k.error FROM calibration_rows AS k JOIN captures AS c USING(id) "
        "WHERE k.error <> '' ORDER BY c.day, c.name, key"
    ).fetchall()
    return (len(rows), *rows[0]) if rows else (0, "", "")


def trees_of(catalogue: Catalogue, serial: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield capture and JSON of a machine's calibrations that have results, in that order."""
    for one in calibrations(catalogue):
        if one.serial == serial and not one.error:
            tree = json.loads(catalogue.store.read(json_name(one.key)))
            yield one.name, tree["calibration"]


def tree_of(catalogue: Catalogue, key: str) -> dict[str, Any] | None:
    """Return the JSON of one capture's calibration; None without one."""
    if not any(one.key == key for one in calibrations(catalogue)):
        return None
    tree: dict[str, Any] = json.loads(catalogue.store.read(json_name(key)))["calibration"]
    return tree


def serials(catalogue: Catalogue) -> set[str]:
    """Return the serial numbers of the machines that have a calibration."""
    rows = catalogue.connection.execute("SELECT serial FROM calibration_rows WHERE serial <> ''")
    return {serial for (serial,) in rows}


def calibrations_table(found: Sequence[ListedCalibration], writer: Writer) -> Table:
    """Return a row per calibration: machine, decision, points, and the worst error over MPE."""
    words = writer.words
    names = (
        "serial", "machine", "capture", "date", "as_found", "decision", "points", "of_mpe", "at",
    )  # fmt: skip
    rows = [
        [
            printable(one.serial) or writer.none,
            printable(f"{one.maker} {one.model}".strip()) or writer.none,
            printable(one.name),
            one.date or writer.none,
            *(
                writer.none if each is None else decided(each, words).lower()
                for each in (one.as_found, one.decision)
            ),
            str(one.points),
            writer.none if one.worst is None else words.number(f"{one.worst:.2f}"),
            printable(one.worst_at) or writer.none,
        ]
        for one in found
    ]
    head = [words(f"listing.{name}") for name in names]
    return writer.table(head, rows, 6, words("listing.calibrations"))


def calibrations_text(found: Sequence[ListedCalibration], view: View = PAPER) -> str:
    """Format the list of calibrations."""
    writer = plain_writer(view)
    if not found:
        return writer.words("listing.no_calibrations")
    parts = [calibrations_table(found, writer).text()]
    parts += [f"{printable(one.name)}: {printable(one.error)}" for one in found if one.error]
    return "\n\n".join([*parts, paragraph(writer.words("listing.calibrations_note"))])


def calibration_columns(found: Sequence[ListedCalibration]) -> ExportColumns:
    """Return the columns (N,) by name; nan where there is no MPE."""
    names = [field.name for field in fields(ListedCalibration)]
    cells = list(zip(*map(astuple, found), strict=True)) or [()] * len(names)
    columns: ExportColumns = {}
    for name, values in zip(names, cells, strict=True):
        if name == "worst":
            numbers = [math.nan if x is None else x for x in values]
            columns[name] = np.array(numbers, float)
        else:
            columns[name] = np.array(values, np.int64 if name == "points" else object)
    return columns
