"""The four longitudinal axes as plain data: directions and the quantities relative to them."""

from __future__ import annotations

import math
from typing import Any

from ...measurement import Measurement, Stated, by_kind
from ...vehicle import AGAINST_AN_AXIS, AXES, OF_SECOND_ORDER, Axis, Unit
from ..format.view import DEFINED

ANGLE = {
    "centreline": "centreline_angle",
    "thrust-line": "thrust_angle",
    "side-bisector": "side_bisector_angle",
}


def axes_tree(measurement: Measurement, found: list[Stated]) -> dict[str, Any]:
    """Return for each axis its angle, > 0 to the right, and the quantities relative to it.

    found: all stated quantities. Degrees and metres; angles of axes from the rear-axle normal. The
    elevation camber is the same for all axes. A quantity that is zero by definition of the axis is
    0 with u 0; one that is zero except for second-order terms is null.
    """
    return {axis: _axis(measurement, axis, found) for axis in AXES}


def _axis(measurement: Measurement, axis: Axis, found: list[Stated]) -> dict[str, Any]:
    frame = measurement.frame
    known = by_kind(found, axis)
    angle = next((q for q in found if q.name == ANGLE.get(axis)), None)
    heading = angle.value if angle else 0.0
    names = [wheel.observation.name for wheel in measurement.wheels if wheel.angles is not None]
    return {
        "definition": DEFINED[axis],
        "direction": (math.cos(heading) * frame.forward - math.sin(heading) * frame.left).tolist(),
        **pair("angle", angle, "rad"),
        "wheels": [
            {"name": name}
            | {
                key: number
                for kind in ("toe", "camber", "camber_iso")
                for key, number in pair(kind, known[name, kind], "rad").items()
            }
            for name in names
        ],
        **{
            key: None if (kind, axis) in OF_SECOND_ORDER else number
            for kind, (unit, _) in AGAINST_AN_AXIS.items()
            for key, number in pair(kind, known.get(("vehicle", kind)), unit).items()
        },
    }


def pair(name: str, quantity: Stated | None, unit: Unit) -> dict[str, float]:
    """Return `name_deg` and `u_name_deg`, or `_m`; zeros where there is no such quantity."""
    value, u = (quantity.value, quantity.u) if quantity else (0.0, 0.0)
    scale, suffix = (math.degrees(1.0), "deg") if unit == "rad" else (1.0, "m")
    return {f"{name}_{suffix}": value * scale, f"u_{name}_{suffix}": u * scale}
