"""Printed values read back, and the last place that an uncertainty calls for, both by Decimal.

Independent of the program's rounding: units are named here again.
"""

from __future__ import annotations

import math
import re
from decimal import Context, Decimal

ANGLE = re.compile(r"([+-]?)(\d+)°(?:(\d\d)'(?:(\d\d(?:[.,]\d+)?)\")?)?")
ARCS = {'"': 1, "'": 60, "°": 3600}


def two_digits(x: float) -> Decimal:
    """Round to two significant digits, from all binary digits of x."""
    near = Context(prec=2).create_decimal_from_float(x)
    return near.quantize(Decimal(1).scaleb(near.adjusted() - 1))  # 1 as 1.0


def step(expanded: float) -> float:
    """Return the unit of the last of U's two digits."""
    return float(Decimal(1).scaleb(two_digits(expanded).adjusted() - 1))


def arc_step_s(expanded_s: float) -> float:
    """Return the step of a value in deg-min-sec: a power of ten of seconds, minutes, degrees."""
    for seconds in ARCS.values():
        found = step(expanded_s / seconds)
        if found <= 10.0 or seconds == 3600:
            return found * seconds
    raise AssertionError


def seconds_of(text: str) -> float:
    """Read +00°19'40.7", +00°20' or +01° as seconds of arc."""
    found = ANGLE.fullmatch(text)
    assert found, text
    sign, degrees, minutes, seconds = found.groups()
    whole = 3600 * int(degrees) + 60 * int(minutes or 0)
    whole += float((seconds or "0").replace(",", "."))
    return -whole if sign == "-" else whole


def arc_s(text: str) -> float:
    """Read 23", 4.3", 21' or 17° as seconds of arc."""
    return float(text[:-1].replace(",", ".")) * ARCS[text[-1]]


def says_angle(value_text: str, value_deg: float, expanded_deg: float) -> bool:
    """Return whether an angle is printed right: rounded to the place of its U, and no finer."""
    unit_s = arc_step_s(3600.0 * expanded_deg)
    read_s = seconds_of(value_text)
    steps = read_s / unit_s
    near = abs(read_s - 3600.0 * value_deg) <= unit_s * (0.5 + 1e-6)
    return near and math.isclose(steps, round(steps), abs_tol=1e-6)


def says_width(width_text: str, width_deg: float) -> bool:
    """Return whether an uncertainty is printed with its two digits."""
    return math.isclose(
        arc_s(width_text), 3600.0 * width_deg, abs_tol=arc_step_s(3600.0 * width_deg) * 0.5001
    )
