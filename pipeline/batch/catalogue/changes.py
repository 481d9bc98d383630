"""Differences between a catalogue and the results' JSON files."""

from __future__ import annotations

import hashlib
import os
import re
import sqlite3
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from ..storage.entry import Entry
from ..storage.store import Store
from .load_records import json_name
from .schema import KEY_DIGITS

KEY, PREFIX = re.compile(r"[0-9a-f]{64}\.json"), re.compile(r"[0-9a-f]{2}")
GRAIN_NS = 20_000_000  # timestamps of file systems have a resolution of up to 10 ms


@dataclass
class Changes:
    """Keys to read, and keys whose JSON file was removed.

    entries: the objects of object storage, by key to read.
    """

    read: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    entries: dict[str, Entry] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.read or self.removed)


def in_folder(folder: Path, current: sqlite3.Connection | None, updated_ns: int) -> Changes:
    """Return the changes below `folder` / measurements since the update at updated_ns.

    Adding, removing or replacing a file sets the ctime of its folder, which copying with
    preserved dates cannot set back: 257 stat calls show that nothing has changed. A file that was
    modified in place is not detected; `results --rebuild` reads all.
    """
    changes = Changes()
    root = folder / "measurements"
    since_ns = updated_ns - GRAIN_NS
    try:
        folders = {e.name: e.stat().st_ctime_ns for e in os.scandir(root) if e.is_dir()}
        root_changed = root.stat().st_ctime_ns >= since_ns
    except FileNotFoundError:
        folders, root_changed = {}, True
    names = set(filter(PREFIX.fullmatch, folders))
    if root_changed and current is not None:
        names |= {row[0] for row in current.execute(_PREFIXES)}
    for prefix in sorted(names):
        changed = folders.get(prefix, since_ns) >= since_ns
        if changed or root_changed:
            known = _known(current, prefix)
            _in_subfolder(root / prefix, known, since_ns if changed else None, changes)
    return changes


_PREFIXES = "SELECT DISTINCT substr(key, 1, 2) FROM captures"


def _in_subfolder(folder: Path, known: set[str], since_ns: int | None, changes: Changes) -> None:
    """Add the new and removed files of one folder; with since_ns also those replaced since."""
    found = set()
    try:
        for entry in os.scandir(folder):
            key = entry.name.removesuffix(".json")
            if KEY.fullmatch(entry.name) is None or not key.startswith(folder.name):
                continue
            found.add(key)
            if key not in known or (since_ns and entry.stat().st_ctime_ns >= since_ns):
                changes.read.append(key)
    except FileNotFoundError:
        pass
    changes.removed.extend(sorted(known - found))
    changes.read.sort()


def _known(current: sqlite3.Connection | None, prefix: str) -> set[str]:
    if current is None:
        return set()
    ends = (int(prefix.ljust(KEY_DIGITS, digit), 16) for digit in "0f")
    rows = current.execute("SELECT key FROM captures WHERE id BETWEEN ? AND ?", tuple(ends))
    return {row[0] for row in rows}


def in_storage(store: Store, current: sqlite3.Connection | None) -> Changes:
    """Return the differences between object storage and the catalogue."""
    columns = "SELECT key, size, md5 FROM captures"
    known = {row[0]: row[1:] for row in current.execute(columns)} if current else {}
    changes, is_unchanged = Changes(), ObjectComparison(store)
    for entry in _listed(store):
        key = entry.name[-69:-5]
        if not is_unchanged(entry, *known.pop(key, (None, ""))):
            changes.read.append(key)
            changes.entries[key] = entry
    changes.removed.extend(sorted(known))
    return changes


class ObjectComparison:
    """Comparison of listed objects with rows of the catalogue, by size and ETag.

    The ETag of a plain put is the MD5 of the content. Where the first ETag that differs is found
    not to be one (encryption with a customer's key), sizes decide.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._etags_are_md5: bool | None = None

    def __call__(self, entry: Entry, size: int | None, md5: str) -> bool:
        """Return whether an object has the size and MD5 of a row; False for a size of None."""
        if entry.size != size or entry.stamp == md5:
            return entry.size == size
        if self._etags_are_md5 is None:
            md5_read = hashlib.md5(self._store.read(entry.name), usedforsecurity=False).hexdigest()
            self._etags_are_md5 = md5_read == entry.stamp
        return not self._etags_are_md5


def _listed(store: Store) -> Iterator[Entry]:
    """List the JSON files by sixteen listings at a time (one alone: 0.1 s per thousand)."""

    def below(digit: str) -> list[Entry]:
        return [
            entry
            for entry in store.list(f"measurements/{digit}")
            if KEY.fullmatch(entry.name[-69:]) and entry.name == json_name(entry.name[-69:-5])
        ]

    with ThreadPoolExecutor(16) as pool:
        for entries in pool.map(below, "0123456789abcdef"):
            yield from entries
