"""One job and the process that does it: started, heard, and ended."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

LONGEST_LINE = 100_000
FINISHED = ("done", "failed", "cancelled")
SHOWN = ("ready", "done")  # its results can be looked at


@dataclass(eq=False)
class Job:
    """One piece of work and where it stands.

    folder: of its results, a report's being its measurement's. uses: jobs whose results it reads.
    state: waiting, running, ready (results are there, points follow), done, failed, cancelled.
    progress: steps done, their number, and what is being done. failure: what the page shows.
    note: why results that are there lack their points. lock: of state, failure, note and process.
    """

    id: str
    task: str
    name: str
    folder: Path
    uses: tuple[Job, ...] = field(default=(), repr=False)
    state: str = "waiting"
    progress: tuple[int, int, str] = (0, 0, "")
    failure: dict[str, Any] | None = None
    note: str = ""
    process: subprocess.Popen[str] | None = field(default=None, repr=False)
    finished: threading.Event = field(default_factory=threading.Event, repr=False)
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @property
    def scratch(self) -> Path:
        """What its child unpacks, and no other's."""
        return self.folder / f"scratch-{self.id}"

    @property
    def told(self) -> dict[str, Any]:
        """What the page learns of it."""
        done, total, text = self.progress
        return {
            "id": self.id,
            "task": self.task,
            "name": self.name,
            "state": self.state,
            "progress": {"done": done, "total": total, "text": text},
            "failure": self.failure,
            "note": self.note,
        }


def started(job: Job) -> subprocess.Popen[str]:
    """A new interpreter, which takes no module from the folder that it happens to stand in."""
    beside = str(Path(__file__).parents[3])  # the folder that the package lies in
    known = [beside, *filter(None, [os.environ.get("PYTHONPATH")])]
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
            start_new_session=True,  # Ctrl-C is the server's to answer
            env=os.environ | {"PYTHONPATH": os.pathsep.join(known), "TMPDIR": str(job.scratch)},
        )


def send(stream: IO[str], text: str) -> None:
    """Write the plan; a child that ended at once needs none."""
    try:
        stream.write(text)
        stream.close()
    except BrokenPipeError:
        return


def hear(job: Job, line: str) -> None:
    """Take in one line of the child: where it stands, or how it ended."""
    try:
        (kind, said), *_ = json.loads(line).items()
    except (ValueError, AttributeError):
        return
    if kind == "progress":
        job.progress = tuple(said)
    elif kind == "failure":
        end(job, "failed", said)
    elif kind in SHOWN:
        with job.lock:
            job.state = job.state if job.state in FINISHED else kind


def end(job: Job, state: str, failure: dict[str, Any] | None = None) -> None:
    """End the job, unless it has ended; one whose results are there is done without its points."""
    with job.lock:
        if job.state == "ready":
            job.note, job.state = (failure or {}).get("text", ""), "done"
        elif job.state not in FINISHED:
            job.failure, job.state = failure, state


def fail(job: Job, text: str) -> None:
    """End the job for a reason."""
    end(job, "failed", {"text": text})


def kill(job: Job) -> None:
    """End the process and all that it started."""
    process = job.process
    if process is not None and process.poll() is None:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            return
