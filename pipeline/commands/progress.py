"""Progress on a terminal; silence in a pipe."""

from __future__ import annotations

import sys
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
