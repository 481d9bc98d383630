"""The engine of a Dask cluster: each task goes to the same kind of child, on one of its workers."""

from __future__ import annotations

import atexit
import importlib
import multiprocessing
from concurrent.futures import Future
from contextlib import ExitStack
from functools import lru_cache
from typing import Any

from ... import __version__
from ...errors import InputError, MissingDependencyError
from ..storage.scratch import scratch_folder
from .child import ChildError
from .measure_one import PassingError
from .work import Done, Task
from .workers import Limits, Workers

CONNECT_S = 10.0


class Cluster:
    """The workers of the Dask scheduler at an address."""

    def __init__(self, address: str, limits: Limits) -> None:
        self._distributed = _library()
        try:
            self._client: Any = self._distributed.Client(
                address, timeout=CONNECT_S, set_as_default=False
            )
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(
                f"--scheduler {address}: no Dask scheduler answers there: start one with "
                "`dask scheduler`, or check the address"
            ) from error
        self._executor = self._client.get_executor(pure=False)
        self._limits = limits
        self._check(address)

    @property
    def slots(self) -> int:
        """Threads of all workers that are there by now."""
        return max(1, sum(map(int, self._client.nthreads().values())))

    def submit(self, task: Task) -> Future[list[Done]]:
        """The task's outcome to come; a lost worker is told as a child that was killed."""
        told: Future[list[Done]] = Future()
        sent = self._executor.submit(do_in_child, task, self._limits)
        sent.add_done_callback(lambda done: self._pass_on(done, told))
        return told

    def close(self) -> None:
        """Take back what is not yet done."""
        self._executor.shutdown(wait=False)
        self._client.close()

    def _pass_on(self, done: Future[list[Done]], told: Future[list[Done]]) -> None:
        error = InputError("the Dask scheduler is gone") if done.cancelled() else done.exception()
        if isinstance(error, self._distributed.KilledWorker):
            error = ChildError("killed", "the workers that did it were lost")
        elif not isinstance(error, ChildError | PassingError | InputError | None):
            error = PassingError(f"a worker of the cluster: {error!r}")
        if error is None:
            told.set_result(done.result())
        else:
            told.set_exception(error)

    def _check(self, address: str) -> None:
        told = self._client.run(_about)
        for worker, (version, daemonic) in sorted(told.items()):
            if version != __version__:
                raise InputError(
                    f"--scheduler {address}: its worker {worker} has wheelplane {version}, this is "
                    f"{__version__}: install the same everywhere"
                )
            if daemonic:
                raise InputError(
                    f"--scheduler {address}: its worker {worker} may not start children: set "
                    "DASK_DISTRIBUTED__WORKER__DAEMON=False where `dask worker` is started"
                )


def do_in_child(task: Task, limits: Limits) -> list[Done]:
    """Do a task in the child of this thread of a Dask worker."""
    return _workers(limits).do(task)


@lru_cache(maxsize=1)
def _workers(limits: Limits) -> Workers:
    """The children of this process, one a thread, which end with it."""
    stack = ExitStack()
    scratch = stack.enter_context(scratch_folder())
    threads = _library().get_worker().state.nthreads
    workers = Workers(threads, limits, scratch)
    stack.callback(workers.close)
    atexit.register(stack.close)
    return workers


def _about() -> tuple[str, bool]:
    return __version__, bool(multiprocessing.current_process().daemon)


def _library() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise MissingDependencyError(
            "--scheduler needs the library distributed: pip install 'wheelplane[cluster]'"
        ) from error
