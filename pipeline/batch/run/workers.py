"""The embedded engine: a thread for each worker, which waits for its child."""

from __future__ import annotations

import os
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from .child import Child
from .work import Done, Task

LEAST_BYTES = 256 * 2**20


@dataclass(frozen=True)
class Limits:
    """What one task may take: seconds, and bytes of memory; None for a worker's fair share."""

    timeout_s: float
    memory_bytes: int | None


class Workers:
    """So many workers of this machine."""

    def __init__(self, workers: int, limits: Limits, scratch: Path) -> None:
        if workers > 1:
            os.environ["WHEELPLANE_THREADS"] = "1"  # of each child, which inherits it
        self.slots = workers
        self._threads = ThreadPoolExecutor(workers)
        self._children: list[Child] = []
        self._of_thread = threading.local()
        self._timeout_s, self._scratch = limits.timeout_s, scratch
        self._memory_bytes = limits.memory_bytes or memory_of_each(workers)

    def submit(self, task: Task) -> Future[list[Done]]:
        """The task's outcome to come."""
        return self._threads.submit(self.do, task)

    def do(self, task: Task) -> list[Done]:
        """Do a task in the child of this thread."""
        if not hasattr(self._of_thread, "child"):
            child = Child(self._timeout_s, self._memory_bytes, self._scratch)
            self._of_thread.child = child
            self._children.append(child)
        child = self._of_thread.child
        assert isinstance(child, Child)
        return child.do(task)

    def close(self) -> None:
        """Kill all children, which wakes the threads that wait for them."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for child in self._children:
            child.close()


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory_of_each(workers: int) -> int:
    """The share of a worker in this machine's memory, or its control group's, a tenth kept free."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    with suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    share = int(0.9 * total / workers)
    if share < LEAST_BYTES:
        raise InputError(
            f"--workers {workers}: leaves each {share / 2**20:.0f} MB of memory, "
            f"{LEAST_BYTES / 2**20:.0f} MB is the least: use fewer"
        )
    return share
