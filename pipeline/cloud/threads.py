"""Threads over the rows of large clouds, and over scans; results in the order of these."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:  # imported where more than one thread works
    from concurrent.futures import Future, ThreadPoolExecutor

R = TypeVar("R")
S = TypeVar("S")
T = TypeVar("T")

ROWS_PER_CHUNK = 65_536  # does not depend on the number of threads, nor do sums over chunks
MOST_THREADS = 8
THREADS = "WHEELPLANE_THREADS"
POOL = "wheelplane-rows"  # name of its threads


def threads() -> int:
    """Return the number of threads: WHEELPLANE_THREADS, or the processors of this process."""
    given = os.environ.get(THREADS, "")
    if given.isdecimal() and int(given) > 0:
        return int(given)
    return min(
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1, MOST_THREADS
    )


def over_chunks(work: Callable[[slice], T], rows: int, size: int = ROWS_PER_CHUNK) -> list[T]:
    """Call `work` on each chunk of the rows; return its results in the order of the rows."""
    chunks = [slice(start, min(start + size, rows)) for start in range(0, rows, size)]
    workers = min(threads(), len(chunks))
    if workers < 2:
        return [work(chunk) for chunk in chunks]

    def share(first: int) -> list[T]:
        return [work(chunk) for chunk in chunks[first::workers]]

    others = [_pool().submit(share, first) for first in range(1, workers)]
    done = [share(0), *(other.result() for other in others)]
    return [done[k % workers][k // workers] for k in range(len(chunks))]


def over_items(
    work: Callable[[S], T],
    items: Sequence[S],
    begins: Callable[[S], object],
    several: bool = True,
) -> list[T]:
    """Call `work` on each item; return its results in the order of the items.

    several: items at once, in processes where a fork is safe, else in threads. begins: called in
    this thread with each item, in their order, before its work. Of several errors, raises that of
    the first item.
    """

    def announced(item: S) -> S:
        begins(item)
        return item

    workers = min(threads(), len(items)) if several else 1
    if workers < 2:
        return [work(announced(item)) for item in items]
    from .forked import can_fork, in_processes

    _end_pool()
    if can_fork():
        each = {THREADS: str(threads() // workers)}
        return in_processes(work, items, workers, each, begins)
    return side_by_side(announced, work, items)


def side_by_side(first: Callable[[S], R], then: Callable[[R], T], items: Sequence[S]) -> list[T]:
    """Call `first` on one item after another, and in threads `then` on what it returns.

    Returns the results in the order of the items; of several errors, raises that of the first item.
    """
    workers = min(threads(), len(items))
    if workers < 2:
        return [then(first(item)) for item in items]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(workers) as pool:
        done: list[T] = []
        running: deque[Future[T]] = deque()
        try:
            for item in items:
                if len(running) == workers:
                    done.append(running.popleft().result())
                running.append(_begin(pool, then, first, item))
            while running:
                done.append(running.popleft().result())
        finally:
            for one in running:
                one.cancel()
    return done


def _begin(
    pool: ThreadPoolExecutor, then: Callable[[R], T], first: Callable[[S], R], item: S
) -> Future[T]:
    """Call `first` and begin `then`; an error of the former is one of the result."""
    from concurrent.futures import Future

    try:
        return pool.submit(then, first(item))
    except Exception as error:
        failed: Future[T] = Future()
        failed.set_exception(error)
        return failed


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    """Return the pool, kept between passes: starting it takes as long as a pass over a million.

    One thread less than processors, since the caller takes a share as well: two threads woken at
    once may start on one processor.
    """
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(MOST_THREADS - 1, POOL)


def _end_pool() -> None:
    """End the threads of the pool, where no other thread may be using it."""
    if not _pool.cache_info().currsize:
        return
    others = (t for t in threading.enumerate() if t is not threading.current_thread())
    if all(other.name.startswith(POOL) for other in others):
        _pool().shutdown()
        _pool.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not survive a fork
