"""Verdicts as plain data for measurement.json."""

from __future__ import annotations

import math
from typing import Any

from ...measurement import Conformity, Verdict
from ...vehicle import Unit


def conformity_tree(conformity: Conformity | None) -> dict[str, Any]:
    """Return the overall `verdict` and `conformity`, by quantity; null without tolerance.

    Angles in degrees, lengths in metres; null where there is no limit or no decision.
    """
    if conformity is None:
        return {"verdict": None, "conformity": None}
    tolerance, (at_least, at_most) = conformity.tolerance, conformity.joint_bounds
    return {
        "verdict": {
            "decision": conformity.decision,
            "rule": tolerance.rule,
            "confidence": tolerance.confidence,
            "coverage_factor": conformity.factors[1],
            "probability_all_conform": [at_least, at_most],
            "joint_probability_of_conformity": conformity.probability,
        },
        "conformity": [_verdict(verdict) for verdict in conformity.verdicts],
    }


def tolerance_tree(conformity: Conformity | None) -> dict[str, Any]:
    """Return the tolerance for `provenance.config`, as in its file."""
    if conformity is None:
        return {}
    return {"tolerance": conformity.tolerance.model_dump(exclude_none=True)}


def _verdict(verdict: Verdict) -> dict[str, Any]:
    quantity, interval, unit = verdict.quantity, verdict.interval, verdict.quantity.unit
    suffix = "deg" if unit == "rad" else "m"
    limits = (None, None) if interval is None else (interval.lower, interval.upper)
    numbers = {
        "value": quantity.value,
        "u": quantity.u,
        "lower": limits[0],
        "upper": limits[1],
        "guard_band": verdict.guard_band,
    }
    return {
        "quantity": quantity.name,
        "name": quantity.subject,
        "wheel": quantity.wheel,
        "inner_wheel_deg": _in_unit(quantity.inner_rad, "rad"),
        "decision": verdict.decision,
        "reason": verdict.reason,
        **{f"{name}_{suffix}": _in_unit(value, unit) for name, value in numbers.items()},
        "coverage_factor": verdict.factor,
        "probability_of_conformity": verdict.probability,
        "consumer_risk": verdict.risk if verdict.decision == "conform" else None,
        "producer_risk": verdict.risk if verdict.decision == "not conform" else None,
    }


def _in_unit(value: float | None, unit: Unit) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return math.degrees(value) if unit == "rad" else value
