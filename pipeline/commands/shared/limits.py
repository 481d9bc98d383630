"""Limits of memory and time of a command that reads files in this process."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import click

from ...errors import InputError, TimeLimitError
from ...system import machine_bytes, memory_limit, time_limit
from .options import FiniteRange

TOO_MUCH = 2.0**62  # bytes
SECONDS = FiniteRange(1, 1e6)  # 11 days
MEMORY = re.compile(r"(\d+(?:\.\d+)?)\s*([KMGT])i?B?", re.IGNORECASE)


def limited(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --timeout and --memory to a command, and run it within them."""

    @click.option(
        "--timeout", type=SECONDS, default=3600.0, show_default=True,
        metavar="SECONDS", help="Time limit, after which it ends.",
    )  # fmt: skip
    @click.option(
        "--memory", metavar="SIZE",
        help="Memory limit, such as 4G; by default, nine tenths of the machine's.",
    )  # fmt: skip
    @wraps(command)
    def run(*values: Any, timeout: float, memory: str | None, **options: Any) -> Any:
        with within(timeout, memory, "measure fewer points"):
            return command(*values, **options)

    return run


def size_in_bytes(size: str | None) -> int | None:
    """Return the bytes of a size such as 900M. Raises InputError."""
    if size is None:
        return None
    match = MEMORY.fullmatch(size)
    number = float(match[1]) * 2 ** (10 * (1 + "KMGT".index(match[2].upper()))) if match else 0.0
    if not 2.0**20 <= number < TOO_MUCH:
        raise InputError(f"--memory {size}: a size such as 900M or 4G is needed")
    return int(number)


@contextmanager
def within(seconds: float, memory: str | None, advice: str) -> Iterator[None]:
    """Allow that many seconds, and memory beyond what the process holds now.

    memory: nine tenths of the machine's if None. advice: what needs less. Raises InputError that
    names the option, once all temporary files have been removed.
    """
    more_bytes = size_in_bytes(memory) or int(0.9 * machine_bytes())
    try:
        with memory_limit(more_bytes), time_limit(seconds, TimeLimitError):
            yield
    except TimeLimitError:
        raise InputError(f"it takes more than {seconds:g} s: allow more by --timeout") from None
    except MemoryError:
        raise InputError(
            f"it needs more than {more_bytes / 2**20:.0f} MB of memory: allow more by --memory, "
            f"or {advice} at once"
        ) from None
