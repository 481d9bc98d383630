"""Files mapped into memory, whose content no other process changes meanwhile."""

from __future__ import annotations

import mmap
import signal
from contextlib import suppress
from io import BufferedReader

from .locks import fcntl


def lent(stream: BufferedReader) -> mmap.mmap | None:
    """Map an open file into memory; None where the system does not lend it.

    A process that reads a mapped file which another has cut is killed. So the file must be on a
    lease, which Linux gives to its owner while nobody writes to it: whoever opens it for writing
    waits until it is no longer mapped, 45 s at most (F_SETLEASE of fcntl(2)).
    """
    if not hasattr(fcntl, "F_SETLEASE"):
        return None
    with suppress(OSError):
        fcntl.fcntl(stream, fcntl.F_SETSIG, signal.SIGURG)  # SIGIO would end the process
        fcntl.fcntl(stream, fcntl.F_SETLEASE, fcntl.F_RDLCK)
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)  # holds the file open
    return None
