"""Plan file: the set of trials and readings that is intended, and what it shall show."""

from __future__ import annotations

from pathlib import Path
from typing import Self

from pydantic import Field, model_validator  # noqa: TID253 - a plan is a pydantic model

from ...config import Section, parse_section, read_toml
from ...measurement import read_value
from .item import Item
from .quantities import QUANTITIES, indicated

PLANNED = ("toe", "camber", "total_toe", "thrust_angle")
SCATTERS = ("repeatability", "reproducibility")
PLAN_FORM = """\
# A calibration to be planned. Values are texts with their units.
[plan]
trials = 8              # targets in further positions, besides the four reference wheels
repeats = 3             # readings of each point, series and direction
series = 1
directions = true       # each point approached upwards and downwards
track = "1.5 m"
wheelbase = "2.7 m"
spacing = "1.5 mm"      # between the points of a scan, on the target; not needed with a capture

[plan.toe]
lower = "-1°"           # the trials are spread from here
upper = "1°"            # to here
repeatability = "0.5'"  # standard deviation of single readings of the machine
# reproducibility = "0.3'" # standard deviation between series
# wanted = "1'"         # U of the error of a point
# ratio = 4.0           # or the ratio of MPE to U
zero = "1'"             # errors that shall be detected
gain = 0.02
hysteresis = "1'"

[plan.camber]
lower = "-3°"
upper = "3°"
repeatability = "0.5'"
zero = "1'"
"""


class PlannedQuantity(Section):
    """Known scatter of one quantity's readings, and its wanted U; values are texts with units.

    lower, upper: between which its trials are placed; only of toe and camber. wanted: U of the
    error of a point; ratio: of MPE to U instead. zero, gain, hysteresis: errors to be detected.
    """

    repeatability: str
    reproducibility: str | None = None
    lower: str | None = None
    upper: str | None = None
    wanted: str | None = None
    ratio: float | None = Field(None, gt=0.0)
    zero: str | None = None
    gain: float | None = Field(None, gt=-0.5, lt=0.5)
    hysteresis: str | None = None


class Plan(Section):
    """Set of trials and readings; a table for each quantity."""

    trials: int = Field(ge=0, le=200)
    repeats: int = Field(ge=1, le=1000)
    series: int = Field(1, ge=1, le=100)
    directions: bool = False
    track: str = "1.5 m"
    wheelbase: str = "2.7 m"
    spacing: str | None = None
    toe: PlannedQuantity | None = None
    camber: PlannedQuantity | None = None
    total_toe: PlannedQuantity | None = None
    thrust_angle: PlannedQuantity | None = None

    @model_validator(mode="after")
    def _be_complete(self) -> Self:
        if not self.quantities():
            raise ValueError("it plans no quantity: add a table such as [plan.toe]")
        if self.repeats == 1 and self.series == 1:
            raise ValueError("repeats = 1 in one series shows no repeatability: write 2 or more")
        for name in ("track", "wheelbase", "spacing"):
            text = getattr(self, name)
            if text is not None:
                self.length_m(name)
        return self

    def quantities(self) -> dict[str, PlannedQuantity]:
        """Return the planned quantities by their kinds."""
        found = {kind: getattr(self, kind) for kind in PLANNED}
        return {kind: table for kind, table in found.items() if table is not None}

    def length_m(self, name: str) -> float:
        """Return track, wheelbase or spacing. Raises ValueError for what is no length."""
        value = read_value(str(getattr(self, name)))
        if value.scale != "m" or not value.number > 0.0:
            raise ValueError(f"{name}: a length above zero is needed, such as 1.5 mm")
        return value.number

    def value(self, kind: str, part: str, item: Item) -> float | None:
        """Return a text of a quantity's table, radians or metres. Raises ValueError.

        Scatter below zero and a wanted U that is not above it are refused.
        """
        text = getattr(self.quantities()[kind], part)
        if text is None:
            return None
        try:
            size = indicated(read_value(text), QUANTITIES[kind], item.rim_m)
        except ValueError as error:
            raise ValueError(f"{kind}.{part}: {error}") from error
        if (part in SCATTERS and size < 0.0) or (part == "wanted" and not size > 0.0):
            least = "of zero or more" if part in SCATTERS else "above zero"
            raise ValueError(
                f"plan.{kind}.{part}: {text} is no size of an uncertainty: write one {least}"
            )
        return size


class PlanFile(Section):
    """Plan file: [plan]."""

    plan: Plan


def load_plan(path: Path) -> Plan:
    """Load a plan file (TOML). Raises ConfigError."""
    return parse_section(PlanFile, read_toml(path), str(path)).plan
