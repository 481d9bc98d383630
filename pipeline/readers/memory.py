"""Whether a cloud fits into memory, asked before anything is allocated."""

from __future__ import annotations

import resource
from pathlib import Path

from .faults import fault
from .source import Source

_RESERVE = 64 << 20  # for the rest of the program


def check_memory(rows: int, row_bytes: int, source: Source) -> None:
    """Raise InputError when `rows` of that many bytes each do not fit."""
    needed, free = rows * row_bytes, available_bytes() - _RESERVE
    if needed > free:
        raise fault(
            source,
            f"its {rows} points need {needed / 2**30:.3g} GiB of memory, "
            f"{max(free, 0) / 2**30:.3g} GiB are free",
            "thin the cloud, or use a larger machine",
        )


def available_bytes() -> int:
    """What this process may still allocate: free memory, within its own limit."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    mine = limit - pages * resource.getpagesize() if limit != resource.RLIM_INFINITY else None
    for line in Path("/proc/meminfo").read_text().splitlines():
        if line.startswith("MemAvailable:"):
            machine = int(line.split()[1]) << 10
            return machine if mine is None else min(machine, mine)
    return 1 << 62 if mine is None else mine
