"""Work on several items at once in forked processes, which send back what they find."""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import Generic, NoReturn, TypeVar, cast

from ..errors import InputError
from ..system import add_taken, give_back, share_memory, signals, taken
from .native import load_opencv

S = TypeVar("S")
T = TypeVar("T")

LATE = ("numpy.fft", "numpy.ma")  # numpy imports them at its first transform and median


def can_fork() -> bool:
    """Return whether a fork is safe: no other thread of Python may hold a lock at that moment."""
    forks = hasattr(os, "fork") and sys.platform != "darwin"  # whose libraries are not made for it
    return forks and threading.active_count() == 1


def in_processes(
    work: Callable[[S], T],
    items: Sequence[S],
    workers: int,
    environment: Mapping[str, str],
    begins: Callable[[S], object],
) -> list[T]:
    """Call `work` on each item in so many processes, each of which takes one item after another.

    environment: their variables that are different from this one's. begins: called here with each
    item, in their order, before its work. Returns the results in the order of the items; of several
    errors, raises that of the first item.
    """
    _load_ahead()
    found: dict[int, T] = {}
    failed: dict[int, Exception] = {}
    left = iter(range(len(items)))
    with ExitStack() as stack:
        busy: dict[Connection, tuple[Forked[S, T], int]] = {}

        def give(process: Forked[S, T]) -> None:
            k = None if failed else next(left, None)
            if k is not None:
                begins(items[k])
                process.begin(k)
                busy[process.answers] = process, k

        for _ in range(workers):
            process = Forked(work, items, workers, environment)
            stack.callback(process.end)
            give(process)
        while busy:
            for answers in cast(list[Connection], wait(list(busy))):
                process, k = busy.pop(answers)
                try:
                    found[k] = process.result()
                except Exception as error:
                    failed[k] = error
                give(process)
    if failed:
        raise failed[min(failed)]
    return [found[k] for k in range(len(items))]


def _load_ahead() -> None:
    """Import what measuring imports late, once for all processes that are forked afterwards."""
    load_opencv()
    for name in LATE:
        importlib.import_module(name)


class Forked(Generic[S, T]):
    """A process that calls a function on the items that it is given, one after another.

    answers: readable when a result is there. workers: how many such processes share the memory that
    this one may use. environment: its variables that are different there.
    """

    def __init__(
        self,
        function: Callable[[S], T],
        items: Sequence[S],
        workers: int,
        environment: Mapping[str, str],
    ) -> None:
        self.answers, there = Pipe()
        self._process = os.fork()
        if self._process == 0:
            _serve(function, items, workers, environment, self.answers, there)
        there.close()

    def begin(self, k: int) -> None:
        """Begin the call on the item of this number."""
        with suppress(BrokenPipeError):  # it was killed, as its result will say
            self.answers.send(k)

    def result(self) -> T:
        """Return what the function returned, or raise what it raised."""
        try:
            returned, error, seconds = self.answers.recv()
        except (EOFError, ConnectionResetError):
            raise InputError(
                "one of several processes was killed, perhaps for lack of memory: set "
                "WHEELPLANE_THREADS=1, or use a larger machine"
            ) from None
        add_taken(seconds)
        if error is not None:
            raise error
        return cast(T, returned)

    def end(self) -> None:
        """End the process, with what it is doing."""
        with suppress(ChildProcessError, ProcessLookupError):  # where SIGCHLD is ignored
            os.kill(self._process, signal.SIGKILL)
            os.waitpid(self._process, 0)
        self.answers.close()


def _serve(
    function: Callable[[S], object],
    items: Sequence[S],
    workers: int,
    environment: Mapping[str, str],
    answers: Connection,
    there: Connection,
) -> NoReturn:
    """Call the function in the process that was just forked on each item that is named; end.

    answers: the end of the other process, which tells by closing it that it has gone.
    """
    try:
        answers.close()
        os.environ.update(environment)
        for number in signals("SIGINT", "SIGTERM", "SIGHUP"):
            signal.signal(number, signal.SIG_DFL)
        share_memory(workers)
        taken()
        while True:
            _send(there, (*_answer(function, items[there.recv()]), taken()))
            give_back()
    finally:  # the other end is closed, too
        os._exit(0)


def _send(there: Connection, answer: tuple[object, Exception | None, dict[str, float]]) -> None:
    """Send an answer; of one that cannot be sent, why."""
    try:
        there.send(answer)
    except (TypeError, ValueError, AttributeError, pickle.PicklingError) as error:
        there.send((None, RuntimeError(f"no answer of a process: {error}"), answer[2]))


def _answer(function: Callable[[S], T], item: S) -> tuple[T | None, Exception | None]:
    """Return what the function returns, and what it raises."""
    try:
        return function(item), None
    except Exception as error:
        error.add_note(traceback.format_exc())
        return None, error
