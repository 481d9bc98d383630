"""Report of a measurement in the chosen format, language and view."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...config import load_config
from ...report.format.laboratory import read_laboratory
from ...report.format.language import load_translations
from ...report.format.report_options import ReportOptions
from ...report.html.page import html_report
from ...report.json.measurement import to_json
from ...report.text.report import detailed_report
from ...report.write import write_whole
from .comparing import load
from .panel import view_of

TYPES = {
    "html": "text/html; charset=utf-8",
    "pdf": "application/pdf",
    "txt": "text/plain; charset=utf-8",
    "json": "application/json",
}


def report(plan: dict[str, Any], _send: Callable[[str, object], None]) -> None:
    """Write the report of the job in plan["out"] to plan["file"] there."""
    out = Path(plan["out"])
    measurement, conformity = load(out)
    view = view_of(measurement, plan["axis"], plan["style"], plan["convention"])
    settings = load_config(Path(plan["config"]) if plan["config"] else None)
    laboratory = read_laboratory(settings.report)
    options = ReportOptions(load_translations(plan["language"]), view, laboratory)
    kind = plan["format"]
    if kind == "txt":
        content = detailed_report(measurement, conformity, view).encode()
    elif kind == "json":
        content = to_json(measurement, conformity, view.axis).encode()
    elif kind == "html":
        content = html_report(measurement, conformity, options).encode()
    else:
        from ...report.html.pdf import pdf_report

        page = html_report(measurement, conformity, options, still=True)
        content = pdf_report(page, "wheelplane")
    write_whole(out / plan["file"], content)
