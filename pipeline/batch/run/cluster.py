"""Engine of a Dask cluster: each task runs in a worker process on one of its workers."""

from __future__ import annotations

import atexit
import importlib
import logging
import multiprocessing
import time
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from functools import lru_cache
from typing import Any

from ... import __version__
from ...errors import InputError, MissingDependencyError
from ..operation.run_state import AtWork
from ..storage.scratch import scratch_folder
from .measure_one import EngineLostError, TransientError
from .work import CompletedCapture, Task
from .worker_process import WorkerError
from .workers import Limits, Workers

CONNECT_S, WAIT_S = 10.0, 120.0


class Cluster:
    """Workers of the Dask scheduler at an address."""

    def __init__(self, address: str, limits: Limits) -> None:
        self._distributed = _library()
        for name in ("distributed", "distributed.client", "asyncio"):  # which print tracebacks of
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what is reported here
        self._address, self._limits = address, limits
        self._at_work: dict[int, AtWork] = {}
        self._slots, self._is_lost = 1, False
        self._connect()

    def _connect(self) -> None:
        address = self._address
        try:
            self._client: Any = self._distributed.Client(
                address, timeout=CONNECT_S, set_as_default=False
            )
            self._check(address)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {address}: no Dask scheduler answers: start one with "
                "`dask scheduler`, or check the address"
            ) from error

    def _connect_again(self) -> None:
        """Wait for the scheduler to be started again. Raises InputError after WAIT_S."""
        end_s = time.monotonic() + WAIT_S
        while self._is_lost:
            with suppress(OSError):  # it does not end in time
                self._client.close(timeout=1.0)
            try:
                self._connect()
                self._is_lost = False
            except InputError as error:
                if time.monotonic() > end_s:
                    fact = "the Dask scheduler is lost: start it and repeat the command"
                    raise InputError(fact) from error
                time.sleep(1.0)

    @property
    def slots(self) -> int:
        """Number of threads of all workers connected so far."""
        if not self._is_lost:
            with suppress(OSError):  # just lost, which the tasks will report
                self._slots = max(1, sum(map(int, self._client.nthreads().values())))
        return self._slots

    def submit(self, task: Task) -> Future[list[CompletedCapture]]:
        """Submit a task; a lost Dask worker is reported as a worker process that was killed.

        Waits for a lost scheduler, whose tasks end with EngineLostError.
        """
        if self._is_lost:
            self._connect_again()
        result: Future[list[CompletedCapture]] = Future()
        names = tuple(found.name for found in task.captures)
        self._at_work[id(result)] = AtWork(names, time.time(), "given to the cluster")
        result.add_done_callback(lambda done: self._at_work.pop(id(done), None))
        sent = self._client.submit(run_in_worker, task, self._limits, pure=False)
        sent.add_done_callback(lambda done: self._forward(done, result))
        return result

    @property
    def at_work(self) -> tuple[AtWork, ...]:
        """Captures given to the cluster and not yet done."""
        return tuple(self._at_work.copy().values())

    def close(self) -> None:
        """Cancel the tasks not yet done."""
        if not self._is_lost:
            self._client.close()

    def _forward(self, sent: Any, result: Future[list[CompletedCapture]]) -> None:
        """Give `result` what became of a task sent, the cluster's future, which is done."""
        try:
            result.set_result(sent.result(timeout=WAIT_S))
        except (WorkerError, TransientError, InputError) as error:
            result.set_exception(error)
        except self._distributed.KilledWorker:
            text = "the Dask workers that measured it were lost"
            result.set_exception(WorkerError("killed", text))
        except Exception as error:
            if sent.status == "error":
                result.set_exception(TransientError(f"a worker of the cluster: {error!r}"))
                return
            self._is_lost |= sent.client is self._client
            fact = f"the Dask scheduler is lost: waiting for it up to {WAIT_S:.0f} s"
            result.set_exception(EngineLostError(fact))

    def _check(self, address: str) -> None:
        about = self._client.run(_about)
        for worker, (version, daemonic) in sorted(about.items()):
            if version != __version__:
                raise InputError(
                    f"--scheduler {address}: its worker {worker} has wheelplane {version}, this "
                    f"machine {__version__}: install the same version everywhere"
                )
            if daemonic:
                raise InputError(
                    f"--scheduler {address}: its worker {worker} may not start processes: set "
                    "DASK_DISTRIBUTED__WORKER__DAEMON=False where `dask worker` is started"
                )


def run_in_worker(task: Task, limits: Limits) -> list[CompletedCapture]:
    """Run a task in the worker process of this thread of a Dask worker."""
    return _workers(limits).run(task)


@lru_cache(maxsize=1)
def _workers(limits: Limits) -> Workers:
    """Return the worker processes of this process, one per thread, which end with it."""
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
            "--scheduler needs the library distributed: run pip install 'wheelplane[cluster]'"
        ) from error
