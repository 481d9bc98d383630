"""Reports written on demand by a process of their own, and saved under the user's name."""

from __future__ import annotations

import json
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...report.format.language import LANGUAGES
from ...report.format.view import CONVENTIONS, PAPER, STYLES_WITHOUT_RIM, axis_by
from ...report.json.stored import RECORD
from ...report.write import write_files, write_whole
from ...vehicle import AXES
from ..content.reporting import TYPES
from ..security import RefusedError
from .process import MEASURED, PageJob
from .queue import Jobs

REPORT_SECONDS, TABLE_SECONDS = 120.0, 60.0
USUAL = {"axis": PAPER.axis, "style": PAPER.angles, "convention": PAPER.convention}
ON_OFFER = {"axis": AXES, "style": STYLES_WITHOUT_RIM, "convention": CONVENTIONS}


def report_file(
    jobs: Jobs, job: PageJob, kind: str, language: str, asked: Mapping[str, str]
) -> Path:
    """Return the report of a measurement or a comparison as a file, written if necessary.

    asked: axis, style and convention of its view, where they are not the usual ones; before: id of
    an earlier measurement of the same vehicle.
    """
    view = {key: asked.get(key) or usual for key, usual in USUAL.items()}
    if not asked.get("axis") and view["convention"] in CONVENTIONS:
        view["axis"] = axis_by(view["convention"])
    on_offer = kind in TYPES and language in LANGUAGES and job.task in (*MEASURED, "compare")
    if not on_offer or any(value not in ON_OFFER[key] for key, value in view.items()):
        raise RefusedError(400, "no such report")
    before = jobs.shown(asked["before"]) if asked.get("before") else None
    parts = [language, *view.values(), *([before.id] if before else [])]
    name = f"report-{'-'.join(parts).replace('/', '')}.{kind}"
    path = job.folder / name
    if path.is_file():
        return path
    plan = {"of": job.task, "format": kind, "language": language, **view, "file": name}
    uses = (job, before) if before else (job,)
    plan["before"] = str(before.folder / RECORD) if before else ""
    plan["before_name"] = before.name if before else ""
    report = jobs.start("report", name, plan, uses=uses)
    report.finished.wait(REPORT_SECONDS)
    if report.state != "done":
        jobs.cancel(report)
        failure = report.failure or {"text": "the report was not written in time: try again"}
        raise RefusedError(400 if failure.get("refused") else 500, failure["text"])
    return path


def table_rows(jobs: Jobs, job: PageJob, content: bytes, name: str, language: str) -> Any:
    """Return the rows of a table of readings, read by a process of its own.

    name: of the file, which its faults name. Raises RefusedError with every fault, in `language`.
    """
    token = secrets.token_hex(8)
    folder = job.folder / f"table-{token}"
    folder.mkdir()
    (folder / name).write_bytes(content)
    plan = {
        "table": str(folder / name),
        "file": f"rows-{token}.json",
        "owned": str(folder),
        "language": language,
    }
    reading = jobs.start("table", name, plan, uses=(job,))
    reading.finished.wait(TABLE_SECONDS)
    if reading.state != "done":
        jobs.cancel(reading)
        failure = reading.failure or {"text": f"{name}: not read in time: give readings only"}
        raise RefusedError(400, failure["text"])
    rows = job.folder / plan["file"]
    try:
        return json.loads(rows.read_text(encoding="utf-8"))
    finally:
        rows.unlink()


def save_folder(files: Mapping[str, bytes], target: Path) -> str:
    """Write files to a new folder `target`, all or none, and return that path."""
    try:
        target.mkdir()
    except OSError as error:
        fact = f"{target}: cannot be created ({error.strerror}): choose another name or folder"
        raise RefusedError(409, fact) from error
    try:
        write_files(target, files)
    except BaseException:
        shutil.rmtree(target, ignore_errors=True)
        raise
    return str(target)


def save(report: Path, target: Path) -> str:
    """Copy a report completely to `target` and return that path."""
    write_whole(target, report.read_bytes())
    return str(target)
