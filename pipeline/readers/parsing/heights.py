"""Matrices of heights: a point for each cell, and the pitch and unit that a header states."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import numpy as np

from ...system import frozen
from ...units import LENGTH_UNITS, in_metres
from ...vectors import Array
from ..faults import fault
from ..source import Block, Source
from .columns import stated_unit, unit_of
from .lines import is_number

_KEY_AND_VALUE = re.compile(
    r"\W*([^\W\d][\w /().\[\]µμ-]*?)[\"'\s]*[\s:=,;][\"'\s]*([-+.\d][\d.e+-]*)[\"'\s,;]*(\S*)",
    re.IGNORECASE,
)
_OF = "(?:pixel)?(?:pitch|resolution|spacing|interval|step|calibration|size)"
_PITCH = {
    "xy": re.compile(f"xy{_OF}|{_OF}xy|pixelpitch|pixelsize|cellsize"),
    "x": re.compile(f"x{_OF}|{_OF}x"),
    "y": re.compile(f"y{_OF}|{_OF}y"),
}
_METRES = {"µm": 1e-6, "nm": 1e-9} | {unit: in_metres(1.0, unit) for unit in LENGTH_UNITS}
_INTEGER_LIMITS = (-32768.0, -2147483648.0)
_FEWEST_NINES, _FEWEST_IN_STEPS, _LONGEST_LINE = 4, 8, 200
_APART = 0.25  # of the span of the other heights: a mark lies farther from the nearest of them


@frozen
class Heights:
    """A matrix of heights: x and y step by `pitch`, in `unit` if stated; `none`: no height."""

    pitch: tuple[float, float]
    unit: str | None = None
    none: float | None = None

    def block(self, table: Array, first_row: int) -> Block:
        """Return the rows (N, C) of the matrix from `first_row` on as a block of N C points."""
        row, column = np.divmod(np.arange(table.size), table.shape[1])
        row += first_row
        z = table.ravel()
        invalid = np.isnan(z)
        for value in {self.none, *_marks(z)} - {None}:
            invalid |= z == value
        dx, dy = self.pitch
        return Block((column * dx, row * dy, z), None, (row, column), invalid)


def stated_heights(lines: Iterable[str]) -> Heights | None:
    """Return the pitch and unit of the heights that the lines of a header state, if they do."""
    steps: dict[str, tuple[float, str | None]] = {}
    unit = none = None
    flip = False
    for line in (text for text in lines if len(text) <= _LONGEST_LINE):
        if (stated := stated_unit(line)) is not None:
            unit = unit_of(stated) or unit
            continue
        found = _KEY_AND_VALUE.match(line)
        if not found or not is_number(found[2]):
            continue
        key, value = re.sub(r"[\W_]+", "", found[1].lower()), float(found[2])
        for name, pattern in _PITCH.items():
            if pattern.fullmatch(key) and value > 0.0:
                steps[name] = value, unit_of(found[3].partition("/")[0])
        if key == "nodatavalue":
            none = value
        flip |= key == "cellsize"  # a grid of Esri begins with its northern row
    x, y = (steps.get(name, steps.get("xy")) for name in "xy")
    if x is None or y is None:
        return None
    unit = unit or x[1] or y[1]
    dx, dy = (
        value * _METRES[own] / _METRES[unit] if own and unit else value for value, own in (x, y)
    )
    return Heights((dx, -dy if flip else dy), unit, none)


def height_blocks(heights: Heights, tables: Iterable[Array], source: Source) -> Iterator[Block]:
    """Yield the blocks of successive tables of a matrix. Raises InputError for a first row of x."""
    row = 0
    for table in tables:
        if row == 0 and _counts_up(table):
            fact = "the first row of its heights rises in equal steps, as positions do"
            raise fault(source, fact, "delete that row, and a column of positions")
        if len(table):
            yield heights.block(table, row)
        row += len(table)


def _marks(heights: Array) -> Iterator[float]:
    """Yield the lowest and highest value where they mark missing heights: -9999, -99999.9999.

    A value of nines does if it stands apart from the heights; a surface of 9.999 is one.
    """
    there = heights[np.isfinite(heights)]
    ends = {float(value) for value in (there.min(), there.max())} if len(there) else set()
    nines = {value for value in ends if _is_of_nines(value)}
    rest = there[~np.isin(there, list(nines))]
    for value in ends:
        apart = float(np.abs(rest - value).min(initial=np.inf))
        is_apart = not len(rest) or apart > _APART * float(np.ptp(rest))
        if value in _INTEGER_LIMITS or (value in nines and is_apart):
            yield value


def _is_of_nines(value: float) -> bool:
    """Return whether the digits of a value are nines alone, four or more."""
    digits = f"{abs(value):.4f}".rstrip("0").replace(".", "")
    return len(digits) >= _FEWEST_NINES and set(digits) == {"9"}


def _counts_up(table: Array) -> bool:
    """Return whether the first row rises in equal steps, and the next neither rises nor falls so.

    A row of one value, as of missing heights, has no steps.
    """
    if len(table) < 2 or table.shape[1] < _FEWEST_IN_STEPS:
        return False
    first, second = (np.diff(row) for row in table[:2])
    return bool(np.ptp(first) < 1e-3 * first[0] and not np.ptp(second) < 1e-3 * abs(second[0]))
