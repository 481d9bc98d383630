"""Progress of a batch: a bar on a terminal, otherwise lines for a log."""

from __future__ import annotations

import importlib
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

from ...errors import printable
from .work import CompletedCapture

EVERY_S = 10.0
MOST_LINES = 20  # failures shown; the catalogue has them all


class ProgressLines:
    """Lines on standard error: one every ten seconds, and one for each of the first failures."""

    def __init__(self) -> None:
        self._todo: int | None = None
        self._done = self._failed = 0
        self._started_s = self._printed_s = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def planned(self, known: int, todo: int) -> None:
        """Take the numbers of captures done before and to be done now."""
        self._todo, self._started_s = todo, time.monotonic()
        self._print(f"{known + todo} captures: {known} done before, {todo} to do")

    def finished(self, done: CompletedCapture) -> None:
        """Take one more finished capture."""
        self._done += 1
        outcome = done.outcome
        if outcome.status in ("failed", "quarantined"):
            self._failed += 1
            if self._failed <= MOST_LINES:
                self._print(f"{outcome.status}: {done.name}: {outcome.stage}: {outcome.reason}")
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
        left = f", {_duration(((self._todo or 0) - self._done) / rate)} left" if rate else ""
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
        self._bar = rich.RecordProgress(
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

    def planned(self, known: int, todo: int) -> None:
        """Take the numbers of captures done before and to be done now."""
        super().planned(known, todo)
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


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class ProgressListener(Protocol):
    """Listener to the progress of a run."""

    def planned(self, known: int, todo: int) -> None:
        """Take the numbers of captures done before and to be done now."""

    def finished(self, done: CompletedCapture) -> None:
        """Take one more finished capture."""

    def note(self, text: str) -> None:
        """Take a message."""


@dataclass
class RunCounts:
    """Counts of what a run found and did.

    known: captures done before. done: captures done now, by status. passed_over: files that belong
    to no capture, by suffix. removed: captures that have results but are no longer in the archive;
    None if the archive was not listed completely.
    """

    known: int = 0
    done: Counter[str] = field(default_factory=Counter)
    passed_over: Counter[str] = field(default_factory=Counter)
    removed: Sequence[str] | None = None
