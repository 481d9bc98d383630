"""Threads over the rows of large clouds: chunks of one size, results in the order of the rows."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

T = TypeVar("T")

ROWS_PER_CHUNK = 65_536  # does not depend on the number of threads, nor do sums over chunks
MOST_THREADS = 8


def threads() -> int:
    """Return the number of threads: WHEELPLANE_THREADS, or the processors of this process."""
    given = os.environ.get("WHEELPLANE_THREADS", "")
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


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    """Return the pool, kept between passes: starting it takes as long as a pass over a million.

    One thread less than processors, since the caller takes a share as well: two threads woken at
    once may start on one processor.
    """
    return ThreadPoolExecutor(MOST_THREADS - 1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not survive a fork
