"""An explanation as plain data: `wheelplane/explanation/1`; metres."""

from __future__ import annotations

from typing import Any

from ... import __version__
from ...explanation import ExplainedCandidate, ExplainedScan, Explanation
from ...units import in_metres

SCHEMA = "wheelplane/explanation/1"


def explanation_tree(found: Explanation, pictures: dict[str, list[str]]) -> dict[str, Any]:
    """Return the explanation as plain data; pictures: names of files by the scan's name."""
    return {
        "schema": SCHEMA,
        "version": __version__,
        "capture": found.source,
        "target": found.target,
        "length_unit": found.length_unit,
        "scans": [_scan(one, found.length_unit, pictures.get(one.name, [])) for one in found.scans],
    }


def hint_of(scan: ExplainedScan, one: ExplainedCandidate, unit: str) -> str | None:
    """Return what follows --hint to choose the candidate of a scan; None in a cloud."""
    if scan.role == "vehicle":
        return None
    point = ",".join(f"{x / in_metres(1.0, unit):.4g}" for x in one.candidate.centre_m + 0.0)
    return f"{scan.name}={point}"


def _scan(scan: ExplainedScan, unit: str, pictures: list[str]) -> dict[str, Any]:
    return {
        "name": scan.name,
        "role": scan.role,
        "file": scan.file,
        "status": scan.status,
        "reason": scan.reason,
        "points": scan.points,
        "pictures": pictures,
        "candidates": [
            {
                "number": one.number,
                "standing": one.standing,
                "verdict": one.verdict,
                "wheel": one.wheel or None,
                "match": round(one.candidate.match, 4),
                "centre_m": one.candidate.centre_m.tolist(),
                "normal": one.candidate.normal.tolist(),
                "noise_m": one.candidate.sigma_m,
                "points": one.candidate.points,
                "hint": hint_of(scan, one, unit),
            }
            for one in scan.candidates
        ],
    }
