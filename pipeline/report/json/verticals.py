"""Verticals from which camber, caster and SAI can be measured, as plain data."""

from __future__ import annotations

import math
from typing import Any

from ...measurement import Measurement, Vertical, vertical_tilts
from .poses import rounded_rows


def verticals_tree(measurement: Measurement) -> dict[str, Any]:
    """Return `vertical_in_use`, from which all cambers are measured, and `verticals`."""
    return {
        "vertical_in_use": measurement.vertical_kind,
        "verticals": [_vertical(measurement, one) for one in measurement.verticals],
    }


def _vertical(measurement: Measurement, vertical: Vertical) -> dict[str, Any]:
    aside, ahead = vertical_tilts(measurement, vertical)
    tilts = {"tilt_left": aside, "tilt_forward": ahead}
    return {
        "kind": vertical.kind,
        "by": vertical.by,
        "direction": vertical.normal.tolist(),
        "components": [
            {
                "name": component.name,
                "degrees_of_freedom": component.dof if math.isfinite(component.dof) else None,
                "pooled": component.pooled,
                "factor": rounded_rows(component.factor[:3]),
            }
            for component in vertical.components
        ],
        **{f"{name}_deg": math.degrees(tilt.value) for name, tilt in tilts.items()},
        **{f"u_{name}_deg": math.degrees(tilt.u) for name, tilt in tilts.items()},
    }
