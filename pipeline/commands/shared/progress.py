"""Progress on a terminal; silence in a pipe."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

import click


class _Line:
    """One line on the terminal, overwritten in place and erased at the end."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()
        self._written = False

    def __enter__(self) -> Self:
        return self

    def _write(self, text: str) -> None:
        if self._shown:
            self._written = True
            click.echo(f"\r\x1b[K{text}", nl=False, err=True)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._written:
            click.echo("\r\x1b[K", nl=False, err=True)


class TerminalProgress(_Line):
    """Progress through a known number of items; called with the name of each."""

    def __init__(self, total: int, doing: str = "measuring") -> None:
        super().__init__()
        self._total, self._doing, self._done = total, doing, 0

    def __call__(self, name: str) -> None:
        """Show `name` and its number."""
        self._done += 1
        self._write(f"{self._doing} {name} ({min(self._done, self._total)}/{self._total})")


class Reading(_Line):
    """Percentage of a long read; called with the rows read and their total."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name, self._percent = name, -1
        self._started = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Show the percentage at each step, from the second second on."""
        percent = 100 * done // max(1, total)
        if percent != self._percent and time.monotonic() - self._started > 1.0:
            self._percent = percent
            self._write(f"reading {self._name}: {percent} %")
