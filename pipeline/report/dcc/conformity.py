"""Verdicts as the five words of a digital certificate, which follow ILAC-G8:09/2019."""

from __future__ import annotations

from ...calibration import Calibration, CalibrationPoint

WORST = ("fail", "conditionalFail", "conditionalPass", "pass")


def conformity_of(point: CalibrationPoint) -> str:
    """Return pass or fail; conditionalPass, conditionalFail: undecided, inside the MPE or not."""
    assert point.verdict is not None
    assert point.mpe is not None
    decision = point.verdict.decision
    if decision == "undecided":
        return "conditionalPass" if abs(point.error.value) <= point.mpe else "conditionalFail"
    return "pass" if decision == "conform" else "fail"


def overall(found: Calibration) -> str:
    """Return the worst of the final results; empty where no MPE is stated.

    Points that were not read again as left keep what they were as found; with one, it is no pass.
    """
    points = [point for result in found.final for point in result.points]
    points += found.not_read_again
    seen = {conformity_of(point) for point in points if point.verdict is not None}
    worst = next((word for word in WORST if word in seen), "")
    return "conditionalPass" if worst == "pass" and found.not_read_again else worst
