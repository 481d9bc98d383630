"""Tolerance file: limits of angles and lengths, and the decision rule."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Literal, Self

from pydantic import Field, create_model, model_validator  # noqa: TID253 - a tolerance is a pydantic model

from ..config import Section, config_file, parse_section, read_toml
from ..vehicle import VEHICLE, WHEEL, VehicleQuantity, WheelQuantity

Rule = Literal["guarded", "simple"]


@dataclass(frozen=True)
class ToleranceInterval:
    """Interval from lower to upper, both included, radians or metres; infinite without a limit.

    Raises ValueError where it holds no value, or every value.
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not self.lower < self.upper or self.lower == -self.upper == -math.inf:
            raise ValueError(f"no tolerance lies from {self.lower} to {self.upper}")

    @property
    def width(self) -> float:
        """Upper less lower limit; inf where one of them is missing."""
        return self.upper - self.lower


class AngleLimits(Section):
    """Limits of an angle, degrees: lower, upper or both, or nominal with +- tolerance."""

    lower_deg: float | None = Field(None, ge=-90.0, le=90.0)
    upper_deg: float | None = Field(None, ge=-90.0, le=90.0)
    nominal_deg: float | None = Field(None, ge=-90.0, le=90.0)
    tolerance_deg: float | None = Field(None, gt=0.0, le=90.0)

    @model_validator(mode="after")
    def _make_an_interval(self) -> Self:
        _check_limits(self, "deg")
        return self

    @property
    def interval(self) -> ToleranceInterval:
        """Tolerance interval, radians."""
        lower, upper = _limits(self, "deg")
        return ToleranceInterval(math.radians(lower), math.radians(upper))


class LengthLimits(Section):
    """Limits of a length, metres: lower, upper or both, or nominal with +- tolerance."""

    lower_m: float | None = Field(None, ge=0.0)
    upper_m: float | None = Field(None, ge=0.0)
    nominal_m: float | None = Field(None, ge=0.0)
    tolerance_m: float | None = Field(None, gt=0.0)

    @model_validator(mode="after")
    def _make_an_interval(self) -> Self:
        _check_limits(self, "m")
        return self

    @property
    def interval(self) -> ToleranceInterval:
        """Tolerance interval, metres."""
        return ToleranceInterval(*_limits(self, "m"))


class OffsetLimits(LengthLimits):
    """Limits of a signed length, metres."""

    lower_m: float | None = None
    upper_m: float | None = None
    nominal_m: float | None = None


def _limits_of(entry: WheelQuantity | VehicleQuantity) -> tuple[object, None]:
    """Return the type and the default of a quantity's limits."""
    if isinstance(entry, WheelQuantity) or entry.unit == "rad":
        return AngleLimits | None, None
    return (OffsetLimits if entry.signed else LengthLimits) | None, None


# For a wheel or both of an axle, and for the vehicle: a table for each entry of definitions.py.
_OF_WHEEL: dict[str, Any] = {entry.name: _limits_of(entry) for entry in WHEEL}
_OF_VEHICLE: dict[str, Any] = {entry.name: _limits_of(entry) for entry in VEHICLE}
WheelTolerance = create_model("WheelTolerance", __base__=Section, **_OF_WHEEL)
VehicleTolerance = create_model("VehicleTolerance", __base__=Section, **_OF_VEHICLE)


class Tolerance(Section):
    """Tolerance file; `configs/tolerances/example.toml` explains it."""

    title: str = ""
    rule: Rule = "guarded"
    confidence: float = Field(0.95, gt=0.5, lt=1.0)
    trials: bool = True
    rear: WheelTolerance = WheelTolerance()
    front: WheelTolerance = WheelTolerance()
    RR: WheelTolerance = WheelTolerance()
    RL: WheelTolerance = WheelTolerance()
    FR: WheelTolerance = WheelTolerance()
    FL: WheelTolerance = WheelTolerance()
    vehicle: VehicleTolerance = VehicleTolerance()

    @model_validator(mode="after")
    def _limit_something(self) -> Self:
        wheels = ("RR", "RL", "FR", "FL")
        if not any(self.of_wheel(wheel) for wheel in wheels) and not self.of_vehicle():
            raise ValueError("it holds no limit: add a table such as [rear.toe] with upper_deg")
        return self

    @property
    def coverage_factor(self) -> float:
        """Guard band at a single limit, in standard uncertainties; 0 by the simple rule."""
        return NormalDist().inv_cdf(self.confidence) if self.rule == "guarded" else 0.0

    def of_wheel(self, wheel: str) -> dict[str, ToleranceInterval]:
        """Return the intervals of a wheel's angles, radians; its own table overrides its axle's."""
        own, axle = getattr(self, wheel), self.rear if wheel.startswith("R") else self.front
        return _intervals(axle) | _intervals(own)

    def of_vehicle(self) -> dict[str, ToleranceInterval]:
        """Return the intervals of the vehicle's angles (radians) and lengths (metres)."""
        return _intervals(self.vehicle)


def load_tolerance(name: str) -> Tolerance:
    """Load a tolerance by name (`example`) or TOML file. Raises ConfigError."""
    return parse_section(Tolerance, read_toml(config_file("tolerances", name)), name)


def _intervals(limits: Section) -> dict[str, ToleranceInterval]:
    return {name: given.interval for name, given in limits if given is not None}


def _limits(given: AngleLimits | LengthLimits, unit: str) -> tuple[float, float]:
    """Return lower and upper limit in the file's unit."""
    lower, upper, nominal, tolerance = (
        getattr(given, f"{part}_{unit}") for part in ("lower", "upper", "nominal", "tolerance")
    )
    if nominal is not None:
        return nominal - tolerance, nominal + tolerance
    return -math.inf if lower is None else lower, math.inf if upper is None else upper


def _check_limits(given: AngleLimits | LengthLimits, unit: str) -> None:
    """Raise ValueError where the table does not define one interval."""
    has = {name.removesuffix(f"_{unit}") for name, value in given if value is not None}
    if has not in ({"lower"}, {"upper"}, {"lower", "upper"}, {"nominal", "tolerance"}):
        raise ValueError(
            f"give lower_{unit}, upper_{unit} or both, or nominal_{unit} with tolerance_{unit}"
        )
    lower, upper = _limits(given, unit)
    if not lower < upper:
        raise ValueError(f"lower_{unit} = {lower:g} is not below upper_{unit} = {upper:g}")
