"""Which captures are done: known by their fingerprints, so that nothing is read to find out.

What a run learns is written to the results as small files of lines, each whole and never changed,
so that several runs may write at once and a kill loses only what is then found out again.
"""

from __future__ import annotations

import json
import sqlite3
import time
import uuid
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path

from pipeline.batch.discover import Found
from pipeline.batch.entry import Entry
from pipeline.batch.store import Store
from pipeline.batch.work import Done

FLUSH_S, FLUSH_LINES = 10.0, 2000
TABLES = """
PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;
CREATE TABLE seen(name, fingerprint, key, elsewhere, PRIMARY KEY(name, fingerprint)) WITHOUT ROWID;
CREATE TABLE there(key PRIMARY KEY) WITHOUT ROWID;
CREATE TABLE current(name PRIMARY KEY, key) WITHOUT ROWID;
"""


class Ledger:
    """What is done, in a passing database at `path`, and what this run adds.

    mark: of the settings; of other settings nothing is known. archive: whose files are looked at
    again where a capture names some beyond its own.
    """

    def __init__(self, results: Store, mark: str, archive: Store, path: Path) -> None:
        self._results = results
        self._folder = f"run/seen/{mark[:16]}"
        self._database = sqlite3.connect(path, isolation_level=None)
        self._database.executescript(TABLES)
        self._listed: Callable[[str], Entry | None] = lru_cache(maxsize=4096)(archive.stat)
        self._lines: list[str] = []
        self._flushed_s = time.monotonic()

    def load(self) -> None:
        """Read what earlier runs learnt, and which results are there."""
        self._database.execute("BEGIN")
        for file in self._results.list(f"{self._folder}/"):
            lines = self._results.read(file.name).splitlines()
            self._database.executemany(
                "INSERT OR IGNORE INTO seen VALUES (?, ?, ?, ?)", map(json.loads, lines)
            )
        keys = ((entry.name[-69:-5],) for entry in self._results.list("measurements/"))
        self._database.executemany("INSERT OR IGNORE INTO there VALUES (?)", keys)
        self._database.execute("COMMIT")

    def key_of(self, found: Found) -> str | None:
        """The key of a capture whose result is there; None where it has to be looked at."""
        row = self._database.execute(
            "SELECT key, elsewhere FROM seen JOIN there USING(key) "
            "WHERE name = ? AND fingerprint = ?",
            (found.name, found.fingerprint),
        ).fetchone()
        if row is None:
            return None
        others = [Entry(*file) for file in json.loads(row[1])]
        return row[0] if all(self._listed(file.name) == file for file in others) else None

    def keep(self, name: str, key: str) -> None:
        """Note that this is the one result of a capture that counts."""
        self._database.execute("INSERT OR REPLACE INTO current VALUES (?, ?)", (name, key))

    def add(self, done: Done) -> None:
        """Note what became of a capture."""
        self.keep(done.name, done.key)
        self._database.execute("INSERT OR IGNORE INTO there VALUES (?)", (done.key,))
        if done.fingerprint is None:
            return
        elsewhere = json.dumps([[file.name, file.size, file.stamp] for file in done.elsewhere])
        row = (done.name, done.fingerprint, done.key, elsewhere)
        self._database.execute("INSERT OR IGNORE INTO seen VALUES (?, ?, ?, ?)", row)
        self._lines.append(json.dumps(row))
        if len(self._lines) >= FLUSH_LINES or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def outdated(self, results: Iterable[tuple[str, str]]) -> list[str]:
        """Of keys with their captures' names, those in whose place another result counts now."""
        look = "SELECT key FROM current WHERE name = ?"
        rows = ((key, self._database.execute(look, (name,)).fetchone()) for key, name in results)
        return [key for key, row in rows if row is not None and row[0] != key]

    def flush(self) -> None:
        """Write down what was added."""
        if self._lines:
            text = "\n".join(self._lines) + "\n"
            self._results.write_new(f"{self._folder}/{uuid.uuid4().hex}.jsonl", text.encode())
        self._lines = []
        self._flushed_s = time.monotonic()
