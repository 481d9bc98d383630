"""Captures to tasks, tasks to an engine, and once more what a dying child left undone."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from typing import Protocol

from ...errors import InputError
from ..plan.discover import Found
from .child import ChildError
from .measure_one import PassingError, Verdict
from .work import ArchiveError, Done, Request, Task

SMALL_BYTES, MOST_TOGETHER = 50_000, 50
ATTEMPTS, ATTEMPTS_IF_KILLED = 2, 4  # who kills may not mean the capture
ATTEMPTS_TO_READ = 3
FAULTS_IN_A_ROW, FIRST_WAIT_S = 8, 0.25


class Engine(Protocol):
    """What does tasks, in children."""

    @property
    def slots(self) -> int:
        """How many tasks it does at the same time, by now."""

    def submit(self, task: Task) -> Future[list[Done]]:
        """The task's outcome to come; it raises ChildError or PassingError."""

    def close(self) -> None:
        """End at once, whatever is being done."""


def tasks_of(request: Request, captures: Iterable[Found]) -> Iterator[Task]:
    """Small captures together, other ones alone."""
    together: list[Found] = []
    for found in captures:
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
    """Tasks on their way through an engine.

    probe: raises InputError where the archive itself cannot be reached. tell: of deaths and faults.
    """

    tasks: Iterator[Task]
    engine: Engine
    probe: Callable[[], object]
    tell: Callable[[str], None]
    _again: deque[Task] = field(default_factory=deque)
    _later: deque[Task] = field(default_factory=deque)
    _faults: int = 0

    def outcomes(self) -> Iterator[Done]:
        """What became of each capture, as it comes; few tasks are out at any time.

        Raises InputError where storage or machine fail for good.
        """
        out: dict[Future[list[Done]], Task] = {}
        while True:
            while len(out) < 2 * self.engine.slots + 1 and (task := self._next()) is not None:
                out[self.engine.submit(task)] = task
            if not out:
                return
            for future in wait(out, return_when=FIRST_COMPLETED).done:
                task = out.pop(future)
                try:
                    done = future.result()
                except ChildError as error:
                    self._died(task, error)
                except PassingError as error:
                    self._failed(task, error)
                except OSError as error:  # no more processes, or no more files open
                    self._failed(task, PassingError(f"a child cannot be started: {error}"))
                else:
                    self._faults = 0
                    yield from done

    def _next(self) -> Task | None:
        if self._again:
            return self._again.popleft()
        task = next(self.tasks, None)
        return self._later.popleft() if task is None and self._later else task

    def _died(self, task: Task, error: ChildError) -> None:
        """Each of several alone, for one of them is to blame; one alone once more, or no more."""
        if len(task.captures) > 1:
            self._again.extend(replace(task, captures=(found,)) for found in task.captures)
            return
        name = task.captures[0].name
        attempts = (*task.attempts, f"{error.cause}: {error.text}\n{error.log}".rstrip())
        task = replace(task, attempts=attempts)
        alike = sum(attempt.startswith(error.cause) for attempt in attempts)
        if task.verdict is not None:
            task = replace(task, blind=True)
        elif alike >= (ATTEMPTS_IF_KILLED if error.cause == "killed" else ATTEMPTS):
            self.tell(f"{name}: {error.text}, again: put aside")
            task = replace(task, verdict=Verdict("quarantined", "child", error.text))
        else:
            self.tell(f"{name}: {error.text}: once more")
        self._again.append(task)

    def _failed(self, task: Task, error: PassingError) -> None:
        """Later once more, unless it is the capture that cannot be read, or nothing that can be."""
        self._faults += 1
        if isinstance(error, ArchiveError) and len(task.captures) == 1:
            self.probe()
            task = replace(task, attempts=(*task.attempts, str(error)))
            if len(task.attempts) >= ATTEMPTS_TO_READ:
                reason = "its files cannot be read from the archive"
                task = replace(task, verdict=Verdict("failed", "read", reason), blind=True)
        elif self._faults >= FAULTS_IN_A_ROW:
            raise InputError(f"{error} (the run stops; the same command goes on with it)")
        self._later.extend(replace(task, captures=(found,)) for found in task.captures)
        self.tell(f"{error}: later once more")
        time.sleep(FIRST_WAIT_S * 2 ** min(self._faults, 5))
