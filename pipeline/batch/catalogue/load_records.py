"""JSON files of results -> records, read by several threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from ...errors import InputError
from ..storage.store import Store
from .rows import Record, read_record

# Reading files and SQLite's JSON parser release the GIL; requests mostly wait.
THREADS_LOCAL, THREADS_REMOTE = 4, 32
AHEAD = 8  # results in memory for each thread
RecordProgress = Callable[[int, int], None]
KnownRecord = Callable[[str], Record | None]


def no_progress(_done: int, _total: int) -> None:
    """Ignore the progress."""


def none_known(_key: str) -> None:
    """Know no record without reading its file."""


def json_name(key: str) -> str:
    """Return the name of the JSON file of a key."""
    return f"measurements/{key[:2]}/{key}.json"


def load_records(store: Store, keys: Iterable[str]) -> Iterator[Record]:
    """Yield the records of these keys in their order, skipping JSON files removed meanwhile."""
    threads = THREADS_REMOTE if store.local is None else THREADS_LOCAL
    pending: deque[Future[Record | None]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for key in keys:
                pending.append(pool.submit(_read, store, key))
                if len(pending) > AHEAD * threads:
                    yield from _done(pending.popleft())
            while pending:
                yield from _done(pending.popleft())
        finally:
            for future in pending:
                future.cancel()


def _done(future: Future[Record | None]) -> Iterator[Record]:
    record = future.result()
    if record is not None:
        yield record


def _read(store: Store, key: str) -> Record | None:
    try:
        return read_record(key, store.read(json_name(key)))
    except InputError:
        if store.exists(json_name(key)):
            raise
        return None
