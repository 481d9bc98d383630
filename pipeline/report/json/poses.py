"""Normals and centres with their covariances as plain data, from which every angle follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...measurement import Measurement, Observation, WheelResult
from ...uncertainty import UncertainTarget, UncertaintyComponent
from ...vectors import Array

DIGITS = 9  # of a factor: what follows from it keeps six


def poses_tree(measurement: Measurement) -> dict[str, Any]:
    """Return the poses from which the angles follow, and those of the targets as mounted.

    The latter are null where no run-out is compensated: both are the same then. Scanner
    coordinates, normals outward.
    """
    plates = measurement.plates
    return {
        "evaluated": _poses(measurement, rotations=plates is None),
        "as_mounted": None if plates is None else _poses(plates, rotations=True),
    }


def _poses(measurement: Measurement, *, rotations: bool) -> dict[str, Any]:
    wheels = [wheel for wheel in measurement.wheels if wheel.evaluated is not None]
    components: dict[tuple[object, object], dict[str, Any]] = {}
    entries = []
    for wheel in wheels:
        pose, name = wheel.pose, wheel.observation.name
        assert pose is not None
        sense = _sense(measurement, pose, str(wheel.wheel))
        for component in pose.components:
            key = (component.name, component.shared or (name,))
            shown = components.setdefault(key, _component(component))
            if component.factor.any() or (rotations and component.turn is not None):
                factor = _factor(component, sense, rotations)
                shown["acts_on"].append({"name": name, "factor": factor})
        entries.append(_entry(wheel, pose, sense) | _rotation(wheel.observation, rotations))
    return {"wheels": entries, "components": [c for c in components.values() if c["acts_on"]]}


def _sense(measurement: Measurement, pose: UncertainTarget, wheel: str) -> float:
    """Return 1 where the pose's normal is the outward one, else -1."""
    outward = measurement.frame.left * (1.0 if wheel.endswith("L") else -1.0)
    return 1.0 if pose.normal @ outward > 0.0 else -1.0


def _entry(wheel: WheelResult, pose: UncertainTarget, sense: float) -> dict[str, Any]:
    return {
        "name": wheel.observation.name,
        "wheel": wheel.wheel,
        "normal": (sense * pose.normal).tolist(),
        "centre_m": pose.centre_m.tolist(),
    }


def _rotation(seen: Observation, rotations: bool) -> dict[str, Any]:
    """Return the in-plane rotation that a scan shows, and what is stated of its position."""
    shown, stated = seen.fitted.turn if rotations else None, seen.turn
    return {
        "in_plane_axis": shown.axis.tolist() if shown else None,
        "in_plane_period_deg": math.degrees(shown.period_rad) if shown else None,
        "stated_rotation_deg": _degrees(stated.angle_rad if stated else None),
        "u_stated_rotation_deg": _degrees(stated.u_rad if stated else None),
        "position": stated.position if stated else None,
    }


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None else math.degrees(angle_rad)


def _component(component: UncertaintyComponent) -> dict[str, Any]:
    return {
        "name": component.name,
        "degrees_of_freedom": component.dof if math.isfinite(component.dof) else None,
        "pooled": component.pooled,
        "acts_on": [],
    }


def _factor(component: UncertaintyComponent, sense: float, rotations: bool) -> list[list[float]]:
    """Return rows for the normal (rad), the centre (m) and the in-plane rotation (rad)."""
    rows: Sequence[Array] = [*(sense * component.factor[:3]), *component.factor[3:]]
    if rotations and component.turn is not None:
        rows = [*rows, sense * component.turn]
    return rounded_rows(rows)


def rounded_rows(rows: Sequence[Array] | Array) -> list[list[float]]:
    """Return the rows of a factor with DIGITS significant digits."""
    return [[float(f"{x:.{DIGITS}g}") for x in np.asarray(row).tolist()] for row in rows]
