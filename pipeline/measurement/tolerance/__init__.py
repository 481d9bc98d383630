"""Tolerances: limits as data sheets print them, a file of them, and which file is a capture's."""

from .find import BY_MODEL, load_tolerance, tolerance_for, tolerance_of
from .values import ToleranceInterval, Value, angle_rad, read_value, rim_diameter

__all__ = [
    "BY_MODEL",
    "ToleranceInterval",
    "Value",
    "angle_rad",
    "load_tolerance",
    "read_value",
    "rim_diameter",
    "tolerance_for",
    "tolerance_of",
]
