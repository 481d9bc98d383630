"""A vehicle in its frame, its longitudinal axes and its angles, with their derivatives.

Four longitudinal axes are in use; all lie in the plane of left and forward, so that they differ by
a rotation about up alone:
- rear-axle: the rear-axle normal, which is the paper's axis and forward of `VehicleFrame`;
- centreline: through the midpoints of both axles, the geometric centreline;
- thrust-line: bisects the rear wheels' toe; of a trial of one, with the trial in its place;
- side-bisector: bisector of the wheel-centre lines, left and right.

The angle of an axis is measured from the rear-axle normal, > 0 to the right. Relative to an axis at
angle a, toe is toe - a on the left and toe + a on the right; total toe and the elevation camber do
not change; ISO camber follows the toe: tan(iso) = tan(camber)/cos(toe).

A vertical other than the normal to the plane of the wheel centres, the floor's normal or gravity,
changes what is measured from it: camber, caster and steering axis inclination. Toe stays in the
plane of the wheel centres.

Signs: thrust angle, steer ahead, axle offset > 0 to the right; setback > 0 where the right wheel
is behind the left; rear axle skew (key `rear_squareness`) has the sign of the rear setback relative
to the centreline; cross toe, cross camber and wheelbase difference: left less right.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

from ..system import frozen
from .autodiff import Dual, atan2, constant, cos, length, over, sin

Axis = Literal["rear-axle", "centreline", "thrust-line", "side-bisector"]
AXES: tuple[Axis, ...] = ("rear-axle", "centreline", "thrust-line", "side-bisector")
RR, RL, FR, FL = range(4)


@frozen
class Wheel:
    """Components of a wheel's outward unit normal; side: +1 on the left, -1 on the right.

    place: index of the reference wheel that it is, or stands for. rise, level: its parts along
    the vertical and across it; None where that is up.
    """

    side: float
    place: int
    outward: Dual
    forward: Dual
    up: Dual
    rise: Dual | None = None
    level: Dual | None = None


@frozen
class Position:
    """Wheel centre in the vehicle frame, metres from the middle of the rear axle."""

    left: Dual
    forward: Dual
    up: Dual


@frozen
class Vehicle:
    """Wheels, wheel centres and lengths; the first four wheels are RR, RL, FR, FL."""

    wheels: tuple[Wheel, ...]
    positions: tuple[Position, Position, Position, Position]
    rear_track: Dual
    front_track: Dual
    wheelbase: Dual

    def toe(self, index: int, axis: Axis = "rear-axle") -> Dual:
        """Return toe of one wheel relative to an axis; positive is toe-in."""
        return self._toes_by_axis[axis][index]

    def camber(self, index: int) -> Dual:
        """Return camber as elevation, positive with the top outward; no axis changes it."""
        return -atan2(*self._rises_and_levels[index])

    def camber_iso(self, index: int, axis: Axis = "rear-axle") -> Dual:
        """Return ISO camber, projected on the plane across an axis."""
        wheel = self.wheels[index]
        if axis == "rear-axle" and wheel.rise is None:
            return -atan2(wheel.up, wheel.outward)
        rise, level = self._rises_and_levels[index]
        return -atan2(rise, level * cos(self.toe(index, axis)))

    def axis(self, axis: Axis) -> Dual:
        """Return the angle of an axis from the rear-axle normal, > 0 to the right."""
        return self._axes[axis]

    def axis_of(self, index: int, axis: Axis) -> Dual:
        """Return the angle of an axis as the vehicle stands with one wheel in its place.

        Of the four references it is that of `axis`; a trial of a rear wheel turns the thrust line.
        """
        place = self.wheels[index].place
        if axis != "thrust-line" or index == place or place not in (RR, RL):
            return self._axes[axis]
        right, left = (index if rear == place else rear for rear in (RR, RL))
        return self._thrust(left, right)

    @cached_property
    def _axes(self) -> dict[Axis, Dual]:
        middle = (self.positions[FL].left + self.positions[FR].left) / 2.0
        ahead = (self.positions[FL].forward + self.positions[FR].forward) / 2.0
        return {
            "rear-axle": constant(0.0, len(self.wheelbase.slope)),
            "centreline": atan2(-middle, ahead),
            "thrust-line": self._thrust(RL, RR),
            "side-bisector": (self._side(RL, FL) + self._side(RR, FR)) / 2.0,
        }

    @cached_property
    def _toes(self) -> tuple[Dual, ...]:
        """Toes of all wheels relative to the rear-axle normal."""
        return tuple(atan2(wheel.forward, wheel.outward) for wheel in self.wheels)

    @cached_property
    def _toes_by_axis(self) -> dict[Axis, tuple[Dual, ...]]:
        return {
            axis: tuple(
                toe - self.axis_of(index, axis) * self.wheels[index].side
                for index, toe in enumerate(self._toes)
            )
            for axis in AXES
        }

    @cached_property
    def _rises_and_levels(self) -> tuple[tuple[Dual, Dual], ...]:
        return tuple(map(_rise_and_level, self.wheels))

    def _thrust(self, left: int, right: int) -> Dual:
        """Return the angle of the line that bisects the toes of two wheels."""
        return (self._toes[left] - self._toes[right]) / 2.0

    def _side(self, rear: int, front: int) -> Dual:
        back, head = self.positions[rear], self.positions[front]
        return atan2(back.left - head.left, head.forward - back.forward)

    def distance(self, one: int, other: int) -> Dual:
        """Return the distance between two wheel centres."""
        a, b = self.positions[one], self.positions[other]
        return length(a.left - b.left, a.forward - b.forward, a.up - b.up)

    def thrust_angle(self, axis: Axis) -> Dual:
        """Return the angle of the thrust line from an axis, > 0 to the right."""
        return self.axis("thrust-line") - self.axis(axis)

    def steer_ahead(self) -> Dual:
        """Return the mean direction of the front wheels from the thrust line, > 0 to the right."""
        return (self.toe(FL, "thrust-line") - self.toe(FR, "thrust-line")) / 2.0

    def setback(self, left: int, right: int, axis: Axis) -> Dual:
        """Return how far the right wheel centre is behind the left one, along an axis."""
        a, b = self.positions[left], self.positions[right]
        angle = self.axis(axis)
        return (a.forward - b.forward) * cos(angle) - (a.left - b.left) * sin(angle)

    def axle_offset(self, axis: Axis) -> Dual:
        """Return the front axle's offset to the right of an axis through the rear axle's middle."""
        a, b = self.positions[FL], self.positions[FR]
        angle = self.axis(axis)
        return -((a.forward + b.forward) * sin(angle) + (a.left + b.left) * cos(angle)) / 2.0


def _rise_and_level(wheel: Wheel) -> tuple[Dual, Dual]:
    if wheel.rise is None or wheel.level is None:
        return wheel.up, length(wheel.outward, wheel.forward)
    return wheel.rise, wheel.level


def upright(parts: tuple[Dual, Dual, Dual], vertical: tuple[Dual, Dual, Dual]) -> tuple[Dual, ...]:
    """Return the parts of a vector to the left, forwards and up, in the frame of a vertical.

    parts, vertical: to the left, forward and up of the vehicle frame; the vertical is a unit vector
    e. Forward there is forward less its part along e, left is e x forward.
    """
    (left, forward, up), (e_left, e_forward, e_up) = parts, vertical
    rise = left * e_left + forward * e_forward + up * e_up
    level = length(e_left, e_up)
    return (
        over(left * e_up - up * e_left, level),
        over(forward - e_forward * rise, level),
        rise,
    )
