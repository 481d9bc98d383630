"""Error messages that several readers share: the file, the fact, and what to do."""

from __future__ import annotations

from ..errors import InputError
from .source import Source


def fault(source: Source, fact: str, action: str = "export the scan again") -> InputError:
    """Return the error of one line: the file, the fact, what to do."""
    return InputError(f"{source.name}: {fact}: {action}")


def too_many(source: Source, most: int, noun: str) -> InputError:
    """Return the error for a small file that takes long to read: too many lines, blocks ..."""
    return fault(source, f"it has more than {most} {noun}", "split it or export it again")


def too_short(source: Source, declared: int, held: int, noun: str = "points") -> InputError:
    """Return the error for a file that ends before all that its header declares."""
    return InputError(
        f"{source.name}: the header declares {declared} {noun}, the file holds {held}: "
        "the copy is incomplete; copy it again"
    )


def too_long(source: Source, declared: int, extra: str, noun: str = "points") -> InputError:
    """Return the error for a file that continues after all that its header declares."""
    return InputError(
        f"{source.name}: the header declares {declared} {noun}, but {extra} follow that it does "
        "not explain: the count is wrong; export the scan again"
    )
