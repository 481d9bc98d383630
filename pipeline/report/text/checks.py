"""Repeat scans and the Monte Carlo check as plain text."""

from __future__ import annotations

from ...measurement import Measurement
from ...uncertainty import MonteCarlo
from ..format.view import View
from ..tables.checks import monte_carlo_table, monte_carlo_words, repeats_table
from .plain import plain_writer


def repeats_text(measurement: Measurement, view: View) -> list[str]:
    """Return a line for toe and one for camber of each group of repeat scans; none without."""
    writer = plain_writer(view)
    table = repeats_table(measurement, writer)
    if table is None:
        return []
    return [table.block(writer.words("checks.repeats_note"))]


def monte_carlo_text(measurement: Measurement, drawn: MonteCarlo, view: View) -> str:
    """Return a line for each quantity against the axis in use, then the verdict on all axes."""
    writer = plain_writer(view)
    note, verdict = monte_carlo_words(drawn, writer)
    return f"{monte_carlo_table(measurement, drawn, writer).block(note)}\n  {verdict}"
