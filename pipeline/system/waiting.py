"""Waiting within a time: for what a pipe brings, and for work."""

from __future__ import annotations

import os
import select
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


def read_within(descriptor: int, size: int, seconds: float) -> bytes:
    """Return the next bytes of a pipe, `size` at most; b"" at its end. Raises TimeoutError."""
    if hasattr(select, "poll"):
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        if not poll.poll(max(0.0, seconds) * 1000.0):
            raise TimeoutError
        return os.read(descriptor, size)
    read: list[bytes] = []
    reader = threading.Thread(
        target=lambda: read.append(os.read(descriptor, size)), daemon=True
    )  # ends with the pipe, if it is not waited for
    reader.start()
    reader.join(max(0.0, seconds))
    if not read:
        raise TimeoutError
    return read[0]


@contextmanager
def time_limit(seconds: float, error: type[BaseException]) -> Iterator[None]:
    """Raise the error in the main thread, if this is it, once the time is over."""
    if threading.current_thread() is not threading.main_thread():
        yield
    elif hasattr(signal, "setitimer"):

        def end(_number: int, _frame: FrameType | None) -> None:
            raise error

        handler = signal.signal(signal.SIGALRM, end)
        try:
            signal.setitimer(signal.ITIMER_REAL, seconds)
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, handler)
    else:
        timer = threading.Timer(seconds, _raise_in_thread, (threading.get_ident(), error))
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()


def _raise_in_thread(thread: int, error: type[BaseException]) -> None:
    """Raise the error in a thread, before its next instruction of Python."""
    import ctypes

    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))
