"""Reports written on demand by a process of their own, and saved under the user's name."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from ...report.format.language import LANGUAGES
from ...report.format.view import AngleStyle
from ...report.write import write_whole
from ...vehicle import AXES
from ..content.reporting import TYPES
from ..security import RefusedError
from .process import PageJob
from .queue import Jobs

REPORT_SECONDS = 120.0


def report_file(
    jobs: Jobs, job: PageJob, kind: str, language: str, axis: str | None, style: str | None
) -> Path:
    """Return the report of a measured job as a file in its folder, written if necessary."""
    axis, style = axis or "rear-axle", style or "dms"
    on_offer = kind in TYPES and language in LANGUAGES and axis in AXES
    if not on_offer or style not in get_args(AngleStyle) or style == "mm" or job.task != "measure":
        raise RefusedError(400, "no such report")
    name = f"report-{language}-{axis}-{style.replace('/', '')}.{kind}"
    path = job.folder / name
    if path.is_file():
        return path
    plan = {"format": kind, "language": language, "axis": axis, "style": style, "file": name}
    report = jobs.start("report", name, plan, uses=(job,))
    report.finished.wait(REPORT_SECONDS)
    if report.state != "done":
        jobs.cancel(report)
        failure = report.failure or {"text": "the report was not written in time: try again"}
        raise RefusedError(500, failure["text"])
    return path


def save(report: Path, target: Path) -> str:
    """Copy a report completely to `target` and return that path."""
    write_whole(target, report.read_bytes())
    return str(target)
