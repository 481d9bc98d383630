"""The vehicle as a workshop reads it: axle by axle, then what joins the axles."""

from __future__ import annotations

from ...measurement import Measurement
from ..format.earlier import Earlier
from ..format.layout import paragraph
from ..format.view import DEFINED, PAPER, View
from ..format.writer import Writer
from ..tables.front import changes_table, is_of_same_scans
from ..tables.vehicle import axes_table, vehicle_table
from ..tables.wheels import axles_table
from .plain import plain_writer


def vehicle_lines(measurement: Measurement, view: View = PAPER) -> str:
    """Return the axis in use, a block an axle, then angles and lengths, each with its u."""
    writer = plain_writer(view)
    return "\n".join(
        [
            paragraph(f"Longitudinal axis in use ({view.axis}): the {DEFINED[view.axis]}."),
            *_convention(writer),
            paragraph(writer.words("results.axles_note")),
            axles_table(measurement, writer).text(),
            "",
            vehicle_table(measurement, writer).text(),
        ]
    )


def _convention(writer: Writer) -> list[str]:
    """Return a sentence on the convention in use, unless it is the default."""
    convention = writer.view.convention
    if convention == "default":
        return []
    return [paragraph(writer.words.known("convention", convention))]


def before_text(measurement: Measurement, before: Earlier, view: View) -> str:
    """Return what was before, what is now, and the change."""
    writer = plain_writer(view)
    words = writer.words
    date = before.date or words("front.undated")
    name = "note_before_same" if is_of_same_scans(measurement, before) else "note_before"
    note = words(f"front.{name}", capture=before.capture, date=date)
    return changes_table(measurement, before, writer).block(note)


def axes_text(measurement: Measurement, writer: Writer) -> str:
    """Return the four axes: angle to the paper's, and toe of the four wheels against each."""
    table = axes_table(measurement, writer)
    return f"{table.caption}\n{table.text()}"
