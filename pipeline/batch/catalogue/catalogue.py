"""catalogue.sqlite: the index of the results' JSON files, built from these alone.

The file is never changed in place: a new one is written beside it and renamed over it. Readers
need no lock, a killed writer leaves the old file, and the same JSON files give the same bytes in
any order, whether the catalogue was updated or rebuilt.

In object storage no writer holds a lock, which a killed one would leave behind: a new catalogue
replaces only the one that it was made from. A writer that was overtaken starts again from that of
the other.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import field
from pathlib import Path
from typing import IO, Any

from ...errors import InputError
from ...system import acquire, frozen, sync_folder
from ..storage.entry import PARTIAL
from ..storage.store import Store, open_store
from .changes import Changes, in_folder, in_storage
from .columns import renew_columns
from .load_records import KnownRecord, RecordProgress, no_progress, none_known
from .rows import Record
from .schema import create, drop, number_of, open_draft, put
from .segments import load_changed_records
from .sqlite_file import mark_verified, open_sqlite_file, write_sqlite_file

FILE, LOCK = "catalogue.sqlite", "catalogue.lock"


@frozen
class Catalogue:
    """Open catalogue, read-only, usable from any thread; see `query` and `trends`.

    kept: answers that several questions need, by what was asked.
    """

    store: Store
    connection: sqlite3.Connection
    kept: dict[Any, Any] = field(default_factory=dict, compare=False)

    def __enter__(self) -> Catalogue:
        return self

    def __exit__(self, *_: object) -> None:
        self.connection.close()


def rebuild(store: Store, progress: RecordProgress = no_progress) -> int:
    """Rebuild the catalogue from the JSON files and return how many were read.

    progress: called with the number of files read and the number to read. Raises InputError,
    also for a folder without results, in which nothing is written.
    """
    _require_results(store, store.url)
    return _published(
        store, lambda space: _refresh(store, space, progress, none_known, from_scratch=True)
    )


def update(
    store: Store, progress: RecordProgress = no_progress, known: KnownRecord = none_known
) -> int:
    """Bring the catalogue up to date with the JSON files and return how many differed.

    The changes are detected here. The cost hardly depends on their number, since the whole file is
    written again (1 s at 100,000 results): call it once a minute, not once a result. known: the
    record of a key without reading its file, if the caller has it. Raises InputError.
    """
    return _published(store, lambda space: _refresh(store, space, progress, known))


class _OvertakenError(Exception):
    """Another process published a catalogue meanwhile."""


def _published(store: Store, refresh: Callable[[_Workspace], int]) -> int:
    """Refresh until no other writer comes between; of those who do, one has succeeded each time."""
    while True:
        with suppress(_OvertakenError), _workspace(store) as workspace:
            return refresh(workspace)


def open_catalogue(results: str, progress: RecordProgress = no_progress) -> Catalogue:
    """Open the catalogue of a folder or URL of results, after bringing it up to date.

    While another process updates it, the existing file is used. For results that are read-only,
    and for object storage, a temporary copy is used. Raises InputError.
    """
    store = open_store(results)
    _require_results(store, results)
    with _workspace(store, reading=True) as workspace:
        if workspace.locked:
            _refresh(store, workspace, progress, none_known)
        connection = open_sqlite_file(workspace.file, verified=workspace.locked)
    if connection is None:
        raise InputError(f"{results}/{FILE}: damaged, and being rebuilt: try again later")
    if store.local is None and not connection.execute("SELECT 1 FROM captures").fetchone():
        raise InputError(f"{results}: no results found: give the URL that `batch` wrote to")
    return Catalogue(store, connection)


def _require_results(store: Store, results: str) -> None:
    if store.local is not None and not (store.local / "measurements").is_dir():
        raise InputError(f"{results}: no results found: give the folder that `batch` wrote to")


@frozen
class _Workspace:
    """Folder for drafts, and the catalogue's file.

    locked: this process holds the catalogue's lock. publish: the file is a copy that has to be
    uploaded to object storage. stamp: of the object that it is a copy of; None without one.
    """

    folder: Path
    file: Path
    locked: bool = True
    publish: bool = False
    stamp: str | None = None


@contextmanager
def _workspace(store: Store, reading: bool = False) -> Iterator[_Workspace]:
    if store.local is not None and (lock := _lock_file(store.local)) is not None:
        file = store.local / FILE
        with lock:
            locked = acquire(lock.fileno(), wait=not (reading and file.exists()))
            yield _Workspace(store.local / PARTIAL, file, locked)
        return
    if store.local is not None and not reading:
        raise InputError(f"{store.local}: not writable: check its permissions")
    with tempfile.TemporaryDirectory(prefix="wheelplane-") as folder:
        file = Path(folder) / FILE
        entry = store.stat(FILE)
        if entry is not None:
            shutil.copy2(store.fetch(FILE, Path(folder) / "fetched"), file)
        stamp = None if entry is None else entry.stamp
        yield _Workspace(Path(folder), file, publish=not reading, stamp=stamp)


def _refresh(
    store: Store,
    workspace: _Workspace,
    progress: RecordProgress,
    known: KnownRecord,
    from_scratch: bool = False,
) -> int:
    """Replace the catalogue by one of the present JSON files; return how many differed."""
    draft, final = (workspace.folder / uuid.uuid4().hex for _ in range(2))
    try:
        draft.touch()
        now_ns = draft.stat().st_mtime_ns  # by the clock of the file system
        current = None if from_scratch else open_sqlite_file(workspace.file)
        updated_ns = workspace.file.stat().st_mtime_ns if current else 0
        changes = (
            in_storage(store, current)
            if store.local is None
            else in_folder(store.local, current, updated_ns)
        )
        records = load_changed_records(store, changes, progress, known)
        differing = _draft(workspace.file, current, draft, final, changes, records)
        if final.exists():
            _publish(store, workspace, final)
        mark_verified(workspace.file, now_ns)
    except (sqlite3.Error, OSError) as error:
        fact = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"{store.url}/{FILE}: cannot be written ({fact}): check disk space and permissions"
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
    """Write `final` from the current catalogue and the changes; return how many rows differ.

    Without changes nothing is written.
    """
    if current is not None:
        current.close()
        if not changes:
            return 0
        shutil.copyfile(file, draft)
    with closing(open_draft(draft) if current else create(draft)) as connection:
        connection.execute("BEGIN")
        drop(connection, map(number_of, changes.removed))
        differing = len(changes.removed) + put(connection, records)
        if differing:
            renew_columns(connection, map(number_of, (*changes.removed, *changes.read)))
        connection.execute("COMMIT")
        if differing or current is None:
            write_sqlite_file(connection, final)
    return differing


def _publish(store: Store, workspace: _Workspace, final: Path) -> None:
    final.replace(workspace.file)
    if store.local is not None:
        sync_folder(workspace.file.parent)
    elif workspace.publish and not store.send(FILE, workspace.file, workspace.stamp):
        raise _OvertakenError


def _lock_file(folder: Path) -> IO[str] | None:
    """Open the file whose lock a writer holds; None if the folder is read-only."""
    try:
        (folder / PARTIAL).mkdir(parents=True, exist_ok=True)
        return (folder / PARTIAL / LOCK).open("w")
    except OSError:
        return None
