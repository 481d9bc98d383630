"""How a batch goes: a bar on a terminal, now and then a line in a log."""

from __future__ import annotations

import importlib
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

from .work import Done

EVERY_S = 10.0
MOST_LINES = 20  # of failures; the catalogue has them all


class Lines:
    """Lines on standard error: one every ten seconds, and one for each of the first failures."""

    def __init__(self) -> None:
        self._todo: int | None = None
        self._done = self._bad = 0
        self._begun_s = self._told_s = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def planned(self, known: int, todo: int) -> None:
        """How many captures were done before, and how many are to be done now."""
        self._todo, self._begun_s = todo, time.monotonic()
        self._say(f"{known + todo} captures: {known} done before, {todo} to do")

    def finished(self, done: Done) -> None:
        """One more is done."""
        self._done += 1
        verdict = done.verdict
        if verdict.status in ("failed", "quarantined"):
            self._bad += 1
            if self._bad <= MOST_LINES:
                self._say(f"{verdict.status}: {done.name}: {verdict.stage}: {verdict.reason}")
            if self._bad == MOST_LINES:
                self._say("further failures are not told here; the catalogue has them all")
        elif self._todo is None:
            self._say(f"{verdict.status}: {done.name}")
        self._advance()

    def note(self, text: str) -> None:
        """Something worth a line."""
        self._say(text)

    @property
    def state(self) -> str:
        """Done, rate, time left, failures."""
        took_s = max(1e-3, time.monotonic() - self._begun_s)
        rate = self._done / took_s
        left = f", {_duration(((self._todo or 0) - self._done) / rate)} left" if rate else ""
        bad = f", {self._bad} failed" if self._bad else ""
        return f"{self._done} of {self._todo or 0}, {rate:.3g}/s{left}{bad}"

    def _advance(self) -> None:
        now_s = time.monotonic()
        if self._todo is not None and now_s > self._told_s + EVERY_S:
            self._told_s = now_s
            self._say(self.state)

    def _say(self, text: str) -> None:
        print(" ".join(text.split()), file=sys.stderr, flush=True)


class Bar(Lines):
    """A bar below the lines."""

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
        self._task = self._bar.add_task("looking for captures", total=None)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def planned(self, known: int, todo: int) -> None:
        """How many captures were done before, and how many are to be done now."""
        super().planned(known, todo)
        self._bar.update(self._task, total=todo)

    def _advance(self) -> None:
        self._bar.update(self._task, completed=self._done, description=self.state)

    def _say(self, text: str) -> None:
        self._bar.console.print(" ".join(text.split()), markup=False, highlight=False)


def teller() -> Lines:
    """A bar where standard error is a terminal, else lines."""
    return Bar() if sys.stderr.isatty() else Lines()


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class ProgressListener(Protocol):
    """Who is told how a run goes."""

    def planned(self, known: int, todo: int) -> None:
        """So many captures were done before, so many are to be done."""

    def finished(self, done: Done) -> None:
        """One more is done."""

    def note(self, text: str) -> None:
        """Something worth a line."""


@dataclass
class RunCounts:
    """What a run found and did.

    known: captures that were done before. done: those that were not, by what became of them.
    passed_over: files that belong to no capture, by their suffix. gone: captures that have results
    but are no longer in the archive; None where the archive was not looked through to its end.
    """

    known: int = 0
    done: Counter[str] = field(default_factory=Counter)
    passed_over: Counter[str] = field(default_factory=Counter)
    gone: Sequence[str] | None = None
