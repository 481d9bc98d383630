"""Targets against their wheels: each mounting's offsets, and what they show together."""

from __future__ import annotations

import math

from ...validation import Mountings
from ..format.language import Translations
from ..format.writer import Column, Columns, Table, Writer

UNITS = {"toe": "rad", "camber": "rad"}


def mountings_table(found: Mountings, writer: Writer) -> Table:
    """Return the offsets of each target from its wheel, with u and U."""
    words, rows = writer.words, []
    for one in found.mountings:
        for name, known in one.offsets.items():
            if name in UNITS:
                value = writer.number(known.value, "rad", known.expanded)
                sizes = [writer.size(x, "rad") for x in (known.u, known.expanded)]
            else:
                value = writer.millimetres(known.value, known.expanded, "+")
                sizes = [writer.size(x, "m") for x in (known.u, known.expanded)]
            shown = words(f"mounting.{name}")
            rows.append([writer.wheel(one.name), writer.wheel(one.wheel), shown, value, *sizes])
    columns: Columns = (
        words("results.name"), Column(words("results.wheel"), "text"), words("mounting.offset"),
        words("mounting.value"), Column("u", "text"), "U",
    )  # fmt: skip
    return writer.table(columns, rows, 3, words("mounting.table"))


def scatter_lines(found: Mountings, words: Translations) -> list[str]:
    """Return what the mountings of each target show, in the keys of its file."""
    return [
        words(
            "mounting.scatter",
            count=one.count,
            target=one.target.description,
            keys=f"stand_off = {one.stand_off_m:.5f}, stand_off_u = {one.u_m:.5f}, "
            f"clamp_tilt_deg = {math.degrees(one.tilt_rad):.3f}, clamp_shift = {one.shift_m:.5f}",
        )
        for one in found.scatters
    ]


def not_both(found: Mountings, words: Translations) -> list[str]:
    """Return what does not show both, and why."""
    return [words("comparison.not_compared", name=n, reason=r) for n, r in found.missing]
