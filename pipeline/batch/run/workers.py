"""Engine of this machine: a thread for each worker, which waits for its process."""

from __future__ import annotations

import os
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from ...errors import InputError
from ...readers import child_environment
from ...system import frozen, machine_bytes
from ..operation.run_state import AtWork
from .work import CompletedCapture, Task
from .worker_process import WorkerProcess

LEAST_BYTES = 256 * 2**20


@frozen
class Limits:
    """Limits of one task: seconds, and bytes of memory; None for an equal share of memory."""

    timeout_s: float
    memory_bytes: int | None


class Workers:
    """Workers of this machine, a fixed number."""

    def __init__(self, workers: int, limits: Limits, scratch: Path) -> None:
        one_each = {"WHEELPLANE_THREADS": "1"} if workers > 1 else {}
        self._environment = child_environment(storage=True, **one_each)
        self.slots = workers
        self._threads = ThreadPoolExecutor(workers)
        self._processes: list[WorkerProcess] = []
        self._per_thread = threading.local()
        self._at_work: dict[int, AtWork] = {}
        self._timeout_s, self._scratch = limits.timeout_s, scratch
        self._memory_bytes = limits.memory_bytes or memory_of_each(workers)

    def submit(self, task: Task) -> Future[list[CompletedCapture]]:
        """Submit a task."""
        return self._threads.submit(self.run, task)

    def run(self, task: Task) -> list[CompletedCapture]:
        """Run a task in the worker process of this thread."""
        if not hasattr(self._per_thread, "process"):
            process = WorkerProcess(
                self._timeout_s, self._memory_bytes, self._scratch, self._environment
            )
            self._per_thread.process = process
            self._processes.append(process)
        process = self._per_thread.process
        assert isinstance(process, WorkerProcess)
        number = self._processes.index(process) + 1
        names = tuple(found.name for found in task.captures)
        self._at_work[number] = AtWork(names, time.time(), f"worker {number}")
        try:
            return process.run(task)
        finally:
            del self._at_work[number]

    @property
    def at_work(self) -> tuple[AtWork, ...]:
        """Captures at work now, by worker."""
        return tuple(self._at_work.copy().values())

    def close(self) -> None:
        """Kill all worker processes, which wakes the threads that wait for them."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for process in self._processes:
            process.close()


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory_of_each(workers: int) -> int:
    """Return a worker's share of the memory of machine or control group, a tenth kept free."""
    share = int(0.9 * machine_bytes() / workers)
    if share < LEAST_BYTES:
        raise InputError(
            f"--workers {workers}: each gets {share / 2**20:.0f} MB of memory, at least "
            f"{LEAST_BYTES / 2**20:.0f} MB are needed: use fewer"
        )
    return share
