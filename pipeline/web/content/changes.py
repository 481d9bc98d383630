"""Changes between two stored measurements of one vehicle: before, now, change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...measurement import Measurement
from ...report.format.earlier import (
    Earlier,
    check_comparable,
    read_earlier,
)
from ...report.format.language import Translations
from ...report.format.view import PAPER
from ...report.format.writer import Writer
from ...report.json.stored import read_measurement
from ...report.tables.front import changes_table
from .panel import table_tree, view_of


def changes(now: Path, before: Path, name: str, words: Translations) -> dict[str, Any]:
    """Return the table of changes of two measurement.json, the earlier of that name.

    Raises InputError.
    """
    measurement, _ = read_measurement(now, now.name)
    earlier = earlier_of(measurement, before, name)
    view = view_of(measurement, PAPER.axis, PAPER.angles, "default")
    return table_tree(changes_table(measurement, earlier, Writer(words, view)))


def earlier_of(measurement: Measurement, path: Path, name: str) -> Earlier:
    """Return an earlier measurement of the same vehicle, under the name by which the page shows it.

    Raises InputError, which names it so and not by its path.
    """
    try:
        earlier = replace(read_earlier(path), source=name)
    except InputError as error:
        raise InputError(str(error).replace(str(path), name)) from error
    check_comparable(earlier, measurement)
    return earlier
