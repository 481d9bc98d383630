"""Sentences that remember their template and parts, so that the page can say them in Portuguese."""

from __future__ import annotations

from typing import Self


class Wording(str):
    """Sentence in English, of a template and its parts; a string like any other."""

    __slots__ = ("parts", "template")
    template: str
    parts: dict[str, object]

    def __new__(cls, template: str, **parts: object) -> Self:
        """Fill the parts in."""
        made = super().__new__(cls, template.format(**parts))
        made.template, made.parts = template, parts
        return made


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
