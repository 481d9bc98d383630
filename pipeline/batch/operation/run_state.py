"""State of the runs that work on results, which each of them writes there while it works."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field

from ...errors import InputError, printable
from ..storage.store import Store

FOLDER = "run/state/"
SILENT_S = 60.0  # a run writes more often
FORGET_S = 86400.0
MOST_SHOWN = 10


@dataclass(frozen=True)
class AtWork:
    """Captures that a worker has been given together, and since when (seconds since 1970)."""

    captures: tuple[str, ...]
    since_s: float
    worker: str


@dataclass
class RunState:
    """State of one run; times in seconds since 1970 by the clock of its machine.

    known, todo: captures done before, and to be done when it began. done: by status. failures: by
    status, stage and reason. ended: how; empty while it works.
    """

    runner: str
    shard: str
    started_s: float
    updated_s: float
    known: int = 0
    todo: int = 0
    done: dict[str, int] = field(default_factory=dict)
    failures: dict[str, int] = field(default_factory=dict)
    at_work: tuple[AtWork, ...] = ()
    ended: str = ""

    @property
    def finished(self) -> int:
        """Number of captures done by this run."""
        return sum(self.done.values())

    @property
    def rate(self) -> float:
        """Captures per second."""
        return self.finished / max(1e-3, self.updated_s - self.started_s)


def write_state(results: Store, name: str, state: RunState) -> None:
    """Write or replace the state of a run."""
    results.write(f"{FOLDER}{name}.json", (json.dumps(asdict(state), indent=1) + "\n").encode())


def read_states(results: Store) -> Iterator[tuple[str, RunState]]:
    """Yield the files of the runs' states, and the states."""
    for entry in results.list(FOLDER):
        try:
            tree = json.loads(results.read(entry.name))
            tree["at_work"] = tuple(
                AtWork(tuple(one["captures"]), one["since_s"], one["worker"])
                for one in tree["at_work"]
            )
            yield entry.name, RunState(**tree)
        except (InputError, ValueError, TypeError, KeyError):
            continue  # just removed, or of another version


def forget_states(results: Store) -> None:
    """Remove the states of runs that ended, or gave no sign for a day."""
    for name, state in read_states(results):
        if state.ended or time.time() - state.updated_s > FORGET_S:
            results.remove(name)


def states_text(results: Store) -> str:
    """Return the states of all runs as lines, those at work first."""
    states = sorted(read_states(results), key=lambda each: (bool(each[1].ended), each[0]))
    if not states:
        return f"{results.url}: no run has begun"
    now_s = time.time()
    return "\n".join(map(printable, (line for _, one in states for line in _lines(one, now_s))))


def _lines(state: RunState, now_s: float) -> Iterator[str]:
    shard = "" if state.shard == "1/1" else f", shard {state.shard}"
    yield f"{state.runner}{shard}: {_standing(state, now_s)}"
    done = ", ".join(f"{count:,} {status}" for status, count in sorted(state.done.items()))
    left = max(0, state.todo - state.finished)
    yield f"  {state.known:,} done before; now {done or 'none'}; {left:,} to do"
    for one in () if state.ended else sorted(state.at_work, key=lambda one: one.since_s):
        others = f" and {len(one.captures) - 1} small ones" * (len(one.captures) > 1)
        since = duration(now_s - one.since_s)
        yield f"  at work: {one.captures[0]}{others}, for {since}, {one.worker}"
    failures = sorted(state.failures.items(), key=lambda item: (-item[1], item[0]))
    for reason, count in failures[:MOST_SHOWN]:
        yield f"{count:7,} {reason}"


def _standing(state: RunState, now_s: float) -> str:
    """Return in words whether a run works, how fast, and how long it will take."""
    took = duration(state.updated_s - state.started_s)
    if state.ended:
        return f"{state.ended} after {took}, {duration(now_s - state.updated_s)} ago"
    silent_s = now_s - state.updated_s
    if silent_s > SILENT_S:
        return f"no sign for {duration(silent_s)}: killed, or its machine is not reached"
    left = state.todo - state.finished
    rest = f", {duration(left / state.rate)} left" if state.finished and left > 0 else ""
    return f"running for {took}, {state.rate:.3g}/s{rest}"


def duration(seconds: float) -> str:
    """Format a time in its unit."""
    if seconds < 90:
        return f"{max(0.0, seconds):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
