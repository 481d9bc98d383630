"""Segments: the rows of a thousand results in one object, so that a catalogue needs few requests.

A run that writes to object storage adds every result it writes; nothing depends on it. The rows of
a result are used only if the listing shows an object of the same size and MD5.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import time
from collections.abc import Iterator
from dataclasses import astuple

from ..storage.store import Store
from .calibration_row import CalibrationRow
from .changes import Changes, ObjectComparison
from .load_records import KnownRecord, RecordProgress, load_records
from .rows import CaptureRow, QuantityRow, Record, WheelRow

FOLDER = "segments/"
ROWS = "2003856391"  # first line: to be raised with every change of the rows
RESULTS = 1000  # in a segment: 1.3 MB
FLUSH_S = 300.0  # after which fewer are written
WORTH = 100  # from this number of results to read, segments are read first


class Segments:
    """Collector of the results that one process writes; call `flush` at the end."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._lines: list[str] = []
        self._flushed_s = time.monotonic()

    def add(self, record: Record) -> None:
        """Add the record of a result that was written."""
        rows = [
            astuple(record.capture),
            [astuple(w) for w in record.wheels],
            [astuple(q) for q in record.quantities],
            None if record.calibration is None else astuple(record.calibration),
        ]
        self._lines.append(json.dumps(rows, separators=(",", ":")))
        if len(self._lines) >= RESULTS or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Write the collected records as a segment."""
        if self._lines:
            text = "\n".join([ROWS, *self._lines])
            data = gzip.compress(text.encode(), compresslevel=6, mtime=0)
            name = hashlib.sha256(data).hexdigest()[:32]
            self._store.write_new(f"{FOLDER}{name}.json.gz", data)
            self._lines.clear()
        self._flushed_s = time.monotonic()


def load_changed_records(
    store: Store, changes: Changes, progress: RecordProgress, known: KnownRecord
) -> Iterator[Record]:
    """Yield the records of all keys to read: known ones, of segments if possible, of JSON files."""
    for done, record in enumerate(_load_changed(store, changes, known), start=1):
        progress(done, len(changes.read))
        yield record


def _load_changed(store: Store, changes: Changes, known: KnownRecord) -> Iterator[Record]:
    wanted = []
    for key in changes.read:
        if (record := known(key)) is None:
            wanted.append(key)
        else:
            yield record
    if store.local is None and len(wanted) >= WORTH:
        is_unchanged, missing = ObjectComparison(store), dict.fromkeys(wanted)
        for record in _from_segments(store):
            row = record.capture
            if row.key in missing and is_unchanged(changes.entries[row.key], row.size, row.md5):
                del missing[row.key]
                yield record
        wanted = list(missing)
    yield from load_records(store, wanted)


def _from_segments(store: Store) -> Iterator[Record]:
    for entry in store.list(FOLDER):
        try:
            head, *lines = gzip.decompress(store.read(entry.name)).decode().split("\n")
            if head == ROWS:
                yield from map(_record, lines)
        except (OSError, EOFError, ValueError, TypeError):
            continue  # damaged segment: the JSON files are read instead


def _record(line: str) -> Record:
    capture, wheels, quantities, calibrated = json.loads(line)
    return Record(
        CaptureRow(*capture),
        tuple(WheelRow(*wheel) for wheel in wheels),
        tuple(QuantityRow(*quantity) for quantity in quantities),
        None if calibrated is None else CalibrationRow(*calibrated),
    )
