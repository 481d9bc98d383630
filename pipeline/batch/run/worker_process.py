"""Worker process: a crash or kill ends one task and nothing else.

Each worker has one process with its own pipe, started by a fork server that has loaded the program
and used until it dies. Processes that share a pipe and its lock, as in most pools, are not robust:
one that is killed while it holds the lock blocks all others (pebble 5.2 lost hundreds of 1,500
tasks, or hung, in each of six runs with 3 to 231 kills).
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Literal, cast

from ...readers import confine, die_with
from ...system import hold_freed, signals, start_method
from .measure_one import TransientError
from .work import CompletedCapture, Task, work

PRELOAD = [__name__]
SEARCH_PATH = tuple(sys.path)  # in the fork server, which imports this first: of its environment
LOG, TAIL_BYTES = "log.txt", 4000
UNKNOWN_CODE = 255  # of multiprocessing, for a process whose fork server ended before it could say
EXTERNAL_SIGNALS = signals("SIGKILL", "SIGTERM", "SIGHUP")
STARTING = threading.Lock()  # of this process's variables

Cause = Literal["crashed", "killed", "too long", "memory"]


class WorkerError(Exception):
    """Worker process that ended before its task: the cause, its description, the last output."""

    def __init__(self, cause: Cause, text: str, log: str = "") -> None:
        super().__init__(cause, text, log)
        self.cause, self.text, self.log = cause, text, log


class WorkerProcess:
    """Process that runs one task after another, and is replaced when it dies.

    timeout_s: limit of one task. memory_bytes: limit of memory in addition to that at its start.
    scratch: existing folder for temporary files, which are removed with the process. environment:
    all of its variables.
    """

    def __init__(
        self, timeout_s: float, memory_bytes: int, scratch: Path, environment: Mapping[str, str]
    ) -> None:
        self._timeout_s = timeout_s
        self._memory_bytes = memory_bytes
        self._scratch = scratch
        self._environment = environment
        self._running: tuple[BaseProcess, Connection, Path] | None = None

    def run(self, task: Task) -> list[CompletedCapture]:
        """Run a task. Raises WorkerError, and TransientError as `work` does."""
        process, pipe, _ = self._running or self._start()
        try:
            pipe.send(task)
            if not wait([pipe, process.sentinel], self._timeout_s):
                log = self.close()
                raise WorkerError("too long", f"it takes more than {self._timeout_s:g} s", log)
            kind, answer = pipe.recv()
        except (EOFError, OSError) as error:
            raise self._death(process) from error
        if kind == "memory":
            most = f"{self._memory_bytes / 2**20:.0f} MB"
            raise WorkerError("memory", f"it needs more than {most} of memory", self.close())
        if kind == "failed":
            raise answer
        assert isinstance(answer, list)
        return answer

    def close(self) -> str:
        """Kill the process and return its last output."""
        if self._running is None:
            return ""
        process, pipe, folder = self._running
        self._running = None
        process.kill()
        process.join()
        pipe.close()
        try:
            log = (folder / LOG).read_bytes()[-TAIL_BYTES:].decode(errors="replace")
        except OSError:
            log = ""
        shutil.rmtree(folder, ignore_errors=True)
        return log

    def _start(self) -> tuple[BaseProcess, Connection, Path]:
        context = cast(SpawnContext, multiprocessing.get_context(start_method()))
        context.set_forkserver_preload(PRELOAD)  # no other method heeds it
        folder = Path(tempfile.mkdtemp(dir=self._scratch))
        environment = {**self._environment, "TMPDIR": str(folder)}
        pipe, theirs = context.Pipe()
        process = context.Process(
            target=_serve, args=(theirs, self._memory_bytes, folder, environment), daemon=True
        )
        with _environment(self._environment):
            process.start()
        theirs.close()
        self._running = process, pipe, folder
        return self._running

    def _death(self, process: BaseProcess) -> WorkerError:
        process.join()
        code = process.exitcode or 0
        log = self.close()
        if code == UNKNOWN_CODE:
            return WorkerError("killed", "it was killed with its fork server", log)
        if -code in EXTERNAL_SIGNALS:
            name = signal.Signals(-code).name
            return WorkerError("killed", f"it was killed ({name}), perhaps for lack of memory", log)
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return WorkerError("crashed", f"it crashes the program ({how})", log)


@contextmanager
def _environment(stated: Mapping[str, str]) -> Iterator[None]:
    """Replace the variables of this process for a moment.

    multiprocessing starts its fork server and its resource tracker, also again when they died,
    with the variables of this process, as `python -c`: without PYTHONSAFEPATH in them it finds
    modules in the current folder.
    """
    with STARTING:
        before = dict(os.environ)
        _become(stated)
        try:
            yield
        finally:
            _become(before)


def _become(environment: Mapping[str, str]) -> None:
    for name in os.environ.keys() - environment.keys():
        del os.environ[name]
    os.environ.update(environment)


def _serve(
    pipe: Connection, memory_bytes: int, folder: Path, environment: Mapping[str, str]
) -> None:
    """Serve tasks in the worker process until the parent ends."""
    _become(environment)
    sys.path[:] = SEARCH_PATH  # multiprocessing gave it that of the parent
    die_with(os.getppid())  # the fork server, which ends with the program
    parent = multiprocessing.parent_process()
    if parent is None or not parent.is_alive():
        return
    threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    log = os.open(folder / LOG, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(log, stream)
    faulthandler.enable(log)
    hold_freed()
    tempfile.tempdir = str(folder)
    confine(memory_bytes)
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(_answer(task))


def _end_with(program: int) -> None:
    """End this process with the program, of which the fork server may learn later."""
    wait([program])
    os._exit(0)


def _answer(task: Task) -> tuple[str, Any]:
    try:
        return "done", work(task)
    except MemoryError:
        return "memory", None
    except TransientError as error:
        return "failed", type(error)(str(error))
    except Exception as error:
        if "start new thread" in str(error):  # for lack of memory
            return "memory", None
        return "failed", TransientError(traceback.format_exc())
