"""Quantities over many captures, as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...vectors import Array
from ..catalogue.catalogue import Catalogue
from ..catalogue.columns import captures_of, column_of
from .query import ALL, Filter, chosen, known_quantity, quantity_units


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
    return tuple(each_series(catalogue, quantities, which))


def each_series(
    catalogue: Catalogue, quantities: Sequence[str] | None = None, which: Filter = ALL
) -> Iterator[Series]:
    """Yield the same one by one, so that those of a million captures need no memory together."""
    units = quantity_units(catalogue)
    wanted = (
        list(units)
        if quantities is None
        else [known_quantity(catalogue, name) for name in quantities]
    )
    numbers, days = captures_of(catalogue.connection)
    among = None if which == ALL else np.isin(numbers, chosen(catalogue, which))
    before = np.zeros(len(numbers), bool)
    for name in wanted:
        values, u = column_of(catalogue.connection, name, units[name], numbers)
        found = np.isfinite(values) if among is None else np.isfinite(values) & among
        if found.any():
            if not np.array_equal(found, before):  # most are of the same captures
                before, shared = found, (numbers[found], days[found])
            yield Series(name, units[name], *shared, values[found], u[found])
