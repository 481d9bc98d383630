"""Times of measurements by stage: written beside the results, which are the same however long."""

from __future__ import annotations

import heapq
import json
import math
import time
import uuid
from collections.abc import Iterator

from ...errors import printable
from ...system import STAGES, frozen
from ..storage.store import Store

FOLDER = "run/times/"
FLUSH_S, FLUSH_LINES = 60.0, 2000
STEP_S = 1e-4  # of the bound in a file's name
# In the order of the flow; "other": unpacking and the rest of the measurement. Earlier versions
# wrote "measure" for all of it.
HEADS = ("copy", "identify", *STAGES, "other", "measure")


@frozen
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
        self._added: list[CaptureTime] = []
        self._flushed_s = time.monotonic()

    def add(self, one: CaptureTime) -> None:
        """Add the times of a capture."""
        self._added.append(one)
        if len(self._added) >= FLUSH_LINES or time.monotonic() > self._flushed_s + FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Write what was added to the results, longest first, with a bound of it in the name."""
        if self._added:
            ordered = sorted(self._added, key=lambda one: one.total_s, reverse=True)
            lines = [[one.name, one.key, one.seconds, one.memory_bytes] for one in ordered]
            text = "".join(json.dumps(line) + "\n" for line in lines)
            bound = math.ceil(ordered[0].total_s / STEP_S)
            name = f"{FOLDER}{bound:010d}-{uuid.uuid4().hex}.jsonl"
            self._results.write_new(name, text.encode())
        self._added = []
        self._flushed_s = time.monotonic()


def slowest(results: Store, count: int) -> list[CaptureTime]:
    """Return the measurements that took longest, each result once.

    Files whose bound is below all of them are not read, and damaged lines are passed over.
    """
    found: list[CaptureTime] = []
    for bound_s, name in sorted(((_bound_s(n), n) for n in results.names(FOLDER)), reverse=True):
        if len(found) == count and found[-1].total_s >= bound_s:
            break
        longest: dict[str, CaptureTime] = {one.key: one for one in found}
        for one in _read(results.read(name)):
            if math.isfinite(bound_s) and len(found) == count and one.total_s < found[-1].total_s:
                break
            if one.key not in longest or one.total_s > longest[one.key].total_s:
                longest[one.key] = one
        found = heapq.nlargest(count, longest.values(), key=lambda one: one.total_s)
    return found


def _read(data: bytes) -> Iterator[CaptureTime]:
    """Yield the times of a file in its order."""
    for line in data.splitlines():
        try:
            one = CaptureTime(*json.loads(line))
            known = isinstance(one.name, str) and math.isfinite(one.total_s + one.memory_bytes)
        except (ValueError, TypeError, AttributeError):
            continue
        if known:
            yield one


def _bound_s(name: str) -> float:
    """Return the most that any capture of a file took; no bound for one of an earlier version."""
    bound, dash, _ = name.removeprefix(FOLDER).partition("-")
    return int(bound) * STEP_S if dash and bound.isdecimal() else math.inf


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
