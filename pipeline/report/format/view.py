"""How a report is to be read: from which longitudinal axis, in which unit of angle, how finely."""

from __future__ import annotations

import math
import re
from typing import Literal, get_args

from ...errors import InputError
from ...measurement import VerticalKind
from ...system import frozen
from ...units import in_metres
from ...vehicle import Axis
from .digits import UNKNOWN, Sign, arc, brief, decimal, metres, rounded, sexagesimal

AngleStyle = Literal["dms", "deg", "mm/m", "mm"]
ANGLE_STYLES: tuple[AngleStyle, ...] = get_args(AngleStyle)
STYLES_WITHOUT_RIM = tuple(style for style in ANGLE_STYLES if style != "mm")
DigitStyle = Literal["uncertainty", "full"]
DIGIT_STYLES: tuple[DigitStyle, ...] = get_args(DigitStyle)
Convention = Literal["default", "iso-8855", "german-workshop"]
CONVENTIONS: tuple[Convention, ...] = get_args(Convention)
# Counted to the right by default; about Z_V, to the left, by ISO 8855 and in German workshops.
HEADINGS = ("thrust_angle", "steer_ahead", "centreline_angle", "side_bisector_angle")
# In mm at a rim: toe, a difference of distances; in mm/m: toe and every heading, a slope. Camber is
# customary in neither and stays in degrees.
Sort = Literal["toe", "total", "heading", "camber"]

DEFINED: dict[Axis, str] = {
    "rear-axle": "normal to the rear axle",
    "centreline": "geometric centreline, through the midpoints of both axles",
    "thrust-line": (
        "thrust line, which bisects the rear wheels' toe; of a trial of a rear wheel, with the "
        "trial in that wheel's place"
    ),
    "side-bisector": "bisector of the lines through the wheel centres of either side",
}
UNITS: dict[AngleStyle, str] = {
    "dms": "Angles in degrees, minutes and seconds of arc; the sign belongs to the whole angle.",
    "deg": "Angles in decimal degrees.",
    "mm/m": (
        "Toe and angles of lines in mm/m, the tangent; camber in degrees, minutes\n"
        "and seconds of arc."
    ),
    "mm": (
        "Toe in mm: how much farther apart the rims stand behind than ahead, at the height of the\n"
        "wheel centres; D sin(toe) of each wheel, their sum of an axle, D = {rim} mm. Other\n"
        "angles in degrees, minutes and seconds of arc."
    ),
}
DIGITS: dict[DigitStyle, str] = {
    "uncertainty": (
        "Digits: an uncertainty has two; a value ends at the place at which its expanded\n"
        "uncertainty U (95 %) ends. Vectors and planes, for calculations, keep theirs."
    ),
    "full": "Digits: a fixed number, whatever the uncertainty.",
}
RIM_M = (0.1, 2.0)


@frozen
class View:
    """The axis in use, the unit of angles, the rim's diameter, which mm needs, and the digits.

    digits: "uncertainty" as `digits.py` explains; "full" without regard to the uncertainty.
    vertical: from which camber, caster and SAI are measured. convention: signs, and further angles.
    """

    axis: Axis = "rear-axle"
    angles: AngleStyle = "dms"
    rim_m: float = math.nan
    digits: DigitStyle = "uncertainty"
    vertical: VerticalKind = "wheels"
    convention: Convention = "default"

    def sense(self, name: str) -> float:
        """Return -1 for a quantity whose sign is reversed in this convention, else 1."""
        kind = name.partition("_to_")[0]
        return -1.0 if self.convention != "default" and kind in HEADINGS else 1.0

    def angle(self, angle_rad: float, sort: Sort, expanded_rad: float = UNKNOWN) -> str:
        """Write an angle with its sign and unit, to the place of its expanded uncertainty."""
        unit = self._decimal_unit(sort, angle_rad)
        expanded_rad = self.known(expanded_rad)
        if unit is None:
            return sexagesimal(angle_rad, expanded_rad)
        return decimal(unit.value, unit.slope * expanded_rad, unit.decimals) + unit.mark

    def total_toe(self, left_rad: float, right_rad: float, expanded_rad: float = UNKNOWN) -> str:
        """Write the total toe of an axle from the toe of both wheels."""
        total_rad = left_rad + right_rad
        unit = self._decimal_unit("total", total_rad)
        if self.angles != "mm" or unit is None:
            return self.angle(total_rad, "total", expanded_rad)
        total_mm = 1e3 * self.rim_m * (math.sin(left_rad) + math.sin(right_rad))
        return decimal(total_mm, unit.slope * self.known(expanded_rad), unit.decimals) + unit.mark

    def width(
        self,
        size_rad: float,
        sort: Sort,
        at_rad: float = 0.0,
        expanded_rad: float | None = None,
        sign: Sign = "",
    ) -> str:
        """Write an uncertainty, or another small size, at the angle at_rad.

        To the place of its expanded uncertainty; with two digits where there is none.
        """
        unit = self._decimal_unit(sort, at_rad)
        expanded = self.known(size_rad if expanded_rad is None else expanded_rad)
        if unit is None:
            return arc(size_rad, expanded, sign)
        size = unit.slope * size_rad
        return decimal(size, unit.slope * expanded, unit.decimals, sign) + unit.mark

    def limit(self, angle_rad: float, sort: Sort) -> str:
        """Write an exact angle, such as a limit, as briefly as its fixed digits allow."""
        unit = self._decimal_unit(sort, angle_rad)
        if unit is None:
            return brief(angle_rad)
        text = rounded(unit.value, -unit.decimals).rstrip("0").rstrip(".")
        return ("0" if text == "+0" else text) + unit.mark

    def length(self, length_m: float, expanded_m: float = UNKNOWN) -> str:
        """Write a length in metres, to the place of its expanded uncertainty."""
        return metres(length_m, self.known(expanded_m))

    def known(self, expanded: float) -> float:
        """Return the uncertainty that the digits follow: none with full digits."""
        return UNKNOWN if self.digits == "full" else expanded

    def _decimal_unit(self, sort: Sort, at_rad: float) -> _DecimalUnit | None:
        """Return the decimal unit of an angle; None where it is written as degrees-minutes."""
        if self.angles == "deg":
            return _DecimalUnit(math.degrees(at_rad), math.degrees(1.0), 5, "°")
        if self.angles == "mm/m" and sort != "camber":
            return _DecimalUnit(1e3 * math.tan(at_rad), 1e3 / math.cos(at_rad) ** 2, 3, " mm/m")
        if self.angles == "mm" and sort in ("toe", "total"):
            wheels = 2.0 if sort == "total" else 1.0
            at_rad, rim_mm = at_rad / wheels, 1e3 * self.rim_m
            value_mm = wheels * rim_mm * math.sin(at_rad)
            return _DecimalUnit(value_mm, rim_mm * math.cos(at_rad), 3, " mm")
        return None

    @property
    def units(self) -> str:
        """Explanation of the units."""
        return UNITS[self.angles].format(rim=f"{1e3 * self.rim_m:g}")


@frozen
class _DecimalUnit:
    """An angle in a decimal unit, the unit's change per radian there, its digits without U."""

    value: float
    slope: float
    decimals: int
    mark: str


PAPER = View()  # as the paper has it: the rear axle's normal; degrees, minutes and seconds


def axis_by(convention: Convention) -> Axis:
    """Return the axis of a convention, where none is given."""
    return PAPER.axis if convention == "default" else "centreline"


def read_view(
    axis: Axis, angles: AngleStyle, rim: str | None, digits: DigitStyle = "uncertainty"
) -> View:
    """Return a view from the options --axis, --angles, --rim and --digits. Raises InputError."""
    if angles != "mm":
        if rim is not None:
            raise InputError(f"--rim {rim} without --angles mm: add it, or leave out the rim")
        return View(axis, angles, digits=digits)
    if rim is None:
        raise InputError("--angles mm without --rim: name the rim's diameter, such as --rim 16in")
    found = re.fullmatch(r"(\d+(?:\.\d*)?)\s*(mm|in|m)", rim.strip())
    if found is None:
        raise InputError(f"--rim {rim}: a diameter with its unit is needed, such as 16in or 406mm")
    rim_m = in_metres(float(found[1]), found[2])
    if not RIM_M[0] <= rim_m <= RIM_M[1]:
        raise InputError(
            f"--rim {rim}: a diameter of {rim_m:g} m is no rim's: name one from {RIM_M[0]:g} to "
            f"{RIM_M[1]:g} m, such as 16in or 406mm"
        )
    return View(axis, angles, rim_m, digits)
