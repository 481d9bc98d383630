"""A calibration as JSON: `wheelplane/calibration/1`; degrees and metres."""

from __future__ import annotations

import math
from typing import Any

from ...calibration import (
    Adjustment,
    Calibration,
    CalibrationPlan,
    CalibrationPoint,
    Characteristic,
    GaugeRR,
    QuantityPlan,
    QuantityResult,
)
from ...measurement import Estimate
from ...vehicle import Unit
from .measurement import doubts_tree
from .text import json_text

SCHEMA = "wheelplane/calibration/1"
PLAN_SCHEMA = "wheelplane/calibration-plan/1"


def calibration_json(found: Calibration) -> str:
    """Return the text of calibration.json; same calibration, same bytes."""
    return f"{json_text(calibration_tree(found))}\n"


def calibration_tree(found: Calibration) -> dict[str, Any]:
    """Return a calibration as plain data; values in the item's axis and sign."""
    return {
        "schema": SCHEMA,
        "version": found.version,
        "date": found.date,
        "item": found.item.model_dump(exclude_none=True),
        "decision_rule": None if found.rule is None else found.rule.model_dump(),
        "decision": found.decision,
        "decision_as_found": found.decision_as_found,
        "warnings": list(found.warnings),
        "doubts": doubts_tree(found.doubts),
        "quantities": [_quantity(result) for result in found.results],
        "adjustments": [_adjustment(one) for one in found.adjustments],
        "readings": {
            "source": found.readings.source,
            "sha256": found.readings.sha256,
            "count": len(found.readings.rows),
        },
        "references": [
            {
                "series": one.series,
                "source": one.provenance.source,
                "date": one.provenance.date,
                "inputs": one.provenance.inputs,
                "config": one.provenance.config,
                "seed": one.provenance.seed,
            }
            for one in found.references
        ],
        "notes": list(found.notes),
    }


def plan_json(found: CalibrationPlan) -> str:
    """Return a plan as JSON; degrees and metres."""
    tree = {
        "schema": PLAN_SCHEMA,
        "source": found.source,
        "plan": found.plan.model_dump(exclude_none=True),
        "quantities": [_planned(one) for one in found.quantities],
        "trials": [
            {"name": name, "wheel": wheel, "toe_deg": math.degrees(toe),
             "camber_deg": math.degrees(camber)}
            for name, wheel, toe, camber in found.places
        ],
    }  # fmt: skip
    return f"{json_text(tree)}\n"


def _planned(one: QuantityPlan) -> dict[str, Any]:
    unit, slope = one.unit, one.sensitivity
    return {
        "quantity": one.quantity,
        "points": list(one.points),
        **_of("u_reference", one.reference, unit),
        "error": _estimate(one.error, unit),
        "mpe_over_u": one.ratio,
        "zero_error": _estimate(one.zero, unit),
        "expanded_95_sensitivity": None if slope is None else slope.expanded,
        "hysteresis": _estimate(one.hysteresis, unit),
        "detections": [
            {"name": error.name, "power": error.power, "trials": error.trials}
            for error in one.detections
        ],
        **_of("wanted", one.wanted, unit),
        "repeats_needed": one.repeats,
        **_of("u_reference_needed", one.u_reference, unit),
    }


def _quantity(result: QuantityResult) -> dict[str, Any]:
    unit = result.unit
    return {
        "quantity": result.quantity,
        "state": result.state,
        "decision": result.decision,
        "levels": list(result.levels),
        "points": [_point(point) for point in result.points],
        "characteristic": _characteristic(result.characteristic, unit),
        **_of("repeatability", result.repeatability, unit),
        "dof_repeatability": result.dof_repeatability,
        **_of("reproducibility", result.reproducibility, unit),
        "hysteresis": _estimate(result.hysteresis, unit),
        "gauge_rr": _gauge_rr(result.gauge_rr, unit),
        "no_gauge_rr": result.no_gauge_rr,
        "vertical": result.vertical,
        "thrust_line_by_trial": list(result.in_place),
        "unread": list(result.unread),
        "left_out": list(result.left_out),
        **_of("resolution_shown", result.coarser or result.finer, unit),
        "notes": list(result.notes),
    }


def _point(point: CalibrationPoint) -> dict[str, Any]:
    unit, verdict = point.unit, point.verdict
    return {
        "point": point.point,
        "reference": _estimate(point.reference, unit),
        **_of("reading", point.reading, unit),
        "directions": [
            {"direction": one.direction, **_of("mean", one.mean, unit), "n": one.n}
            for one in point.directions
        ],
        "n": point.n,
        **_of("repeatability", point.repeatability, unit),
        "dof_repeatability": point.dof_repeatability,
        **_of("resolution", point.resolution, unit),
        "error": _estimate(point.error, unit),
        "budget": [
            {
                "name": one.name,
                "origin": one.origin,
                **_of("u", one.u, unit),
                "dof": _known(one.dof),
            }
            for one in point.budget
        ],
        "en": point.en,
        **_of("mpe", point.mpe, unit),
        "decision": None if verdict is None else verdict.decision,
        "reason": "" if verdict is None else verdict.reason,
        **_of("guard_band", None if verdict is None else verdict.guard_band, unit),
        "probability_of_conformity": None if verdict is None else verdict.probability,
        "risk": None if verdict is None else verdict.risk,
    }


def _characteristic(line: Characteristic, unit: Unit) -> dict[str, Any]:
    slope = line.sensitivity
    return {
        "zero_error": _estimate(line.zero, unit),
        "sensitivity": None
        if slope is None
        else {"value": slope.value, "u": slope.u, "dof": _known(slope.dof),
              "expanded_95": slope.expanded},
        "linearity": _estimate(line.linearity, unit),
        "worst_point": line.worst_point,
        "probability_of_line": line.fits,
    }  # fmt: skip


def _gauge_rr(study: GaugeRR | None, unit: Unit) -> dict[str, Any] | None:
    if study is None:
        return None
    scale = math.degrees(1.0) if unit == "rad" else 1.0
    parts = {"ev": study.ev, "av": study.av, "interaction": study.interaction, "grr": study.grr,
             "pv": study.pv, "tv": study.tv}  # fmt: skip
    return {
        "parts": study.parts,
        "appraisers": list(study.appraisers),
        "trials": study.trials,
        "interaction_pooled": study.pooled,
        "anova": [
            {
                "source": row.source,
                "dof": row.dof,
                "sum_of_squares": row.sum_of_squares * scale**2,
                "mean_square": _known(row.mean_square * scale**2),
                "f": row.f,
                "p": row.p,
            }
            for row in study.rows
        ],
        **{
            key: value
            for name, size in parts.items()
            for key, value in _of(name, size, unit).items()
        },
        "distinct_categories": study.distinct_categories,
    }


def _adjustment(one: Adjustment) -> dict[str, Any]:
    return {
        "quantity": one.quantity,
        "point": one.point,
        "found": _estimate(one.found, one.unit),
        "left": _estimate(one.left, one.unit),
        "change": _estimate(one.change, one.unit),
    }


def _estimate(known: Estimate | None, unit: Unit) -> dict[str, Any] | None:
    """Return value, u, degrees of freedom (null: infinite), k and U of an estimate.

    rectangular_share: of the resolution in the variance, as it makes k less than Student's t.
    """
    if known is None:
        return None
    k = known.expanded / known.u if known.u > 0.0 else None
    return {
        **_of("value", known.value, unit),
        **_of("u", known.u, unit),
        "dof": _known(known.dof),
        "k": k,
        "rectangular_share": known.uniform**2,
        **_of("expanded_95", known.expanded, unit),
    }


def _of(name: str, value: float | None, unit: Unit) -> dict[str, float | None]:
    """Return a field whose name ends in its unit; null where it is not known."""
    scale, suffix = (math.degrees(1.0), "deg") if unit == "rad" else (1.0, "m")
    known = None if value is None else _known(value * scale)
    return {f"{name}_{suffix}": known}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
