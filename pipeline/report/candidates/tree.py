"""An explanation as plain data: `wheelplane/explanation/1`; metres."""

from __future__ import annotations

from typing import Any

from ... import __version__
from ...explanation import ExplainedCandidate, ExplainedScan, Explanation
from ...units import in_metres
from ...vectors import Array
from ..format.digits import rounded
from ..format.language import Translations
from .pictures import picture_axes, picture_corners_m, places

SCHEMA = "wheelplane/explanation/1"


def explanation_tree(
    found: Explanation, pictures: dict[str, list[str]], words: Translations
) -> dict[str, Any]:
    """Return the explanation as plain data; pictures: names of files by the scan's name.

    words: of the verdicts; `finding` names each in every language.
    """
    return {
        "schema": SCHEMA,
        "version": __version__,
        "capture": found.source,
        "target": found.target,
        "length_unit": found.length_unit,
        "scans": [
            _scan(one, found.length_unit, pictures.get(one.name, []), words) for one in found.scans
        ],
    }


def verdict_of(one: ExplainedCandidate, words: Translations) -> str:
    """Return in words why a candidate was taken or refused."""
    return words(
        f"candidate.{one.finding}",
        least=words.number(f"{one.least_match:.2f}"),
        apart=words.number(f"{one.apart_m * 1e3:.0f} mm"),
        wheel=words.wheel(one.wheel),
    )


def hint_of(scan: ExplainedScan, one: ExplainedCandidate, unit: str) -> str | None:
    """Return what follows --hint to choose the candidate of a scan; None in a cloud."""
    return None if scan.role == "vehicle" else f"{scan.name}={point_of(one, unit)}"


def point_of(one: ExplainedCandidate, unit: str) -> str:
    """Return the candidate's centre as an option takes it: X,Y,Z in the unit of the scans."""
    metres, place = in_metres(1.0, unit), -3 if unit == "m" else -1
    texts = (rounded(x / metres, place, "") for x in one.candidate.centre_m)
    return ",".join(text.rstrip("0").rstrip(".") for text in texts)


def _scan(
    scan: ExplainedScan, unit: str, pictures: list[str], words: Translations
) -> dict[str, Any]:
    return {
        "name": scan.name,
        "role": scan.role,
        "file": scan.file,
        "status": scan.status,
        "reason": scan.reason,
        "points": scan.points,
        "pictures": pictures,
        "picture_axes": picture_axes(scan),
        "picture_corners": _in_unit(picture_corners_m(scan), unit),
        "region": _in_unit(scan.drawn_m, unit),
        "candidates": [
            {
                "number": one.number,
                "standing": one.standing,
                "finding": one.finding,
                "verdict": verdict_of(one, words),
                "wheel": one.wheel or None,
                "target": one.target or None,
                "match": round(one.candidate.match, 4),
                "centre_m": one.candidate.centre_m.tolist(),
                "normal": one.candidate.normal.tolist(),
                "noise_m": one.candidate.sigma_m,
                "points": one.candidate.points,
                "in_picture": at,
                "point": point_of(one, unit),
                "hint": hint_of(scan, one, unit),
            }
            for one, at in zip(scan.candidates, places(scan), strict=True)
        ],
    }


def _in_unit(points_m: Array, unit: str) -> list[list[float]]:
    """Return points (N, 3) in the unit of the scans."""
    return [[round(float(x), 6) for x in point] for point in points_m / in_metres(1.0, unit)]
