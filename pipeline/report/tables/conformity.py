"""Verdicts: of each quantity with limits what is decided, and at what risk."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...errors import Doubt
from ...measurement import (
    VEHICLE_BY_SWEEP,
    WHEEL_BY_RUNOUT,
    WHEEL_BY_SWEEP,
    Conformity,
    Estimate,
    Quantity,
    Verdict,
)
from ...vehicle import VEHICLE
from ..format.digits import UNKNOWN
from ..format.language import Translations
from ..format.notes import notes_in
from ..format.writer import Column, Columns, Table, Writer

LENGTHS = frozenset(one.kind for one in VEHICLE if not one.signed)
SIGNS = {"conform": "✓", "not conform": "✗", "undecided": "?"}


def limits_table(conformity: Conformity, writer: Writer) -> Table:
    """Return a row for each quantity with limits: the decision, and why it is undecided."""
    words = writer.words
    undecided = any(verdict.decision == "undecided" for verdict in conformity.verdicts)
    columns: Columns = (
        words("verdict.decision"), words("results.name"), words("vehicle.quantity"),
        words("vehicle.value"), words("verdict.lower"), words("verdict.upper"), "u",
        words("verdict.guard"), words("verdict.probability"), words("verdict.risk"),
        *([Column(words("verdict.reason"), "page")] if undecided else []),
    )  # fmt: skip
    rows = [_row(verdict, writer) for verdict in conformity.verdicts]
    kinds = [v.decision.replace(" ", "-") for v in conformity.verdicts]
    return writer.table(columns, rows, 3, words("verdict.table"), kinds)


def decided(decision: str, words: Translations) -> str:
    """Return the word for a decision, capitalised."""
    key = decision.replace(" ", "_")
    return words(f"verdict.{key}")


def rule(conformity: Conformity, words: Translations) -> str:
    """Return the decision rule in words."""
    tolerance = conformity.tolerance
    low, high = (words.number(f"{factor:.3f}") for factor in conformity.factors)
    one = low == high
    parts = {
        "confidence": words.number(f"{tolerance.confidence:.12g}"),
        "factor": f"{low} u" if one else words("verdict.factors", low=low, high=high),
    }
    return f"{words('verdict.rule')}: {words(f'verdict.rule_{tolerance.rule}', **parts)}"


def doubted(notes: Sequence[Doubt], words: Translations) -> list[str]:
    """Return the notes that leave verdicts open, in words."""
    return [words("verdict.doubt", note=note) for note in notes_in(dict.fromkeys(notes), words)]


def joint(conformity: Conformity, writer: Writer) -> str:
    """Return the probability that all conform, and its bounds for any correlation, in words."""
    words = writer.words
    if conformity.probability is None:
        return words("verdict.joint_in_doubt" if conformity.doubts else "verdict.joint_unknown")
    low, high = conformity.joint_bounds
    least, most = math.floor(low * 1000) / 10, math.ceil(high * 1000) / 10
    bounds = {"low": words.number(f"{least:.1f}"), "high": words.number(f"{most:.1f} %")}
    return words("verdict.joint", probability=writer.share(conformity.probability), **bounds)


def subject(verdict: Verdict, writer: Writer) -> str:
    """Name the wheel; of a trial also the wheel whose limits apply to it."""
    what = verdict.quantity
    if what.subject == "vehicle":
        return writer.words.known("role", "vehicle")
    other = what.wheel is not None and what.wheel != what.subject
    return writer.wheel(what.subject) + (f" ({writer.wheel(str(what.wheel))})" if other else "")


def quantity(what: Quantity, writer: Writer) -> str:
    """Name the quantity, of toe-out on turns with the angle at which it is limited."""
    name = writer.from_rear_axle(what.name)
    if what.inner_rad is None:
        return name
    angle = writer.words.number(f"{math.degrees(what.inner_rad):.6g}°")
    return writer.words("quantity.at", quantity=name, angle=angle)


def notes(conformity: Conformity, writer: Writer) -> str:
    """Return the signs of the quantities, and what the columns hold."""
    words, side = writer.words, writer.heading_side
    names = {verdict.quantity.name for verdict in conformity.verdicts}
    steered = names & {*WHEEL_BY_SWEEP, *VEHICLE_BY_SWEEP}
    keys = ["signs_note", *["steering_signs_note"] * bool(steered), "probability_note"]
    return " ".join(words(f"verdict.{key}", side=side) for key in keys)


def _row(verdict: Verdict, writer: Writer) -> list[str]:
    what, interval = verdict.quantity, verdict.interval
    sense = writer.view.sense(what.name)
    shown = interval.times(sense) if interval else None
    lower, upper = (shown.lower, shown.upper) if shown else (None, None)
    value = None if what.value is None else sense * what.value
    word = decided(verdict.decision, writer.words).lower()
    return [
        word if writer.plain else f"{SIGNS[verdict.decision]} {word}",
        subject(verdict, writer), quantity(what, writer),
        _value(value, what, writer, _expanded(verdict)),
        *(_value(x, what, writer) for x in (lower, upper)),
        *(_width(x, what, writer) for x in (what.u, verdict.guard_band)),
        writer.share(verdict.probability), writer.share(verdict.risk), _why(verdict, writer),
    ]  # fmt: skip


def _value(value: float | None, what: Quantity, writer: Writer, expanded: float = UNKNOWN) -> str:
    """Write a value or a limit; a length that may be negative in millimetres, as its u."""
    if what.unit == "rad":
        return writer.angle(value, what.name, expanded)
    if what.name in LENGTHS or value is None or not math.isfinite(value):
        return writer.number(value, "m", expanded)
    return writer.millimetres(value, expanded, "+")


def _width(size: float | None, what: Quantity, writer: Writer) -> str:
    if what.unit == "rad":
        return writer.angle_width(size, what.name, what.value or 0.0)
    return writer.size(size, "m")


def reason(verdict: Verdict, writer: Writer) -> str:
    """Return why a quantity is undecided, in English, with its limits as they are printed."""
    if writer.view.sense(verdict.quantity.name) > 0.0:
        return verdict.reason
    swapped = {"lower limit": "upper limit", "upper limit": "lower limit"}
    found = next((side for side in swapped if side in verdict.reason), "")
    return verdict.reason.replace(found, swapped[found]) if found else verdict.reason


def _expanded(verdict: Verdict) -> float:
    """Return U, to whose place the value is written; its limits are exact."""
    what = verdict.quantity
    return UNKNOWN if what.u is None else Estimate(0.0, what.u, what.dof).expanded


def _why(verdict: Verdict, writer: Writer) -> str:
    """Return why a quantity is undecided, in the report's language."""
    what, interval, words = verdict.quantity, verdict.interval, writer.words
    if verdict.decision != "undecided":
        return ""
    if what.reason and what.name in WHEEL_BY_RUNOUT:
        return words("verdict.no_runout")
    if what.reason:
        steered = what.name in (*WHEEL_BY_SWEEP, *VEHICLE_BY_SWEEP)
        return words("verdict.no_sweep" if steered else "verdict.not_measured")
    if interval is None or what.value is None or what.u is None:
        return words("verdict.unknown")
    if what.doubts:
        return words("verdict.in_doubt")
    if verdict.guard_band is None:
        return words("verdict.undecidable")
    lower = what.value - interval.lower < interval.upper - what.value
    lower = lower == (writer.view.sense(what.name) > 0.0)
    return words("verdict.near_lower" if lower else "verdict.near_upper")
