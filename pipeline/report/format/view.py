"""How a report is to be read: from which longitudinal axis, and in which unit of angle."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal, get_args

from ...errors import InputError
from ...units import in_metres
from ...vehicle import Axis, deg_min_sec

AngleStyle = Literal["dms", "deg", "mm/m", "mm"]
ANGLE_STYLES: tuple[AngleStyle, ...] = get_args(AngleStyle)
# In mm at a rim: toe, a difference of distances; in mm/m: toe and every heading, a slope. Camber is
# customary in neither and stays in degrees.
Sort = Literal["toe", "heading", "camber"]

DEFINED: dict[Axis, str] = {
    "rear-axle": "normal to the rear axle",
    "centreline": "geometric centreline, through the midpoints of both axles",
    "thrust-line": "thrust line, which bisects the rear wheels' toe",
    "side-bisector": "bisector of the lines through the wheel centres of either side",
}
UNITS: dict[AngleStyle, str] = {
    "dms": "Angles in degrees, minutes and seconds of arc; the sign belongs to the whole angle.",
    "deg": "Angles in decimal degrees.",
    "mm/m": (
        "Toe and what is counted to the right in mm/m, the tangent; camber in degrees, minutes\n"
        "and seconds of arc."
    ),
    "mm": (
        "Toe in mm: how much farther apart the rims stand behind than ahead, at the height of the\n"
        "wheel centres; D sin(toe) of each wheel, their sum of an axle, D = {rim} mm. Other\n"
        "angles in degrees, minutes and seconds of arc."
    ),
}
RIM_M = (0.1, 2.0)


@dataclass(frozen=True)
class View:
    """The axis in use, the unit of angles, and the rim's diameter, which mm needs."""

    axis: Axis = "rear-axle"
    angles: AngleStyle = "dms"
    rim_m: float = math.nan

    def angle(self, angle_rad: float, sort: Sort) -> str:
        """Write an angle with its sign and unit."""
        if self.angles == "deg":
            return f"{_zero(math.degrees(angle_rad), 5):+.5f}°"
        if self.angles == "mm/m" and sort != "camber":
            return f"{_zero(1e3 * math.tan(angle_rad), 3):+.3f} mm/m"
        if self.angles == "mm" and sort == "toe":
            return _millimetres(self.rim_m * math.sin(angle_rad))
        return deg_min_sec(angle_rad)

    def total_toe(self, left_rad: float, right_rad: float) -> str:
        """Write the total toe of an axle from the toe of both wheels."""
        if self.angles == "mm":
            return _millimetres(self.rim_m * (math.sin(left_rad) + math.sin(right_rad)))
        return self.angle(left_rad + right_rad, "toe")

    def width(self, u_rad: float, sort: Sort, at_rad: float = 0.0) -> str:
        """Write a standard uncertainty, or another small angle, at the angle at_rad."""
        if self.angles == "deg":
            return f"{math.degrees(u_rad):.5f}°"
        if self.angles == "mm/m" and sort != "camber":
            return f"{1e3 * u_rad / math.cos(at_rad) ** 2:.3f} mm/m"
        if self.angles == "mm" and sort == "toe":
            return f"{1e3 * self.rim_m * u_rad * math.cos(at_rad):.3f} mm"
        return f'{math.degrees(u_rad) * 3600:.1f}"'

    @property
    def units(self) -> str:
        """Explanation of the units."""
        return UNITS[self.angles].format(rim=f"{1e3 * self.rim_m:g}")


PAPER = View()  # as the paper has it: the rear axle's normal; degrees, minutes and seconds


def read_view(axis: Axis, angles: AngleStyle, rim: str | None) -> View:
    """Return a view from the options --axis, --angles and --rim. Raises InputError."""
    if angles != "mm":
        if rim is not None:
            raise InputError(f"--rim {rim} without --angles mm: add it, or leave out the rim")
        return View(axis, angles)
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
    return View(axis, angles, rim_m)


def _millimetres(length_m: float) -> str:
    return f"{_zero(1e3 * length_m, 3):+.3f} mm"


def _zero(value: float, decimals: int) -> float:
    """Round a value, without the sign of a zero."""
    return round(value, decimals) + 0.0
