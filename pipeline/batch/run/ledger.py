"""Which captures are done: known by their fingerprints, so that nothing is read to find out.

What a run learns is written to the results as small files of lines, each whole and never changed,
so that several runs may write at once and a kill loses only what is then found out again.
"""

from __future__ import annotations

import json
import sqlite3
import time
import uuid
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from ..catalogue.gather import gather
from ..plan.discover import Found
from ..storage.entry import Entry, legible
from ..storage.store import Store
from .work import Done

FOLDER = "run/seen/"
FLUSH_S, FLUSH_LINES = 10.0, 2000
TABLES = """
PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;
CREATE TABLE seen(name, fingerprint, key, elsewhere,
  PRIMARY KEY(name, fingerprint, key, elsewhere)) WITHOUT ROWID;
CREATE TABLE there(key PRIMARY KEY, name, done DEFAULT TRUE) WITHOUT ROWID;
CREATE TABLE current(name PRIMARY KEY, key) WITHOUT ROWID;
"""


class Ledger:
    """What is done, in a passing database at `path`, and what this run adds.

    mark: of the settings; of other settings only the captures' names are known. archive: whose
    files are looked at again where a capture names some beyond its own.
    """

    def __init__(self, results: Store, mark: str, archive: Store, path: Path) -> None:
        self._results = results
        self._folder = f"{FOLDER}{mark[:16]}/"
        self._database = sqlite3.connect(path, isolation_level=None)
        self._database.executescript(TABLES)
        self._listed = lru_cache(maxsize=4096)(archive.stat)
        self._lines: list[str] = []
        self._flushed_s = time.monotonic()

    def load(self) -> None:
        """Read what earlier runs learnt, and which results are there and of which captures."""
        keys = ((entry.name[-69:-5],) for entry in self._results.list("measurements/"))
        name_it = "UPDATE there SET name = ? WHERE key = ?"
        self._database.execute("BEGIN")
        self._database.executemany("INSERT OR IGNORE INTO there(key) VALUES (?)", keys)
        for file in self._results.list(FOLDER):
            rows = [json.loads(line) for line in self._results.read(file.name).splitlines()]
            self._database.executemany(name_it, ((name, key) for name, _, key, _ in rows))
            if file.name.startswith(self._folder):
                self._database.executemany("INSERT OR IGNORE INTO seen VALUES (?, ?, ?, ?)", rows)
        unknown = self._database.execute("SELECT key FROM there WHERE name IS NULL").fetchall()
        records = gather(self._results, (key for (key,) in unknown))
        names = ((record.capture.name, record.capture.key) for record in records)
        self._database.executemany(name_it, names)
        self._database.execute("COMMIT")

    def doubt(self, keys: Iterable[str]) -> None:
        """Take these results for not done."""
        rows = ((key,) for key in keys)
        self._database.executemany("UPDATE there SET done = FALSE WHERE key = ?", rows)

    def look_again(self) -> None:
        """Forget what the archive was like."""
        self._listed.cache_clear()
        self._database.execute("DELETE FROM current")

    def note(self, found: Found) -> None:
        """That a capture is in the archive."""
        row = (legible(found.name),)
        self._database.execute("INSERT OR IGNORE INTO current(name) VALUES (?)", row)

    def is_done(self, found: Found) -> bool:
        """Whether the result of a capture is there, which then counts; else it has to be looked at.

        Of several results by this fingerprint it is the one whose files elsewhere are as now.
        """
        rows = self._database.execute(
            "SELECT key, elsewhere FROM seen JOIN there USING(key) "
            "WHERE seen.name = ? AND fingerprint = ? AND done",
            (legible(found.name), found.fingerprint),
        ).fetchall()
        for key, elsewhere in rows:
            others = [Entry(*file) for file in json.loads(elsewhere)]
            if all(self._listed(file.name) == file for file in others):
                self._keep(legible(found.name), key)
                return True
        return False

    def state(self, found: Found) -> str:
        """A text that changes with the capture's files, and those elsewhere that it named."""
        rows = self._database.execute(
            "SELECT elsewhere FROM seen JOIN there USING(key) WHERE seen.name = ?",
            (legible(found.name),),
        )
        names = {file[0] for (elsewhere,) in rows for file in json.loads(elsewhere)}
        return f"{found.fingerprint} {[self._listed(name) for name in sorted(names)]}"

    def add(self, done: Done) -> None:
        """Note what became of a capture."""
        name = legible(done.name)
        self._keep(name, done.key)
        self._database.execute(
            "INSERT OR REPLACE INTO there(key, name) VALUES (?, ?)", (done.key, name)
        )
        elsewhere = json.dumps([[file.name, file.size, file.stamp] for file in done.elsewhere])
        row = (name, done.fingerprint or "", done.key, elsewhere)
        self._database.execute("INSERT OR IGNORE INTO seen VALUES (?, ?, ?, ?)", row)
        self._lines.append(json.dumps(row))
        if len(self._lines) >= FLUSH_LINES or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def outdated(self) -> list[str]:
        """The keys of results in whose place another result of their capture counts now."""
        rows = self._database.execute(
            "SELECT there.key FROM there JOIN current USING(name) WHERE there.key <> current.key"
        )
        return [key for (key,) in rows]

    def forget(self, key: str) -> None:
        """Note that a result is there no more."""
        self._database.execute("DELETE FROM there WHERE key = ?", (key,))

    def gone(self) -> list[str]:
        """The captures that have results but were not noted since the last look, by name."""
        rows = self._database.execute(
            "SELECT DISTINCT name FROM there WHERE name <> '' "
            "AND name NOT IN (SELECT name FROM current) ORDER BY name"
        )
        return [name for (name,) in rows]

    def flush(self) -> None:
        """Write down what was added."""
        if self._lines:
            text = "\n".join(self._lines) + "\n"
            self._results.write_new(f"{self._folder}{uuid.uuid4().hex}.jsonl", text.encode())
        self._lines = []
        self._flushed_s = time.monotonic()

    def _keep(self, name: str, key: str) -> None:
        self._database.execute("INSERT OR REPLACE INTO current VALUES (?, ?)", (name, key))
