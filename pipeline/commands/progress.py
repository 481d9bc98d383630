"""Progress on a terminal; silence in a pipe."""

from __future__ import annotations

import sys
import time
from types import TracebackType

import click


class Progress:
    """Called with the name of what is being worked on; writes one line over itself."""

    def __init__(self, total: int, doing: str = "measuring") -> None:
        self._total, self._doing, self._done = total, doing, 0
        self._shown = sys.stderr.isatty()

    def __enter__(self) -> Progress:
        return self

    def __call__(self, name: str) -> None:
        """Show that `name` is next."""
        self._done += 1
        if self._shown:
            line = f"{self._doing} {name} ({min(self._done, self._total)}/{self._total})"
            click.echo(f"\r\x1b[K{line}", nl=False, err=True)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._shown:
            click.echo("\r\x1b[K", nl=False, err=True)


class Reading:
    """Called with the rows read and their number; shows the share of a long read."""

    def __init__(self, name: str) -> None:
        self._name, self._percent = name, -1
        self._started = time.monotonic()
        self._shown = sys.stderr.isatty()

    def __enter__(self) -> Reading:
        return self

    def __call__(self, done: int, total: int) -> None:
        """Show how far it is, after the first second and at each percent."""
        percent = 100 * done // max(1, total)
        if self._shown and percent != self._percent and time.monotonic() - self._started > 1.0:
            self._percent = percent
            click.echo(f"\r\x1b[Kreading {self._name}: {percent} %", nl=False, err=True)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._percent >= 0:
            click.echo("\r\x1b[K", nl=False, err=True)
