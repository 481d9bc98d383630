"""Times of measurements by stage: written beside the results, which are the same however long."""

from __future__ import annotations

import heapq
import json
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass

from ...errors import printable
from ...system import STAGES
from ..storage.store import Store

FOLDER = "run/times/"
FLUSH_S, FLUSH_LINES = 60.0, 2000
# In the order of the flow; "other": unpacking and the rest of the measurement. Earlier versions
# wrote "measure" for all of it.
HEADS = ("copy", "identify", *STAGES, "other", "measure")


@dataclass(frozen=True)
class CaptureTime:
    """Seconds of a capture's measurement by stage, and the most memory of its worker process."""

    name: str
    key: str
    seconds: dict[str, float]
    memory_bytes: int

    @property
    def total_s(self) -> float:
        """Seconds of all stages."""
        return sum(self.seconds.values())


class Times:
    """Times that one process collects; call `flush` at the end."""

    def __init__(self, results: Store) -> None:
        self._results = results
        self._lines: list[str] = []
        self._flushed_s = time.monotonic()

    def add(self, one: CaptureTime) -> None:
        """Add the times of a capture."""
        self._lines.append(json.dumps([one.name, one.key, one.seconds, one.memory_bytes]))
        if len(self._lines) >= FLUSH_LINES or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Write what was added to the results."""
        if self._lines:
            text = "\n".join(self._lines) + "\n"
            self._results.write_new(f"{FOLDER}{uuid.uuid4().hex}.jsonl", text.encode())
        self._lines = []
        self._flushed_s = time.monotonic()


def slowest(results: Store, count: int) -> list[CaptureTime]:
    """Return the measurements that took longest, each result once."""
    found: dict[str, CaptureTime] = {}
    for one in heapq.nlargest(4 * count, _all(results), key=lambda one: one.total_s):
        found.setdefault(one.key, one)
    return list(found.values())[:count]


def _all(results: Store) -> Iterator[CaptureTime]:
    for entry in results.list(FOLDER):
        for line in results.read(entry.name).splitlines():
            yield CaptureTime(*json.loads(line))


def slow_text(found: list[CaptureTime]) -> str:
    """Format the times as a table, in seconds and MB."""
    if not found:
        return "No times: these results were written by an earlier version, or none was measured."
    width = max(len("capture"), *(len(printable(one.name)) for one in found))
    heads = [head for head in HEADS if any(head in one.seconds for one in found)]
    lines = [f"{'capture':{width}}  {'s':>8}  " + "  ".join(f"{h:>8}" for h in heads) + "      MB"]
    for one in found:
        stages = "  ".join(f"{one.seconds.get(head, 0.0):8.2f}" for head in heads)
        memory = f"{one.memory_bytes / 1e6:6.0f}"
        lines.append(f"{printable(one.name):{width}}  {one.total_s:8.2f}  {stages}  {memory}")
    return "\n".join(lines)
