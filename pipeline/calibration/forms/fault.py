"""Faults of a table, each in one line."""

from __future__ import annotations

from typing import Self


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
