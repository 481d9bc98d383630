"""The report as one HTML page that needs nothing beside it; pdf.py prints the same."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from ...measurement import Conformity, Measurement
from ...vehicle import AXES
from ..format.language import Translations
from ..format.notes import notes_in
from ..format.report_options import ReportOptions
from ..format.writer import Writer
from ..json.measurement import to_json
from ..plots.angles import angles_drawing
from ..plots.budget import vehicle_budget
from ..plots.drawing import FONT
from ..plots.frame import MOST_DOTS, frame_drawing
from ..plots.sign_convention import signs_drawing
from ..plots.top_view import top_drawing
from ..scene.scene import SYMBOL_M, scene
from ..tables.checks import monte_carlo_table, monte_carlo_words, repeats_table
from ..tables.conformity import joint, limits_table, notes
from ..tables.kinematics import runout_tables, steering_tables
from ..tables.vehicle import axes_table, vehicle_table
from ..tables.wheels import centres_table, wheels_table
from . import provenance as page_origin
from . import results as page_results
from .document import NUMBER_DIGITS
from .front import front
from .template import render
from .wheels import cards

VIEWER = Path(__file__).parents[1] / "static" / "viewer.js"


def html_report(
    measurement: Measurement,
    conformity: Conformity | None,
    dress: ReportOptions,
    still: bool = False,
) -> str:
    """Return the page; still: without the 3D view, for print. Same measurement, same text."""
    return rendered(page_of(measurement, conformity, dress), still)


def rendered(page: dict[str, Any], still: bool = False) -> str:
    """Return the HTML of a page by its fields; still: as in `html_report`."""
    return render("report.html", page | {"viewer": "", "scene": None} if still else page)


def page_of(
    measurement: Measurement, conformity: Conformity | None, dress: ReportOptions
) -> dict[str, Any]:
    """Return the fields of the page's template."""
    words, view = dress.words, dress.view
    writer = Writer(words, view)
    record = dress.record or to_json(measurement, conformity, view.axis, dress.before)
    digest = hashlib.sha256(record.encode()).hexdigest()
    number = digest[:NUMBER_DIGITS]
    made = measurement.provenance
    shown = scene(measurement, conformity, words, view)
    five_point = page_origin.is_five_point(measurement)
    return {
        "words": words,
        "title": words("title.report"),
        "running": words("head.report"),
        "font": FONT,
        "number": number,
        "digest": digest,
        "version": made.version,
        "vehicle": made.vehicle or "",
        "laboratory": dress.laboratory,
        "head": page_origin.head_pairs(measurement, number, words),
        "verdict": page_results.headline(measurement, conformity, words),
        "wheels": wheels_table(measurement, writer),
        "front": front(measurement, conformity, writer, dress.before),
        "before": dress.before,
        "limits": limits_table(conformity, writer) if conformity else None,
        "joint": joint(conformity, writer) if conformity else "",
        "limits_notes": notes(conformity, writer) if conformity else "",
        "u_note": words("results.u_note", factor=page_results.factor_words(measurement, words)),
        "plots": {
            "angles": angles_drawing(measurement, conformity, words, view.axis),
            "frame": frame_drawing(shown, words),
            "top": top_drawing(measurement, words, view),
            "budget": vehicle_budget(measurement, words, view.axis),
            "signs": signs_drawing(writer),
        },
        "troubles": page_origin.troubles(measurement, words),
        "cards": cards(measurement, writer),
        "five_point": five_point,
        "still_note": _still_note(shown, five_point, words),
        "centres": centres_table(measurement, writer),
        "vehicle_table": vehicle_table(measurement, writer),
        "vehicle_note": words("vehicle.note", side=writer.heading_side),
        "axes": axes_table(measurement, writer),
        "definitions": [(writer.axis(a), words.known("definition", a)) for a in AXES],
        "turned": [
            *steering_tables(measurement, writer),
            *runout_tables(measurement, writer),
        ],
        "repeats": repeats_table(measurement, writer),
        "monte_carlo": (
            monte_carlo_table(measurement, drawn, writer),
            *monte_carlo_words(drawn, writer),
        )
        if (drawn := measurement.monte_carlo) is not None
        else None,
        "notes": notes_in(measurement.notes, words),
        "inputs": page_origin.inputs_table(measurement, words),
        "config": page_origin.settings(measurement, conformity),
        "scene": shown,
        "viewer": VIEWER.read_text(encoding="utf-8").replace("</script", "<\\/script")
        if VIEWER.is_file()
        else "",
        "viewer_words": words.section("viewer"),
    } | _said(measurement, dress)


def _said(measurement: Measurement, dress: ReportOptions) -> dict[str, Any]:
    """Return sentences on axis, units, signs and method, and the names of the sections."""
    words, view = dress.words, dress.view
    axis = words.known("axis", view.axis)
    axis_note = words(
        "conventions.axis", axis=axis, definition=words.known("definition", view.axis)
    )
    key = "units_" + view.angles.replace("/", "")
    rim = words.number(f"{view.rim_m * 1e3:g}")
    units = words(f"conventions.{key}", rim=rim)
    digits = words(f"conventions.digits_{view.digits}")
    lines = [words("conventions.toe", axis=axis)]
    side = Writer(words, view).heading_side
    names = ("camber", "iso", "thrust", "frame")
    lines += [words(f"conventions.{name}", side=side) for name in names]
    if view.convention != "default":
        lines.append(words.known("convention", view.convention))
    ids = [
        "results",
        "values",
        "frame",
        "wheels",
        "vehicle",
        "conventions",
        "uncertainty",
        "origin",
    ]
    return {
        "axis_note": axis_note,
        "units": units,
        "conventions": [*lines, axis_note, words("conventions.wheels"), units, digits],
        "method": page_origin.methods(measurement, words),
        "sections": [(name, words(f"section.{name}")) for name in ids],
    }


def _still_note(shown: dict[str, Any], five_point: bool, words: Translations) -> str:
    if five_point:
        return words("frame.five", diameter=f"{2e3 * SYMBOL_M:g} mm")
    count = min(shown["cloud"]["count"], MOST_DOTS) if shown["cloud"] else 0
    return words("frame.still", count=words.count(count))
