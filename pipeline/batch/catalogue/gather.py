"""Results' JSONs -> records, many at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from ...errors import InputError
from ..storage.store import Store
from .rows import Record, read_record

# Reading and SQLite's JSON leave Python's lock free; requests mostly wait.
THREADS_LOCAL, THREADS_REMOTE = 4, 32
AHEAD = 8  # results in memory for each thread
Progress = Callable[[int, int], None]


def silent(_done: int, _total: int) -> None:
    """The progress that nobody is told of."""


def name_of(key: str) -> str:
    """Where the JSON of a key stands."""
    return f"measurements/{key[:2]}/{key}.json"


def gather(store: Store, keys: Iterable[str]) -> Iterator[Record]:
    """The records of these keys, in their order; none for a JSON that is gone by now."""
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
        return read_record(key, store.read(name_of(key)))
    except InputError:
        if store.exists(name_of(key)):
            raise
        return None
