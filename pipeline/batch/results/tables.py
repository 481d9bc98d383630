"""Statistics, drifts and outliers of many captures as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from ...errors import printable
from ...measurement import Estimate
from ...report.format.digits import UNKNOWN
from ...report.format.language import Translations
from ...report.format.notes import joined_notes_in
from ...report.format.view import Sort
from ...report.format.writer import Column, Table, Writer, sort_of
from ..catalogue.catalogue import Catalogue
from ..catalogue.rows import FAILED, CaptureRow
from .query import FailureGroup, Filter, copies, doubted, removed, verticals
from .trends import MONTH_DAYS, Drift, Outlier, Summary

REASONS = {"fewer than three dated values": "few_values", "all on one date": "one_date"}


def summary_table(found: Sequence[Summary], writer: Writer) -> Table:
    """Return the statistics of each quantity; single values to the place of the typical U."""
    words = writer.words
    head = [words(f"listing.{name}") for name in
            ("quantity", "n", "mean", "sd", "robust_sd", "median", "min", "max",
             "typical_u")]  # fmt: skip
    rows = []
    for s in found:
        wide = expanded(s.u_rms)
        mean, median, low, high = (
            value(x, s.unit, writer, wide, s.quantity) for x in (s.mean, s.median, s.low, s.high)
        )
        sizes = s.sd, s.robust_sd, s.u_rms
        sd, robust, u = (width(x, s.unit, writer, s.quantity) for x in sizes)
        name = quantity_name(s.quantity, writer)
        rows.append([name, writer.words.count(s.n), mean, sd, robust, median, low, high, u])
    return writer.table(head, rows, 1, words("listing.summary"))


def drift_table(found: Sequence[Drift], writer: Writer) -> Table:
    """Return the slope of each quantity over time, per 30 days."""
    words = writer.words
    head = [Column(words(f"listing.{name}"), minor=name in ("from", "to", "scatter")) for name in
            ("quantity", "n", "from", "to", "per_month", "half", "scatter", "p",
             "drift")]  # fmt: skip
    rows = [_drift_row(one, writer) for one in found]
    classes = ["undecided" if one.significant else "" for one in found]
    return writer.table(head, rows, 1, words("listing.drifts"), classes)


def _drift_row(d: Drift, writer: Writer) -> list[str]:
    words = writer.words
    row = [quantity_name(d.quantity, writer), words.count(d.n)]
    if d.reason:
        reason = words(f"listing.{REASONS[d.reason]}") if d.reason in REASONS else d.reason
        return [*row, *[writer.none] * 6, reason]
    wide = d.expanded * MONTH_DAYS
    return [
        *row,
        day_text(d.first_day),
        day_text(d.last_day),
        value(d.slope * MONTH_DAYS, d.unit, writer, wide, d.quantity),
        width(wide, d.unit, writer, d.quantity),
        width(d.scatter, d.unit, writer, d.quantity),
        words.number(f"{d.p:.2g}"),
        words("listing.yes" if d.significant else "listing.no"),
    ]


def worst_table(found: Sequence[Outlier], writer: Writer) -> Table:
    """Return values far from the median."""
    words = writer.words
    head = [*(words(f"listing.{name}") for name in ("capture", "date", "quantity", "value")), "u",
            words("listing.median"), words("listing.deviation")]  # fmt: skip
    rows = []
    for o in found:
        wide = expanded(o.u)
        texts = (value(o.value, o.unit, writer, wide, o.quantity),
                 width(o.u, o.unit, writer, o.quantity),
                 value(o.median, o.unit, writer, wide, o.quantity))  # fmt: skip
        rows.append([printable(o.name), o.date or writer.none, quantity_name(o.quantity, writer),
                     *texts, words.number(f"{o.score:.1f}")])  # fmt: skip
    return writer.table(head, rows, 3, words("listing.worst"))


def capture_status(row: CaptureRow, words: Translations) -> str:
    """Return the status of a capture in words, and whether it is in doubt."""
    status = words(f"page.{row.status}")
    return words("listing.in_doubt", status=status) if row.doubted else status


def capture_class(row: CaptureRow) -> str:
    """Return the class of a capture's row in a table."""
    if row.status not in ("ok", "part"):
        return "not-conform"
    return "undecided" if row.reason or row.status == "part" else ""


def doubts_listed(rows: Sequence[CaptureRow], words: Translations) -> list[str]:
    """Return a line for each capture that was measured, and why it is in doubt."""
    return [
        f"{printable(row.name or row.key)}: {printable(joined_notes_in(row.reason, words))}"
        for row in rows
        if row.reason and row.status not in FAILED
    ]


def verticals_note(catalogue: Catalogue, which: Filter, words: Translations) -> list[str]:
    """Return from which verticals cambers are that are not to be compared; nothing of one."""
    each = unlike_verticals(catalogue, which, words)
    return [words("listing.unlike_verticals", each=each)] if each else []


def unlike_verticals(catalogue: Catalogue, which: Filter, words: Translations) -> str:
    """Return the verticals of the captures' cambers with their numbers; empty of one alone."""
    found = verticals(catalogue, which)
    each = (
        f"{words.known('page', f'vertical_{vertical}')}: {words.count(number)}"
        for vertical, number in found.items()
    )
    return "; ".join(each) if len(found) > 1 else ""


def counted_notes(catalogue: Catalogue, which: Filter, words: Translations) -> list[str]:
    """Return how many captures statistics leave out, and count though they show nothing new."""
    counts = {
        "doubted": doubted(catalogue, which),
        "removed_counted": removed(catalogue, which),
        "copies_counted": copies(catalogue, which),
    }
    return [
        words(f"listing.{key}", count=words.count(found)) for key, found in counts.items() if found
    ]


def failures_table(found: Sequence[FailureGroup], writer: Writer) -> Table:
    """Return the groups of failures, the most frequent first."""
    words = writer.words
    head = [words(f"listing.{name}") for name in
            ("count", "status", "stage", "reason", "examples")]  # fmt: skip
    rows = [
        [words.count(group.count), words(f"page.{group.status}"), group.stage or writer.none,
         printable(joined_notes_in(group.reason, words)), ", ".join(map(printable, group.examples))]
        for group in found
    ]  # fmt: skip
    return writer.table(head, rows, 5, words("listing.failures"))


def quantity_name(quantity: str, writer: Writer) -> str:
    """Return the name of a quantity of the catalogue, such as `RR toe`; plain text keeps it."""
    if writer.plain:
        return quantity
    wheel, _, kind = quantity.rpartition(" ")
    return f"{writer.wheel(wheel)} {writer.words.known('quantity', kind)}".strip()


def expanded(u: float | None) -> float:
    """Return U of a value of which the catalogue holds u, as of infinite degrees of freedom."""
    return UNKNOWN if u is None else Estimate(0.0, u).expanded


def value(x: float, unit: str, writer: Writer, wide: float, quantity: str = "camber") -> str:
    """Write a value in degrees or metres to the place of its U, `wide`.

    quantity: by which an angle is in mm/m where the view is, such as `RR toe`.
    """
    if not math.isfinite(x):
        return writer.none
    if unit == "deg":
        text = writer.view.angle(math.radians(x), _sort(quantity), math.radians(wide))
        return writer.words.number(text)
    return writer.millimetres(x, wide, "+")


def width(x: float, unit: str, writer: Writer, quantity: str = "camber") -> str:
    """Write an uncertainty or a standard deviation with two digits."""
    if not math.isfinite(x):
        return writer.none
    if unit == "deg":
        return writer.words.number(writer.view.width(math.radians(x), _sort(quantity)))
    return writer.size(x, "m")


def _sort(quantity: str) -> Sort:
    return sort_of(quantity.rpartition(" ")[2])


def day_text(day: float) -> str:
    """Format days since 1970-01-01 as a date."""
    return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=day)).date().isoformat()
