"""A batch, from its archive to its catalogue."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

from ...errors import InputError, WheelplaneError
from ..catalogue.catalogue import update
from ..catalogue.history import failures, holds_results, put_aside, write_gone
from ..catalogue.segments import Segments
from ..plan.discover import Captures, Found, discover
from ..plan.shard import ALL, Shard
from ..storage.entry import Entry
from ..storage.store import Store, open_store
from .ledger import Ledger
from .progress import ProgressListener, RunCounts
from .tasks import Engine, Run, tasks_of
from .work import Request


class Batch:
    """Work on the captures of an archive, or of a shard of them.

    scratch: an existing folder for passing files.
    """

    def __init__(
        self,
        request: Request,
        engine: Engine,
        scratch: Path,
        teller: ProgressListener,
        shard: Shard = ALL,
    ) -> None:
        self.request, self.shard, self.tally = request, shard, RunCounts()
        self._engine, self._scratch, self._teller = engine, scratch, teller
        self._archive, self._results = open_store(request.archive), open_store(request.results)
        mark = request.settings.mark
        self._ledger = Ledger(self._results, mark, self._archive, scratch / "ledger")
        self._ledger.load()
        if request.retry:
            self._ledger.doubt(failures(self._results))
        self._segments = Segments(self._results)
        self._known = 0

    @property
    def holds_results(self) -> bool:
        """Whether there is any result by now, of whichever run."""
        return holds_results(self._results)

    def run(self, limit: int | None = None) -> RunCounts:
        """Measure what is new or changed, at most `limit` captures, and renew the catalogue.

        Raises InputError where storage or machine fail, and KeyboardInterrupt; what was done by
        then is written down, and in the catalogue.
        """
        captures = self.look()
        todo = sum(1 for _ in self.new(captures))
        self.tally.known = self._known
        if not (todo or self._known or self.shard.n > 1):
            seen = ", ".join(sorted(captures.passed_over)) or "nothing at all"
            raise InputError(
                f"{self.request.archive}: holds no captures, but {seen}: name the folder above them"
            )
        self._teller.planned(self.tally.known, todo if limit is None else min(todo, limit))
        with self.renewing():
            self.measure(islice(self.new(captures), limit))
        return self.tally

    def look(self) -> Captures:
        """The captures that are in the archive now."""
        self._ledger.look_again()
        found = discover(self._entries(), self._scratch / "captures", self.request.archive)
        self.tally.passed_over = found.passed_over
        return found

    def new(self, captures: Iterable[Found]) -> Iterator[Found]:
        """Those of this shard that are new or changed, as far as is known without reading them."""
        self._known = 0
        for found in captures:
            self._ledger.note(found)
            if not self.shard.holds(found.name):
                continue
            if self._ledger.is_done(found):
                self._known += 1
            else:
                yield found
        self.tally.gone = self._ledger.gone()

    def state(self, found: Found) -> str:
        """A text that changes with the files of a capture, also those that it names elsewhere."""
        return self._ledger.state(found)

    def measure(self, captures: Iterable[Found]) -> None:
        """Measure captures and write down what becomes of them."""
        tasks = tasks_of(self.request, captures)
        run = Run(tasks, self._engine, self._probe, self._teller.note)
        try:
            for done in run.outcomes():
                self._ledger.add(done)
                if done.record is not None:
                    self._segments.add(done.record)
                self.tally.done[done.verdict.status] += 1
                self._teller.finished(done)
        except BaseException:
            self._engine.close()
            raise

    @contextmanager
    def renewing(self) -> Iterator[None]:
        """Renew at the end, however it comes; a fault in that never hides what brought it."""
        try:
            yield
        except BaseException:
            try:
                self.renew(at_end=True)
            except WheelplaneError as error:
                self._teller.note(str(error))
            raise
        self.renew(at_end=True)

    def renew(self, at_end: bool = False) -> None:
        """Write down what is known by now, put aside what is outdated, renew the catalogue.

        Of a shard the catalogue is left to whoever reads it, since it is of all shards.
        """
        self._ledger.flush()
        if at_end:
            self._segments.flush()
        for key in self._ledger.outdated():
            put_aside(self._results, key)
            self._ledger.forget(key)
        if self.tally.gone is not None:
            write_gone(self._results, self.tally.gone)
        if self.shard.n == 1:
            update(self._results)

    def _entries(self) -> Iterator[Entry]:
        """The files of the archive; not those of the results, where these lie within."""
        within = _within(self._archive, self._results)
        for entry in self._archive.list():
            if within is None or not entry.name.startswith(within):
                yield entry

    def _probe(self) -> None:
        next(iter(self._archive.list()), None)


def _within(archive: Store, results: Store) -> str | None:
    """How the names of the results' files begin in the archive; None where they lie elsewhere."""
    outer, inner = archive.url.rstrip("/") + "/", results.url.rstrip("/") + "/"
    if archive.local is not None and results.local is not None:
        outer, inner = f"{archive.local.resolve()}/", f"{results.local.resolve()}/"
    return inner[len(outer) :] if inner.startswith(outer) else None
