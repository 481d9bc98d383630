"""Indications of a machine under test: true values with its errors, rounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..parameters.machine import Indication, MachineFile

# The sense that the truth counts as negative.
OPPOSITE = {"toe": "toe-out", "camber": "top-in", "total_toe": "toe-out", "thrust_angle": "left",
            "caster": "top-forwards", "sai": "top-out", "toe_out_on_turns": "toe-in"}  # fmt: skip
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

    truth: content of truth.json. No point where the vehicle is not swept, as caster, SAI and
    toe-out on turns need it.
    """
    sense = -1.0 if table.positive == OPPOSITE.get(quantity) else 1.0
    found = _points(truth, quantity, table.axis or "rear-axle")
    return {point: sense * value for point, value in found.items()}


def _points(truth: Mapping[str, Any], quantity: str, axis: str) -> dict[str, float]:
    """Return the true values in the truth's own sense."""
    vehicle, frame = truth["vehicle"], truth["frame"]
    if quantity == "track":
        return {end: 1e3 * frame[f"{end}_track_m"] for end in ("front", "rear")}
    if quantity == "toe_out_on_turns":
        turns = truth.get("toe_out_on_turns", ())
        return {turn["turn"]: 60.0 * turn["difference_deg"] for turn in turns}
    if quantity in ("caster", "sai"):
        angle_deg = "caster_deg" if quantity == "caster" else "inclination_deg"
        return {axis["wheel"]: 60.0 * axis[angle_deg] for axis in truth.get("kingpins", ())}
    if quantity == "total_toe":
        return {end: 60.0 * vehicle[f"{end}_total_toe_deg"] for end in ("front", "rear")}
    if quantity == "thrust_angle":
        return {"vehicle": 60.0 * vehicle["thrust_angle_deg"] if axis == "rear-axle" else 0.0}
    wheels = [wheel for wheel in truth["wheels"] if wheel["role"] in ("reference", "trial")]
    rear = {
        wheel["wheel"]: wheel[f"{quantity}_deg"]
        for wheel in wheels
        if wheel["role"] == "reference" and wheel["wheel"] in ("RR", "RL")
    }
    along = quantity == "toe" and axis == "thrust-line"
    return {
        wheel["name"]: 60.0
        * (_to_thrust_line(wheel, rear) if along else float(wheel[f"{quantity}_deg"]))
        for wheel in wheels
    }


def _to_thrust_line(wheel: Mapping[str, Any], rear: Mapping[str, float]) -> float:
    """Return the toe of a wheel as the machine sees the vehicle, degrees.

    rear: toes of RR and RL. The machine's line bisects the rear toes of the vehicle that stands on
    it, a trial in its wheel's place: a rear wheel then has half of their sum.
    """
    now = {**rear, wheel["wheel"]: wheel["toe_deg"]}
    if wheel["wheel"] in rear:
        return float(now["RR"] + now["RL"]) / 2.0
    thrust = (now["RL"] - now["RR"]) / 2.0
    return float(wheel["toe_deg"] - thrust if wheel["wheel"] == "FL" else wheel["toe_deg"] + thrust)


def with_points(truth: Mapping[str, Any], machine: MachineFile) -> MachineFile:
    """Return the machine without the quantities that the vehicle has no point of."""
    tables = machine.quantities().items()
    none = [name for name, table in tables if not true_values(truth, table, name)]
    return machine.model_copy(update=dict.fromkeys(none))


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
