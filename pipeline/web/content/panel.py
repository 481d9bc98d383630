"""Panel of a measurement: its tables in every unit, and the details of each wheel."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ...measurement import Conformity, Measurement, Stated, WheelResult
from ...report.format.language import Translations
from ...report.format.notes import notes_in
from ...report.format.view import (
    CONVENTIONS,
    PAPER,
    STYLES_WITHOUT_RIM,
    AngleStyle,
    Convention,
    View,
)
from ...report.format.writer import Table, Writer
from ...report.html.provenance import head_pairs, troubles, wheel_facts
from ...report.html.results import headline
from ...report.plots.budget import wheel_budget
from ...report.plots.drawing import Drawing
from ...report.plots.residuals import histogram_drawing, profile_drawing
from ...report.plots.target_face import face_drawing
from ...report.scene.scene import wheel_texts
from ...report.tables.conformity import joint, limits_table
from ...report.tables.kinematics import runout_tables, steering_tables
from ...report.tables.vehicle import vehicle_table
from ...report.tables.wheels import axles_table, wheels_table
from ...vehicle import AXES, Axis


def panel(
    measurement: Measurement, conformity: Conformity | None, words: Translations
) -> dict[str, Any]:
    """Build the panel in one language; what depends on the view by convention, axis and style."""
    plain = Writer(words, view_of(measurement, PAPER.axis, PAPER.angles, "default"))

    def in_every_view(make: Callable[[Writer], Any]) -> dict[str, Any]:
        return {
            convention: {
                axis: {
                    style: make(Writer(words, view_of(measurement, axis, style, convention)))
                    for style in STYLES_WITHOUT_RIM
                }
                for axis in AXES
            }
            for convention in CONVENTIONS
        }

    return {
        "head": head_pairs(measurement, "", words),
        "headline": dataclasses.asdict(headline(measurement, conformity, words)),
        "joint": joint(conformity, plain) if conformity else "",
        "limits": in_every_view(lambda writer: table_tree(limits_table(conformity, writer)))
        if conformity
        else None,
        "tables": in_every_view(lambda writer: _tables(measurement, writer)),
        "extra": in_every_view(lambda writer: _turned_tables(measurement, writer)),
        "labels": in_every_view(lambda writer: wheel_texts(measurement, writer)),
        "axes": {axis: plain.axis(axis) for axis in AXES},
        "conventions": {
            convention: "" if convention == "default" else words.known("convention", convention)
            for convention in CONVENTIONS
        },
        "wheels": [
            {"name": result.observation.name, "facts": wheel_facts(result, plain)}
            for result in measurement.wheels
        ],
        "troubles": [dataclasses.asdict(trouble) for trouble in troubles(measurement, words)],
        "notes": notes_in(measurement.notes, words),
    }


def drawings(
    measurement: Measurement,
    result: WheelResult,
    known: Mapping[tuple[str, str], Stated],
    words: Translations,
) -> Iterator[Drawing]:
    """Draw the evidence of one wheel: target, residuals, uncertainty budget.

    known: the quantities by subject and kind.
    """
    of_target = [
        face_drawing(result, measurement.frame, words),
        histogram_drawing(result, words),
        profile_drawing(result, words),
    ]
    yield from (drawing for drawing in of_target if drawing is not None)
    if result.angles is not None:
        angles = [known[result.observation.name, kind] for kind in ("toe", "camber")]
        yield wheel_budget(angles, measurement.uncertainty.components, words)


def view_of(
    measurement: Measurement, axis: Axis, style: AngleStyle, convention: Convention
) -> View:
    """Return a view of a measurement, which names the vertical that it was measured from."""
    return View(axis, style, vertical=measurement.vertical_kind, convention=convention)


def _tables(measurement: Measurement, writer: Writer) -> list[dict[str, Any]]:
    makers = (wheels_table, axles_table, vehicle_table)
    return [table_tree(make(measurement, writer)) for make in makers]


def _turned_tables(measurement: Measurement, writer: Writer) -> list[dict[str, Any]]:
    """Return the tables of a sweep and of run-outs, without their notes."""
    found = (*steering_tables(measurement, writer), *runout_tables(measurement, writer))
    return [table_tree(table) for table, _ in found]


def table_tree(table: Table) -> dict[str, Any]:
    """Return a table as plain data."""
    return {
        "caption": table.caption,
        "head": list(table.head),
        "rows": [list(row) for row in table.rows],
        "left": table.left,
        "classes": list(table.classes),
        "minor": list(table.minor),
    }
