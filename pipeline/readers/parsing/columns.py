"""Columns by their names, the units in those names, and columns that bear none."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ...vectors import Array
from ..colour import COLOURS
from ..faults import fault
from ..options import KNOWN_COLUMNS
from ..source import Layout, Source

INTENSITIES = (
    *("intensity", "scalar_intensity", "reflectance", "scalar_reflectance"),
    *("reflectivity", "i"),
)
# Names of x, y and z, by those who write them; the second set is ParaView's.
_AXES = (
    ("x", "y", "z"),
    ("points:0", "points:1", "points:2"),
    ("points_0", "points_1", "points_2"),
    *(("easting", "northing", up) for up in ("elevation", "height", "z")),
    *(("east", "north", up) for up in ("elevation", "height", "up")),
)
_UNITS = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), "m"),
    **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), "mm"),
    **dict.fromkeys(("in", "inch", "inches"), "in"),
    **dict.fromkeys(("cm", "centimetre", "centimetres", "centimeter", "centimeters"), "cm"),
    **dict.fromkeys(("um", "µm", "μm", "micron", "microns", "micrometer", "micrometre"), "µm"),
    **dict.fromkeys(("nm", "nanometer", "nanometre"), "nm"),
    **dict.fromkeys(("ft", "foot", "feet"), "ft"),
}
_BRACKETED = re.compile(r"(.*?)[\s_]*(?:\[([^\]]*)\]|\(([^)]*)\))")
_SUFFIXED = re.compile(r"(.*?)(?:\s*/\s*|_|\s+in\s+|\s+)(\w+)")
_UNIT_LINE = re.compile(
    r"\W*(?:(?:height|length|linear|coordinate) |z ?)?units?[\"'\s]*[\s:=,;]+[\"'\s]*"
    r"(?:(?:in|is|are)\s+)?([^\s\"',;]+)",
    re.IGNORECASE,
)
_DECORATION = re.compile(r"coordinates?|coord|position|pos|axis|value|[\s_.-]+")
_LONGEST_NAME, _LONGEST_UNIT_LINE = 100, 200
MOST_UNNAMED = 12
_SHOWN_ROWS = 1000
_FEWEST_ROWS = 3


def unit_of(text: str) -> str | None:
    """Return the unit of length that a word stands for: m, mm, in, cm, µm, nm, ft; or None."""
    return _UNITS.get(text.strip(" \t\"'[]()").lower())


def stated_unit(line: str) -> str | None:
    """Return the word that a line gives as the unit (`Units: mm`); None if it gives none."""
    found = _UNIT_LINE.match(line) if len(line) <= _LONGEST_UNIT_LINE else None
    return found and found[1]


def find_layout(names: Sequence[str]) -> Layout:
    """Find x, y, z and the intensity by name, in either case, with the unit they state.

    Where no intensity is named, a colour is. Names may have a unit (`X [m]`, `x(mm)`, `X_m`) and
    may be those of surveyors and of ParaView.
    Raises ValueError when a coordinate is missing or occurs twice, or the units differ.
    """
    parted = [_part(name) for name in names]
    bare = [name for name, _ in parted]
    for known in (bare, [_DECORATION.sub("", name) for name in bare]):
        for axes in _AXES:
            if all(known.count(axis) == 1 for axis in axes):
                x, y, z = (known.index(axis) for axis in axes)
                shade = next((known.index(name) for name in INTENSITIES if name in known), None)
                unit = _one_unit([parted[k][1] for k in (x, y, z)])
                return Layout((x, y, z), shade, unit, () if shade is not None else _colour(bare))
    for axis in "xyz":
        if bare.count(axis) != 1:
            count = bare.count(axis)
            what = "missing" if not count else f"there {count} times"
            raise ValueError(f"{axis} is {what} among the columns {', '.join(names)[:120]}")
    raise AssertionError("x, y and z are there")


def _colour(names: Sequence[str]) -> tuple[int, ...]:
    """Return the indices of red, green and blue among the names; none if one is not there once."""
    for colour in COLOURS:
        if all(names.count(name) == 1 for name in colour):
            return tuple(names.index(name) for name in colour)
    return ()


def are_known(names: Sequence[str]) -> bool:
    """Return whether all of the words are names of columns, x, y and z among them."""
    bare = {_part(name)[0] for name in names}
    return {"x", "y", "z"} <= bare <= KNOWN_COLUMNS | set(INTENSITIES)


def _part(name: str) -> tuple[str, str | None]:
    """Return a column's name in lower case and the unit behind it, as written, or None."""
    name = name.strip(" \t\"'").lower()
    if len(name) > _LONGEST_NAME:
        return name, None
    if found := _BRACKETED.fullmatch(name):
        return found[1], next(unit for unit in found.groups()[1:] if unit is not None)
    found = _SUFFIXED.fullmatch(name)
    if found and unit_of(found[2]):
        return found[1], found[2]
    return name, None


def _one_unit(stated: Sequence[str | None]) -> str | None:
    """Return the unit of three columns, None if they state none. Raises ValueError."""
    units = {unit_of(text) or text for text in stated if text}
    if len(units) > 1:
        raise ValueError(f"the columns of x, y and z have the units {', '.join(sorted(units))}")
    return next(iter(units), None)


def unnamed_layout(columns: int) -> Layout:
    """Return x, y, z and perhaps the intensity of columns without names."""
    return Layout((0, 1, 2), 3 if columns == 4 else None)


def check_unnamed(table: Array, source: Source, by: str = "--columns") -> None:
    """Raise InputError where the first of the columns (N, C) without names seem to be no x y z.

    by: what names columns, for the message.

    Row and column of the scanner's raster are two whole numbers before three that are not, or
    they count up; an index counts up from row to row.
    """
    table = table[:_SHOWN_ROWS]
    rows, columns = table.shape
    if rows < _FEWEST_ROWS or columns < 4:
        return
    with np.errstate(invalid="ignore"):
        whole = np.all(table == np.rint(table), axis=0)  # False where a number is missing
        steps = np.diff(table, axis=0)
    if whole[0] and np.all(steps[:, 0] == 1.0) and not np.all(steps[:, 1] == 1.0):
        raise _unnamed(source, "its first column counts the rows", ["-"], columns, by)
    if whole[0] and not whole[1:4].any() and np.all(steps[:, 0] > 0.0):
        raise _unnamed(source, "its first column is a rising whole number", ["-"], columns, by)
    if columns < 5 or not (whole[0] and whole[1]) or (table[:, :2] < 0.0).any():
        return
    counts = any(np.mean((steps[:, k] == 1.0) & (steps[:, 1 - k] == 0.0)) > 0.5 for k in (0, 1))
    if counts or not whole[2:5].any():
        first_two = "its first two columns are whole numbers, as of a raster"
        raise _unnamed(source, first_two, ["row", "col"], columns, by)


def _unnamed(source: Source, fact: str, first: list[str], columns: int, by: str) -> InputError:
    found, plain = (
        ",".join([*names, *["-"] * (columns - len(names))])
        for names in ([*first, "x", "y", "z"], ["x", "y", "z"])
    )
    action = f"give {by} {found} or, if they are coordinates, {by} {plain}"
    return fault(source, f"{fact}, and no column has a name", action)
