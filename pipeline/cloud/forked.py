"""Calls in forked processes, which hold this process's arrays and send back what they return."""

from __future__ import annotations

import importlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection, Pipe
from typing import Generic, NoReturn, TypeVar, cast

from ..errors import InputError
from ..system import add_taken, share_memory, signals, taken
from .native import load_opencv

R = TypeVar("R")
T = TypeVar("T")

LATE = ("numpy.fft", "numpy.ma")  # numpy imports them at its first transform and median


def can_fork() -> bool:
    """Return whether a fork is safe: no other thread of Python may hold a lock at that moment."""
    forks = hasattr(os, "fork") and sys.platform != "darwin"  # whose libraries are not made for it
    return forks and threading.active_count() == 1


def load_ahead() -> None:
    """Import what measuring imports late, once for all processes that are forked afterwards."""
    load_opencv()
    for name in LATE:
        importlib.import_module(name)


class Forked(Generic[T]):
    """Call of a function in a process of its own, begun; its result is asked for as of a Future.

    workers: how many such processes share the memory that this one may use. environment: its
    variables that are different there.
    """

    def __init__(
        self, function: Callable[[R], T], value: R, workers: int, environment: Mapping[str, str]
    ) -> None:
        self._answer, answers = Pipe(duplex=False)
        self._process = os.fork()
        if self._process == 0:
            os.environ.update(environment)
            _serve(function, value, workers, answers)
        answers.close()

    def result(self) -> T:
        """Return what the function returned, or raise what it raised."""
        try:
            returned, error, seconds = self._answer.recv()
        except EOFError:
            raise InputError(
                "one of several processes was killed, perhaps for lack of memory: set "
                "WHEELPLANE_THREADS=1, or use a larger machine"
            ) from None
        finally:
            self.cancel()
        add_taken(seconds)
        if error is not None:
            raise error
        return cast(T, returned)

    def cancel(self) -> None:
        """End the process, whose result is here or no longer wanted."""
        os.kill(self._process, signal.SIGKILL)
        os.waitpid(self._process, 0)
        self._answer.close()


def _serve(
    function: Callable[[R], object], value: R, workers: int, answers: Connection
) -> NoReturn:
    """Call the function in the process that was just forked, send what it returns, and end."""
    try:
        for number in signals("SIGINT", "SIGTERM", "SIGHUP"):
            signal.signal(number, signal.SIG_DFL)
        share_memory(workers)
        taken()
        try:
            answer: tuple[object, Exception | None] = function(value), None
        except Exception as error:
            error.add_note(traceback.format_exc())
            answer = None, error
        answers.send((*answer, taken()))
    finally:
        os._exit(0)
