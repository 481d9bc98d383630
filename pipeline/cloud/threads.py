"""Rows of large clouds in blocks of one size, worked on by threads, answered in their order."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

T = TypeVar("T")

BLOCK_ROWS = 65_536  # the same for any number of threads, and so are the sums over blocks
MOST_THREADS = 8


def threads() -> int:
    """Threads that work on blocks: WHEELPLANE_THREADS, or the processors of this process."""
    told = os.environ.get("WHEELPLANE_THREADS", "")
    if told.isdecimal() and int(told) > 0:
        return int(told)
    return min(
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1, MOST_THREADS
    )


def over_blocks(work: Callable[[slice], T], rows: int, block_rows: int = BLOCK_ROWS) -> list[T]:
    """`work` on each block of the rows, in the order of the rows."""
    blocks = [slice(start, min(start + block_rows, rows)) for start in range(0, rows, block_rows)]
    workers = min(threads(), len(blocks))
    if workers < 2:
        return [work(block) for block in blocks]

    def share(first: int) -> list[T]:
        return [work(block) for block in blocks[first::workers]]

    others = [_pool().submit(share, first) for first in range(1, workers)]
    done = [share(0), *(other.result() for other in others)]
    return [done[k % workers][k // workers] for k in range(len(blocks))]


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    """Threads that wait for the next pass; starting them takes as long as a pass over a million.

    One less than there are, for who asks takes a share as well: two that are woken at once may
    find themselves on one processor.
    """
    return ThreadPoolExecutor(MOST_THREADS - 1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a fork leaves them behind
