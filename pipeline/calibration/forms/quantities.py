"""Quantities that a wheel alignment machine indicates: their points, signs, units and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from ...measurement import Value, angle_rad
from ...system import frozen
from ...units import in_metres
from ...vehicle import Unit

Subject = Literal["wheel", "axle", "vehicle", "turn"]
AXLES, TURNS, VEHICLE = ("front", "rear"), ("left", "right"), ("vehicle",)


@frozen
class MachineQuantity:
    """A quantity of a machine under test.

    subject: what its points are: a wheel or trial; an axle (for total toe also two targets, A+B);
    the vehicle; or a turn. signs: the sense that the machine may count as positive, and its factor
    to this program's sign; one name for a length without sign. axis: whether it depends on the
    longitudinal axis. largest: plausible size, radians or metres; least: of a length without sign.
    wheels_at_rim: as of `angle_rad`.
    """

    kind: str
    subject: Subject
    unit: Unit
    signs: Mapping[str, float]
    largest: float
    axis: bool = False
    wheels_at_rim: int = 0
    least: float = -math.inf


_TOE = {"toe-in": 1.0, "toe-out": -1.0}
_SIDE = {"right": 1.0, "left": -1.0}
_BACK = {"top-backwards": 1.0, "top-forwards": -1.0}
_BEHIND = {"right-behind": 1.0, "left-behind": -1.0}


def _angle(
    kind: str,
    subject: Subject,
    signs: Mapping[str, float],
    largest_deg: float,
    axis: bool = False,
    wheels_at_rim: int = 0,
) -> MachineQuantity:
    largest = math.radians(largest_deg)
    return MachineQuantity(kind, subject, "rad", signs, largest, axis, wheels_at_rim)


QUANTITIES = {
    quantity.kind: quantity
    for quantity in (
        _angle("toe", "wheel", _TOE, 30.0, axis=True, wheels_at_rim=1),
        _angle("camber", "wheel", {"top-out": 1.0, "top-in": -1.0}, 20.0),
        _angle("total_toe", "axle", _TOE, 30.0, wheels_at_rim=2),
        _angle("thrust_angle", "vehicle", _SIDE, 15.0, axis=True),
        _angle("caster", "wheel", _BACK, 40.0),
        _angle("sai", "wheel", {"top-in": 1.0, "top-out": -1.0}, 40.0),
        _angle("toe_out_on_turns", "turn", {"toe-out": 1.0, "toe-in": -1.0}, 20.0),
        MachineQuantity("setback", "axle", "m", _BEHIND, 1.0, axis=True),
        MachineQuantity("track", "axle", "m", {"length": 1.0}, 5.0, least=0.3),
    )
}
ANGLE_UNITS = ("deg", "dms", "min", "mm/m", "mm")
LENGTH_UNITS = ("mm", "m")
PER_DEGREE = {"deg": 1.0, "min": 60.0, "dms": 3600.0}


def units_of(quantity: MachineQuantity) -> tuple[str, ...]:
    """Return the units in which a machine may indicate the quantity; mm of toe is at the rim."""
    if quantity.unit == "m":
        return LENGTH_UNITS
    return ANGLE_UNITS if quantity.wheels_at_rim else ANGLE_UNITS[:-1]


def value_of(number: float, unit: str) -> Value:
    """Return a number that a machine indicates in a unit, other than dms, as a value."""
    if unit == "mm/m":
        return Value(number, "mm/m")
    if unit in LENGTH_UNITS:
        return Value(in_metres(number, unit), "m")
    return Value(number / 60.0 if unit == "min" else number, "deg")


def indicated(value: Value, quantity: MachineQuantity, rim_m: float | None) -> float:
    """Return a value with its unit in radians or metres. Raises ValueError for another kind."""
    if quantity.unit == "m":
        if value.scale != "m":
            raise ValueError("an angle, but a length is needed, such as 12 mm")
        return value.number
    return angle_rad(value, rim_m, quantity.wheels_at_rim)


def as_shown(value: float, unit: str, quantity: MachineQuantity, rim_m: float | None) -> float:
    """Return radians or metres as the number that a machine indicates in a unit; dms in seconds.

    Inverse of `indicated`. rim_m: known where the unit is mm of toe.
    """
    if quantity.unit == "m":
        return 1e3 * value if unit == "mm" else value
    if unit == "mm/m":
        return 1e3 * math.tan(value)
    if unit == "mm":
        assert rim_m is not None  # checked with the readings
        across_m = quantity.wheels_at_rim * rim_m
        return 1e3 * across_m * math.sin(value / quantity.wheels_at_rim)
    return math.degrees(value) * PER_DEGREE[unit]
