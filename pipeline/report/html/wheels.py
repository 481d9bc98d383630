"""Wheel by wheel: its picture, its residuals, its budget, and the facts of its scan."""

from __future__ import annotations

from ...measurement import Measurement, Stated, WheelResult, by_kind, stated
from ...system import frozen
from ..format.writer import Writer
from ..plots.budget import wheel_budget
from ..plots.drawing import Drawing
from ..plots.residuals import histogram_drawing, profile_drawing
from ..plots.target_face import coarseness, face_drawing
from .provenance import Pairs, wheel_facts


@frozen
class Card:
    """One wheel's evidence; toe, camber: name, value, U, or nothing where it was not measured."""

    title: str
    status: str
    toe: tuple[str, ...]
    camber: tuple[str, ...]
    face: Drawing | None
    histogram: Drawing | None
    profile: Drawing | None
    budget: Drawing | None
    facts: Pairs


def cards(measurement: Measurement, writer: Writer) -> list[Card]:
    """Return a card of every wheel and trial."""
    known = by_kind(stated(measurement), writer.view.axis)
    faces = [w for w in measurement.wheels if w.observation.evidence is not None]
    coarser = coarseness(len(faces))
    return [_card(result, measurement, known, writer, coarser) for result in measurement.wheels]


def _card(
    result: WheelResult,
    measurement: Measurement,
    known: dict[tuple[str, str], Stated],
    writer: Writer,
    coarser: int,
) -> Card:
    seen, words = result.observation, writer.words
    name, role = seen.name, words.known("role", seen.role)
    wheel = f", {words.wheel(result.wheel)}" if result.wheel and result.wheel != name else ""
    measured = result.angles is not None
    angles = [known[name, kind] for kind in ("toe", "camber")] if measured else []
    toe, camber = (
        ((writer.quantity(q.kind), writer.value(q), writer.width(q, q.expanded)) for q in angles)
        if measured
        else ((), ())
    )
    return Card(
        title=f"{words.wheel(name)} ({role}{wheel})",
        status=words("wheel.status_bad", status=writer.status(seen.status)),
        toe=toe,
        camber=camber,
        face=face_drawing(result, measurement.frame, words, coarser),
        histogram=histogram_drawing(result, words),
        profile=profile_drawing(result, words),
        budget=wheel_budget(angles, measurement.uncertainty.components, words)
        if measured
        else None,
        facts=wheel_facts(result, writer),
    )
