"""Tolerance file: limits of angles and lengths, and the decision rule."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any, Literal, Self

from pydantic import Field, create_model, model_validator  # noqa: TID253 - a tolerance is a pydantic model

from ...config import Section
from ...vehicle import REFERENCE_WHEELS, VEHICLE, WHEEL, Unit
from ..quantities import CROSS, RADIAN, TURNS, UNITS, WHEEL_BY_RUNOUT, WHEEL_BY_SWEEP
from .limits import AngleLimits, LengthLimits, OffsetLimits, TurnLimits
from .values import ToleranceInterval, rim_diameter

Rule = Literal["guarded", "simple"]
# The number of wheels whose toe a quantity sums; only these are given in mm at the rim.
WHEELS_AT_RIM = {"toe": 1, "total_toe": 2, "cross_toe": 2}
ALIASES = {"kpi": "sai", "cross_kpi": "cross_sai"}


def _limits(unit: Unit, signed: bool = True) -> Any:
    """Return the type and the default of a quantity's limits, for `create_model`."""
    if unit == "rad":
        return AngleLimits | None, None
    return (OffsetLimits if signed else LengthLimits) | None, None


# A table for each quantity of a wheel, or of both wheels of an axle, and of the vehicle.
_OF_WHEEL = {entry.name: _limits(RADIAN) for entry in WHEEL}
_OF_WHEEL |= {
    name: _limits(UNITS.get(name, RADIAN), name != "radial_runout")
    for name in (*WHEEL_BY_SWEEP, *WHEEL_BY_RUNOUT)
}
_OF_WHEEL["kpi"] = _OF_WHEEL["sai"]
_OF_VEHICLE = {entry.name: _limits(entry.unit, entry.signed) for entry in VEHICLE}
_OF_VEHICLE |= {name: _limits(RADIAN) for name in (*CROSS, "cross_kpi")}
_OF_VEHICLE |= dict.fromkeys(TURNS, (TurnLimits | None, None))
WheelTolerance = create_model("WheelTolerance", __base__=Section, **_OF_WHEEL)
VehicleTolerance = create_model("VehicleTolerance", __base__=Section, **_OF_VEHICLE)


class Tolerance(Section):
    """Tolerance file; `configs/tolerances/example.toml` explains it."""

    title: str = ""
    vehicle_model: str | None = Field(None, min_length=1)
    rule: Rule = "guarded"
    confidence: float = Field(0.95, gt=0.5, lt=1.0)
    trials: bool = True
    rim: str | None = None
    rear: WheelTolerance = WheelTolerance()
    front: WheelTolerance = WheelTolerance()
    RR: WheelTolerance = WheelTolerance()
    RL: WheelTolerance = WheelTolerance()
    FR: WheelTolerance = WheelTolerance()
    FL: WheelTolerance = WheelTolerance()
    vehicle: VehicleTolerance = VehicleTolerance()

    @model_validator(mode="before")
    @classmethod
    def _name_the_right_table(cls, tables: Any) -> Any:
        of_wheel, of_vehicle = WheelTolerance.model_fields, VehicleTolerance.model_fields
        for table, keys in tables.items() if isinstance(tables, dict) else ():
            if table in of_wheel or table in of_vehicle:
                right = "vehicle" if table in of_vehicle else "front"
                raise ValueError(f"[{table}]: name what it belongs to, as in [{right}.{table}]")
            for key in keys if isinstance(keys, dict) else ():
                if table == "vehicle" and key in of_wheel:
                    raise ValueError(
                        f"vehicle.{key}: it is a quantity of a wheel: use [front.{key}] or so"
                    )
                if table != "vehicle" and key in of_vehicle:
                    raise ValueError(
                        f"{table}.{key}: it is a quantity of the vehicle: use [vehicle.{key}]"
                    )
        return tables

    @model_validator(mode="after")
    def _limit_something(self) -> Self:
        if not any(self.of_wheel(wheel) for wheel in REFERENCE_WHEELS) and not self.of_vehicle():
            raise ValueError("it holds no limit: add a table such as [rear.toe] with upper_deg")
        for table in ("rear", "RR", "RL"):
            for name in (*WHEEL_BY_SWEEP, "kpi"):
                if getattr(getattr(self, table), name) is not None:
                    raise ValueError(
                        f"{table}.{name}: only front wheels are swept for a steering axis: use "
                        f"[front.{name}], [FR.{name}] or [FL.{name}]"
                    )
        return self

    @property
    def coverage_factor(self) -> float:
        """Guard band at a single limit, in standard uncertainties; 0 by the simple rule."""
        return NormalDist().inv_cdf(self.confidence) if self.rule == "guarded" else 0.0

    @property
    def rim_m(self) -> float | None:
        """Diameter at which toe in mm is given, metres. Raises ValueError where it is no rim's."""
        return None if self.rim is None else rim_diameter(self.rim)

    def of_wheel(self, wheel: str) -> dict[str, ToleranceInterval]:
        """Return the intervals of a wheel's quantities; its own table overrides its axle's."""
        axle = "rear" if wheel.startswith("R") else "front"
        return self._intervals(axle) | self._intervals(wheel)

    def of_vehicle(self) -> dict[str, ToleranceInterval]:
        """Return the intervals of the vehicle's angles (radians) and lengths (metres)."""
        return self._intervals("vehicle")

    def inner_rad(self, name: str) -> float:
        """Return the angle of the inner wheel at which toe-out on turns is limited."""
        limits = getattr(self.vehicle, name)
        return math.radians(limits.inner_deg) if isinstance(limits, TurnLimits) else math.nan

    def _intervals(self, table: str) -> dict[str, ToleranceInterval]:
        """Return the intervals of a table by quantity. Raises ValueError that names the key."""
        rim_m = self.rim_m
        found: dict[str, ToleranceInterval] = {}
        for key, limits in getattr(self, table):
            if limits is None:
                continue
            name = ALIASES.get(key, key)
            if name in found:
                raise ValueError(f"{table}: {name} and {key} are one quantity: leave out one")
            kind = name.partition("_to_")[0].removeprefix("rear_").removeprefix("front_")
            try:
                found[name] = limits.interval(WHEELS_AT_RIM.get(kind, 0), rim_m)
            except ValueError as error:
                raise ValueError(f"{table}.{key}: {error}") from error
        return found
