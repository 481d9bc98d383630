"""Readings of the machine under test: one row a reading, checked against item and reference."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Literal, get_args

from ...measurement import Value, read_value
from ...units import in_metres
from .item import Item
from .quantities import QUANTITIES, MachineQuantity, indicated, units_of
from .table_file import Cell, Faults, Row, read_table

State = Literal["as found", "as left"]
STATES: tuple[State, ...] = get_args(State)
DIRECTIONS = ("up", "down")
REQUIRED = ("point", "quantity", "value", "unit", "series", "repeat", "state")
OPTIONAL = ("direction", "operator", "note")
COLUMNS = (*REQUIRED, *OPTIONAL)
# Why a point of a quantity has no reference value; "" where it has one.
WhyNot = Callable[[str, str, str], str]

_DECIMAL = re.compile(r"([-+]?)(\d*)([.,]?)(\d*)")
_COMMA_WITHIN = re.compile(r"(?<=\d),(?=\d)")


@dataclass(frozen=True)
class Reading:
    """One reading, radians or metres, in the item's axis and sign.

    direction: of the approach, "" where it is not stated. row: in the file.
    """

    point: str
    quantity: str
    value: float
    unit: str
    series: str
    repeat: int
    direction: str
    state: State
    operator: str
    row: int


@dataclass(frozen=True)
class Readings:
    """Readings of one file, in its order, and the file's sha256."""

    source: str
    sha256: str
    rows: tuple[Reading, ...]


def read_readings(path: Path, item: Item, why_not: WhyNot) -> Readings:
    """Read the readings of an item. Raises FaultyTableError with all faults of the file.

    why_not: of quantity, point and series.
    """
    faults = Faults(path.name)
    found = sound_readings(path, item, why_not, faults)
    faults.check()
    return found


def sound_readings(path: Path, item: Item, why_not: WhyNot, faults: Faults) -> Readings:
    """Read the readings of an item that are without fault, and note every fault of the others."""
    table = read_table(path, REQUIRED, OPTIONAL, faults)
    found = [_reading(row, item, why_not, faults) for row in table]
    kept = [reading for reading in found if reading is not None]
    kept = _with_directions(_once(kept, faults), faults)
    if not table:
        faults.add(None, None, "it has no reading below its heading: enter them")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Readings(path.name, f"sha256:{digest}", tuple(kept))


def read_texts(path: Path) -> list[tuple[str, ...]]:
    """Read a table of readings as texts in the order of COLUMNS, whatever their values.

    Raises FaultyTableError for a heading or cells that cannot be used, InputError for no table.
    """
    faults = Faults(path.name)
    table = read_table(path, REQUIRED, OPTIONAL, faults)
    faults.check()
    return [tuple(_written(row.cells.get(column, "")) for column in COLUMNS) for row in table]


def _written(cell: Cell) -> str:
    """Return a cell as it would be typed; a number with every digit and no exponent."""
    return f"{Decimal(repr(cell)).normalize():f}" if isinstance(cell, float) else cell


def _reading(row: Row, item: Item, why_not: WhyNot, faults: Faults) -> Reading | None:
    """Return the reading of a row; None where it has a fault."""
    before = len(faults.found)
    for column in REQUIRED:
        if column not in row.cells:
            faults.add(row.number, column, "it is empty: fill it in, or delete the row")
    kind, unit = _word(row, "quantity"), _word(row, "unit")
    quantity = QUANTITIES.get(kind)
    if kind and quantity is None:
        faults.add(row.number, "quantity", f"{kind!r}: known are {', '.join(QUANTITIES)}")
    elif quantity is not None and kind not in item.declared():
        faults.add(row.number, "quantity", f"the item file has no [item.{kind}]: declare it there")
        quantity = None
    value = math.nan
    if quantity is not None and unit:
        if unit not in units_of(quantity):
            known = ", ".join(units_of(quantity))
            faults.add(row.number, "unit", f"{unit!r} is no unit of {kind}: known are {known}")
        elif "value" in row.cells:
            value = _value(row, unit, quantity, item, faults)
    point, series = row.text("point"), row.text("series")
    if quantity is not None and point and series:
        reason = why_not(kind, point, series)
        if reason:
            faults.add(row.number, "point", reason)
    repeat = row.text("repeat")
    if repeat and not (repeat.isdecimal() and int(repeat) > 0):
        faults.add(row.number, "repeat", f"{repeat!r}: a whole number from 1 is needed")
    state, direction = (
        _word(row, "state").replace("-", " ").replace("_", " "),
        _word(row, "direction"),
    )
    if state and state not in STATES:
        faults.add(row.number, "state", f"{state!r}: write 'as found' or 'as left'")
    if direction and direction not in DIRECTIONS:
        faults.add(row.number, "direction", f"{direction!r}: write up or down, or leave it empty")
    if len(faults.found) > before:
        return None
    return Reading(
        point=point,
        quantity=kind,
        value=value,
        unit=unit,
        series=series,
        repeat=int(repeat),
        direction=direction,
        state="as found" if state == "as found" else "as left",
        operator=row.text("operator"),
        row=row.number,
    )


def _word(row: Row, column: str) -> str:
    return row.text(column).casefold()


def _value(row: Row, unit: str, quantity: MachineQuantity, item: Item, faults: Faults) -> float:
    """Return the value of a row, radians or metres; nan where it has a fault."""
    try:
        found = indicated(_parsed(row.cells["value"], unit), quantity, item.rim_m)
    except ValueError as error:
        faults.add(row.number, "value", str(error))
        return math.nan
    if not abs(found) <= quantity.largest or (quantity.kind == "track" and found <= 0.0):
        shown = f"{row.text('value')} {unit}"
        most = (
            f"{math.degrees(quantity.largest):.0f}°"
            if quantity.unit == "rad"
            else f"{quantity.largest:g} m"
        )
        faults.add(
            row.number, "value", f"{shown} is no plausible {quantity.kind} (at most {most}): "
            "check value and unit"
        )  # fmt: skip
    return found


def _parsed(cell: Cell, unit: str) -> Value:
    """Return a value with its unit. Raises ValueError: the fact, and what to write."""
    if unit == "dms":
        if isinstance(cell, float):
            raise ValueError(f"{cell:g} has no marks of degrees and minutes: write it as 0°10'30\"")
        return read_value(_COMMA_WITHIN.sub(".", cell))
    number = cell if isinstance(cell, float) else decimal_number(cell)
    if unit == "mm/m":
        return Value(number, "mm/m")
    if unit in ("mm", "m"):
        return Value(in_metres(number, unit), "m")
    return Value(number / 60.0 if unit == "min" else number, "deg")


def decimal_number(text: str) -> float:
    """Return the number of a text with a decimal point, or an unambiguous decimal comma.

    1,234 may be 1.234 or 1234; 0,234 and 12,5 are decimal numbers. Raises ValueError.
    """
    found = _DECIMAL.fullmatch(text.replace("\N{MINUS SIGN}", "-"))
    if found is None or not (found[2] or found[4]):
        raise ValueError(f"{text!r} is no number: write it as -0.25, its unit in the column unit")
    sign, whole, mark, rest = found.groups()
    if mark == "," and len(rest) == 3 and 1 <= len(whole) <= 3 and not whole.startswith("0"):
        raise ValueError(
            f"{text!r} may be {sign}{whole}.{rest} or {sign}{whole}{rest}: write it with a point"
        )
    return float(f"{sign}{whole or 0}.{rest or 0}")


def _once(readings: list[Reading], faults: Faults) -> list[Reading]:
    """Return readings, the first of each; note those that stand twice."""
    rows: dict[tuple[object, ...], int] = {}
    for one in readings:
        key = (one.state, one.quantity, one.point, one.series, one.operator, one.direction,
               one.repeat)  # fmt: skip
        if key in rows:
            faults.add(one.row, "repeat", f"{one.repeat} of {one.quantity} at {one.point} stands "
                       f"in row {rows[key]} already: number each repeat once")  # fmt: skip
        rows.setdefault(key, one.row)
    first = set(rows.values())
    return [one for one in readings if one.row in first]


def _with_directions(readings: list[Reading], faults: Faults) -> list[Reading]:
    """Return readings less those without a direction, of quantities that have one elsewhere."""
    stated = {(one.state, one.quantity) for one in readings if one.direction}
    for one in readings:
        if not one.direction and (one.state, one.quantity) in stated:
            fact = f"it is empty, but other rows of {one.quantity} state it: fill in up or down"
            faults.add(one.row, "direction", fact)
    return [one for one in readings if one.direction or (one.state, one.quantity) not in stated]
