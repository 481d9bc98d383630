"""A batch, from its archive to its catalogue."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Protocol

from pipeline.batch.catalogue import open_catalogue, update
from pipeline.batch.discover import Captures, Found, discover
from pipeline.batch.entry import Entry
from pipeline.batch.gather import name_of
from pipeline.batch.ledger import Ledger
from pipeline.batch.shard import ALL, Shard
from pipeline.batch.store import Store, open_store
from pipeline.batch.tasks import Engine, Run, tasks_of
from pipeline.batch.work import Done, Request
from pipeline.errors import InputError


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
    passed_over: files that belong to no capture, by their suffix.
    """

    known: int = 0
    done: Counter[str] = field(default_factory=Counter)
    passed_over: Counter[str] = field(default_factory=Counter)


class Batch:
    """Work on the captures of an archive, or of a shard of them.

    scratch: an existing folder for passing files.
    """

    def __init__(
        self,
        request: Request,
        engine: Engine,
        scratch: Path,
        teller: Teller,
        shard: Shard = ALL,
    ) -> None:
        self.request, self.shard, self.tally = request, shard, Tally()
        self._engine, self._scratch, self._teller = engine, scratch, teller
        self._archive, self._results = open_store(request.archive), open_store(request.results)
        mark = request.settings.mark
        self._ledger = Ledger(self._results, mark, self._archive, scratch / "ledger")
        self._ledger.load()
        self._known = 0

    def run(self, limit: int | None = None) -> Tally:
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
        try:
            self.measure(islice(self.new(captures), limit))
        finally:
            self.renew()
        return self.tally

    def look(self) -> Captures:
        """The captures that are in the archive now."""
        found = discover(self._entries(), self._scratch / "captures", self.request.archive)
        self.tally.passed_over = found.passed_over
        return found

    def new(self, captures: Iterable[Found]) -> Iterator[Found]:
        """Those of this shard that are new or changed, as far as is known without reading them."""
        self._known = 0
        for found in captures:
            if not self.shard.holds(found.name):
                continue
            key = self._ledger.key_of(found)
            if key is None:
                yield found
            else:
                self._known += 1
                self._ledger.keep(found.name, key)

    def measure(self, captures: Iterable[Found]) -> None:
        """Measure captures and write down what becomes of them."""
        tasks = tasks_of(self.request, captures)
        run = Run(tasks, self._engine, self._probe, self._teller.note)
        try:
            for done in run.outcomes():
                self._ledger.add(done)
                self.tally.done[done.verdict.status] += 1
                self._teller.finished(done)
        except BaseException:
            self._engine.close()
            raise

    def renew(self) -> None:
        """Write down what is known by now; unless it is of a shard, renew the catalogue by it."""
        self._ledger.flush()
        if self.shard.n > 1:
            return
        update(self._results)
        with open_catalogue(self.request.results) as catalogue:
            rows = catalogue.connection.execute("SELECT key, name FROM captures")
            outdated = self._ledger.outdated(rows)
        for key in outdated:
            self._results.write(f"superseded/{key}.json", self._results.read(name_of(key)))
            self._results.remove(name_of(key))
        if outdated:
            update(self._results)

    def _entries(self) -> Iterator[Entry]:
        """The files of the archive; not those of the results, where these lie within."""
        within = _within(self._archive, self._results)
        for entry in self._archive.list():
            if within is None or not entry.name.startswith(within):
                yield entry

    def _probe(self) -> None:
        next(iter(self._archive.list()), None)


def forget_failures(results: Store) -> None:
    """Take away the results of what failed, so that it is measured again."""
    with open_catalogue(results.url) as catalogue:
        rows = catalogue.connection.execute(
            "SELECT key FROM captures WHERE status IN ('failed', 'quarantined', 'damaged')"
        ).fetchall()
    for (key,) in rows:
        results.remove(name_of(key))


def _within(archive: Store, results: Store) -> str | None:
    """How the names of the results' files begin in the archive; None where they lie elsewhere."""
    outer, inner = archive.url.rstrip("/") + "/", results.url.rstrip("/") + "/"
    if archive.local is not None and results.local is not None:
        outer, inner = f"{archive.local.resolve()}/", f"{results.local.resolve()}/"
    return inner[len(outer) :] if inner.startswith(outer) else None
