"""Batch run, from the archive to the catalogue."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

from ...errors import InputError, WheelplaneError
from ..catalogue.catalogue import update
from ..catalogue.history import holds_results, retried, supersede, write_removed
from ..catalogue.segments import Segments
from ..operation.times import CaptureTime, Times
from ..plan.discover import Captures, FoundCapture, discover
from ..plan.shard import ALL, Shard
from ..storage.entry import Entry, legible
from ..storage.inventory import Inventory, objects_of
from ..storage.store import Store, open_store
from ..storage.zipped import ZippedRemoteStore, ZippedStore
from .progress import ProgressListener, RunCounts
from .result_index import ResultIndex
from .tasks import Engine, Run, tasks_of
from .work import VANISHED, RunRequest


class Batch:
    """Measurement of the captures of an archive, or of a shard of it.

    scratch: existing folder for temporary files. inventory: read in the place of a listing; it may
    be days old, so that no capture counts as removed by it.
    """

    def __init__(
        self,
        request: RunRequest,
        engine: Engine,
        scratch: Path,
        listener: ProgressListener,
        shard: Shard = ALL,
        inventory: Inventory | None = None,
    ) -> None:
        self._inventory = inventory
        self.request, self.shard, self.counts = request, shard, RunCounts()
        self._engine, self._scratch, self._listener = engine, scratch, listener
        self._archive = open_store(request.archive, confined=True)
        self._results = open_store(request.results)
        for store in (self._archive, self._results):
            store.be_patient(listener.note)
        of_settings = request.settings.settings_hash
        self._index = ResultIndex(self._results, of_settings, self._archive, scratch / "index")
        self._index.load()
        if request.retry:
            self._index.mark_undone(retried(self._results, request.retry))
        self._segments, self._times = Segments(self._results), Times(self._results)

    @property
    def holds_results(self) -> bool:
        """Whether there is any result, of any run."""
        return holds_results(self._results)

    def run(self, limit: int | None = None) -> RunCounts:
        """Measure new and changed captures, at most `limit`, and update the catalogue.

        Raises InputError for faults of storage or machine, and KeyboardInterrupt; the captures
        finished by then are written, and in the catalogue.
        """
        captures = self.find_captures()
        self.counts.known, todo = self._index.counts()
        if not (todo or self.counts.known or self.shard.n > 1):
            kinds = [kind or "files without suffix" for kind in sorted(captures.passed_over)]
            fact = f"only {', '.join(kinds)}" if kinds else "nor any other file"
            raise InputError(
                f"{self.request.archive}: no captures found, {fact}: give the folder that contains "
                "them"
            )
        most = todo if limit is None else min(todo, limit)
        expected_s = self._index.expected_s(most)
        self._listener.planned(self.counts.known, most, expected_s, later=todo - most)
        with self.updating_catalogue():
            self.measure(islice(self.pending(captures), limit and most) if todo else ())
        return self.counts

    def find_captures(self) -> Captures:
        """Find the captures that are in the archive now, and their results."""
        spool = self._scratch / "captures"
        found = discover(self._entries(), spool, self.request.archive, self._inside)
        self.counts.passed_over = found.passed_over
        self._index.compare(found.listed(), self.shard.holds)
        self.counts.removed = None if self._inventory else self._index.removed(found.unlisted)
        return found

    def pending(self, captures: Iterable[FoundCapture]) -> Iterator[FoundCapture]:
        """Yield the new and changed captures of this shard, as far as known without reading."""
        return filter(self._index.is_todo, captures)

    def state(self, found: FoundCapture) -> str:
        """Return a text that changes with the files of a capture and those it names elsewhere."""
        return self._index.state(found)

    def measure(self, captures: Iterable[FoundCapture]) -> None:
        """Measure captures and write their results."""
        tasks = tasks_of(self.request, captures)
        run = Run(tasks, self._engine, self._probe, self._listener.note)
        try:
            for done in run.outcomes():
                if done.outcome != VANISHED:
                    self._index.add(done)
                    self._supersede(self._index.replaced(done))
                if done.seconds:
                    took = {stage: round(seconds, 4) for stage, seconds in done.seconds}
                    name = legible(done.name)
                    self._times.add(CaptureTime(name, done.key, took, done.memory_bytes))
                if done.record and self._results.local is None:
                    self._segments.add(pickle.loads(done.record))  # noqa: S301 - of our workers
                self.counts.done[done.outcome.status] += 1
                self._listener.finished(done)
                if self._index.is_full and self.shard.n == 1:
                    self.update_catalogue()
        except BaseException:
            self._engine.close()
            raise

    @contextmanager
    def updating_catalogue(self) -> Iterator[None]:
        """Update the catalogue at the end, also after an error, which stays the one raised.

        Then storage that does not answer is no longer waited for.
        """
        try:
            yield
        except BaseException:
            for store in (self._archive, self._results):
                store.be_patient(None)
            try:
                self.update_catalogue(at_end=True)
            except WheelplaneError as error:
                self._listener.note(str(error))
            raise
        self.update_catalogue(at_end=True)

    def update_catalogue(self, at_end: bool = False) -> None:
        """Write the index, move superseded results aside, update the catalogue.

        Of several shards each updates it at its end, so that the last one leaves that of all.
        """
        self._index.flush()
        if at_end:
            self._segments.flush()
            self._times.flush()
            self.counts.finished, _ = self._index.counts()
        self._supersede(self._index.outdated())
        if self.counts.removed is not None:
            write_removed(self._results, self.counts.removed)
        if at_end or self.shard.n == 1:
            update(self._results, known=self._index.record_of)
            self._index.forget_records()

    def _supersede(self, keys: Iterable[str]) -> None:
        for key in keys:
            supersede(self._results, key)
            self._index.drop(key)

    def _entries(self) -> Iterator[Entry]:
        """Yield the files of the archive, without those of the results if these are inside."""
        within = _within(self._archive, self._results)
        for entry in self._listed():
            if within is None or not entry.name.startswith(within):
                yield entry

    def _listed(self) -> Iterator[Entry]:
        if self._inventory is None:
            yield from self._archive.list()
            return
        if not isinstance(self._archive, ZippedRemoteStore):
            raise InputError(f"{self._archive.url}: --inventory is of a bucket: leave it out")
        with tempfile.TemporaryDirectory(dir=self._scratch) as folder:
            found = objects_of(self._inventory, self._archive.url, Path(folder))
            yield from self._archive.entries(found)

    def _inside(self, entry: Entry) -> tuple[Entry, ...] | None:
        """Return the members of a zip; none of one that is known to be a single capture.

        None of one that cannot be opened.
        """
        store, single = self._archive, FoundCapture(entry.name, "zip", (entry,))
        if not isinstance(store, ZippedStore | ZippedRemoteStore):
            return ()
        is_single = self._index.knows(single) and not self._index.knows_below(entry.name)
        return () if is_single else store.zips.members(entry)

    def _probe(self) -> float:
        """Wait until archive and results answer, and return since when they do."""
        next(iter(self._archive.list()), None)
        next(iter(self._results.names("run/")), None)
        return max(self._archive.back_s, self._results.back_s)


def _within(archive: Store, results: Store) -> str | None:
    """Return the prefix of the results' files in the archive; None if they are outside."""
    outer, inner = archive.url.rstrip("/") + "/", results.url.rstrip("/") + "/"
    if archive.local is not None and results.local is not None:
        outer, inner = f"{archive.local.resolve()}/", f"{results.local.resolve()}/"
    return inner[len(outer) :] if inner.startswith(outer) else None
