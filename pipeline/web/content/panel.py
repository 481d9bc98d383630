"""Panel of a measurement: its tables in every unit, and the details of each wheel."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from ...measurement import Conformity, Measurement, WheelResult
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
from ...report.tables.conformity import joint, limits_table
from ...report.tables.kinematics import runout_tables, steering_tables
from ...report.tables.vehicle import vehicle_table
from ...report.tables.wheels import axles_table, wheels_table
from ...vehicle import AXES, Axis


def panel(
    measurement: Measurement, conformity: Conformity | None, words: Translations
) -> dict[str, Any]:
    """Build the panel in one language."""
    plain = Writer(words, view_of(measurement, PAPER.axis, PAPER.angles, "default"))
    turned = (*steering_tables(measurement, plain), *runout_tables(measurement, plain))
    extra = [table for table, _ in turned]
    return {
        "head": head_pairs(measurement, "", words),
        "headline": dataclasses.asdict(headline(measurement, conformity, words)),
        "joint": joint(conformity, plain) if conformity else "",
        "limits": table_tree(limits_table(conformity, plain)) if conformity else None,
        "tables": {
            convention: {
                axis: {
                    style: _tables(
                        measurement, words, view_of(measurement, axis, style, convention)
                    )
                    for style in STYLES_WITHOUT_RIM
                }
                for axis in AXES
            }
            for convention in CONVENTIONS
        },
        "axes": {axis: plain.axis(axis) for axis in AXES},
        "conventions": {
            convention: "" if convention == "default" else words.known("convention", convention)
            for convention in CONVENTIONS
        },
        "extra": [table_tree(table) for table in extra],
        "wheels": [
            {"name": result.observation.name, "facts": wheel_facts(result, plain)}
            for result in measurement.wheels
        ],
        "troubles": [dataclasses.asdict(trouble) for trouble in troubles(measurement, words)],
        "notes": notes_in(measurement.notes, words),
    }


def drawings(
    measurement: Measurement, result: WheelResult, words: Translations
) -> Iterator[Drawing]:
    """Draw the evidence of one wheel: target, residuals, uncertainty budget."""
    of_target = [
        face_drawing(result, measurement.frame, words),
        histogram_drawing(result, words),
        profile_drawing(result, words),
    ]
    yield from (drawing for drawing in of_target if drawing is not None)
    if result.angles is not None:
        yield wheel_budget(measurement, result.observation.name, words, PAPER.axis)


def view_of(
    measurement: Measurement, axis: Axis, style: AngleStyle, convention: Convention
) -> View:
    """Return a view of a measurement, which names the vertical that it was measured from."""
    return View(axis, style, vertical=measurement.vertical_kind, convention=convention)


def _tables(measurement: Measurement, words: Translations, view: View) -> list[dict[str, Any]]:
    writer = Writer(words, view)
    makers = (wheels_table, axles_table, vehicle_table)
    return [table_tree(make(measurement, writer)) for make in makers]


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
