"""Seconds of the stages of a measurement, each without those of the stages called inside it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

STAGES = ("read", "segment", "plane", "centre", "angles", "report")  # in the order of the flow

_seconds: dict[str, float] = {}
_adding = threading.Lock()
_inside = threading.local()  # seconds of the stages called inside the one that is open


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Add the time of a function, or of a context, to the stage of this name."""
    before, began_s = getattr(_inside, "s", 0.0), time.perf_counter()
    _inside.s = 0.0
    try:
        yield
    finally:
        took_s = time.perf_counter() - began_s
        with _adding:
            _seconds[name] = _seconds.get(name, 0.0) + took_s - _inside.s
        _inside.s = before + took_s


def taken() -> dict[str, float]:
    """Return the seconds by stage since the last call, of all threads of this process."""
    with _adding:
        found = {name: _seconds[name] for name in STAGES if name in _seconds}
        _seconds.clear()
    return found


def add_taken(seconds: dict[str, float]) -> None:
    """Add seconds by stage that another process has taken."""
    with _adding:
        for name, took_s in seconds.items():
            _seconds[name] = _seconds.get(name, 0.0) + took_s
