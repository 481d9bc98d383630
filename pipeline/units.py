"""Units and coordinate conventions that a user may declare; the program uses metres and radians."""

from __future__ import annotations

from typing import Literal, get_args

from .vectors import Array

# A unit is `factor` metres, or 1/`divisor` of a metre: 0.001 is no binary fraction, so a product
# with it rounds twice where a division rounds once.
# A foot is the international one; that of older surveys in the USA is longer by 2e-6 of itself.
_FACTOR = {"m": 1.0, "in": 0.0254, "ft": 0.3048}
_DIVISOR = {"mm": 1000.0, "cm": 100.0}

LengthUnit = Literal["m", "mm", "in", "cm", "ft"]
LENGTH_UNITS: tuple[LengthUnit, ...] = get_args(LengthUnit)
AngleUnit = Literal["deg", "gon", "rad"]
Coordinates = Literal["cartesian", "spherical"]
Azimuth = Literal["auto", "clockwise", "counterclockwise"]  # seen from above


def to_metres(lengths: Array, unit: str) -> None:
    """Scale float64 `lengths` of any shape to metres, in place, rounding each once."""
    if unit in _DIVISOR:
        lengths /= _DIVISOR[unit]
    elif unit != "m":
        lengths *= _FACTOR[unit]


def in_metres(length: float, unit: str) -> float:
    """Return one length in metres."""
    return length / _DIVISOR[unit] if unit in _DIVISOR else length * _FACTOR[unit]
