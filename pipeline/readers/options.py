"""Statements of the user about files that do not say it themselves: columns, pitch of heights."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..system import frozen

SKIPPED = "-"
# Columns that --columns may name; only x, y, z and the intensity are read.
KNOWN_COLUMNS = frozenset(
    (
        *("x", "y", "z", "i", "intensity", "row", "col", "column", "index", "id", "t", "time"),
        *("r", "g", "b", "a", "red", "green", "blue", "alpha", "nx", "ny", "nz"),
    )
)


@frozen
class ReadOptions:
    """How to read what a file does not say of itself.

    columns: names of a text's or an array's columns, `-` for one that is not needed.
    pitch: of a matrix of heights: the steps of x from column to column and of y from row to row,
    in the file's unit. Raises ValueError, one fact, for options that cannot be.
    """

    columns: tuple[str, ...] | None = None
    pitch: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.columns is not None:
            _check_columns(self.columns)
            if self.pitch is not None:
                raise ValueError("a matrix of heights has a pitch and no named columns: give one")
        if self.pitch is not None and not all(math.isfinite(d) and d for d in self.pitch):
            raise ValueError("the pitch needs two numbers other than 0, such as 0.05,0.1")

    def stated(self) -> dict[str, list[str] | list[float]]:
        """Return what is stated, as plain data, for the record of a result."""
        stated: dict[str, list[str] | list[float]] = {}
        if self.columns is not None:
            stated["columns"] = list(self.columns)
        if self.pitch is not None:
            stated["pitch"] = list(self.pitch)
        return stated


AS_THE_FILE_SAYS = ReadOptions()


def _check_columns(names: Sequence[str]) -> None:
    lower = [name.lower() for name in names]
    unknown = [name for name in lower if name != SKIPPED and name not in KNOWN_COLUMNS]
    if unknown:
        raise ValueError(
            f"the column {unknown[0][:40]!r} is unknown: name x, y, z, i, and - for the others"
        )
    for axis in ("x", "y", "z"):
        if lower.count(axis) != 1:
            raise ValueError(f"{axis} is named {lower.count(axis)} times: name it once")
    if lower.count("i") + lower.count("intensity") > 1:
        raise ValueError("the intensity is named twice: name it once")
