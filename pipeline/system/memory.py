"""Memory of the machine and of this process, and its limit.

Linux reports both in /proc and limits it. Elsewhere the machine's size is known, and nothing is
limited: a limit counts from what the process holds at its start.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

resource: Any
try:
    import resource
except ImportError:  # Windows
    resource = None

UNKNOWN = 1 << 62
MAPPED, DATA = 0, 5  # columns of /proc/self/statm, proc(5)
# Parameters of mallopt(3) and their values: free memory at the top of the heap that is kept, and
# size from which an array is mapped on its own.
HELD = {-1: 64 << 20, -3: 4 << 20}


def machine_bytes() -> int:
    """Return the memory of the machine, or of the control group that this process is in."""
    total = _physical_bytes()
    with suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return total


def free_bytes() -> int:
    """Return the free memory of the machine; all its memory where only that is known."""
    with suppress(OSError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) << 10
    return (_windows_bytes() or (0, machine_bytes()))[1]


def unlimited_bytes() -> int:
    """Return the bytes that the limits of this process still allow it."""
    least = UNKNOWN
    if resource is not None:
        for kind, column in ((resource.RLIMIT_AS, MAPPED), (resource.RLIMIT_DATA, DATA)):
            limit = resource.getrlimit(kind)[0]
            if limit != resource.RLIM_INFINITY:
                least = min(least, limit - (_held_bytes(column) or 0))
    return least


def peak_bytes() -> int:
    """Return the most memory that this process has held; 0 where that is not known."""
    if resource is None:
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * unit


@contextmanager
def memory_limit(more_bytes: int) -> Iterator[None]:
    """Allow that many bytes beyond what the process holds now, where the system can limit them."""
    held = _held_bytes(DATA)
    if resource is None or held is None:
        yield
        return
    before, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = held + more_bytes
    if resource.RLIM_INFINITY not in (before, hard):
        most = min(most, before)
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (before, hard))


def hold_freed() -> None:
    """Keep memory that was freed for the arrays that follow, up to what HELD says (glibc).

    The system hands out each page of new memory anew, which takes longer than arithmetic in it.
    """
    with suppress(AttributeError, OSError, TypeError):
        library = ctypes.CDLL(None)
        for parameter, size in HELD.items():
            library.mallopt(parameter, size)


def give_back() -> None:
    """Give memory that was freed back to the system, where glibc would keep it for later."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def share_memory(processes: int) -> None:
    """Leave this process, one of so many, its share of what the limits still allow."""
    held = _held_bytes(DATA)
    if resource is not None and held is not None and (left := unlimited_bytes()) < UNKNOWN:
        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        resource.setrlimit(resource.RLIMIT_DATA, (held + max(left, 0) // processes, hard))


def _held_bytes(column: int) -> int | None:
    """Return what counts for a limit: memory that is mapped, or private and written to."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[column])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


def _physical_bytes() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return (_windows_bytes() or (UNKNOWN, 0))[0]


def _windows_bytes() -> tuple[int, int] | None:
    """Return all and free memory as Windows reports it; None elsewhere."""
    import ctypes

    windll = getattr(ctypes, "windll", None)
    if windll is None:
        return None
    status = (ctypes.c_uint64 * 8)(64)  # MEMORYSTATUSEX: its size and the load, all, free, ...
    if not windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
        return None
    return status[1], status[2]
