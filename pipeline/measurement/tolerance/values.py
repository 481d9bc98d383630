"""Values as data sheets print them, such as -0°05' or 2.5 mm/m, and intervals of them."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from typing import Literal

from ...system import frozen
from ...units import in_metres

Scale = Literal["deg", "mm/m", "m"]
RIM_M = (0.1, 2.0)

_NUMBER = r"(\d+(?:\.\d*)?|\.\d+)"
_SIGN = r"\s*([-+\N{MINUS SIGN}]?)\s*"
_SEXAGESIMAL = (
    rf"{_SIGN}(?:{_NUMBER}\s*(?:°|deg))?\s*(?:{_NUMBER}\s*(?:'|′|min))?\s*"  # noqa: RUF001
    rf"(?:{_NUMBER}\s*(?:\"|″))?\s*"
)
_LINEAR = rf"{_SIGN}{_NUMBER}\s*(mm/m|mm|m|in)\s*"
FORMS = "0°10', 10', 0.17°, 2.5 mm/m or 1.5 mm"


@frozen
class ToleranceInterval:
    """Interval from lower to upper, both included, radians or metres; infinite without a limit.

    Raises ValueError where it holds no value, or every value.
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not self.lower < self.upper or self.lower == -self.upper == -math.inf:
            raise ValueError(f"no tolerance lies from {self.lower} to {self.upper}")

    def times(self, sense: float) -> ToleranceInterval:
        """Return the interval of a quantity whose sign is reversed where sense is -1."""
        return self if sense > 0.0 else ToleranceInterval(-self.upper, -self.lower)

    @property
    def width(self) -> float:
        """Upper less lower limit; inf where one of them is missing."""
        return self.upper - self.lower


@frozen
class Value:
    """A number on the scale of its unit: degrees, mm/m (1000 tan of an angle), or metres."""

    number: float
    scale: Scale


def read_value(text: str) -> Value:
    """Parse a value with its unit. Raises ValueError that names the forms."""
    found = re.fullmatch(_LINEAR, text)
    if found is not None:
        sign, digits, unit = found.groups()
        number = float(digits) if sign in ("", "+") else -float(digits)
        return Value(number, "mm/m") if unit == "mm/m" else Value(in_metres(number, unit), "m")
    found = re.fullmatch(_SEXAGESIMAL, text)
    if found is None or not any(found.groups()[1:]):
        raise ValueError(f"{text!r} is no value with its unit: write it as {FORMS}")
    degrees = _degrees(text, found.groups()[1:])
    return Value(degrees if found[1] in ("", "+") else -degrees, "deg")


def _degrees(text: str, parts: tuple[str | None, ...]) -> float:
    """Return degrees from degrees, minutes and seconds; only the last part has decimals."""
    given = [(part, 60.0**-i) for i, part in enumerate(parts) if part is not None]
    whole = all(part.isdigit() for part, _ in given[:-1])
    if not whole or any(float(part) >= 60.0 for part, _ in given[1:]):
        raise ValueError(
            f"{text!r}: whole degrees and minutes, minutes and seconds below 60, as in 1°10'30\""
        )
    return math.fsum(float(part) * scale for part, scale in given)


def rim_diameter(text: str) -> float:
    """Return the diameter at which toe in mm is given, metres. Raises ValueError for no rim's."""
    rim_m = math.nan
    with suppress(ValueError):
        value = read_value(text)
        rim_m = value.number if value.scale == "m" else math.nan
    if not RIM_M[0] <= rim_m <= RIM_M[1]:
        raise ValueError(
            f"rim = {text!r}: a diameter from {RIM_M[0]:g} to {RIM_M[1]:g} m is needed, "
            "such as 16in or 406mm"
        )
    return rim_m


def angle_rad(value: Value, rim_m: float | None, wheels: int) -> float:
    """Return the angle that a limit stands for, radians.

    A length is mm at the rim, the sum of D sin(toe) over `wheels` wheels of equal toe. Raises
    ValueError where the rim's diameter is missing, or the quantity (wheels = 0) has none.
    """
    number = value.number
    if math.isinf(number):
        return number
    if value.scale == "deg":
        return math.radians(number)
    if value.scale == "mm/m":
        return math.atan(number / 1e3)
    if not wheels:
        raise ValueError(
            "only toe is given in mm at the rim: write this angle as 0°10', 10' or 0.17°"
        )
    if rim_m is None:
        raise ValueError(
            f"{number * 1e3:g} mm is at the rim: add its diameter, such as "
            'rim = "16in", at the top of the limits or below [item] of the item file'
        )
    if abs(number) > wheels * rim_m:
        raise ValueError(f"{number * 1e3:g} mm is more than the rim of {rim_m * 1e3:g} mm has")
    return wheels * math.asin(number / (wheels * rim_m))
