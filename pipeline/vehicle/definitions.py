"""Every quantity of a wheel and of the vehicle in one table; what it means: vehicle.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from .autodiff import Dual
from .axes import AXES, FL, FR, RL, RR, Axis, Vehicle

Unit = Literal["rad", "m"]


def named(kind: str, axis: Axis | None) -> str:
    """What a quantity is called against an axis: `toe`, `toe_to_thrust_line`."""
    return kind if axis in (None, "rear-axle") else f"{kind}_to_{axis.replace('-', '_')}"


@dataclass(frozen=True)
class OfWheel:
    """A quantity of each wheel, radians; of: of the vehicle and the wheel's index.

    axis: the one it is counted from; None where that does not matter.
    """

    kind: str
    of: Callable[[Vehicle, int], Dual]
    axis: Axis | None = None

    @property
    def name(self) -> str:
        """The kind, and the axis where it is not the paper's."""
        return named(self.kind, self.axis)


@dataclass(frozen=True)
class OfVehicle:
    """A quantity of the vehicle, radians or metres; signed: of a length that may be negative."""

    kind: str
    unit: Unit
    of: Callable[[Vehicle], Dual]
    signed: bool = True
    axis: Axis | None = None

    @property
    def name(self) -> str:
        """The kind, and the axis where it is not the paper's."""
        return named(self.kind, self.axis)


WHEEL = (
    OfWheel("toe", Vehicle.toe, "rear-axle"),
    OfWheel("camber", Vehicle.camber),
    OfWheel("camber_iso", Vehicle.camber_iso, "rear-axle"),
    *(
        OfWheel(kind, partial(of, axis=axis), axis)
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
# What an axis makes zero by its definition.
ZERO = {
    ("thrust_angle", "thrust-line"),
    ("rear_setback", "rear-axle"),
    ("axle_offset", "centreline"),
}
# Zero but for (track difference)(wheelbase difference), hundredths of a millimetre: it has next to
# no slope, so that no first-order uncertainty describes it.
OF_SECOND_ORDER = {("axle_offset", "side-bisector")}


def _against(kind: str) -> list[OfVehicle]:
    """An entry an axis."""
    unit, of = AGAINST_AN_AXIS[kind]
    return [
        OfVehicle(kind, unit, partial(of, axis=axis), axis=axis)
        for axis in AXES
        if (kind, axis) not in ZERO | OF_SECOND_ORDER
    ]


VEHICLE = (
    OfVehicle("rear_total_toe", "rad", lambda v: v.toe(RL) + v.toe(RR)),
    OfVehicle("front_total_toe", "rad", lambda v: v.toe(FL) + v.toe(FR)),
    *_against("thrust_angle"),
    OfVehicle("rear_cross_camber", "rad", lambda v: v.camber(RL) - v.camber(RR)),
    OfVehicle("front_cross_camber", "rad", lambda v: v.camber(FL) - v.camber(FR)),
    OfVehicle("steer_ahead", "rad", Vehicle.steer_ahead),
    OfVehicle("centreline_angle", "rad", lambda v: v.axis("centreline")),
    OfVehicle("side_bisector_angle", "rad", lambda v: v.axis("side-bisector")),
    OfVehicle("rear_squareness", "rad", lambda v: -v.axis("centreline")),
    OfVehicle("rear_track", "m", lambda v: v.rear_track, signed=False),
    OfVehicle("front_track", "m", lambda v: v.front_track, signed=False),
    OfVehicle("wheelbase", "m", lambda v: v.wheelbase, signed=False),
    OfVehicle("wheelbase_left", "m", lambda v: v.distance(FL, RL), signed=False),
    OfVehicle("wheelbase_right", "m", lambda v: v.distance(FR, RR), signed=False),
    OfVehicle("wheelbase_difference", "m", lambda v: v.distance(FL, RL) - v.distance(FR, RR)),
    *_against("front_setback"),
    *_against("rear_setback"),
    *_against("axle_offset"),
)
