"""A process of its own for each worker: what kills it kills one task, and nothing else.

Each worker has one child with a pipe of its own, started by a fork server that has loaded the
program; the child is used until it dies. Children that share a pipe and its lock, as in most pools,
will not do: one that is killed as it holds the lock stops them all (pebble 5.2 lost hundreds of
1,500 tasks, or hung, in each of six runs with 3 to 231 kills).
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import shutil
import signal
import tempfile
import traceback
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Literal

from ...readers import confine, die_with
from .measure_one import PassingError
from .work import Done, Task, work

PRELOAD = [f"{__package__}.work"]
TAIL_BYTES = 4000
FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)

Cause = Literal["crashed", "killed", "too long", "memory"]


class ChildError(Exception):
    """A child ended before its task did: the cause, a text that tells it, what it said last."""

    def __init__(self, cause: Cause, text: str, log: str = "") -> None:
        super().__init__(cause, text, log)
        self.cause, self.text, self.log = cause, text, log


class Child:
    """One process that does task after task, and is replaced when it dies.

    timeout_s: of a task. memory_bytes: what it may hold beyond what it holds at its start.
    scratch: an existing folder for passing files, cleared of them with the process.
    """

    def __init__(self, timeout_s: float, memory_bytes: int, scratch: Path) -> None:
        self._timeout_s = timeout_s
        self._memory_bytes = memory_bytes
        self._scratch = scratch
        self._running: tuple[BaseProcess, Connection, Path] | None = None

    def do(self, task: Task) -> list[Done]:
        """The task's outcome. Raises ChildError, and PassingError as `work` does."""
        process, pipe, _ = self._running or self._start()
        try:
            pipe.send(task)
            if not wait([pipe, process.sentinel], self._timeout_s):
                said = self.close()
                raise ChildError("too long", f"it takes more than {self._timeout_s:g} s", said)
            kind, answer = pipe.recv()
        except (EOFError, OSError) as error:
            raise self._death(process) from error
        if kind == "memory":
            most = f"{self._memory_bytes / 2**20:.0f} MB"
            raise ChildError("memory", f"it needs more than {most} of memory", self.close())
        if kind == "failed":
            raise answer
        assert isinstance(answer, list)
        return answer

    def close(self) -> str:
        """Kill the process, whatever it does; what it said last."""
        if self._running is None:
            return ""
        process, pipe, folder = self._running
        self._running = None
        process.kill()
        process.join()
        pipe.close()
        try:
            said = (folder / "said").read_bytes()[-TAIL_BYTES:].decode(errors="replace")
        except OSError:
            said = ""
        shutil.rmtree(folder, ignore_errors=True)
        return said

    def _start(self) -> tuple[BaseProcess, Connection, Path]:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(PRELOAD)
        folder = Path(tempfile.mkdtemp(dir=self._scratch))
        pipe, theirs = context.Pipe()
        process = context.Process(
            target=_serve, args=(theirs, self._memory_bytes, folder), daemon=True
        )
        process.start()
        theirs.close()
        self._running = process, pipe, folder
        return self._running

    def _death(self, process: BaseProcess) -> ChildError:
        process.join()
        code = process.exitcode or 0
        said = self.close()
        if -code in FROM_OUTSIDE:
            name = signal.Signals(-code).name
            return ChildError("killed", f"it was killed ({name}), perhaps for want of memory", said)
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return ChildError("crashed", f"it crashes the program ({how})", said)


def _serve(pipe: Connection, memory_bytes: int, folder: Path) -> None:
    """The child's side: one task after another, until the parent is gone."""
    die_with(os.getppid())  # the fork server, which ends with the program
    parent = multiprocessing.parent_process()
    if parent is None or not parent.is_alive():
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    said = os.open(folder / "said", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(said, stream)
    faulthandler.enable(said)
    tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
    confine(memory_bytes)
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(_answer(task))


def _answer(task: Task) -> tuple[str, Any]:
    try:
        return "done", work(task)
    except MemoryError:
        return "memory", None
    except PassingError as error:
        return "failed", type(error)(str(error))
    except Exception:
        return "failed", PassingError(traceback.format_exc())
