"""Check that a cloud fits into memory, before anything is allocated."""

from __future__ import annotations

from ..system import free_bytes, unlimited_bytes
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
            remedy("the cloud"),
        )


def remedy(what: str) -> str:
    """Return what helps against a lack of memory."""
    more = "allow more by --memory" if unlimited_bytes() < free_bytes() else "use a larger machine"
    return f"thin {what}, or {more}"


def available_bytes() -> int:
    """Return the bytes this process may still allocate: free memory, within its own limits."""
    return min(free_bytes(), unlimited_bytes())
