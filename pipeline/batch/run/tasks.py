"""Captures -> tasks -> engine, with further attempts after the death of a worker process."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from typing import Protocol

from ...errors import InputError
from ..operation.run_state import AtWork
from ..plan.discover import FoundCapture
from .measure_one import EngineLostError, Outcome, TransientError
from .work import ArchiveError, CompletedCapture, RunRequest, Task
from .worker_process import WorkerError

SMALL_BYTES, MOST_TOGETHER = 50_000, 50
ATTEMPTS, ATTEMPTS_IF_KILLED = 2, 4  # an external kill may not be due to the capture
ATTEMPTS_TO_READ = 3
FAULTS_IN_A_ROW, FIRST_WAIT_S = 8, 0.25


class Engine(Protocol):
    """Engine that runs tasks in worker processes."""

    @property
    def slots(self) -> int:
        """Number of tasks that it runs at the same time."""

    @property
    def at_work(self) -> tuple[AtWork, ...]:
        """Captures at work now, by worker."""

    def submit(self, task: Task) -> Future[list[CompletedCapture]]:
        """Submit a task; the future raises WorkerError or TransientError."""

    def close(self) -> None:
        """Stop all work at once."""


def tasks_of(request: RunRequest, captures: Iterable[FoundCapture]) -> Iterator[Task]:
    """Group small captures into tasks; larger ones get a task each."""
    together: list[FoundCapture] = []
    for found in captures:
        if found.refusal is not None:
            refused = Outcome("failed", "discover", found.refusal)
            yield Task(request, (found,), outcome=refused, blind=True)
            continue
        if found.size > SMALL_BYTES:
            yield Task(request, (found,))
            continue
        together.append(found)
        if len(together) == MOST_TOGETHER:
            yield Task(request, tuple(together))
            together = []
    if together:
        yield Task(request, tuple(together))


@dataclass
class Run:
    """Run of tasks on an engine.

    probe: waits for the storage, and returns the time at which it last answered again; raises
    InputError if it does not. notify: called with a text
    for each death of a worker process and each fault.
    """

    tasks: Iterator[Task]
    engine: Engine
    probe: Callable[[], float]
    notify: Callable[[str], None]
    _again: deque[Task] = field(default_factory=deque)
    _later: deque[Task] = field(default_factory=deque)
    _faults: int = 0
    _is_lost: bool = False

    def outcomes(self) -> Iterator[CompletedCapture]:
        """Yield each capture as it is finished; only a few tasks are submitted at any time.

        Raises InputError for permanent faults of storage or machine.
        """
        out: dict[Future[list[CompletedCapture]], tuple[Task, float]] = {}
        while True:
            while len(out) < 2 * self.engine.slots + 1 and (task := self._next()) is not None:
                out[self.engine.submit(task)] = task, time.monotonic()
            if not out:
                return
            for future in wait(out, return_when=FIRST_COMPLETED).done:
                task, submitted_s = out.pop(future)
                try:
                    done = future.result()
                except WorkerError as error:
                    self._died(task, error)
                except TransientError as error:
                    self._failed(task, error, submitted_s)
                except (OSError, EOFError) as error:  # no more processes or files, no fork server
                    fault = TransientError(f"no worker process can start: {error}")
                    self._failed(task, fault, submitted_s)
                else:
                    self._faults, self._is_lost = 0, False
                    yield from done

    def _next(self) -> Task | None:
        if self._again:
            return self._again.popleft()
        task = next(self.tasks, None)
        return self._later.popleft() if task is None and self._later else task

    def _died(self, task: Task, error: WorkerError) -> None:
        """Retry several captures one by one; retry a single one, or quarantine it.

        Raises InputError if the limits do not even allow to write that.
        """
        if len(task.captures) > 1:
            self._again.extend(replace(task, captures=(found,)) for found in task.captures)
            return
        name = task.captures[0].name
        attempts = (*task.attempts, f"{error.cause}: {error.text}\n{error.log}".rstrip())
        task = replace(task, attempts=attempts)
        alike = sum(attempt.startswith(error.cause) for attempt in attempts)
        if task.blind and error.cause != "killed":
            raise InputError(
                f"{name}: {error.text}, even to write that it failed: allow more by --memory or "
                "--timeout"
            )
        if task.outcome is not None:
            task = replace(task, blind=True)
        elif alike >= (ATTEMPTS_IF_KILLED if error.cause == "killed" else ATTEMPTS):
            self.notify(f"{name}: {error.text} again: quarantined")
            task = replace(task, outcome=Outcome("quarantined", "child", error.text))
        else:
            self.notify(f"{name}: {error.text}: will be tried again")
        self._again.append(task)

    def _failed(self, task: Task, error: TransientError, submitted_s: float) -> None:
        """Retry later, unless the capture itself is unreadable or the faults do not end.

        What was submitted before storage that was away answered again is no fault of its own.
        """
        if isinstance(error, EngineLostError):
            self._again.append(task)
            if not self._is_lost:  # of all tasks that it had
                self.notify(str(error))
            self._is_lost = True
            return
        if submitted_s <= self.probe():
            self._later.append(task)
            return
        self._faults += 1
        if isinstance(error, ArchiveError) and len(task.captures) == 1:
            task = replace(task, attempts=(*task.attempts, str(error)))
            if len(task.attempts) >= ATTEMPTS_TO_READ:
                fact = str(error).replace(f"{task.request.archive.rstrip('/')}/", "")
                reason = f"its files cannot be read from the archive: {fact}"
                task = replace(task, outcome=Outcome("failed", "read", reason), blind=True)
        elif self._faults >= FAULTS_IN_A_ROW:
            raise InputError(f"{error} (run stopped; repeat the command to continue)")
        self._later.extend(replace(task, captures=(found,)) for found in task.captures)
        self.notify(f"{error}: will be tried again later")
        time.sleep(FIRST_WAIT_S * 2 ** min(self._faults, 5))
