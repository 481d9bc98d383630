"""Check that a cloud fits into memory, before anything is allocated."""

from __future__ import annotations

import os
import resource
from contextlib import suppress
from pathlib import Path

from .faults import fault
from .source import Source

_RESERVE = 64 << 20  # for the rest of the program
_MAPPED, _DATA = 0, 5  # columns of /proc/self/statm, proc(5)


def check_memory(rows: int, row_bytes: int, source: Source) -> None:
    """Raise InputError when `rows` rows of `row_bytes` bytes do not fit into free memory."""
    needed, free = rows * row_bytes, available_bytes() - _RESERVE
    if needed > free:
        raise fault(
            source,
            f"its {rows} points need {needed / 2**30:.3g} GiB of memory, "
            f"{max(free, 0) / 2**30:.3g} GiB are free",
            remedy("the cloud"),
        )


def remedy(what: str) -> str:
    """Return what helps against a lack of memory."""
    more = "allow more by --memory" if _own_bytes() < _free_bytes() else "use a larger machine"
    return f"thin {what}, or {more}"


def available_bytes() -> int:
    """Return the bytes this process may still allocate: free memory, within its own limits."""
    return min(_free_bytes(), _own_bytes())


def _own_bytes() -> int:
    own = 1 << 62
    for kind, column in ((resource.RLIMIT_AS, _MAPPED), (resource.RLIMIT_DATA, _DATA)):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY:
            left = limit - _pages(column) * resource.getpagesize()
            own = min(own, left)
    return own


def _free_bytes() -> int:
    for line in Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) << 10
    return 1 << 62


def machine_bytes() -> int:
    """Return the memory of the machine, or of the control group that this process is in."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    with suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return total


def held_bytes() -> int:
    """Return what counts for RLIMIT_DATA: private memory that can be written."""
    return _pages(_DATA) * resource.getpagesize()


def _pages(column: int) -> int:
    return int(Path("/proc/self/statm").read_text().split()[column])
