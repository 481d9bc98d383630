"""One job and its process: start, messages, end."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from ...readers import child_environment
from ...system import end_with_children

LONGEST_LINE = 100_000
FINISHED = ("done", "failed", "cancelled")
SHOWN = ("ready", "done")  # results are available
MEASURED = ("measure", "open")  # tasks whose result is a measurement
LONGEST_FACT = 200


@dataclass(eq=False)
class PageJob:
    """Job and its state.

    folder: of its results; for a report that of its measurement. uses: jobs whose results it
    reads. plan: what its process is given. state: waiting, running, ready (results are available,
    points follow), done, failed, cancelled. progress: steps done, number of steps, current step.
    began: seconds since 1970. vehicle, date: of the measurement, '' if not stated. at: root and
    path of a stored measurement that was opened. kept: its folder outlives the program. failure:
    shown by the page. note: why the points are missing. lock: of state, failure, note and process.
    """

    id: str
    task: str
    name: str
    folder: Path
    uses: tuple[PageJob, ...] = field(default=(), repr=False)
    plan: dict[str, Any] = field(default_factory=dict, repr=False)
    state: str = "waiting"
    progress: tuple[int, int, str] = (0, 0, "")
    failure: dict[str, Any] | None = None
    note: str = ""
    began: float = field(default_factory=time.time, repr=False)
    vehicle: str = ""
    date: str = ""
    at: str = ""
    kept: bool = False
    process: subprocess.Popen[str] | None = field(default=None, repr=False)
    finished: threading.Event = field(default_factory=threading.Event, repr=False)
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @property
    def scratch(self) -> Path:
        """Folder for the files that its process unpacks."""
        return self.folder / f"scratch-{self.id}"

    @property
    def public_state(self) -> dict[str, Any]:
        """State as sent to the page."""
        done, total, text = self.progress
        return {
            "id": self.id,
            "task": self.task,
            "name": self.name,
            "state": self.state,
            "progress": {"done": done, "total": total, "text": text},
            "failure": self.failure,
            "note": self.note,
            "began": self.began,
            "vehicle": self.vehicle,
            "date": self.date,
            "at": self.at,
            "kept": self.kept,
        }


def start_process(job: PageJob) -> subprocess.Popen[str]:
    """Start an interpreter that imports no module from its current folder."""
    job.scratch.mkdir()
    with (job.folder / "log.txt").open("ab") as log:
        return subprocess.Popen(  # noqa: S603
            [sys.executable, "-P", "-m", f"{__package__}.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,  # the server handles Ctrl-C
            env=child_environment(TMPDIR=str(job.scratch)),
        )


def send(stream: IO[str], text: str) -> None:
    """Write the plan, unless the process has already ended."""
    try:
        stream.write(text)
        stream.close()
    except BrokenPipeError:
        return


def receive(job: PageJob, line: str) -> None:
    """Apply one message of the process to the job: progress, readiness or end."""
    try:
        (kind, content), *_ = json.loads(line).items()
    except (ValueError, AttributeError):
        return
    if kind == "progress":
        job.progress = tuple(content)
    elif kind == "about":
        for key in ("name", "vehicle", "date"):
            if key in content:
                setattr(job, key, str(content[key])[:LONGEST_FACT])
    elif kind == "failure":
        end(job, "failed", content)
    elif kind in SHOWN:
        with job.lock:
            job.state = job.state if job.state in FINISHED else kind


def end(job: PageJob, state: str, failure: dict[str, Any] | None = None) -> None:
    """End the job, unless it has ended; if its results are available it is done without points."""
    with job.lock:
        if job.state == "ready":
            job.note, job.state = (failure or {"text": state})["text"], "done"
        elif job.state not in FINISHED:
            job.failure, job.state = failure, state


def fail(job: PageJob, text: str) -> None:
    """End the job as failed, with the reason."""
    end(job, "failed", {"text": text})


def discard_upload(job: PageJob) -> None:
    """Remove the upload that a job owns; it cannot be measured again from it."""
    owned = job.plan.pop("owned", None)
    if owned is not None:
        job.plan["discarded"] = True
        shutil.rmtree(owned, ignore_errors=True)


def kill(job: PageJob) -> None:
    """Kill the process and all processes that it started."""
    process = job.process
    if process is not None and process.poll() is None:
        end_with_children(process)
