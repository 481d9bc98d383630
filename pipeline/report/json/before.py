"""Values of an earlier measurement and the changes since, as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from ...measurement import Measurement, stated
from ..format.earlier import STEERING, Earlier, Known


def before_tree(measurement: Measurement, before: Earlier | None) -> dict[str, Any] | None:
    """Return each quantity of both measurements before, now and its change; null without one."""
    if before is None:
        return None
    earlier = before.values_for(measurement)
    return {
        "file": before.source,
        "sha256": before.sha256,
        "capture": before.capture,
        "date": before.date,
        "quantities": [
            _entry(name, unit, now, earlier[name])
            for name, unit, now in _now(measurement)
            if name in earlier
        ],
    }


def _now(measurement: Measurement) -> Iterator[tuple[str, str, Known]]:
    for quantity in stated(measurement):
        if quantity.axis in (None, "rear-axle"):
            unit = "deg" if quantity.unit == "rad" else "m"
            yield quantity.name, unit, Known(quantity.value, quantity.u, quantity.expanded)
    for axis in measurement.steering_axes:
        for name in STEERING:
            known = getattr(axis, name)
            if known is not None:
                yield f"{axis.wheel}.{name}", "deg", Known(known.value, known.u, known.expanded)


def _entry(name: str, unit: str, now: Known, before: Known) -> dict[str, Any]:
    scale, change = math.degrees(1.0) if unit == "deg" else 1.0, now.less(before)
    return {
        "quantity": name,
        "unit": unit,
        "before": before.value * scale,
        "now": now.value * scale,
        "change": change.value * scale,
        "u": change.u * scale,
        "expanded_95": change.expanded * scale,
    }
