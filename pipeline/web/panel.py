"""What the page shows of a measurement: its tables in every unit, each wheel's facts."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from pipeline.conformity import Conformity
from pipeline.measurement import Measurement, WheelResult
from pipeline.report.budget_svg import wheel_budget
from pipeline.report.drawing import Drawing
from pipeline.report.histogram import histogram_drawing
from pipeline.report.language import Words
from pipeline.report.page_origin import head_pairs, troubles, wheel_facts
from pipeline.report.page_results import axles_table, headline, joint, limits_table, wheels_table
from pipeline.report.page_vehicle import turned_tables, vehicle_table
from pipeline.report.picture import face_drawing
from pipeline.report.view import PAPER, AngleStyle, View
from pipeline.report.writer import Table, Writer
from pipeline.vehicle import AXES, Axis

STYLES: tuple[AngleStyle, ...] = ("dms", "deg", "mm/m")  # mm at the rim needs the rim's diameter


def panel(measurement: Measurement, conformity: Conformity | None, words: Words) -> dict[str, Any]:
    """The panel in one language."""
    plain = Writer(words, PAPER)
    extra = [table for table, _ in turned_tables(measurement, plain)]
    return {
        "head": head_pairs(measurement, "", words),
        "headline": dataclasses.asdict(headline(measurement, conformity, words)),
        "joint": joint(conformity, plain) if conformity else "",
        "limits": table_tree(limits_table(conformity, plain)) if conformity else None,
        "tables": {
            axis: {style: _tables(measurement, words, axis, style) for style in STYLES}
            for axis in AXES
        },
        "axes": {axis: plain.axis(axis) for axis in AXES},
        "extra": [table_tree(table) for table in extra],
        "wheels": [
            {"name": result.observation.name, "facts": wheel_facts(result, plain)}
            for result in measurement.wheels
        ],
        "troubles": [dataclasses.asdict(trouble) for trouble in troubles(measurement, words)],
        "notes": list(measurement.notes),
    }


def drawings(measurement: Measurement, result: WheelResult, words: Words) -> Iterator[Drawing]:
    """What shows how well one wheel was measured: its face, its residuals, its budget."""
    made = [
        face_drawing(result, measurement.frame, words),
        histogram_drawing(result, words),
    ]
    yield from (drawing for drawing in made if drawing is not None)
    if result.angles is not None:
        yield wheel_budget(measurement, result.observation.name, words, PAPER.axis)


def _tables(
    measurement: Measurement, words: Words, axis: Axis, style: AngleStyle
) -> list[dict[str, Any]]:
    writer = Writer(words, View(axis, style))
    makers = (wheels_table, axles_table, vehicle_table)
    return [table_tree(make(measurement, writer)) for make in makers]


def table_tree(table: Table) -> dict[str, Any]:
    """A table as plain data."""
    return {
        "caption": table.caption,
        "head": list(table.head),
        "rows": [list(row) for row in table.rows],
        "left": table.left,
        "classes": list(table.classes),
    }
