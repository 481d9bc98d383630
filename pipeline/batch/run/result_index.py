"""Index of results by the fingerprints of their captures, so that no capture need be read.

Each run adds what it learns to the results as small files of lines, each complete and never
changed: several runs may write at once, and a kill loses only what the next run finds out again.
"""

from __future__ import annotations

import json
import pickle
import sqlite3
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from ..catalogue.load_records import json_name, load_records
from ..catalogue.rows import FAILED, Record
from ..plan.discover import FoundCapture, ListedCapture
from ..storage.entry import Entry, legible
from ..storage.store import Store
from .work import CompletedCapture

FOLDER = "run/seen/"
FLUSH_S, FLUSH_LINES = 10.0, 2000
MOST_RECORDS = 200_000  # kept for the catalogue: 2 kB each
TABLES = """
PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA locking_mode = EXCLUSIVE;
PRAGMA cache_size = -65536;
CREATE TABLE known(name, fingerprint, key, elsewhere,
  PRIMARY KEY(name, fingerprint, key, elsewhere)) WITHOUT ROWID;
CREATE TABLE others(name, key, PRIMARY KEY(name, key)) WITHOUT ROWID;
CREATE VIEW named AS SELECT name, key FROM known UNION ALL SELECT name, key FROM others;
CREATE TABLE present(key PRIMARY KEY, done DEFAULT TRUE) WITHOUT ROWID;
CREATE TABLE written(key PRIMARY KEY, stamp, record) WITHOUT ROWID;
CREATE TABLE current(name PRIMARY KEY, fingerprint, ours, expected_s, key) WITHOUT ROWID;
"""

COMPARED = """
INSERT OR IGNORE INTO current SELECT given.*, (
  SELECT key FROM known JOIN present USING(key)
  WHERE known.name = given.name AND known.fingerprint = given.fingerprint
    AND elsewhere = '[]' AND done)
FROM (SELECT ? AS name, ? AS fingerprint, ? AS ours, ? AS expected_s) AS given
"""
DEPENDENT = """
SELECT current.name, known.key, elsewhere
FROM known JOIN current USING(name, fingerprint) JOIN present ON present.key = known.key
WHERE elsewhere <> '[]' AND done
"""  # results that depend on files elsewhere
SUPERSEDED = """
SELECT DISTINCT named.key FROM named CROSS JOIN current USING(name) CROSS JOIN present
ON present.key = named.key WHERE named.key <> current.key
"""
REPLACED = """
SELECT DISTINCT named.key FROM named CROSS JOIN present ON present.key = named.key
WHERE named.name = :name AND named.key <> :key
"""  # results of a capture by the one that was just written
REMOVED = """
SELECT DISTINCT name, key FROM named CROSS JOIN present USING(key)
WHERE name NOT IN (SELECT name FROM current) AND name <> '' ORDER BY name
"""
# captures below a folder or zip: "0" is the character after "/"
LISTED_BELOW = "SELECT 1 FROM current WHERE name > :name || '/' AND name < :name || '0'"
KNOWN_BELOW = "SELECT 1 FROM named WHERE name > :name || '/' AND name < :name || '0'"
NAMELESS = "SELECT key FROM present WHERE key NOT IN (SELECT key FROM named)"
UNDONE = "SELECT 1 FROM current WHERE name = ? AND ours AND key IS NULL"


class ResultIndex:
    """Finished captures, in a temporary database at `path`, and those that this run adds.

    settings_hash: hash of the settings; of runs with other settings only the names of captures
    are used. archive: its files are checked again where a capture names files outside its folder.
    """

    def __init__(self, results: Store, settings_hash: str, archive: Store, path: Path) -> None:
        self._results = results
        self._folder = f"{FOLDER}{settings_hash[:16]}/"
        # closed by whichever thread drops the last reference
        self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        self._database.executescript(TABLES)
        self._listed = lru_cache(maxsize=4096)(archive.stat)
        self._lines: list[str] = []
        self._records, self._all_named = 0, False
        self._flushed_s = time.monotonic()

    def __del__(self) -> None:
        self._database.close()

    def load(self) -> None:
        """Read the indices of earlier runs, and which results exist.

        What a damaged index held is found out again.
        """
        keys = ((name[-69:-5],) for name in self._results.names("measurements/"))
        self._database.execute("BEGIN")
        self._database.executemany("INSERT OR IGNORE INTO present(key) VALUES (?)", keys)
        for file in self._results.list(FOLDER):
            data = self._results.read(file.name)
            with suppress(ValueError, TypeError, sqlite3.ProgrammingError, sqlite3.InterfaceError):
                rows = json.loads(b"[%s]" % b",".join(data.splitlines()))
                if file.name.startswith(self._folder):
                    known = "INSERT OR IGNORE INTO known VALUES (?, ?, ?, ?)"
                    self._database.executemany(known, rows)
                else:
                    self._name((name, key) for name, _, key, _ in rows)
        self._database.execute("COMMIT")

    def mark_undone(self, keys: Iterable[str]) -> None:
        """Mark these results as not done."""
        rows = ((key,) for key in keys)
        self._database.executemany("UPDATE present SET done = FALSE WHERE key = ?", rows)

    def knows(self, found: FoundCapture) -> bool:
        """Return whether an earlier run measured a capture of this name and fingerprint."""
        row = (legible(found.name), found.fingerprint)
        asked = "SELECT 1 FROM known WHERE name = ? AND fingerprint = ?"
        return self._database.execute(asked, row).fetchone() is not None

    def knows_below(self, name: str) -> bool:
        """Return whether there are results of captures in the folder or zip of this name."""
        return self._database.execute(KNOWN_BELOW, {"name": legible(name)}).fetchone() is not None

    def compare(self, captures: Iterable[ListedCapture], is_ours: Callable[[str], bool]) -> None:
        """Look for valid results of the captures that are in the archive now, which become current.

        Of several results with a capture's fingerprint it is the one whose files elsewhere are
        unchanged. is_ours: whether this run measures the capture of a name.
        """
        self._listed.cache_clear()
        rows = (
            (legible(name), fingerprint, is_ours(name), expected_s)
            for name, fingerprint, expected_s in captures
        )
        self._database.execute("BEGIN")
        self._database.execute("DELETE FROM current")
        self._database.executemany(COMPARED, rows)
        for name, key, elsewhere in self._database.execute(DEPENDENT):
            others = [Entry(*file) for file in json.loads(elsewhere)]
            if all(self._listed(file.name) == file for file in others):
                self._set_current(name, key)
        self._database.execute("COMMIT")

    def counts(self) -> tuple[int, int]:
        """Return how many captures of this run have a valid result, and how many have none."""
        done, total = self._database.execute(
            "SELECT count(key), count(*) FROM current WHERE ours"
        ).fetchone()
        return done, total - done

    def expected_s(self, limit: int) -> float:
        """Return the expected seconds of the first of those that have none."""
        asked = (
            "SELECT total(expected_s) FROM (SELECT expected_s FROM current "
            "WHERE ours AND key IS NULL ORDER BY name LIMIT ?)"
        )
        return float(self._database.execute(asked, (limit,)).fetchone()[0])

    def is_todo(self, found: FoundCapture) -> bool:
        """Return whether a capture is this run's, and has no valid result."""
        name = (legible(found.name),)
        return self._database.execute(UNDONE, name).fetchone() is not None

    def state(self, found: FoundCapture) -> str:
        """Return a text that changes with the files of a capture and those it names elsewhere."""
        rows = self._database.execute(
            "SELECT elsewhere FROM known JOIN present USING(key) WHERE known.name = ?",
            (legible(found.name),),
        )
        names = {file[0] for (elsewhere,) in rows for file in json.loads(elsewhere)}
        return f"{found.fingerprint} {[self._listed(name) for name in sorted(names)]}"

    def add(self, done: CompletedCapture) -> None:
        """Add a finished capture."""
        name = legible(done.name)
        self._set_current(name, done.key)
        self._database.execute("INSERT OR REPLACE INTO present(key) VALUES (?)", (done.key,))
        elsewhere = json.dumps([[file.name, file.size, file.stamp] for file in done.elsewhere])
        row = (name, done.fingerprint or "", done.key, elsewhere)
        self._database.execute("INSERT OR IGNORE INTO known VALUES (?, ?, ?, ?)", row)
        if done.stamp and self._records < MOST_RECORDS:
            self._records += 1
            record = (done.key, done.stamp, done.record)
            self._database.execute("INSERT OR REPLACE INTO written VALUES (?, ?, ?)", record)
        self._lines.append(json.dumps(row))
        if len(self._lines) >= FLUSH_LINES or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def record_of(self, key: str) -> Record | None:
        """Return the record of a result that this run wrote, if its file is still the same."""
        asked = "SELECT stamp, record FROM written WHERE key = ?"
        row = self._database.execute(asked, (key,)).fetchone()
        if row is None:
            return None
        entry = self._results.stat(json_name(key))
        known: Record = pickle.loads(row[1])  # noqa: S301 - of our workers
        return known if entry is not None and entry.stamp == row[0] else None

    @property
    def is_full(self) -> bool:
        """Whether it holds as many records as it may: time to update the catalogue."""
        return self._records >= max(1, MOST_RECORDS)

    def forget_records(self) -> None:
        """Drop the records of results, which the catalogue holds."""
        self._database.execute("DELETE FROM written")
        self._records = 0

    def outdated(self) -> list[str]:
        """Return the keys of results that are superseded by another result of their capture.

        Also those of folders and zips that could not be listed, whose captures are now.
        """
        if not self._holds_others():
            return []
        superseded = [key for (key,) in self._database.execute(SUPERSEDED)]
        return [*superseded, *(key for _, key, is_listed in self._missing() if is_listed)]

    def replaced(self, done: CompletedCapture) -> list[str]:
        """Return the keys of earlier results of a finished capture, as far as an index names them.

        Those that none names are found by `outdated`.
        """
        asked = {"name": legible(done.name), "key": done.key}
        return [key for (key,) in self._database.execute(REPLACED, asked)]

    def drop(self, key: str) -> None:
        """Remove a result."""
        self._database.execute("DELETE FROM present WHERE key = ?", (key,))

    def removed(self, unlisted: Iterable[str] = ()) -> list[str]:
        """Return the captures with results that are not in the latest listing, by name.

        unlisted: folders and zips that could not be listed: captures in them may still be there.
        """
        if not self._holds_others():
            return []
        hidden = tuple(f"{legible(folder)}/" for folder in unlisted)
        names = dict.fromkeys(name for name, _, is_listed in self._missing() if not is_listed)
        return [name for name in names if not name.startswith(hidden)]

    def _missing(self) -> Iterator[tuple[str, str, bool]]:
        """Yield name and key of results that the latest listing has no capture of, by name.

        And whether it is the failure of a folder or zip whose captures it has instead.
        """
        for name, key in self._database.execute(REMOVED):
            is_listed = self._database.execute(LISTED_BELOW, {"name": name}).fetchone() is not None
            yield name, key, is_listed and self._failed(key)

    def _failed(self, key: str) -> bool:
        return any(one.capture.status in FAILED for one in load_records(self._results, [key]))

    def _holds_others(self) -> bool:
        """Return whether there are other results than those of the captures listed.

        By their numbers: a key is of one capture, whose name it hashes. If so, the captures of
        results that are in no index are read from these.
        """
        asked = "SELECT (SELECT count(*) FROM present) > (SELECT count(key) FROM current)"
        if not self._database.execute(asked).fetchone()[0]:
            return False
        if not self._all_named:
            nameless = self._database.execute(NAMELESS).fetchall()
            records = load_records(self._results, (key for (key,) in nameless))
            self._name((record.capture.name, record.capture.key) for record in records)
            self._all_named = True
        return True

    def _name(self, rows: Iterable[tuple[str, str]]) -> None:
        """Add the names of captures, by the keys of their results."""
        self._database.executemany("INSERT OR IGNORE INTO others VALUES (?, ?)", rows)

    def flush(self) -> None:
        """Write what was added to the results."""
        if self._lines:
            text = "\n".join(self._lines) + "\n"
            self._results.write_new(f"{self._folder}{uuid.uuid4().hex}.jsonl", text.encode())
        self._lines = []
        self._flushed_s = time.monotonic()

    def _set_current(self, name: str, key: str) -> None:
        self._database.execute("UPDATE current SET key = ? WHERE name = ?", (key, name))
