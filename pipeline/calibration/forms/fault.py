"""Faults of a table, each in one line."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Self

from ...errors import Wording

ALIKE = "{fact} (so in {count} other rows: {rows})"
FEW, MOST_RANGES = 3, 40  # rows of one fault that are named each; ranges of rows in one line
# What differs from row to row in one systematic fault, by column.
VARYING = {
    "value": ("value", "shown", "one", "other"),
    "repeat": ("value", "repeat", "row", "point"),
}


class Fault(str):
    """Fault of a table in one line: file, row, column, fact and what to do.

    row: of the file; None of the whole table. column: its name. fact: what follows the place.
    """

    __slots__ = ("column", "fact", "row")
    row: int | None
    column: str | None
    fact: str

    def __new__(cls, name: str, row: int | None, column: str | None, fact: str) -> Self:
        """Put file and place before the fact."""
        places = [f"row {row}"] * (row is not None) + [f"column {column}"] * (column is not None)
        made = super().__new__(
            cls, ": ".join([name, *([", ".join(places)] if places else []), fact])
        )
        made.row, made.column, made.fact = row, column, fact
        return made


def summed_up(name: str, faults: Sequence[Fault]) -> list[Fault]:
    """Return faults of the file `name`; one that many rows have is one line, at its first row."""
    groups: dict[object, list[Fault]] = {}
    for number, fault in enumerate(faults):
        groups.setdefault(_key(fault) or number, []).append(fault)
    found = []
    for group in groups.values():
        first, rows = group[0], [fault.row for fault in group if fault.row is not None]
        if len(rows) <= FEW:
            found += group
            continue
        others = {"count": len(rows) - 1, "rows": _ranges(rows[1:])}
        found.append(
            Fault(name, first.row, first.column, Wording(ALIKE, fact=first.fact, **others))
        )
    return found


def _key(fault: Fault) -> object:
    """Return what faults of one kind have in common; None of the whole table."""
    if fault.row is None:
        return None
    if not isinstance(fault.fact, Wording):
        return (fault.column, fault.fact)
    varying = VARYING.get(str(fault.column), ())
    parts = [(name, str(p)) for name, p in fault.fact.parts.items() if name not in varying]
    return (fault.column, fault.fact.template, *parts)


def _ranges(rows: Sequence[int]) -> str:
    """Write rows as 3-25, 30, 32."""
    starts = [rows[0], *(b for a, b in pairwise(rows) if b != a + 1)]
    ends = [*(a for a, b in pairwise(rows) if b != a + 1), rows[-1]]
    shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in zip(starts, ends, strict=True)]
    return ", ".join(shown[:MOST_RANGES]) + ", ..." * (len(shown) > MOST_RANGES)
