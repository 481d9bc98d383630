"""The first page's table: angles axle by axle, each with a bar of value, U and limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...measurement import Conformity, Measurement
from ...system import frozen
from ..format.earlier import Earlier
from ..format.writer import Writer
from ..plots.angles import bar_drawing
from ..plots.drawing import Drawing
from ..tables.conformity import SIGNS, decided
from ..tables.front import FrontGroup, FrontRow, front_groups

MARGIN, LEAST_RAD = 0.08, math.radians(0.2 / 60.0)


@frozen
class FrontLine:
    """A row with its bar, and its decision as sign and word, '' without limits."""

    row: FrontRow
    bar: Drawing | None
    kind: str
    sign: str
    word: str


@frozen
class Front:
    """Lines under their headings; limited: some have limits; changed: some have earlier values."""

    groups: Sequence[tuple[str, Sequence[FrontLine]]]
    limited: bool
    changed: bool


def front(
    measurement: Measurement,
    conformity: Conformity | None,
    writer: Writer,
    before: Earlier | None = None,
) -> Front:
    """Return the table of the first page."""
    groups = front_groups(measurement, conformity, writer, before)
    rows = [row for group in groups for row in group.rows]
    scales = {kind: _scale([row for row in rows if row.kind == kind]) for kind in
              dict.fromkeys(row.kind for row in rows if row.at is not None)}  # fmt: skip
    return Front(
        [
            (group.title, [_line(row, group, scales, writer) for row in group.rows])
            for group in groups
        ],
        any(row.interval is not None for row in rows),
        any(row.at_before is not None for row in rows),
    )


def _line(
    row: FrontRow, group: FrontGroup, scales: dict[str, tuple[float, float]], writer: Writer
) -> FrontLine:
    word = decided(row.decision, writer.words).lower() if row.decision else ""
    title = f"{group.title}, {row.label}: {row.value} (U {row.width})"
    bar = None
    if row.at is not None:
        numbers = row.at.value, row.at.expanded, row.at_before.value if row.at_before else None
        bar = bar_drawing(title, numbers, row.interval, scales[row.kind], row.decision)
    return FrontLine(
        row,
        bar,
        row.decision.replace(" ", "-"),
        SIGNS.get(row.decision, ""),
        word,
    )


def _scale(rows: Sequence[FrontRow]) -> tuple[float, float]:
    """Return the range of rows of one kind, with zero in it where it is near."""
    values = [x for row in rows for x in (row.at, row.at_before) if x is not None]
    ends = [x.value + way * x.expanded for x in values for way in (-1.0, 1.0)]
    low, high = min(ends), max(ends)
    if min(abs(low), abs(high)) < high - low or low < 0.0 < high:
        low, high = min(low, 0.0), max(high, 0.0)
    room = max(MARGIN * (high - low), LEAST_RAD)
    return low - room, high + room
