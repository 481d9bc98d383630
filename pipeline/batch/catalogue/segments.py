"""Rows of a thousand results in one object, so that a catalogue can be made of few requests.

A runner that writes to object storage adds every result it writes; nothing depends on it. What a
segment says of a result counts only if the listing shows an object of that size and MD5.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import time
from collections.abc import Iterator
from dataclasses import astuple

from ..storage.store import Store
from .changes import Changes, Sameness
from .gather import Progress, gather
from .rows import CaptureRow, QuantityRow, Record, WheelRow
from .schema import APPLICATION

FOLDER = "segments/"
RESULTS = 1000  # in a segment: 1.3 MB
FLUSH_S = 300.0  # after which fewer are written
WORTH = 100  # results to read, from which on segments are asked first


class Segments:
    """Collects the results that one process writes; call `flush` at the end."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._lines: list[str] = []
        self._flushed_s = time.monotonic()

    def add(self, record: Record) -> None:
        """Take the record of a result that was written."""
        rows = [
            astuple(record.capture),
            [astuple(w) for w in record.wheels],
            [astuple(q) for q in record.quantities],
        ]
        self._lines.append(json.dumps(rows, separators=(",", ":")))
        if len(self._lines) >= RESULTS or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Write what has been collected."""
        if self._lines:
            text = "\n".join([str(APPLICATION), *self._lines])
            data = gzip.compress(text.encode(), compresslevel=6, mtime=0)
            name = hashlib.sha256(data).hexdigest()[:32]
            self._store.write_new(f"{FOLDER}{name}.json.gz", data)
            self._lines.clear()
        self._flushed_s = time.monotonic()


def gathered(store: Store, changes: Changes, progress: Progress) -> Iterator[Record]:
    """The records of all keys to read, from segments where these tell, else from the JSONs."""
    for done, record in enumerate(_gathered(store, changes), start=1):
        progress(done, len(changes.read))
        yield record


def _gathered(store: Store, changes: Changes) -> Iterator[Record]:
    wanted = changes.read
    if store.local is None and len(wanted) >= WORTH:
        same, missing = Sameness(store), dict.fromkeys(wanted)
        for record in _written(store):
            row = record.capture
            if row.key in missing and same(changes.entries[row.key], row.size, row.md5):
                del missing[row.key]
                yield record
        wanted = list(missing)
    yield from gather(store, wanted)


def _written(store: Store) -> Iterator[Record]:
    for entry in store.list(FOLDER):
        try:
            head, *lines = gzip.decompress(store.read(entry.name)).decode().split("\n")
            if head == str(APPLICATION):
                yield from map(_record, lines)
        except (OSError, EOFError, ValueError, TypeError):
            continue  # a damaged segment tells nothing: the JSONs do


def _record(line: str) -> Record:
    capture, wheels, quantities = json.loads(line)
    return Record(
        CaptureRow(*capture),
        tuple(WheelRow(*wheel) for wheel in wheels),
        tuple(QuantityRow(*quantity) for quantity in quantities),
    )
