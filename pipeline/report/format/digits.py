"""Digits that follow the uncertainty: U with two significant digits, the value to the same place.

Without an uncertainty, or with one below SMALLEST of the unit, a number has a fixed number of
digits. Numbers are rounded to the nearest, ties to even; with two digits that takes less than 5 %
from U. Source: JCGM 100 (GUM), 7.2.6; EA-4/02, 6.3.
"""

from __future__ import annotations

import math
import re
from typing import Literal

from ...vehicle import Unit, deg_min_sec

SIGNIFICANT = 2
SMALLEST = 1e-6
UNKNOWN = math.nan  # as an uncertainty: fixed digits
Sign = Literal["+", ""]  # of positive numbers
# Units of arc, from the finest, that U takes while its two digits reach units or tens of it: tens
# divide 60, hundreds do not. Seconds in each, its mark, and how much of +00°00'00" is finer.
ARCS = ((1.0, '"', 0), (60.0, "'", 3), (3600.0, "°", 6))


def place_of(expanded: float) -> int | None:
    """Return the power of ten of the last of U's two digits, 0.0996 -> -2; None where unknown."""
    if not SMALLEST <= expanded < math.inf:
        return None
    exponent = f"{expanded:.{SIGNIFICANT - 1}e}".partition("e")[2]
    return int(exponent) - (SIGNIFICANT - 1)


def rounded(value: float, place: int, sign: Sign = "+") -> str:
    """Write a number rounded to the power of ten `place`, rounding's -0 as 0."""
    return f"{round(value, -place) + 0.0:{sign}.{max(0, -place)}f}"


def decimal(value: float, expanded: float, decimals: int, sign: Sign = "+") -> str:
    """Write a number to the place of U; with `decimals` where U is unknown."""
    place = place_of(expanded)
    return rounded(value, -decimals if place is None else place, sign)


def metres(length_m: float, expanded_m: float, sign: Sign = "") -> str:
    """Write a length in metres, U being stated in millimetres; 0.01 mm without U."""
    place = place_of(1e3 * expanded_m)
    return f"{rounded(length_m, -5 if place is None else place - 3, sign)} m"


def millimetres(length_m: float, expanded_m: float, sign: Sign = "") -> str:
    """Write a length in millimetres; 0.001 mm without U."""
    return f"{decimal(1e3 * length_m, 1e3 * expanded_m, 3, sign)} mm"


def sexagesimal(angle_rad: float, expanded_rad: float) -> str:
    """Write an angle as +00°19'40", down to the place of U: seconds, tens of them, minutes ...

    The sign belongs to the whole angle; 0.1" without U.
    """
    (seconds, _, finer), place = _arc(expanded_rad)
    if seconds == 1.0 and place <= 0:
        return deg_min_sec(angle_rad, -place)
    step_rad = math.radians(seconds * 10.0**place / 3600.0)
    if not math.isfinite(angle_rad):
        return deg_min_sec(angle_rad)
    text = deg_min_sec(round(angle_rad / step_rad) * step_rad, 0)
    return text[: len(text) - finer]


def brief(angle_rad: float) -> str:
    """Write an exact angle to 0.1" without what is zero: 0°, +30', -1°30', +12'07.5"."""
    degrees, minutes, seconds = re.split("[°']", deg_min_sec(angle_rad)[1:-1])
    parts = [f"{int(degrees)}°", f"{minutes}'", f'{seconds.removesuffix(".0")}"']
    kept = [part for part in parts if part.strip("0°'\"")]
    if not kept:
        return "0°"
    first, last = parts.index(kept[0]), parts.index(kept[-1])
    text = "".join(parts[first : last + 1])
    return f"{'-' if angle_rad < 0 else '+'}{text.removeprefix('0')}"


def arc(angle_rad: float, expanded_rad: float, sign: Sign = "") -> str:
    """Write a small angle in seconds, minutes or degrees, in that unit which U takes."""
    (seconds, mark, _), place = _arc(expanded_rad)
    return f"{rounded(math.degrees(angle_rad) * 3600.0 / seconds, place, sign)}{mark}"


def size(value: float, unit: Unit) -> str:
    """Write an uncertainty with its two digits, as an arc or in millimetres."""
    return millimetres(value, value) if unit == "m" else arc(value, value)


def _arc(expanded_rad: float) -> tuple[tuple[float, str, int], int]:
    """Return the unit of ARCS that U takes, and the power of ten of its last digit in it."""
    expanded_s = math.degrees(expanded_rad) * 3600.0
    for unit in ARCS:
        place = place_of(expanded_s / unit[0])
        if place is None:
            break
        if place <= 1:
            return unit, place
    return (ARCS[0], -1) if place is None else (ARCS[-1], place)
