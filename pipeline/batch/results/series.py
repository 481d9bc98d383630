"""Quantities over many captures, as arrays."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...vectors import Array
from ..catalogue.catalogue import Catalogue
from .query import ALL, Filter, condition, known_quantity, quantity_units

BLOCK = 20_000


@dataclass(frozen=True)
class Series:
    """One quantity over the captures that have it, in the order of their keys.

    numbers: row numbers of the captures (see `schema`); day: days since 1970-01-01, nan if
    undated; values and their standard uncertainties u in `unit` (deg or m), u nan if unknown.
    All (N,).
    """

    quantity: str
    unit: str
    numbers: npt.NDArray[np.int64]
    day: Array
    values: Array
    u: Array


def series(
    catalogue: Catalogue, quantities: Sequence[str] | None = None, which: Filter = ALL
) -> tuple[Series, ...]:
    """Load the named quantities, or all, without those of no capture. Raises InputError."""
    units = quantity_units(catalogue)
    wanted = (
        list(units)
        if quantities is None
        else [known_quantity(catalogue, name) for name in quantities]
    )
    numbers, days, table = _table(catalogue, which, wanted)
    found = []
    for index, name in enumerate(wanted):
        rows = np.flatnonzero(np.isfinite(table[index, 0]))
        if len(rows):
            values, u = table[index][:, rows]
            found.append(Series(name, units[name], numbers[rows], days[rows], values, u))
    return tuple(found)


def _table(
    catalogue: Catalogue, which: Filter, wanted: Sequence[str]
) -> tuple[npt.NDArray[np.int64], Array, Array]:
    """Return row numbers (N,) and days (N,) of captures; values and u (K, 2, N), nan if none."""
    layouts = {
        layout: [text.rpartition(" [")[0] for text in json.loads(names)]
        for layout, names in catalogue.connection.execute("SELECT layout, names FROM layouts")
    }
    where, given = condition(catalogue, which)
    cursor = catalogue.connection.execute(
        "SELECT layout, id, day, p.numbers FROM packed AS p JOIN captures AS c USING(id) "  # noqa: S608
        f"{where} ORDER BY id",
        given,
    )
    numbers, days, blocks = [], [], []
    while rows := cursor.fetchmany(BLOCK):
        block = np.full((len(wanted), 2, len(rows)), np.nan)
        by_layout: dict[int, list[int]] = {}
        for at, row in enumerate(rows):
            by_layout.setdefault(row[0], []).append(at)
        for layout, columns in by_layout.items():
            names = layouts[layout]
            cells = np.frombuffer(b"".join([rows[at][3] for at in columns]), "<f8")
            cells = cells.reshape(len(columns), 2, len(names)).transpose(2, 1, 0)
            here = [k for k, name in enumerate(wanted) if name in names]
            source = [names.index(wanted[k]) for k in here]
            if len(columns) == len(rows):
                block[here] = cells[source]
            else:
                block[np.ix_(here, (0, 1), columns)] = cells[source]
        numbers.append(np.array([row[1] for row in rows], np.int64))
        days.append(np.array([math.nan if row[2] is None else row[2] for row in rows]))
        blocks.append(block)
    if not blocks:
        return np.empty(0, np.int64), np.empty(0), np.empty((len(wanted), 2, 0))
    return np.concatenate(numbers), np.concatenate(days), np.concatenate(blocks, axis=2)
