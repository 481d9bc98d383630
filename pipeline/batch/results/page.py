"""Results of a batch as a report: the selected captures, statistics, drift, outliers, failures."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from ...errors import printable
from ...report.format.writer import NONE, Column, Columns, Table, Writer
from ...report.html.document import Document, Part, Section
from ...report.html.results import Headline
from ...system import frozen
from ..catalogue.catalogue import Catalogue
from .listing import angles_of
from .query import REFERENCE_ANGLES, Filter, by_status, captures, failures
from .series import series
from .tables import (
    capture_class,
    capture_status,
    counted_notes,
    doubts_listed,
    drift_table,
    expanded,
    failures_table,
    quantity_name,
    summary_table,
    value,
    verticals_note,
    width,
    worst_table,
)
from .trend_plot import trend_drawing
from .trends import drifts, summary, worst

MOST_CAPTURES = 500  # of the table of captures
MOST_TRENDS = 12  # drawn, of the significant drifts
LISTS = ("list", "summary", "drift", "worst", "failures")


@frozen
class Selection:
    """Content of a report on a catalogue: captures, quantities, and which of LISTS.

    asked: the options by which captures and quantities are chosen; empty for all.
    """

    source: str
    which: Filter
    quantities: Sequence[str] | None
    lists: Sequence[str]
    limit: int
    worst: int
    asked: str = ""


def results_document(catalogue: Catalogue, chosen: Selection, writer: Writer) -> Document:
    """Return the report; its number is that of the selection and of the captures' JSON."""
    words = writer.words
    counts = by_status(catalogue, chosen.which)
    says = [f"{words(f'page.{status}')}: {words.count(n)}" for status, n in counts.items()]
    fine = "all_well" if set(counts) == {"ok"} else "not_all"
    title = words(f"listing.{fine}" if counts else "listing.none_chosen")
    sections = [_section(catalogue, chosen, name, writer) for name in chosen.lists]
    first = Section("results", sections[0].title, sections[0].parts)
    return Document(
        title=words("listing.title"),
        record=_record(catalogue, chosen),
        head=[
            (words("listing.results"), chosen.source),
            *[(words("listing.selection"), chosen.asked)] * bool(chosen.asked),
        ],
        headline=Headline("none", NONE, title, tuple(says)),
        results=[first],
        annexes=sections[1:],
    )


def _record(catalogue: Catalogue, chosen: Selection) -> str:
    held = [(row.key, row.md5) for row in captures(catalogue, chosen.which)]
    selection = {key: str(x) for key, x in vars(chosen).items()}
    return json.dumps({"selection": selection, "captures": held})


def _section(catalogue: Catalogue, chosen: Selection, name: str, writer: Writer) -> Section:
    words, which, quantities = writer.words, chosen.which, chosen.quantities
    signs = words("listing.all_signs")
    notes = [
        *verticals_note(catalogue, which, words),
        *counted_notes(catalogue, which, words),
    ]
    if name == "list":
        return _captures(catalogue, chosen, writer)
    if name == "summary":
        table = summary_table(summary(catalogue, quantities, which), writer)
        return Section(name, table.caption, [table, signs, words("listing.summary_note"), *notes])
    if name == "drift":
        return _drifts(catalogue, chosen, notes, writer)
    if name == "worst":
        table = worst_table(worst(catalogue, chosen.worst, quantities, which), writer)
        note = f"{signs} {words('listing.k1')}. {words('listing.worst_note')}"
        return Section(name, table.caption, [table, note, *notes])
    table = failures_table(failures(catalogue, which), writer)
    return Section(name, table.caption, [table])


def _drifts(
    catalogue: Catalogue, chosen: Selection, notes: Sequence[str], writer: Writer
) -> Section:
    words = writer.words
    found = drifts(catalogue, chosen.quantities, chosen.which)
    table = drift_table(found, writer)
    marked = [one for one in found if one.significant][:MOST_TRENDS]
    names = [one.quantity for one in marked]
    drawn = series(catalogue, names, chosen.which) if names else ()
    pictures = [
        trend_drawing(one, line, quantity_name(one.quantity, writer), words)
        for one, line in zip(drawn, marked, strict=True)
    ]
    parts: list[Part] = [
        table, words("listing.all_signs"), words("listing.drift_note"), *notes, *pictures,
    ]  # fmt: skip
    return Section("drift", table.caption, parts)


def _captures(catalogue: Catalogue, chosen: Selection, writer: Writer) -> Section:
    """Return a row per capture: its angles and the largest u, or why there are none."""
    words = writer.words
    rows = list(captures(catalogue, chosen.which, limit=chosen.limit))
    angles = angles_of(catalogue, [row.key for row in rows])
    cells, classes = [], []
    for row in rows:
        found = angles.get(row.key, {})
        known = [u for _, u in found.values() if u is not None]
        cells.append([
            printable(row.name or row.key), row.date or writer.none, capture_status(row, words),
            f"{row.wheels_ok}/{row.wheels}",
            *(value(found[name][0], "deg", writer, expanded(found[name][1]), name)
              if name in found else writer.none for name in REFERENCE_ANGLES),
            width(max(known, default=math.nan), "deg", writer),
        ])  # fmt: skip
        classes.append(capture_class(row))
    heads = [f"{writer.wheel(wheel)} {writer.quantity(kind)}" for wheel, kind in
             (name.split() for name in REFERENCE_ANGLES)]  # fmt: skip
    columns: Columns = (
        words("listing.capture"), words("listing.date"), words("listing.status"),
        Column(words("listing.wheels"), minor=True), *heads, words("listing.largest_u"),
    )  # fmt: skip
    table: Table = writer.table(columns, cells, 3, words("listing.captures"), classes)
    total = sum(by_status(catalogue, chosen.which).values())
    parts: list[Part] = [table, f"{words('listing.signs')} {words('listing.captures_note')}"]
    parts += [*verticals_note(catalogue, chosen.which, words), *doubts_listed(rows, words)]
    if total > len(rows):
        parts.append(words("listing.some", shown=words.count(len(rows)), total=words.count(total)))
    return Section("captures", table.caption, parts)
