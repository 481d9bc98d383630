"""Indications of a machine under test: true values with its errors, rounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..parameters.machine import Indication, MachineFile

OPPOSITE = {"toe-out", "top-in", "left"}  # senses that the truth counts as negative
DIRECTIONS = {"up": 0.5, "down": -0.5}


@dataclass(frozen=True)
class Indicated:
    """One reading, in minutes of arc or millimetres."""

    point: str
    quantity: str
    value: float
    series: int
    repeat: int
    direction: str
    operator: str


def true_values(truth: Mapping[str, Any], table: Indication, quantity: str) -> dict[str, float]:
    """Return what a machine without errors would indicate at each point; minutes or millimetres.

    truth: content of truth.json.
    """
    sense = -1.0 if table.positive in OPPOSITE else 1.0
    found = _points(truth, quantity, table.axis or "rear-axle")
    return {point: sense * value for point, value in found.items()}


def _points(truth: Mapping[str, Any], quantity: str, axis: str) -> dict[str, float]:
    """Return the true values in the truth's own sense."""
    vehicle, frame = truth["vehicle"], truth["frame"]
    if quantity == "track":
        return {end: 1e3 * frame[f"{end}_track_m"] for end in ("front", "rear")}
    if quantity == "total_toe":
        return {end: 60.0 * vehicle[f"{end}_total_toe_deg"] for end in ("front", "rear")}
    thrust = 60.0 * vehicle["thrust_angle_deg"]
    if quantity == "thrust_angle":
        return {"vehicle": thrust if axis == "rear-axle" else 0.0}
    angle = thrust if quantity == "toe" and axis == "thrust-line" else 0.0
    return {
        wheel["name"]: 60.0 * wheel[f"{quantity}_deg"]
        + (-angle if wheel["wheel"].endswith("L") else angle)
        for wheel in truth["wheels"]
        if wheel["role"] in ("reference", "trial")
    }


def indicate(
    truth: Mapping[str, Any], machine: MachineFile, rng: np.random.Generator
) -> list[Indicated]:
    """Return all readings of the machine's protocol, quantity by quantity."""
    plan, found = machine.protocol, []
    ways = tuple(DIRECTIONS) if plan.directions else ("",)
    for quantity, table in machine.quantities().items():
        points = true_values(truth, table, quantity)
        for series in range(1, plan.series + 1):
            for operator in plan.operators or ("",):
                offset = table.reproducibility * rng.standard_normal()
                found += [
                    Indicated(
                        point,
                        quantity,
                        reading(table, value + offset, way, rng),
                        series,
                        repeat,
                        way,
                        operator,
                    )
                    for point, value in points.items()
                    for repeat in range(1, plan.repeats + 1)
                    for way in ways
                ]
    return found


def reading(table: Indication, value: float, way: str, rng: np.random.Generator) -> float:
    """Return one reading of what a machine without errors would indicate."""
    shown = value + error(table, value) + table.hysteresis * DIRECTIONS.get(way, 0.0)
    shown += table.repeatability * rng.standard_normal()
    return float(np.round(shown / table.resolution) * table.resolution)


def error(table: Indication, value: float) -> float:
    """Return the systematic error at a value, both directions counted alike."""
    return table.gain * value + table.zero
