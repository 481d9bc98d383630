"""Catalogue contents as text tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from ...errors import printable
from ...report.format.layout import paragraph
from ...report.format.view import PAPER, View
from ...report.format.writer import Table, Writer
from ...report.text.plain import plain_writer
from ..catalogue.catalogue import Catalogue
from ..catalogue.rows import CaptureRow
from ..catalogue.schema import number_of
from .query import ALL, REFERENCE_ANGLES, FailureGroup, Filter, brief, captures
from .tables import drift_table, expanded, summary_table, worst_table
from .trends import Drift, Outlier, Summary

Angles = dict[str, tuple[float, float | None]]  # by "RR toe": degrees and u
BLOCK = 500


def capture_table(
    catalogue: Catalogue, which: Filter = ALL, view: View = PAPER, limit: int | None = None
) -> Iterator[str]:
    """Yield the lines of a table: one capture a line: wheel angles, a failure's reason, doubts."""
    rows = list(captures(catalogue, which, limit=limit))
    widths = [max([len(head), *map(len, map(f, rows))]) for head, f in HEADS.items()]
    angle_width = len(view.angle(math.radians(-10.0), "camber"))  # with all digits, the widest
    heads = [f"{head:<{width}}" for head, width in zip(HEADS, widths, strict=True)]
    yield "  ".join([*heads, *(f"{name:>{angle_width}}" for name in REFERENCE_ANGLES), "largest u"])
    for start in range(0, len(rows), BLOCK):
        block = rows[start : start + BLOCK]
        angles = _angles(catalogue, [number_of(row.key) for row in block])
        for row in block:
            cells = [f"{f(row):<{w}}" for f, w in zip(HEADS.values(), widths, strict=True)]
            cells += _angle_cells(angles.get(number_of(row.key), {}), angle_width, view)
            yield "  ".join(cells + _why(row)).rstrip()


def _angle_cells(found: Angles, width: int, view: View) -> list[str]:
    """Return the cells of a capture's angles and of the largest u; empty if it has none."""
    known = [u for _, u in found.values() if u is not None]
    largest = [view.width(math.radians(max(known)), "camber").rjust(9)] if known else []
    return [_angle(found, name, view).rjust(width) for name in REFERENCE_ANGLES if found] + largest


HEADS: dict[str, Callable[[CaptureRow], str]] = {
    "capture": lambda row: printable(row.name or row.key),
    "date": lambda row: row.date or "-",
    "vehicle": lambda row: printable(row.vehicle or "-"),
    "status": lambda row: row.status,
    "wheels": lambda row: f"{row.wheels_ok}/{row.wheels}",
}


def angles_of(catalogue: Catalogue, keys: list[str]) -> dict[str, Angles]:
    """Load degrees and u of the measured angles of reference wheels, by key; blocks of BLOCK."""
    found: dict[str, Angles] = {}
    for start in range(0, len(keys), BLOCK):
        block = keys[start : start + BLOCK]
        numbers = _angles(catalogue, list(map(number_of, block)))
        found |= {key: numbers[number_of(key)] for key in block if number_of(key) in numbers}
    return found


def _angles(catalogue: Catalogue, numbers: list[int]) -> dict[int, Angles]:
    """Load degrees and u of the measured angles of reference wheels, by row number."""
    found: dict[int, Angles] = {}
    for number_, wheel, toe, camber, u_toe, u_camber in catalogue.connection.execute(
        "SELECT id, name, toe_deg, camber_deg, u_toe_deg, u_camber_deg FROM wheel_rows "  # noqa: S608
        "WHERE role = 'reference' AND toe_deg IS NOT NULL "
        f"AND id IN ({', '.join('?' * len(numbers))})",
        numbers,
    ):
        of_capture = found.setdefault(number_, {})
        of_capture[f"{wheel} toe"] = toe, u_toe
        of_capture[f"{wheel} camber"] = camber, u_camber
    return found


def _angle(found: Angles, name: str, view: View) -> str:
    if name not in found:
        return "-"
    sort = "toe" if name.endswith("toe") else "camber"
    value, u = found[name]
    return view.angle(math.radians(value), sort, math.radians(expanded(u)))  # type: ignore[arg-type]


def _why(row: CaptureRow) -> list[str]:
    return [printable(f"{row.stage}: {row.reason}".strip(": "))]


def captures_note() -> str:
    """Return what the table of captures holds."""
    words = plain_writer(PAPER).words
    return f"{words('listing.signs')} {words('listing.captures_note')}"


def totals(rows: dict[str, int], removed: int = 0) -> str:
    """Format the numbers of captures: all, by status, and no longer in the archive."""
    parts = ", ".join(f"{count:,} {status}" for status, count in rows.items())
    parts += f", {removed:,} no longer in the archive" * (removed > 0)
    return f"{sum(rows.values()):,} captures" + (f": {parts}." if parts else ".")


def summary_text(found: tuple[Summary, ...], view: View = PAPER) -> str:
    """Format a table of statistics."""
    writer = plain_writer(view)
    return _noted(summary_table(found, writer), "summary", writer)


def drift_text(found: tuple[Drift, ...], view: View = PAPER) -> str:
    """Format a table of drifts, per 30 days."""
    writer = plain_writer(view)
    return _noted(drift_table(found, writer), "drift", writer)


def worst_text(found: tuple[Outlier, ...], view: View = PAPER) -> str:
    """Format a table of outliers."""
    writer = plain_writer(view)
    words = writer.words
    signs = paragraph(words("listing.all_signs"))
    notes = f"{signs}\n{words('listing.k1')}.\n{words('listing.worst_note')}"
    return f"{worst_table(found, writer).text()}\n\n{notes}"


def _noted(table: Table, name: str, writer: Writer) -> str:
    words = writer.words
    notes = paragraph(words(f"listing.{name}_note"))
    return f"{table.text()}\n\n{paragraph(words('listing.all_signs'))}\n{notes}"


def failures_text(found: tuple[FailureGroup, ...], _view: View = PAPER) -> str:
    """Format the groups of failures, the most frequent first, with examples."""
    lines = []
    for group in found:
        stage = group.stage or "-"
        reason = printable(brief(group.reason, group.examples[0]))
        lines.append(f"{group.count:>7,}  {group.status}  {stage}: {reason}")
        lines += [f"{'':9}{printable(name)}" for name in group.examples]
    return "\n".join(lines) or "No failures."


def plain(row: Any) -> dict[str, Any]:
    """Return a record as plain data, with null for nan and infinity."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in vars(row).items()
    }
