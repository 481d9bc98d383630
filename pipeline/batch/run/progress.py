"""Progress of a batch: a bar on a terminal, otherwise lines for a log."""

from __future__ import annotations

import importlib
import os
import socket
import sys
import threading
import time
import uuid
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Protocol, Self, TextIO

from ...errors import InputError, WheelplaneError, printable
from ...report.json.text import json_text
from ..catalogue.rows import FAILED
from ..operation.run_state import (
    AtWork,
    RunState,
    duration,
    forget_states,
    remaining_s,
    write_state,
)
from ..results.query import brief, general
from ..storage.entry import legible
from ..storage.store import Store
from .work import CompletedCapture

EVERY_S = 10.0
WRITE_S = 5.0  # between states in the results
MOST_KINDS = 50  # of reasons in a state
MOST_LINES = 20  # failures shown; the catalogue has them all


class ProgressLines:
    """Lines on standard error: one every ten seconds, and one for each of the first failures."""

    def __init__(self) -> None:
        self._todo: int | None = None
        self._done = self._failed = 0
        self._expected_s = self._worked_s = 0.0
        self._started_s = self._printed_s = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def planned(self, known: int, todo: int, expected_s: float, later: int = 0) -> None:
        """Take the numbers of captures done before, to be done now, and later; seconds of now."""
        self._todo, self._started_s = todo, time.monotonic()
        self._expected_s = expected_s
        after = f", {later} when the command is repeated" if later else ""
        self._print(f"{known + todo + later} captures: {known} done before, {todo} to do{after}")

    def finished(self, done: CompletedCapture) -> None:
        """Take one more finished capture."""
        self._done += 1
        self._worked_s += done.expected_s
        outcome = done.outcome
        if outcome.status in ("failed", "quarantined"):
            self._failed += 1
            if self._failed <= MOST_LINES:
                reason = brief(outcome.reason, legible(done.name))
                self._print(f"{outcome.status}: {done.name}: {outcome.stage}: {reason}")
            if self._failed == MOST_LINES:
                self._print("further failures are not shown here; the catalogue lists them all")
        elif self._todo is None:
            self._print(f"{outcome.status}: {done.name}")
        self._advance()

    def note(self, text: str) -> None:
        """Print a message."""
        self._print(text)

    @property
    def state(self) -> str:
        """Number done, rate, time left, failures."""
        took_s = max(1e-3, time.monotonic() - self._started_s)
        rate = self._done / took_s
        left_s = remaining_s(took_s, self._worked_s, self._expected_s)
        left = "" if left_s is None else f", {duration(left_s)} left"
        failed = f", {self._failed} failed" if self._failed else ""
        return f"{self._done} of {self._todo or 0}, {rate:.3g}/s{left}{failed}"

    def _advance(self) -> None:
        now_s = time.monotonic()
        if self._todo is not None and now_s > self._printed_s + EVERY_S:
            self._printed_s = now_s
            self._print(self.state)

    def _print(self, text: str) -> None:
        print(_line(text), file=sys.stderr, flush=True)


class Bar(ProgressLines):
    """Progress bar below the lines."""

    def __init__(self) -> None:
        super().__init__()
        rich: Any = importlib.import_module("rich.progress")
        console: Any = importlib.import_module("rich.console")
        self._bar = rich.Progress(
            rich.BarColumn(),
            rich.TextColumn("{task.description}", markup=False),
            console=console.Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task("searching for captures", total=None)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def planned(self, known: int, todo: int, expected_s: float, later: int = 0) -> None:
        """Take the numbers of captures done before, to be done now, and later; seconds of now."""
        super().planned(known, todo, expected_s, later)
        self._bar.update(self._task, total=todo)

    def _advance(self) -> None:
        self._bar.update(self._task, completed=self._done, description=self.state)

    def _print(self, text: str) -> None:
        self._bar.console.print(_line(text), markup=False, highlight=False)


def progress_listener() -> ProgressLines:
    """Return a bar if standard error is a terminal, otherwise lines."""
    return Bar() if sys.stderr.isatty() else ProgressLines()


def _line(text: str) -> str:
    return printable(" ".join(text.split()))


class ProgressListener(Protocol):
    """Listener to the progress of a run."""

    def planned(self, known: int, todo: int, expected_s: float, later: int = 0) -> None:
        """Take the numbers of captures done before, to be done now, and later; seconds of now."""

    def finished(self, done: CompletedCapture) -> None:
        """Take one more finished capture."""

    def note(self, text: str) -> None:
        """Take a message."""


class RunReport:
    """Listener that also keeps the state of a run in its results, and its events in a log.

    engine: whose captures are at work. log: gets an event a line, as JSON.
    """

    def __init__(
        self,
        listener: ProgressListener,
        results: Store,
        engine: Working,
        shard: str,
        log: TextIO | None = None,
    ) -> None:
        now_s, pid = time.time(), os.getpid()
        self._listener, self._results, self._engine, self._log = listener, results, engine, log
        self._name = f"{now_s:.0f}-{uuid.uuid4().hex[:12]}"
        self._state = RunState(f"{socket.gethostname()}, process {pid}", shard, now_s, now_s)
        self.interrupted = False
        self._lock, self._end = threading.Lock(), threading.Event()
        self._writer = threading.Thread(target=self._keep, daemon=True)

    def __enter__(self) -> Self:
        forget_states(self._results)
        self._write()
        self._writer.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._end.set()
        self._writer.join()
        self._state.ended = "finished" if kind is None else "stopped by an error"
        if self.interrupted:
            self._state.ended = "interrupted"
        self._event("ended", how=self._state.ended, done=self._state.done)
        with suppress(WheelplaneError):  # what ended the run is reported, not this
            self._write()

    def planned(self, known: int, todo: int, expected_s: float, later: int = 0) -> None:
        """Take the numbers of captures done before, to be done now, and later; seconds of now."""
        state = self._state
        state.known, state.todo, state.expected_s = known, todo, expected_s
        self._event("planned", known=known, todo=todo)
        self._listener.planned(known, todo, expected_s, later)

    def finished(self, done: CompletedCapture) -> None:
        """Take one more finished capture."""
        outcome = done.outcome
        with self._lock:
            count(self._state.done, outcome.status)
            self._state.worked_s += done.expected_s
            if outcome.status in FAILED:
                reason = general(outcome.reason, legible(done.name))
                count(self._state.failures, f"{outcome.status}, {outcome.stage}: {reason}")
        self._event(
            "finished",
            capture=legible(done.name),
            key=done.key,
            **asdict(outcome),
            seconds={stage: round(seconds, 4) for stage, seconds in done.seconds},
            memory_bytes=done.memory_bytes,
        )
        self._listener.finished(done)

    def note(self, text: str) -> None:
        """Take a message."""
        self._event("note", text=text)
        self._listener.note(text)

    def _keep(self) -> None:
        while not self._end.wait(WRITE_S):
            with suppress(WheelplaneError):
                self._write()

    def _write(self) -> None:
        with self._lock:
            self._state.updated_s, self._state.at_work = time.time(), self._engine.at_work
            state = replace(self._state)
            write_state(self._results, self._name, state)

    def _event(self, event: str, **fields: Any) -> None:
        if self._log is not None:
            moment = datetime.now(UTC).isoformat(timespec="milliseconds")
            line = json_text({"time": moment, "event": event, **fields}, indent=None)
            try:
                print(line, file=self._log, flush=True)
            except OSError as error:
                file, log, self._log = self._log.name, self._log, None
                with suppress(OSError):
                    log.close()
                raise InputError(
                    f"--log {file}: cannot be written ({error.strerror}): check disk space and path"
                ) from error


def count(counts: dict[str, int], what: str) -> None:
    """Count one more; beyond MOST_KINDS all others together."""
    known = what in counts or len(counts) < MOST_KINDS
    what = what if known else "other reasons"
    counts[what] = counts.get(what, 0) + 1


class Working(Protocol):
    """Engine of which the captures at work are known."""

    @property
    def at_work(self) -> tuple[AtWork, ...]:
        """Captures at work now, by worker."""


@dataclass
class RunCounts:
    """Counts of what a run found and did.

    known: captures done before. done: captures done now, by status. passed_over: files that belong
    to no capture, by suffix. removed: captures that have results but are no longer in the archive;
    None if the archive was not listed completely. finished: captures of the archive that have a
    result at the end, as far as this run knows.
    """

    known: int = 0
    done: Counter[str] = field(default_factory=Counter)
    passed_over: Counter[str] = field(default_factory=Counter)
    removed: Sequence[str] | None = None
    finished: int = 0
