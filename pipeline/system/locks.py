"""Locks on open files, which end with the process that holds them."""

from __future__ import annotations

from typing import Any

fcntl: Any
msvcrt: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None
try:
    import msvcrt
except ImportError:
    msvcrt = None


def acquire(handle: int, wait: bool = True) -> bool:
    """Lock an open file for this process alone, and return whether it did.

    wait: until another process frees it. Where there are no locks, only those who wait go on.
    """
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
        return True
    while msvcrt is not None:
        try:
            msvcrt.locking(handle, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
        except OSError:  # LK_LOCK gives up after 10 s
            if not wait:
                return False
        else:
            return True
    return wait
