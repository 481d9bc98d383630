"""catalogue.sqlite: the index over the results' JSONs, made from them and from nothing else.

The file is never changed in place: a new one is made beside it and takes its name. So readers
need no lock, a killed writer leaves the old one, and the same JSONs give the same bytes, whatever
the order, and whether it was updated or rebuilt.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import sqlite3
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ...errors import InputError
from ..storage.entry import PARTIAL
from ..storage.store import Store, open_store
from .changes import Changes, in_folder, in_storage
from .gather import Progress, silent
from .rows import Record
from .schema import create, drop, number_of, put, working
from .sealed import opened, seal
from .segments import gathered

FILE, LOCK = "catalogue.sqlite", "catalogue.lock"


@dataclass(frozen=True)
class Catalogue:
    """An open catalogue, for reading, from any thread; `query` and `trends` ask it."""

    store: Store
    connection: sqlite3.Connection

    def __enter__(self) -> Catalogue:
        return self

    def __exit__(self, *_: object) -> None:
        self.connection.close()


def rebuild(store: Store, progress: Progress = silent) -> int:
    """Make the catalogue anew from the JSONs; how many were read. Raises InputError.

    progress: called with the number of JSONs read and of those to read.
    """
    with _workplace(store) as place:
        return _refresh(store, place, progress, anew=True)


def update(store: Store, progress: Progress = silent) -> int:
    """Bring the catalogue up to date with the JSONs; how many differed. Raises InputError.

    It finds out itself what changed. Its cost hardly depends on how much did (the whole file is
    laid out again): 1 s at 100,000 results. So a runner calls it every minute, not every result.
    """
    with _workplace(store) as place:
        return _refresh(store, place, progress)


def open_catalogue(results: str, progress: Progress = silent) -> Catalogue:
    """The catalogue of a folder or URL of results, made or brought up to date first.

    While another process is at that, the one that stands is used. Where results cannot be written
    to, and for object storage, a passing copy serves. Raises InputError.
    """
    store = open_store(results)
    if store.local is not None and not (store.local / "measurements").is_dir():
        raise InputError(f"{results}: holds no results: name the folder that `batch` wrote to")
    with _workplace(store, reading=True) as place:
        if place.ours:
            _refresh(store, place, progress)
        connection = opened(place.file, verified=place.ours)
    if connection is None:
        raise InputError(f"{results}/{FILE}: is damaged, and being made anew: try again later")
    if store.local is None and not connection.execute("SELECT 1 FROM captures").fetchone():
        raise InputError(f"{results}: holds no results: name the URL that `batch` wrote to")
    return Catalogue(store, connection)


@dataclass(frozen=True)
class _Place:
    """A folder to work in, and the catalogue's file; ours: no other process is at it.

    publish: whether the file is a copy that has to go back to object storage.
    """

    folder: Path
    file: Path
    ours: bool = True
    publish: bool = False


@contextmanager
def _workplace(store: Store, reading: bool = False) -> Iterator[_Place]:
    if store.local is not None and (lock := _lock_file(store.local)) is not None:
        file = store.local / FILE
        with lock:
            ours = _locked(lock, wait=not (reading and file.exists()))
            yield _Place(store.local / PARTIAL, file, ours)
        return
    if store.local is not None and not reading:
        raise InputError(f"{store.local}: cannot be written to: see to its permissions")
    with tempfile.TemporaryDirectory(prefix="wheelplane-") as folder:
        file = Path(folder) / FILE
        if store.exists(FILE):
            shutil.copy2(store.fetch(FILE, Path(folder) / "fetched"), file)
        yield _Place(Path(folder), file, publish=not reading)


def _refresh(store: Store, place: _Place, progress: Progress, anew: bool = False) -> int:
    """Replace the catalogue by one of the JSONs as they are now; how many differed."""
    draft, final = (place.folder / uuid.uuid4().hex for _ in range(2))
    try:
        draft.touch()
        now_ns = draft.stat().st_mtime_ns  # by the clock of the file system
        current = None if anew else opened(place.file)
        seen_ns = place.file.stat().st_mtime_ns if current else 0
        changes = (
            in_storage(store, current)
            if store.local is None
            else in_folder(store.local, current, seen_ns)
        )
        records = gathered(store, changes, progress)
        differing = _draft(place.file, current, draft, final, changes, records)
        if final.exists():
            _publish(store, place, final)
        os.utime(place.file, ns=(now_ns, now_ns))
    except (sqlite3.Error, OSError) as error:
        fact = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"{store.url}/{FILE}: cannot be made ({fact}): see to the disk's room and permissions"
        ) from error
    finally:
        draft.unlink(missing_ok=True)
        final.unlink(missing_ok=True)
    return differing


def _draft(
    file: Path,
    current: sqlite3.Connection | None,
    draft: Path,
    final: Path,
    changes: Changes,
    records: Iterator[Record],
) -> int:
    """Make `final` of the current catalogue and the changes, if any; how many rows differ."""
    if current is not None:
        current.close()
        if not changes:
            return 0
        shutil.copyfile(file, draft)
    with closing(working(draft) if current else create(draft)) as connection:
        connection.execute("BEGIN")
        drop(connection, map(number_of, changes.gone))
        differing = len(changes.gone) + put(connection, records)
        connection.execute("COMMIT")
        if differing or current is None:
            seal(connection, final)
    return differing


def _publish(store: Store, place: _Place, final: Path) -> None:
    final.replace(place.file)
    if store.local is not None:
        handle = os.open(place.file.parent, os.O_RDONLY)
        os.fsync(handle)
        os.close(handle)
    elif place.publish:
        store.send(FILE, place.file)


def _lock_file(folder: Path) -> IO[str] | None:
    """The file whose lock a writer holds; None where nothing can be written."""
    try:
        (folder / PARTIAL).mkdir(parents=True, exist_ok=True)
        return (folder / PARTIAL / LOCK).open("w")
    except OSError:
        return None


def _locked(lock: IO[str], wait: bool) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    return True
