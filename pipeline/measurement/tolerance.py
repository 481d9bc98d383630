"""The tolerance file: limits of angles and lengths, and the rule that decides by them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Literal, Self

from pydantic import Field, create_model, model_validator  # noqa: TID253 - a tolerance is a pydantic model

from ..config import Section, config_file, parse_section, read_toml
from ..vehicle import VEHICLE, WHEEL, OfVehicle, OfWheel

Rule = Literal["guarded", "simple"]


@dataclass(frozen=True)
class ToleranceInterval:
    """From lower to upper, both included, radians or metres; -inf or inf where there is no limit.

    Raises ValueError where nothing lies within, or everything does.
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not self.lower < self.upper or self.lower == -self.upper == -math.inf:
            raise ValueError(f"no tolerance lies from {self.lower} to {self.upper}")

    @property
    def width(self) -> float:
        """Upper less lower limit; inf where one of them is not there."""
        return self.upper - self.lower


class AngleLimits(Section):
    """Of an angle, degrees: lower and upper or one of them, or nominal with +- tolerance."""

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
        """The same in radians."""
        lower, upper = _limits(self, "deg")
        return ToleranceInterval(math.radians(lower), math.radians(upper))


class LengthLimits(Section):
    """Of a length, metres: lower and upper or one of them, or nominal with +- tolerance."""

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
        """The same as a zone."""
        return ToleranceInterval(*_limits(self, "m"))


class OffsetLimits(LengthLimits):
    """Of a length that has a sign, metres."""

    lower_m: float | None = None
    upper_m: float | None = None
    nominal_m: float | None = None


def _limits_of(entry: OfWheel | OfVehicle) -> tuple[object, None]:
    """The type and the default of a quantity's limits."""
    if isinstance(entry, OfWheel) or entry.unit == "rad":
        return AngleLimits | None, None
    return (OffsetLimits if entry.signed else LengthLimits) | None, None


# Of a wheel or both of an axle, and of the vehicle: a table for each entry of definitions.py.
_OF_WHEEL: dict[str, Any] = {entry.name: _limits_of(entry) for entry in WHEEL}
_OF_VEHICLE: dict[str, Any] = {entry.name: _limits_of(entry) for entry in VEHICLE}
WheelTolerance = create_model("WheelTolerance", __base__=Section, **_OF_WHEEL)
VehicleTolerance = create_model("VehicleTolerance", __base__=Section, **_OF_VEHICLE)


class Tolerance(Section):
    """A tolerance file; `configs/tolerances/example.toml` explains it."""

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
        """Standard uncertainties of a guard band at a single limit; 0 by the simple rule."""
        return NormalDist().inv_cdf(self.confidence) if self.rule == "guarded" else 0.0

    def of_wheel(self, wheel: str) -> dict[str, ToleranceInterval]:
        """Zones of a wheel's angles, radians: its own table stands before that of its axle."""
        own, axle = getattr(self, wheel), self.rear if wheel.startswith("R") else self.front
        return _intervals(axle) | _intervals(own)

    def of_vehicle(self) -> dict[str, ToleranceInterval]:
        """Zones of the vehicle's angles (radians) and lengths (metres)."""
        return _intervals(self.vehicle)


def load_tolerance(name: str) -> Tolerance:
    """Tolerance by name (`example`) or TOML file. Raises ConfigError."""
    return parse_section(Tolerance, read_toml(config_file("tolerances", name)), name)


def _intervals(limits: Section) -> dict[str, ToleranceInterval]:
    return {name: given.interval for name, given in limits if given is not None}


def _limits(given: AngleLimits | LengthLimits, unit: str) -> tuple[float, float]:
    """Lower and upper limit in the file's unit."""
    lower, upper, nominal, tolerance = (
        getattr(given, f"{part}_{unit}") for part in ("lower", "upper", "nominal", "tolerance")
    )
    if nominal is not None:
        return nominal - tolerance, nominal + tolerance
    return -math.inf if lower is None else lower, math.inf if upper is None else upper


def _check_limits(given: AngleLimits | LengthLimits, unit: str) -> None:
    """Raise ValueError where the table does not say one zone."""
    has = {name.removesuffix(f"_{unit}") for name, value in given if value is not None}
    if has not in ({"lower"}, {"upper"}, {"lower", "upper"}, {"nominal", "tolerance"}):
        raise ValueError(
            f"give lower_{unit}, upper_{unit} or both, or nominal_{unit} with tolerance_{unit}"
        )
    lower, upper = _limits(given, unit)
    if not lower < upper:
        raise ValueError(f"lower_{unit} = {lower:g} is not below upper_{unit} = {upper:g}")
