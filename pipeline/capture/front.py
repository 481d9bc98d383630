"""Front of a vehicle as the user gives it: a direction, or a point near it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..system import frozen
from ..units import in_metres
from ..vectors import Array

# cos of the largest angle, 60 degrees, between the given direction and the vehicle's own.
MIN_ALONG = 0.5
MIN_AHEAD = 0.25  # of half the wheelbase: least distance of a point from the middle
FAR_M = 10.0  # largest distance of a point from the nearer axle


@frozen
class Front:
    """The front in the cloud's coordinates; note: the option and value, as the user wrote them.

    direction: (3,), points roughly forward. point_m: (3,), near the front. One of them is None.
    """

    note: str
    direction: tuple[float, ...] | None = None
    point_m: tuple[float, ...] | None = None

    @classmethod
    def given(
        cls,
        where: str,
        option: str,
        direction: Sequence[float] | None,
        point: Sequence[float] | None,
        unit: str,
    ) -> Front | None:
        """Return the front given by an option or a capture.toml, or None.

        where: begins messages. option: name of the direction; that of the point adds 'point'.
        unit: of the point. Raises InputError for both at once, and for a zero direction.
        """
        named = f"{option}-point" if option.startswith("-") else f"{option}_point"
        if direction is not None and point is not None:
            raise InputError(f"{where}{option} and {named}: both give the front: leave out one")
        if point is not None:
            metres = tuple(in_metres(x, unit) for x in point)
            return cls(f"{named} {_numbers(point)}", None, metres)
        if direction is None:
            return None
        if not any(direction):
            raise InputError(
                f"{where}{option} {_numbers(direction)}: has no length: give another direction"
            )
        return cls(f"{option} {_numbers(direction)}", tuple(direction), None)

    def is_ahead(self, rear_m: Array, front_m: Array) -> bool:
        """Return whether the front is at the axle with centre front_m (3,), not at that of rear_m.

        Raises InputError if it is at neither.
        """
        along = front_m - rear_m
        wheelbase_m = float(np.linalg.norm(along))
        along = along / wheelbase_m
        if self.direction is not None:
            # Scaled first: the square of a component may overflow.
            forward = np.array(self.direction) / max(map(abs, self.direction))
            cosine = float(along @ forward / np.linalg.norm(forward))
            if abs(cosine) < MIN_ALONG:
                raise InputError(
                    f"{self.note}: it runs {math.degrees(math.acos(abs(cosine))):.0f}° off the "
                    f"line through the centres of the axles, {_rounded(along)} or "
                    f"{_rounded(-along)}: "
                    "give the one that points forward"
                )
            return cosine > 0.0
        point = np.array(self.point_m)
        nearest_m = min(float(np.linalg.norm(point - axle)) for axle in (rear_m, front_m))
        if nearest_m > FAR_M:
            raise InputError(
                f"{self.note}: it lies {nearest_m:.1f} m from the nearer axle: give a point within "
                f"{FAR_M:g} m of the front, in the unit of the cloud's coordinates"
            )
        ahead = float((point - (rear_m + front_m) / 2.0) @ along) / (wheelbase_m / 2.0)
        if abs(ahead) < MIN_AHEAD:
            raise InputError(
                f"{self.note}: it lies midway between the axles, at {_rounded(rear_m)} and "
                f"{_rounded(front_m)} m: give a point near the front"
            )
        return ahead > 0.0


def _numbers(vector: Sequence[float]) -> str:
    return ",".join(f"{x:g}" for x in vector)


def _rounded(vector: Array) -> str:
    return ",".join(f"{x:.3f}" for x in np.round(vector, 3) + 0.0)
