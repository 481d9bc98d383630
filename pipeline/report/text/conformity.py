"""Verdicts as text: a table that says of each quantity what is decided, and at what risk."""

from __future__ import annotations

import math

from ...measurement import Conformity, Unit, Verdict
from ...vehicle import deg_min_sec
from ..format.layout import aligned

HEAD = ("verdict", "name", "quantity", "value", "lower", "upper", "u", "guard band", "P", "risk")
READING = """\
Toe-in, top-out and thrust to the right are positive; cross camber is left less right; setback is
positive where the right wheel stands behind. What names no axis counts from the rear axle's normal.
u: standard uncertainty (k = 1). Guard band: how far inside of its limits a value must lie.
P: probability that the true value lies within the limits, if it is distributed normally about the
value with deviation u and nothing is known of the vehicle beforehand (JCGM 106).
risk: that the verdict is wrong: of a conform one the consumer's, 1 - P; of a not conform one the
producer's, P. Each quantity is judged on its own."""


def conformity_text(conformity: Conformity) -> str:
    """The verdict, the rule, a row a quantity, and why what is undecided is so."""
    rows = [HEAD, *(_row(verdict) for verdict in conformity.verdicts)]
    at_least = math.floor(conformity.joint_probability[0] * 1000) / 10
    title = " ".join(conformity.tolerance.title.split())
    sections = [
        f"Verdict: {conformity.decision.upper()}" + (f" ({title})" if title else ""),
        _rule(conformity),
        aligned(rows, left=3),
        *(_why(verdict) for verdict in conformity.verdicts if verdict.reason),
        f"Probability that all conform at once: at least {at_least:.1f} %, however they correlate.",
        READING,
    ]
    return "\n".join(sections)


def _rule(conformity: Conformity) -> str:
    tolerance = conformity.tolerance
    if tolerance.rule == "simple":
        return "Rule: simple acceptance (shared risk): the value decides, whatever its uncertainty."
    return (
        f"Rule: guarded acceptance (ISO 14253-1, JCGM 106): conform where P is at least "
        f"{tolerance.confidence:g}; not conform\nfrom {tolerance.coverage_factor:.3f} u beyond a "
        "limit; else undecided."
    )


def _row(verdict: Verdict) -> tuple[str, ...]:
    what, interval, unit = verdict.quantity, verdict.interval, verdict.quantity.unit
    return (
        verdict.decision,
        _subject(verdict),
        what.name.replace("_", " "),
        _value(what.value, unit),
        _value(interval.lower if interval else None, unit),
        _value(interval.upper if interval else None, unit),
        _width(what.u, unit),
        _width(verdict.guard_band, unit),
        "-" if verdict.probability is None else _share(verdict.probability),
        "-" if verdict.risk is None else _share(verdict.risk),
    )


def _subject(verdict: Verdict) -> str:
    """Name of the wheel; of a trial also the wheel whose limits it is judged by."""
    what = verdict.quantity
    trial = what.wheel is not None and what.wheel != what.subject
    return f"{what.subject} ({what.wheel})" if trial else what.subject


def _why(verdict: Verdict) -> str:
    name = verdict.quantity.name.replace("_", " ")
    return f"  {_subject(verdict)} {name}: {verdict.reason}"


def _value(value: float | None, unit: Unit) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return deg_min_sec(value) if unit == "rad" else f"{value:.5f} m"


def _width(value: float | None, unit: Unit) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return f'{math.degrees(value) * 3600:.1f}"' if unit == "rad" else f"{value * 1e3:.3f} mm"


def _share(probability: float) -> str:
    """Per cent, never rounded to the certainty of 0 or 100."""
    if probability < 5e-4:
        return "< 0.1 %"
    return "> 99.9 %" if probability >= 0.9995 else f"{probability * 100:.1f} %"
