"""A vehicle in its frame, and what can be worked out of it, values and slopes at once.

Four longitudinal axes are in use; all lie in the plane of left and forward, so that one differs
from another by a turn about up alone:
- rear-axle: normal to the rear axle, the paper's; forward of `VehicleFrame`;
- centreline: through the midpoints of both axles, the geometric centreline;
- thrust-line: bisects the rear wheels' toe;
- side-bisector: bisects the lines through the wheel centres of either side.

The angle of an axis is counted from the paper's, > 0 to the right. An axis at angle a makes
toe - a of a left wheel's toe and toe + a of a right one's; total toe and the elevation camber stay;
ISO camber follows the toe: tan(iso) = tan(camber)/cos(toe).

Signs: thrust angle, steer ahead, axle offset > 0 to the right; setback > 0 where the right wheel
stands behind the left; rear squareness likewise, of the rear axle against the centreline;
cross camber and wheelbase difference: left less right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .autodiff import Dual, atan2, constant, cos, length, sin

Axis = Literal["rear-axle", "centreline", "thrust-line", "side-bisector"]
AXES: tuple[Axis, ...] = ("rear-axle", "centreline", "thrust-line", "side-bisector")
RR, RL, FR, FL = range(4)


@dataclass(frozen=True)
class Wheel:
    """Parts of a wheel's outward unit normal; side: +1 on the left, -1 on the right."""

    side: float
    outward: Dual
    forward: Dual
    up: Dual


@dataclass(frozen=True)
class Place:
    """A wheel centre in the vehicle frame, metres from the middle of the rear axle."""

    left: Dual
    forward: Dual
    up: Dual


@dataclass(frozen=True)
class Vehicle:
    """What all quantities are computed of; the first four wheels are RR, RL, FR, FL."""

    wheels: tuple[Wheel, ...]
    places: tuple[Place, Place, Place, Place]
    rear_track: Dual
    front_track: Dual
    wheelbase: Dual

    def toe(self, index: int, axis: Axis = "rear-axle") -> Dual:
        """Of one wheel against an axis, > 0 is toe-in."""
        wheel = self.wheels[index]
        return atan2(wheel.forward, wheel.outward) - self.axis(axis) * wheel.side

    def camber(self, index: int) -> Dual:
        """Elevation, > 0 is top out; no turn about up changes it."""
        wheel = self.wheels[index]
        return -atan2(wheel.up, length(wheel.outward, wheel.forward))

    def camber_iso(self, index: int, axis: Axis = "rear-axle") -> Dual:
        """Projected on the plane across an axis."""
        wheel = self.wheels[index]
        if axis == "rear-axle":
            return -atan2(wheel.up, wheel.outward)
        level = length(wheel.outward, wheel.forward)
        return -atan2(wheel.up, level * cos(self.toe(index, axis)))

    def axis(self, axis: Axis) -> Dual:
        """Its angle to the paper's axis, > 0 to the right."""
        if axis == "centreline":
            middle = (self.places[FL].left + self.places[FR].left) / 2.0
            ahead = (self.places[FL].forward + self.places[FR].forward) / 2.0
            return atan2(-middle, ahead)
        if axis == "thrust-line":
            return (self.toe(RL) - self.toe(RR)) / 2.0
        if axis == "side-bisector":
            return (self._side(RL, FL) + self._side(RR, FR)) / 2.0
        return constant(0.0, len(self.wheelbase.slope))

    def _side(self, rear: int, front: int) -> Dual:
        back, head = self.places[rear], self.places[front]
        return atan2(back.left - head.left, head.forward - back.forward)

    def distance(self, one: int, other: int) -> Dual:
        """Between two wheel centres."""
        a, b = self.places[one], self.places[other]
        return length(a.left - b.left, a.forward - b.forward, a.up - b.up)

    def thrust_angle(self, axis: Axis) -> Dual:
        """Of the thrust line to an axis, > 0 to the right."""
        return self.axis("thrust-line") - self.axis(axis)

    def steer_ahead(self) -> Dual:
        """Where the front wheels point between them, against the thrust line; > 0 to the right."""
        return (self.toe(FL, "thrust-line") - self.toe(FR, "thrust-line")) / 2.0

    def setback(self, left: int, right: int, axis: Axis) -> Dual:
        """How far the right wheel's centre stands behind the left one's, along an axis."""
        a, b = self.places[left], self.places[right]
        turn = self.axis(axis)
        return (a.forward - b.forward) * cos(turn) - (a.left - b.left) * sin(turn)

    def axle_offset(self, axis: Axis) -> Dual:
        """Of the front axle's middle to the right of an axis through the rear axle's middle."""
        a, b = self.places[FL], self.places[FR]
        turn = self.axis(axis)
        return -((a.forward + b.forward) * sin(turn) + (a.left + b.left) * cos(turn)) / 2.0
