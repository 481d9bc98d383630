"""Check that a cloud fits into memory, before anything is allocated."""

from __future__ import annotations

import resource
from pathlib import Path

from .faults import fault
from .source import Source

_RESERVE = 64 << 20  # for the rest of the program


def check_memory(rows: int, row_bytes: int, source: Source) -> None:
    """Raise InputError when `rows` rows of `row_bytes` bytes do not fit into free memory."""
    needed, free = rows * row_bytes, available_bytes() - _RESERVE
    if needed > free:
        raise fault(
            source,
            f"its {rows} points need {needed / 2**30:.3g} GiB of memory, "
            f"{max(free, 0) / 2**30:.3g} GiB are free",
            "thin the cloud, or use a larger machine",
        )


def available_bytes() -> int:
    """Return the bytes this process may still allocate: free memory, within its own limit."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    own = limit - pages * resource.getpagesize() if limit != resource.RLIM_INFINITY else None
    for line in Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable:"):
            machine = int(line.split()[1]) << 10
            return machine if own is None else min(machine, own)
    return 1 << 62 if own is None else own
