"""The sentences that several families of readers say about a file they refuse."""

from __future__ import annotations

from ..errors import InputError
from .source import Source


def fault(source: Source, fact: str, mend: str = "export the scan again") -> InputError:
    """One line: the file, the fact, the mend."""
    return InputError(f"{source.name}: {fact}: {mend}")


def too_many(source: Source, most: int, noun: str) -> InputError:
    """A small file that would take long: each of these costs time of its own."""
    return fault(source, f"it has more than {most} {noun}", "split it or export it again")


def too_short(source: Source, declared: int, held: int, noun: str = "points") -> InputError:
    """The file ends before what its header declares."""
    return InputError(
        f"{source.name}: the header declares {declared} {noun}, the file holds {held}: "
        "the copy is incomplete; copy it again"
    )


def too_long(source: Source, declared: int, extra: str, noun: str = "points") -> InputError:
    """The file goes on after what its header declares."""
    return InputError(
        f"{source.name}: the header declares {declared} {noun}, but {extra} follow that it does "
        "not explain: the count is wrong; export the scan again"
    )
