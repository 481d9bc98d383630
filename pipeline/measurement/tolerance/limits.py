"""Limits of one quantity, as a tolerance file states them."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator  # noqa: TID253 - limits are pydantic models

from ...config import Section
from .values import FORMS, Scale, ToleranceInterval, Value, angle_rad, read_value

PARTS = ("lower", "upper", "nominal", "tolerance", "lower_deviation", "upper_deviation")
# The parts that define an interval together.
WHOLE = (
    {"lower"},
    {"upper"},
    {"lower", "upper"},
    {"nominal", "tolerance"},
    {"nominal", "lower_deviation", "upper_deviation"},
)


class Limits(Section):
    """Limits of one quantity, as texts with their units, or as numbers in keys that name it.

    Lower, upper or both; nominal with +- tolerance; nominal with both deviations from it.
    """

    unit: ClassVar[str]
    lower: str | None = None
    upper: str | None = None
    nominal: str | None = None
    tolerance: str | None = None
    lower_deviation: str | None = None
    upper_deviation: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _have_units(cls, table: Any) -> Any:
        for part in PARTS if isinstance(table, dict) else ():
            given = table.get(part)
            if isinstance(given, int | float):
                raise ValueError(
                    f"{part} = {given} has no unit: write {part}_{cls.unit} = {given}, or a text "
                    f"with its unit, such as {FORMS}"
                )
            if isinstance(given, str):
                read_value(given)
        return table

    @model_validator(mode="after")
    def _make_an_interval(self) -> Self:
        given = self._given()
        if set(given) not in WHOLE:
            keys = [f"{part}_{self.unit}" for part in PARTS]
            raise ValueError(
                f"give {keys[0]}, {keys[1]} or both, or {keys[2]} with {keys[3]}, "
                f"or {keys[2]} with {keys[4]} and {keys[5]}"
            )
        if len({value.scale for _, value in given.values()}) > 1:
            raise ValueError("its limits have units of several kinds: write all of them in one")
        for part, (shown, value) in given.items():
            sign = {"tolerance": 1.0, "upper_deviation": 1.0, "lower_deviation": -1.0}.get(
                part, 0.0
            )
            if sign * value.number < 0.0 or (part == "tolerance" and value.number == 0.0):
                way = "below" if sign < 0.0 else "above"
                raise ValueError(f"{shown}: write it with its sign, {way} zero")
            self._check(part, shown, value)
        for low, high in (("lower", "upper"), ("lower_deviation", "upper_deviation")):
            pair = [given[part] for part in (low, high) if part in given]
            if len(pair) == 2 and not pair[0][1].number < pair[1][1].number:
                raise ValueError(f"{pair[0][0]} is not below {pair[1][0]}")
        return self

    def _check(self, part: str, shown: str, value: Value) -> None:
        """Raise ValueError for a value that no such quantity has."""
        raise NotImplementedError

    def _given(self) -> dict[str, tuple[str, Value]]:
        """Return each part as it stands in the file, and its value."""
        found: dict[str, tuple[str, Value]] = {}
        for part in PARTS:
            text, number = getattr(self, part), getattr(self, f"{part}_{self.unit}")
            if text is not None and number is not None:
                raise ValueError(f"it has both {part} and {part}_{self.unit}: leave out one")
            if text is not None:
                found[part] = f"{part} = {text}", read_value(text)
            if number is not None:
                scale: Scale = "m" if self.unit == "m" else "deg"
                found[part] = f"{part}_{self.unit} = {number:g}", Value(number, scale)
        return found

    def interval(self, wheels: int, rim_m: float | None) -> ToleranceInterval:
        """Return the tolerance interval, radians or metres; wheels: as of `angle_rad`."""
        given = self._given()
        number = {part: value.number for part, (_, value) in given.items()}
        ends = number.get("lower", -math.inf), number.get("upper", math.inf)
        if "nominal" in number:
            beside = number.get("tolerance", 0.0)
            less, more = (
                number.get("lower_deviation", -beside),
                number.get("upper_deviation", beside),
            )
            ends = number["nominal"] + less, number["nominal"] + more
        if self.unit == "m":
            return ToleranceInterval(*ends)
        scale = next(value.scale for _, value in given.values())
        return ToleranceInterval(*(angle_rad(Value(end, scale), rim_m, wheels) for end in ends))


class AngleLimits(Limits):
    """Limits of an angle: degrees, a slope in mm/m, or of toe mm at the rim."""

    unit: ClassVar[str] = "deg"
    lower_deg: float | None = Field(None, ge=-90.0, le=90.0)
    upper_deg: float | None = Field(None, ge=-90.0, le=90.0)
    nominal_deg: float | None = Field(None, ge=-90.0, le=90.0)
    tolerance_deg: float | None = Field(None, gt=0.0, le=90.0)
    lower_deviation_deg: float | None = Field(None, ge=-90.0, le=0.0)
    upper_deviation_deg: float | None = Field(None, ge=0.0, le=90.0)

    def _check(self, part: str, shown: str, value: Value) -> None:
        if value.scale == "deg" and abs(value.number) > 90.0:
            raise ValueError(f"{shown}: it must lie from -90° to 90°")


class TurnLimits(AngleLimits):
    """Limits of toe-out on turns with the inner wheel at inner_deg."""

    inner_deg: float = Field(gt=0.0, le=60.0)


class OffsetLimits(Limits):
    """Limits of a signed length, metres."""

    unit: ClassVar[str] = "m"
    lower_m: float | None = None
    upper_m: float | None = None
    nominal_m: float | None = None
    tolerance_m: float | None = Field(None, gt=0.0)
    lower_deviation_m: float | None = Field(None, le=0.0)
    upper_deviation_m: float | None = Field(None, ge=0.0)

    def _check(self, part: str, shown: str, value: Value) -> None:
        if value.scale != "m":
            raise ValueError(f"{shown}: a length is needed, such as 12 mm")


class LengthLimits(OffsetLimits):
    """Limits of a length, metres."""

    lower_m: float | None = Field(None, ge=0.0)
    upper_m: float | None = Field(None, ge=0.0)
    nominal_m: float | None = Field(None, ge=0.0)

    def _check(self, part: str, shown: str, value: Value) -> None:
        super()._check(part, shown, value)
        if part in ("lower", "upper", "nominal") and value.number < 0.0:
            raise ValueError(f"{shown}: a length is not negative")
