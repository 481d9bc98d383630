"""Quantities over many captures, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ...cloud import side_by_side
from ...system import frozen
from ...vectors import Array, Mask
from ..catalogue.catalogue import Catalogue
from ..catalogue.columns import captures_of, column_of
from .query import ALL, Filter, chosen, in_doubt_of, known_quantity, quantity_units

T = TypeVar("T")


@frozen
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
    catalogue: Catalogue,
    quantities: Sequence[str] | None = None,
    which: Filter = ALL,
    in_doubt: bool = False,
) -> tuple[Series, ...]:
    """Load the named quantities, or all, without those of no capture. Raises InputError.

    in_doubt: captures in doubt, too, which statistics leave out.
    """
    loader = _Loader(catalogue, which, in_doubt)
    loaded = map(loader.load, loader.names(quantities))
    return tuple(one for one in loaded if one is not None)


def over_series(
    work: Callable[[Series], T],
    catalogue: Catalogue,
    quantities: Sequence[str] | None = None,
    which: Filter = ALL,
) -> list[T]:
    """Call `work` on each of the same, several at once; return its results in their order.

    Those of a million captures need no memory together.
    """
    loader = _Loader(catalogue, which)
    names = loader.names(quantities)
    found = side_by_side(loader.load, lambda one: None if one is None else [work(one)], names)
    return [result for one in found if one is not None for result in one]


class _Loader:
    """Loader of the series of the captures chosen; in_doubt: also of those in doubt."""

    def __init__(self, catalogue: Catalogue, which: Filter, in_doubt: bool = False) -> None:
        self._catalogue, self._units = catalogue, quantity_units(catalogue)
        self._numbers, self._days = captures_of(catalogue.connection)
        self._among = None if which == ALL else np.isin(self._numbers, chosen(catalogue, which))
        if not in_doubt and len(doubted := in_doubt_of(catalogue)):
            sound = ~np.isin(self._numbers, doubted)
            self._among = sound if self._among is None else sound & self._among
        self._before = np.zeros(len(self._numbers), bool)
        self._shared = self._numbers[:0], self._days[:0]

    def names(self, quantities: Sequence[str] | None) -> list[str]:
        """Return the names of the quantities, or of all. Raises InputError."""
        if quantities is None:
            return list(self._units)
        return [known_quantity(self._catalogue, name) for name in quantities]

    def load(self, name: str) -> Series | None:
        """Return the series of a quantity; None where no capture has it."""
        values, u = column_of(self._catalogue.connection, name, self._units[name], self._numbers)
        found = np.isfinite(values) if self._among is None else np.isfinite(values) & self._among
        if not found.any():
            return None
        if not np.array_equal(found, self._before):  # most are of the same captures
            self._before, self._shared = found, (self._numbers[found], self._days[found])
        return Series(name, self._units[name], *self._shared, *taken(found, values, u))


def taken(wanted: Mask, *columns: Array) -> tuple[Array, ...]:
    """Return the wanted rows of columns (N,); the columns themselves where that is all of them."""
    return columns if wanted.all() else tuple(column[wanted] for column in columns)
