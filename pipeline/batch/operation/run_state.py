"""State of the runs that work on results, which each of them writes there while it works."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field

from ...errors import InputError, printable
from ...system import frozen
from ..storage.store import Store

FOLDER = "run/state/"
SILENT_S = 60.0  # a run writes more often
FORGET_S = 86400.0
MOST_SHOWN = 10


@frozen
class AtWork:
    """Captures that a worker has been given together, and since when (seconds since 1970)."""

    captures: tuple[str, ...]
    since_s: float
    worker: str


@dataclass
class RunState:
    """State of one run; times in seconds since 1970 by the clock of its machine.

    known, todo: captures done before, and to be done when it began. expected_s, worked_s: seconds
    expected of all these, and of those of them that are done (`FoundCapture.expected_s`). done: by
    status. failures: by status, stage and reason. ended: how; empty while it works.
    """

    runner: str
    shard: str
    started_s: float
    updated_s: float
    known: int = 0
    todo: int = 0
    expected_s: float = 0.0
    worked_s: float = 0.0
    done: dict[str, int] = field(default_factory=dict)
    failures: dict[str, int] = field(default_factory=dict)
    at_work: tuple[AtWork, ...] = ()
    ended: str = ""

    @property
    def finished(self) -> int:
        """Number of captures done by this run."""
        return sum(self.done.values())

    @property
    def left(self) -> int:
        """Number of captures still to be done."""
        return max(0, self.todo - self.finished)

    @property
    def left_s(self) -> float | None:
        """Seconds until all are done; None while that is unknown, and at the end."""
        took_s = self.updated_s - self.started_s
        return remaining_s(took_s, self.worked_s, self.expected_s) if self.left else None

    def is_up(self, now_s: float) -> bool:
        """Return whether it works, and gave a sign within SILENT_S."""
        return not self.ended and now_s - self.updated_s <= SILENT_S

    @property
    def by_frequency(self) -> list[tuple[str, int]]:
        """Reasons of failures with their counts, at most MOST_SHOWN."""
        found = sorted(self.failures.items(), key=lambda item: (-item[1], item[0]))
        return found[:MOST_SHOWN]

    @property
    def rate(self) -> float:
        """Captures per second."""
        return self.finished / max(1e-3, self.updated_s - self.started_s)


def remaining_s(took_s: float, worked_s: float, expected_s: float) -> float | None:
    """Return how long the rest takes, if what was expected to take worked_s took took_s."""
    return took_s * max(0.0, expected_s / worked_s - 1.0) if worked_s > 0.0 else None


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
    states = ordered(results)
    if not states:
        return f"{results.url}: no run has begun"
    now_s = time.time()
    return "\n".join(map(printable, (line for one in states for line in _lines(one, now_s))))


def ordered(results: Store) -> list[RunState]:
    """Return the states of all runs, those at work first."""
    states = sorted(read_states(results), key=lambda each: (bool(each[1].ended), each[0]))
    return [state for _, state in states]


def _lines(state: RunState, now_s: float) -> Iterator[str]:
    shard = "" if state.shard == "1/1" else f", shard {state.shard}"
    yield f"{state.runner}{shard}: {_standing(state, now_s)}"
    done = ", ".join(f"{count:,} {status}" for status, count in sorted(state.done.items()))
    # of a run that was cut short, workers may have written results that it did not hear of
    cut = state.left and not state.is_up(now_s)
    least, none, most = ("at least ", "0", "at most ") if cut else ("", "none", "")
    yield f"  {state.known:,} done before; now {least}{done or none}; {most}{state.left:,} to do"
    for one in () if state.ended else sorted(state.at_work, key=lambda one: one.since_s):
        others = f" and {len(one.captures) - 1} small ones" * (len(one.captures) > 1)
        since = duration(now_s - one.since_s)
        yield f"  at work: {one.captures[0]}{others}, for {since}, {one.worker}"
    for reason, count in state.by_frequency:
        yield f"{count:7,} {reason}"


def _standing(state: RunState, now_s: float) -> str:
    """Return in words whether a run works, how fast, and how long it will take."""
    took = duration(state.updated_s - state.started_s)
    if state.ended:
        return f"{state.ended} after {took}, {duration(now_s - state.updated_s)} ago"
    if not state.is_up(now_s):
        silent = duration(now_s - state.updated_s)
        return f"no sign for {silent}: killed, or its machine is not reached"
    rest = "" if state.left_s is None else f", {duration(state.left_s)} left"
    return f"running for {took}, {state.rate:.3g}/s{rest}"


def duration(seconds: float) -> str:
    """Format a time in its unit."""
    if seconds < 90:
        return f"{max(0.0, seconds):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
