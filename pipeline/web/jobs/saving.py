"""Reports made on demand by a process of their own, and kept under the user's name."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from ...report.format.language import LANGUAGES
from ...report.format.view import AngleStyle
from ...report.write import write_whole
from ...vehicle import AXES
from ..content.reporting import TYPES
from ..security import RefusedError
from .process import Job
from .queue import Jobs

REPORT_SECONDS = 120.0


def report_file(
    jobs: Jobs, job: Job, kind: str, language: str, axis: str | None, style: str | None
) -> Path:
    """The report of a measured job as a file in its folder, made if it is not there yet."""
    axis, style = axis or "rear-axle", style or "dms"
    on_offer = kind in TYPES and language in LANGUAGES and axis in AXES
    if not on_offer or style not in get_args(AngleStyle) or style == "mm" or job.task != "measure":
        raise RefusedError(400, "there is no such report")
    name = f"report-{language}-{axis}-{style.replace('/', '')}.{kind}"
    path = job.folder / name
    if path.is_file():
        return path
    plan = {"format": kind, "language": language, "axis": axis, "style": style, "file": name}
    made = jobs.start("report", name, plan, uses=(job,))
    made.finished.wait(REPORT_SECONDS)
    if made.state != "done":
        jobs.cancel(made)
        told = made.failure or {"text": "the report could not be made in time: try again"}
        raise RefusedError(500, told["text"])
    return path


def save(report: Path, place: Path) -> str:
    """Copy a report to `place`, whole; its path."""
    write_whole(place, report.read_bytes())
    return str(place)
