"""Progress on a terminal; silence in a pipe."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

import click


class _Line:
    """One line on the terminal that is written over itself, and gone at the end."""

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


class Progress(_Line):
    """Called with the name of what is being worked on."""

    def __init__(self, total: int, doing: str = "measuring") -> None:
        super().__init__()
        self._total, self._doing, self._done = total, doing, 0

    def __call__(self, name: str) -> None:
        """Show that `name` is next."""
        self._done += 1
        self._write(f"{self._doing} {name} ({min(self._done, self._total)}/{self._total})")


class Reading(_Line):
    """Called with the rows read and their number; shows the share of a long read."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name, self._percent = name, -1
        self._started = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Show how far it is, after the first second and at each percent."""
        percent = 100 * done // max(1, total)
        if percent != self._percent and time.monotonic() - self._started > 1.0:
            self._percent = percent
            self._write(f"reading {self._name}: {percent} %")
