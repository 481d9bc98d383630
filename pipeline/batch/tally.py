"""What is counted in a run, and who is told how it goes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from pipeline.batch.work import Done


class Teller(Protocol):
    """Who is told how a run goes."""

    def planned(self, known: int, todo: int) -> None:
        """So many captures were done before, so many are to be done."""

    def finished(self, done: Done) -> None:
        """One more is done."""

    def note(self, text: str) -> None:
        """Something worth a line."""


@dataclass
class Tally:
    """What a run found and did.

    known: captures that were done before. done: those that were not, by what became of them.
    passed_over: files that belong to no capture, by their suffix. gone: captures that have results
    but are no longer in the archive; None where the archive was not looked through to its end.
    """

    known: int = 0
    done: Counter[str] = field(default_factory=Counter)
    passed_over: Counter[str] = field(default_factory=Counter)
    gone: Sequence[str] | None = None
