"""Every quantity of a wheel and of the vehicle in one table; definitions and signs: axes.py."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import Literal

from ..system import frozen
from .autodiff import Dual
from .axes import AXES, FL, FR, RL, RR, Axis, Vehicle

Unit = Literal["rad", "m"]


def named(kind: str, axis: Axis | None) -> str:
    """Return the name of a quantity relative to an axis: `toe`, `toe_to_thrust_line`."""
    return kind if axis in (None, "rear-axle") else f"{kind}_to_{axis.replace('-', '_')}"


@frozen
class WheelQuantity:
    """A quantity of each wheel, radians.

    of: its value from the vehicle and the wheel's index. axis: the axis it is relative to; None
    where it is the same for all.
    """

    kind: str
    of: Callable[[Vehicle, int], Dual]
    axis: Axis | None = None

    @cached_property
    def name(self) -> str:
        """Kind, and the axis where it is not the rear-axle normal."""
        return named(self.kind, self.axis)


@frozen
class VehicleQuantity:
    """A quantity of the vehicle, radians or metres; signed: False for a length."""

    kind: str
    unit: Unit
    of: Callable[[Vehicle], Dual]
    signed: bool = True
    axis: Axis | None = None

    @cached_property
    def name(self) -> str:
        """Kind, and the axis where it is not the rear-axle normal."""
        return named(self.kind, self.axis)


WHEEL = (
    WheelQuantity("toe", Vehicle.toe, "rear-axle"),
    WheelQuantity("camber", Vehicle.camber),
    WheelQuantity("camber_iso", Vehicle.camber_iso, "rear-axle"),
    *(
        WheelQuantity(kind, partial(of, axis=axis), axis)
        for kind, of in (("toe", Vehicle.toe), ("camber_iso", Vehicle.camber_iso))
        for axis in AXES[1:]
    ),
)
AGAINST_AN_AXIS: dict[str, tuple[Unit, Callable[..., Dual]]] = {
    "thrust_angle": ("rad", Vehicle.thrust_angle),
    "front_setback": ("m", partial(Vehicle.setback, left=FL, right=FR)),
    "rear_setback": ("m", partial(Vehicle.setback, left=RL, right=RR)),
    "axle_offset": ("m", Vehicle.axle_offset),
}
# Zero by definition of the axis.
ZERO = {
    ("thrust_angle", "thrust-line"),
    ("rear_setback", "rear-axle"),
    ("axle_offset", "centreline"),
}
# Zero except for (track difference)(wheelbase difference): 0.2 mm of 0.1 m and 20 mm. Its
# derivatives nearly vanish, so that no first-order uncertainty describes it.
OF_SECOND_ORDER = {("axle_offset", "side-bisector")}


def _against(kind: str) -> list[VehicleQuantity]:
    """Return one entry for each axis."""
    unit, of = AGAINST_AN_AXIS[kind]
    return [
        VehicleQuantity(kind, unit, partial(of, axis=axis), axis=axis)
        for axis in AXES
        if (kind, axis) not in ZERO | OF_SECOND_ORDER
    ]


VEHICLE = (
    VehicleQuantity("rear_total_toe", "rad", lambda v: v.toe(RL) + v.toe(RR)),
    VehicleQuantity("front_total_toe", "rad", lambda v: v.toe(FL) + v.toe(FR)),
    *_against("thrust_angle"),
    VehicleQuantity("rear_cross_toe", "rad", lambda v: v.toe(RL) - v.toe(RR)),
    VehicleQuantity("front_cross_toe", "rad", lambda v: v.toe(FL) - v.toe(FR)),
    VehicleQuantity("rear_cross_camber", "rad", lambda v: v.camber(RL) - v.camber(RR)),
    VehicleQuantity("front_cross_camber", "rad", lambda v: v.camber(FL) - v.camber(FR)),
    VehicleQuantity("steer_ahead", "rad", Vehicle.steer_ahead),
    VehicleQuantity("centreline_angle", "rad", lambda v: v.axis("centreline")),
    VehicleQuantity("side_bisector_angle", "rad", lambda v: v.axis("side-bisector")),
    VehicleQuantity("rear_squareness", "rad", lambda v: -v.axis("centreline")),
    VehicleQuantity("rear_track", "m", lambda v: v.rear_track, signed=False),
    VehicleQuantity("front_track", "m", lambda v: v.front_track, signed=False),
    VehicleQuantity("wheelbase", "m", lambda v: v.wheelbase, signed=False),
    VehicleQuantity("wheelbase_left", "m", lambda v: v.distance(FL, RL), signed=False),
    VehicleQuantity("wheelbase_right", "m", lambda v: v.distance(FR, RR), signed=False),
    VehicleQuantity("wheelbase_difference", "m", lambda v: v.distance(FL, RL) - v.distance(FR, RR)),
    *_against("front_setback"),
    *_against("rear_setback"),
    *_against("axle_offset"),
)
RELATIVE = frozenset(  # to an axis
    [one.kind for one in WHEEL if one.axis] + [one.kind for one in VEHICLE if one.axis]
)
