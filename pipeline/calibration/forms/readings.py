"""Readings of the machine under test: one row a reading, checked against item and reference."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Literal, get_args

from ...errors import Wording
from ...measurement import Value, read_value
from ...system import frozen
from .item import Item
from .quantities import QUANTITIES, MachineQuantity, indicated, units_of, value_of
from .table_file import Cell, Faults, Row, read_table

State = Literal["as found", "as left"]
STATES: tuple[State, ...] = get_args(State)
DIRECTIONS = ("up", "down")
REQUIRED = ("point", "quantity", "value", "unit", "series", "repeat", "state")
OPTIONAL = ("direction", "operator", "note")
COLUMNS = (*REQUIRED, *OPTIONAL)
AS_WRITTEN = ("point", "series", "operator")  # small and capital letters count
PLACE = ("state", "quantity", "point", "series", "operator", "direction", "repeat")
NEEDED_PLACE = tuple(name for name in PLACE if name in REQUIRED)
# Why a point of a quantity has no reference value; "" where it has one.
WhyNot = Callable[[str, str, str], str]

NO_NUMBER = "{value} is no number: write it as -0.25, its unit in the column unit"
NO_MARKS = "{value} has no marks of degrees and minutes: write it as 0°10'30\""
NO_ANGLE = "{value}: write degrees, minutes and seconds as 0°10'30\", minutes and seconds below 60"
TWO_NUMBERS = "{value} may be {one} or {other}: write it with a point"

_DECIMAL = re.compile(r"([-+]?)(\d*)([.,]?)(\d*)")
_COMMA_WITHIN = re.compile(r"(?<=\d),(?=\d)")


@frozen
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


@frozen
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
    earlier = _repeated(table)
    found = [_reading(row, item, why_not, earlier.get(row.number), faults) for row in table]
    kept = [reading for reading in found if reading is not None]
    kept = _with_operators(_with_directions(kept, faults), faults)
    if not table:
        faults.add(None, None, Wording("it has no reading below its heading: enter them"))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Readings(path.name, f"sha256:{digest}", tuple(kept))


def read_texts(path: Path) -> list[tuple[str, ...]]:
    """Read a table of readings as texts in the order of COLUMNS, whatever their values.

    They are for a form that has one field of each repeat and one unit of each quantity. Raises
    FaultyTableError for a heading or cells that cannot be used, and for rows that such a form
    cannot hold; InputError for no table.
    """
    faults = Faults(path.name)
    table = read_table(path, REQUIRED, OPTIONAL, faults)
    earlier = _repeated(table)
    for row in table:
        _add_empty(row, NEEDED_PLACE, faults)
        if row.number in earlier:
            _add_repeat(row, earlier[row.number], faults)
    _add_unlike_units(table, faults)
    faults.check()
    return [tuple(_written(row.cells.get(column, "")) for column in COLUMNS) for row in table]


def _written(cell: Cell) -> str:
    """Return a cell as it would be typed; a number with every digit and no exponent."""
    return f"{Decimal(repr(cell)).normalize():f}" if isinstance(cell, float) else cell


def _reading(
    row: Row, item: Item, why_not: WhyNot, earlier: int | None, faults: Faults
) -> Reading | None:
    """Return the reading of a row; None where it has a fault. earlier: a row of the same repeat."""
    before = len(faults.found)
    _add_empty(row, REQUIRED, faults)
    kind, unit = _word(row, "quantity"), _word(row, "unit")
    quantity = QUANTITIES.get(kind)
    if kind and quantity is None:
        known = ", ".join(QUANTITIES)
        fact = Wording("{value}: known are {known}", value=repr(kind), known=known)
        faults.add(row.number, "quantity", fact)
    elif quantity is not None and kind not in item.declared():
        fact = Wording("the item file has no [item.{kind}]: declare it there", kind=kind)
        faults.add(row.number, "quantity", fact)
        quantity = None
    value = math.nan
    if quantity is not None and unit:
        if unit not in units_of(quantity):
            known = ", ".join(units_of(quantity))
            fact = Wording(
                "{unit} is no unit of {kind}: known are {known}",
                unit=repr(unit),
                kind=kind,
                known=known,
            )
            faults.add(row.number, "unit", fact)
        elif "value" in row.cells:
            value = _value(row, unit, quantity, item, faults)
    point, series = row.text("point"), row.text("series")
    if quantity is not None and point and series:
        reason = why_not(kind, point, series)
        if reason:
            faults.add(row.number, "point", reason)
    _add_repeat(row, earlier, faults)
    state, direction = _word(row, "state"), _word(row, "direction")
    if state and state not in STATES:
        fact = Wording("{value}: write 'as found' or 'as left'", value=repr(state))
        faults.add(row.number, "state", fact)
    if direction and direction not in DIRECTIONS:
        fact = Wording("{value}: write up or down, or leave it empty", value=repr(direction))
        faults.add(row.number, "direction", fact)
    if len(faults.found) > before or row.unusable:
        return None
    return Reading(
        point=point,
        quantity=kind,
        value=value,
        unit=unit,
        series=series,
        repeat=int(row.text("repeat")),
        direction=direction,
        state="as found" if state == "as found" else "as left",
        operator=row.text("operator"),
        row=row.number,
    )


def _word(row: Row, column: str) -> str:
    """Return a word of a row in the one way in which it is compared."""
    word = row.text(column).casefold()
    return word.replace("-", " ").replace("_", " ") if column == "state" else word


def _add_empty(row: Row, columns: Sequence[str], faults: Faults) -> None:
    empty = [c for c in columns if c not in row.cells and c not in row.unusable]
    if empty:
        fact = Wording("it is empty: fill it in, or delete the row")
        faults.add(row.number, ", ".join(empty), fact)


def _add_repeat(row: Row, earlier: int | None, faults: Faults) -> None:
    """Add the fault of a repeat that is no number, or that stands in an earlier row."""
    repeat = row.text("repeat")
    if repeat and not (repeat.isdecimal() and int(repeat) > 0):
        fact = Wording("{value}: a whole number from 1 is needed", value=repr(repeat))
        faults.add(row.number, "repeat", fact)
    elif earlier is not None:
        fact = Wording(
            "{repeat} of {kind} at {point} stands in row {row} already: number each repeat once",
            repeat=repeat,
            kind=_word(row, "quantity"),
            point=row.text("point"),
            row=earlier,
        )
        faults.add(row.number, "repeat", fact)


def _add_unlike_units(table: list[Row], faults: Faults) -> None:
    """Add the faults of values in another unit than the first that is stated of their quantity."""
    valued = [row for row in table if "value" in row.cells]
    first = {_word(row, "quantity"): row for row in reversed(valued) if row.text("unit")}
    for row in valued:
        kind, unit = _word(row, "quantity"), _word(row, "unit")
        known = first.get(kind, row)
        if unit == _word(known, "unit"):
            continue
        fact = Wording(
            "{unit}, but {kind} is in {other} in row {row}: write all of its readings in one unit",
            unit=repr(unit),
            kind=kind,
            other=repr(_word(known, "unit")),
            row=known.number,
        )
        faults.add(row.number, "unit", fact)


def _value(row: Row, unit: str, quantity: MachineQuantity, item: Item, faults: Faults) -> float:
    """Return the value of a row, radians or metres; nan where it has a fault."""
    try:
        found = indicated(_parsed(row.cells["value"], unit), quantity, item.rim_m)
    except ValueError as error:
        faults.add(row.number, "value", error.args[0])
        return math.nan
    if found < quantity.least:
        fact = Wording(
            "{shown} is no plausible {kind} (at least {least}): check value and unit",
            shown=f"{row.text('value')} {unit}",
            kind=quantity.kind,
            least=f"{quantity.least:g} m",
        )
        faults.add(row.number, "value", fact)
        return math.nan
    if not abs(found) <= quantity.largest:
        shown = f"{row.text('value')} {unit}"
        most = (
            f"{math.degrees(quantity.largest):.0f}°"
            if quantity.unit == "rad"
            else f"{quantity.largest:g} m"
        )
        fact = Wording(
            "{shown} is no plausible {kind} (at most {most}): check value and unit",
            shown=shown,
            kind=quantity.kind,
            most=most,
        )
        faults.add(row.number, "value", fact)
    return found


def _parsed(cell: Cell, unit: str) -> Value:
    """Return a value with its unit. Raises ValueError: the fact, and what to write."""
    if unit == "dms":
        if isinstance(cell, float):
            raise ValueError(Wording(NO_MARKS, value=f"{cell:g}"))
        return _sexagesimal(cell)
    return value_of(cell if isinstance(cell, float) else decimal_number(cell), unit)


def _sexagesimal(text: str) -> Value:
    try:
        found = read_value(_COMMA_WITHIN.sub(".", text))
    except ValueError as error:
        raise ValueError(Wording(NO_ANGLE, value=repr(text))) from error
    if found.scale != "deg":
        raise ValueError(Wording(NO_ANGLE, value=repr(text)))
    return found


def decimal_number(text: str) -> float:
    """Return the number of a text with a decimal point, or an unambiguous decimal comma.

    1,234 may be 1.234 or 1234; 0,234 and 12,5 are decimal numbers. Raises ValueError.
    """
    found = _DECIMAL.fullmatch(text.replace("\N{MINUS SIGN}", "-"))
    if found is None or not (found[2] or found[4]):
        raise ValueError(Wording(NO_NUMBER, value=repr(text)))
    sign, whole, mark, rest = found.groups()
    if mark == "," and len(rest) == 3 and 1 <= len(whole) <= 3 and not whole.startswith("0"):
        one, other = f"{sign}{whole}.{rest}", f"{sign}{whole}{rest}"
        raise ValueError(Wording(TWO_NUMBERS, value=repr(text), one=one, other=other))
    return float(f"{sign}{whole or 0}.{rest or 0}")


def _repeated(table: list[Row]) -> dict[int, int]:
    """Return the rows whose repeat stands in an earlier row, by number, and that row."""
    first: dict[tuple[str, ...], int] = {}
    found = {}
    for row in table:
        if not all(row.text(name) for name in NEEDED_PLACE):
            continue
        key = tuple(row.text(name) if name in AS_WRITTEN else _word(row, name) for name in PLACE)
        if key in first:
            found[row.number] = first[key]
        first.setdefault(key, row.number)
    return found


def _with_directions(readings: list[Reading], faults: Faults) -> list[Reading]:
    """Return readings less those without a direction, of quantities that have one elsewhere."""
    stated = {(one.state, one.quantity) for one in readings if one.direction}
    for one in readings:
        if not one.direction and (one.state, one.quantity) in stated:
            fact = Wording(
                "it is empty, but other rows of {kind} state it: fill in up or down",
                kind=one.quantity,
            )
            faults.add(one.row, "direction", fact)
    return [one for one in readings if one.direction or (one.state, one.quantity) not in stated]


def _with_operators(readings: list[Reading], faults: Faults) -> list[Reading]:
    """Return readings less those without an operator, of series that have one elsewhere.

    Rows without one would be those of one more operator.
    """

    def where(one: Reading) -> tuple[str, str, str]:
        return one.state, one.quantity, one.series

    stated = {where(one) for one in readings if one.operator}
    for one in readings:
        if not one.operator and where(one) in stated:
            fact = Wording(
                "it is empty, but other rows of {kind} in series {series} state it: fill it in",
                kind=one.quantity,
                series=one.series,
            )
            faults.add(one.row, "operator", fact)
    return [one for one in readings if one.operator or where(one) not in stated]
