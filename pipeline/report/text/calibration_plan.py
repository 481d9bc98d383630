"""A plan of a calibration as plain text."""

from __future__ import annotations

import math

from ...calibration import CalibrationPlan, Detection, QuantityPlan
from ..format.layout import paragraph
from ..format.view import PAPER, View
from ..format.writer import Table, Writer
from ..tables.calibration import quantity
from .plain import plain_writer


def plan_text(found: CalibrationPlan, view: View = PAPER) -> str:
    """Return the expected uncertainties, the power, and what the wanted U takes."""
    writer = plain_writer(view)
    words, plan = writer.words, found.plan
    ways = words("plan.both_ways") if plan.directions else ""
    title = words("plan.title", wheels=4, trials=len(found.places), source=found.source,
                  series=plan.series, repeats=plan.repeats, ways=ways)  # fmt: skip
    uncertain, detected = _uncertainties(found, writer), _detections(found, writer)
    parts = [paragraph(title), "", uncertain.caption, uncertain.text()]
    if detected.rows:
        parts += ["", detected.caption, detected.text()]
    parts += [line for one in found.quantities for line in _wanted(one, writer)]
    if found.source == "plan":
        places = _places(found, writer)
        parts += ["", places.caption, places.text(), "", paragraph(words("plan.independent"))]
    return "\n".join(parts) + "\n"


def _uncertainties(found: CalibrationPlan, writer: Writer) -> Table:
    words = writer.words
    head = (words("plan.of"), "u(ref)", "u", "U", words("plan.ratio"), words("plan.zero"),
            words("plan.gain"), words("plan.hysteresis"))  # fmt: skip
    rows = [
        [
            quantity(one.quantity, words),
            *(writer.size(u, one.unit) for u in (one.reference, one.error.u, one.error.expanded)),
            writer.none if one.ratio is None else words.number(f"{one.ratio:.1f}"),
            writer.size(one.zero.expanded, one.unit),
            writer.none if one.sensitivity is None
            else words.number(f"{one.sensitivity.expanded:.2g}"),
            writer.size(None if one.hysteresis is None else one.hysteresis.expanded, one.unit),
        ]
        for one in found.quantities
    ]  # fmt: skip
    return writer.table(head, rows, 1, words("plan.table"))


def _detections(found: CalibrationPlan, writer: Writer) -> Table:
    words = writer.words
    of_all = [error for one in found.quantities for error in one.detections]
    searched = bool(found.places) or any(error.trials is not None for error in of_all)
    head = (words("plan.of"), words("plan.detects"), words("plan.size"), "U", words("plan.power"),
            *([words("plan.trials_needed")] if searched else []))  # fmt: skip
    rows = [
        [
            quantity(one.quantity, words),
            words(f"plan.name_{error.name}"),
            _size(error, error.size, one, writer),
            _size(error, error.expanded, one, writer),
            writer.share(error.power),
            *([writer.none if error.trials is None else str(error.trials)] if searched else []),
        ]
        for one in found.quantities
        for error in one.detections
    ]
    return writer.table(head, rows, 2, words("plan.detection"))


def _size(error: Detection, size: float, one: QuantityPlan, writer: Writer) -> str:
    if error.name == "gain":
        return writer.words.number(f"{size:.2g}")
    return writer.size(abs(size), one.unit)


def _wanted(one: QuantityPlan, writer: Writer) -> list[str]:
    if one.wanted is None:
        return []
    words = writer.words
    size = writer.size(one.wanted, one.unit)
    wanted = words("plan.wanted", quantity=quantity(one.quantity, words), wanted=size)
    key = "not_reached" if one.repeats is None else "reached"
    found = ["", paragraph(words(f"plan.{key}", wanted=wanted, repeats=one.repeats))]
    if one.u_reference is None:
        return [*found, paragraph(words("plan.no_reference"))]
    u = writer.size(one.u_reference, one.unit)
    return [*found, paragraph(words("plan.reference_needed", u=u))]


def _places(found: CalibrationPlan, writer: Writer) -> Table:
    words = writer.words
    head = (words("plan.place"), words("plan.wheel"), words("quantity.toe"),
            words("quantity.camber"))  # fmt: skip
    rows = [
        [name, writer.wheel(wheel), *(writer.number(a, "rad", math.radians(0.1)) for a in angles)]
        for name, wheel, *angles in found.places
    ]
    return writer.table(head, rows, 2, words("plan.places"))
