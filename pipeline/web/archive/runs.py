"""State of the runs on a folder of batch results, as they write it there while they work."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from ...batch.operation.run_state import AtWork, RunState, duration, ordered
from ...batch.storage.store import open_store
from ...errors import printable
from ...report.format.language import Translations
from ...report.format.writer import Table
from ..content.panel import table_tree

RENEWED_S = 5  # a run writes as often
ENDS = {"finished": "page.run_finished", "interrupted": "page.run_interrupted"}
WORKER = "worker "


def runs(folder: Path, words: Translations) -> dict[str, Any]:
    """Return the state of each run, those at work first."""
    now_s = time.time()
    states = ordered(open_store(str(folder)))
    return {"runs": [_run(state, now_s, words) for state in states], "renewed_s": RENEWED_S}


def _run(state: RunState, now_s: float, words: Translations) -> dict[str, Any]:
    is_up = state.is_up(now_s)
    rate = words.number(f"{state.rate:.3g}") if state.finished else ""
    left = duration(state.left_s) if is_up and state.left_s is not None else ""
    facts = [
        (words("page.status"), _standing(state, now_s, words)),
        (words("page.run_began"), _ago(now_s - state.started_s, words)),
        (words("page.run_before"), words.count(state.known)),
        (words("page.run_done"), _done(state, words)),
        (words("page.run_todo"), words.count(state.left)),
        (words("page.run_rate"), rate),
        (words("page.run_left"), left),
    ]
    part = "" if state.shard == "1/1" else f", {words('page.run_part')} {state.shard}"
    reasons = state.by_frequency
    return {
        "name": printable(f"{state.runner}{part}"),
        "up": is_up,
        "facts": [[name, value] for name, value in facts if value],
        "work": table_tree(_work(state, now_s, words)) if is_up and state.at_work else None,
        "failures": table_tree(_failures(reasons, words)) if reasons else None,
        "statuses": [reason.partition(",")[0] for reason, _ in reasons],
    }


def _standing(state: RunState, now_s: float, words: Translations) -> str:
    since = now_s - state.updated_s
    if state.ended:
        how = words(ENDS.get(state.ended, "page.run_stopped"))
        return f"{how}, {_ago(since, words)}"
    if not state.is_up(now_s):
        return words("page.run_silent", time=duration(since))
    return words("page.run_running")


def _ago(seconds: float, words: Translations) -> str:
    return words("page.run_ago", time=duration(seconds))


def _done(state: RunState, words: Translations) -> str:
    return ", ".join(
        f"{words.count(count)} {words.texts.get(f'page.{status}', status)}"
        for status, count in sorted(state.done.items())
    )


def _work(state: RunState, now_s: float, words: Translations) -> Table:
    """Return the captures at work, the oldest first."""
    head = [words("page.captures").lower(), words("page.run_for"), words("page.run_worker")]
    rows = [
        [_captures(one, words), duration(now_s - one.since_s), _worker(one.worker, words)]
        for one in sorted(state.at_work, key=lambda one: one.since_s)
    ]
    return Table(head, rows, 1, words("page.run_work"))


def _captures(one: AtWork, words: Translations) -> str:
    name, *others = map(printable, one.captures)
    if not others:
        return name
    return words("page.run_small", name=name, count=words.count(len(others)))


def _worker(name: str, words: Translations) -> str:
    number = name.removeprefix(WORKER)
    return f"{words('page.run_worker')} {number}" if number != name else words("page.run_cluster")


def _failures(reasons: list[tuple[str, int]], words: Translations) -> Table:
    rows = [[words.count(count), printable(reason)] for reason, count in reasons]
    head = [words("page.count"), words("page.reason")]
    return Table(head, rows, 2, words("page.failures"), ["not-conform"] * len(rows))
