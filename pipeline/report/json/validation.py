"""A comparison of two methods as JSON: `wheelplane/validation/1`; degrees and metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ... import __version__
from ...measurement import Provenance
from ...validation import (
    KINDS,
    SHAPE,
    Agreement,
    Comparison,
    ComparisonStudy,
    JointTest,
    Limit,
    Line,
    Mounting,
    Mountings,
    nees,
    scores,
)
from ..tables.study import SETTLED_RAD
from .text import json_text

SCHEMA = "wheelplane/validation/1"


def validation_json(found: Comparison | ComparisonStudy | Mountings) -> str:
    """Return the text of validation.json; same comparison, same bytes."""
    if isinstance(found, Mountings):
        tree = mountings_tree(found)
    else:
        tree = comparison_tree(found) if isinstance(found, Comparison) else study_tree(found)
    tree = {"schema": SCHEMA, "version": __version__, **tree}
    return f"{json_text(tree)}\n"


def comparison_tree(found: Comparison) -> dict[str, Any]:
    """Return the comparison of one capture as plain data."""
    return {
        "capture": found.source,
        "vehicle_name": found.vehicle,
        "first": found.first.label,
        "second": found.second.label,
        "difference": "first less second",
        "verdict": found.verdict,
        "see_deg": _deg(found.to_detect_rad),
        "joint": _test(found.joint),
        "visible_in_one_deg": _deg(found.detectable_in_one_rad),
        "visible_in_all_deg": {kind: _deg(found.detectable_in_all_rad(kind)) for kind in KINDS},
        "angles": [_angle(found, i) for i in range(len(found.en))],
        "planes": _test(found.planes.test(found.planes_rad)),
        "shape": {**_test(found.shape_test), "quantities": _shape(found)},
        "missing": [{"name": name, "reason": reason} for name, reason in found.missing],
        "notes": list(found.notes),
        "provenance": _provenance(found.origins),
    }


def mountings_tree(found: Mountings) -> dict[str, Any]:
    """Return the targets of one capture against their wheels as plain data."""
    return {
        "capture": found.source,
        "vehicle_name": found.vehicle,
        "difference": "target less wheel",
        "mountings": [_mounting(one) for one in found.mountings],
        "scatter": [
            {
                "target": one.target.model_dump(),
                "count": one.count,
                "stand_off_m": one.stand_off_m,
                "stand_off_u_m": one.u_m,
                "clamp_tilt_deg": _deg(one.tilt_rad),
                "clamp_shift_m": one.shift_m,
            }
            for one in found.scatters
        ],
        "missing": [{"name": name, "reason": reason} for name, reason in found.missing],
        "notes": list(found.notes),
        "provenance": _provenance(found.origins),
    }


def _mounting(one: Mounting) -> dict[str, Any]:
    """Return the offsets of one target: degrees and metres, with u and U."""
    tree: dict[str, Any] = {"name": one.name, "wheel": one.wheel, "axis_by": one.by}
    for name, known in one.offsets.items():
        angle = name in KINDS
        for key, value in (("", known.value), ("u_", known.u), ("U_", known.expanded)):
            tree[f"{key}{name}_{'deg' if angle else 'm'}"] = _deg(value) if angle else value
    tree["radial_m"] = math.hypot(one.forward.value, one.upward.value)
    tree["tilt_deg"] = _deg(math.hypot(one.toe.value, one.camber.value))
    return tree


def _provenance(origins: Sequence[Provenance]) -> list[dict[str, Any]]:
    return [
        {"source": o.source, "inputs": o.inputs, "config": o.config, "seed": o.seed}
        for o in origins
    ]


def study_tree(study: ComparisonStudy) -> dict[str, Any]:
    """Return the comparison of many captures as plain data."""
    whole, size = nees(study.found), study.to_detect_rad or SETTLED_RAD
    return {
        "archive": study.source,
        "verdict": study.verdict,
        "see_deg": _deg(study.to_detect_rad),
        "bias_probability": study.bias_probability,
        "disagreeing": study.disagreeing,
        "compared": len(study.found),
        "chance_of_disagreeing": study.chance_of_disagreeing,
        "agreement": {one.kind: agreement_tree(one, size) for one in study.agreements},
        "scores": {
            score.kind: {
                "count": score.count,
                "bias_deg": _deg(score.bias),
                "rms_deg": _deg(score.rms),
                "worst_deg": _deg(score.worst),
                "inside_95": score.inside / score.count,
                "limits_of_inside": [score.low, score.high],
            }
            for score in scores(study.found)
        },
        "nees": {
            "mean": whole.mean,
            "limits_95": [whole.low, whole.high],
            "position": whole.position,
            "values": whole.count,
        },
        "captures": [
            {"name": row.name, "reason": row.reason or None}
            | ({} if row.found is None else comparison_tree(row.found))
            for row in study.rows
        ],
    }


def _angle(found: Comparison, i: int) -> dict[str, Any]:
    kind, index = divmod(i, len(found.names))
    dof = float(found.spread.dof[i])
    return {
        "name": found.names[index],
        "wheel": found.wheels[index],
        "angle": KINDS[kind],
        "first_deg": _deg(found.first.angles_rad[i]),
        "u_first_deg": _deg(found.u_first[i]),
        "second_deg": _deg(found.second.angles_rad[i]),
        "u_second_deg": _deg(found.u_second[i]),
        "difference_deg": _deg(found.difference_rad[i]),
        "u_deg": _deg(found.spread.u[i]),
        "degrees_of_freedom": dof if math.isfinite(dof) else None,
        "expanded_95_deg": _deg(found.spread.expanded[i]),
        "en": float(found.en[i]) if math.isfinite(found.en[i]) else None,
        "visible_deg": _deg(found.detectable_rad[i]),
        "verdict": found.verdicts[i],
        "by_frame_deg": _deg(found.frame_rad[i]),
        "by_plane_deg": _deg(found.planes_rad[i]),
        "u_by_plane_deg": _deg(found.planes.u[i]),
    }


def _shape(found: Comparison) -> list[dict[str, Any]]:
    entries = []
    for index, (name, unit) in enumerate(SHAPE.items()):
        scale = 1.0 if unit == "m" else math.degrees(1.0)
        entries.append(
            {
                "quantity": name,
                "unit": "m" if unit == "m" else "deg",
                "difference": float(found.shape[index]) * scale,
                "u": float(found.shape_spread.u[index]) * scale,
            }
        )
    return entries


def _test(test: JointTest) -> dict[str, Any]:
    return {
        "chi_square": test.chi_square,
        "values": test.count,
        "degrees_of_freedom_of_u": test.dof if math.isfinite(test.dof) else None,
        "probability": test.probability,
    }


def agreement_tree(one: Agreement, size_rad: float) -> dict[str, Any]:
    """Return the agreement of one kind of angle as plain data; size_rad: of a bias to settle."""
    return {
        "differences": len(one.first),
        "wheels": one.subjects,
        "units": one.units,
        "bias_deg": _limit(one.bias),
        "lower_limit_of_agreement_deg": _limit(one.lower),
        "upper_limit_of_agreement_deg": _limit(one.upper),
        "deviation_deg": _deg(one.total),
        "deviation_between_wheels_deg": _deg(one.between),
        "deviation_within_wheels_deg": _deg(one.within),
        "visible_bias_deg": _deg(one.detectable),
        "captures_needed": {
            "bias_deg": _deg(size_rad),
            "captures": one.units_for(size_rad),
            "counted": "vehicles" if one.by_vehicle else "captures",
        },
        "line": _line(one.line),
    }


def _line(line: Line | None) -> dict[str, Any] | None:
    if line is None:
        return None
    return {
        "intercept_deg": _deg(line.intercept),
        "u_intercept_deg": _deg(line.u_intercept),
        "slope": line.slope,
        "u_slope": line.u_slope,
        "chi_square": line.chi_square,
        "degrees_of_freedom": line.dof,
        "probability": line.probability,
    }


def _limit(limit: Limit) -> dict[str, float | None]:
    return {"value": _deg(limit.value), "low": _deg(limit.low), "high": _deg(limit.high)}


def _deg(angle_rad: float | None) -> float | None:
    """Return degrees; null where the angle is missing or not finite."""
    if angle_rad is None or not math.isfinite(angle_rad):
        return None
    return math.degrees(float(angle_rad))
