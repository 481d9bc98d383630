"""Report of a measurement or a comparison in the chosen format, language and view."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...config import load_config
from ...report.format.laboratory import Laboratory, read_laboratory
from ...report.format.language import Translations, load_translations
from ...report.format.report_options import ReportOptions
from ...report.format.view import PAPER
from ...report.format.writer import Writer
from ...report.html.comparison import comparison_document
from ...report.json.before import before_tree
from ...report.json.stored import RECORD
from ...report.json.text import json_text
from ...report.json.validation import validation_json
from ...report.text.report import detailed_report
from ...report.validation import validation_report
from ...report.write import ReportFiles, document_files, report_files, write_whole
from ...validation import Comparison
from ..files.stored import load, load_records
from .changes import earlier_of
from .comparing import COMPARISON
from .panel import view_of

TYPES = {
    "html": "text/html; charset=utf-8",
    "pdf": "application/pdf",
    "txt": "text/plain; charset=utf-8",
    "json": "application/json",
}


def report(plan: dict[str, Any], _send: Callable[[str, object], None]) -> None:
    """Write the report of the job in plan["out"], a task plan["of"], to plan["file"] there."""
    out = Path(plan["out"])
    settings = load_config(Path(plan["config"]) if plan["config"] else None)
    words, laboratory = load_translations(plan["language"]), read_laboratory(settings.report)
    if plan["of"] == "compare":
        found, vertical = load_records(out / COMPARISON)
        options = ReportOptions(words, replace(PAPER, vertical=vertical), laboratory)
        content = _of_comparison(found, plan["format"], options)
    else:
        content = _of_measurement(out, plan, words, laboratory)
    write_whole(out / plan["file"], content)


def _of_comparison(found: Comparison, kind: str, options: ReportOptions) -> bytes:
    """Return what `validate` writes of a comparison."""
    record = validation_json(found)
    if kind in ("json", "txt"):
        text = record if kind == "json" else validation_report(found, options.view)
        return text.encode(errors="backslashreplace")
    document = comparison_document(found, Writer(options.words, options.view), record)
    wanted = ReportFiles(html=kind == "html", pdf=kind == "pdf")
    return document_files("comparison", document, options, wanted)[f"comparison.{kind}"]


def _of_measurement(
    out: Path, plan: dict[str, Any], words: Translations, laboratory: Laboratory
) -> bytes:
    measurement, conformity = load(out)
    view = view_of(measurement, plan["axis"], plan["style"], plan["convention"])
    before, kind = None, plan["format"]
    if plan["before"]:
        before = earlier_of(measurement, Path(plan["before"]), plan["before_name"])
    if kind == "txt":
        return detailed_report(measurement, conformity, view, before).encode()
    # As it was written: an opened one holds more than is read from it.
    tree = json.loads((out / RECORD).read_bytes()) | {"axis_in_use": view.axis}
    record = f"{json_text(tree | {'before': before_tree(measurement, before)})}\n"
    if kind == "json":
        return record.encode()
    options = ReportOptions(words, view, laboratory, before, record)
    wanted = ReportFiles(html=kind == "html", pdf=kind == "pdf")
    return report_files(measurement, conformity, options, wanted)[f"report.{kind}"]
