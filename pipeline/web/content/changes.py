"""Changes between two stored measurements of one vehicle: before, now, change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...report.format.earlier import check_same_vehicle, check_same_vertical, read_earlier
from ...report.format.language import Translations
from ...report.format.view import PAPER
from ...report.format.writer import Writer
from ...report.json.stored import read_measurement
from ...report.tables.front import changes_table
from .panel import table_tree, view_of


def changes(now: Path, before: Path, words: Translations) -> dict[str, Any]:
    """Return the table of changes of two measurement.json. Raises InputError."""
    measurement, _ = read_measurement(now, now.name)
    earlier = read_earlier(before)
    check_same_vehicle(earlier, measurement.provenance.vehicle, now.name)
    check_same_vertical(earlier, measurement.vertical_kind)
    view = view_of(measurement, PAPER.axis, PAPER.angles, "default")
    return table_tree(changes_table(measurement, earlier, Writer(words, view)))
