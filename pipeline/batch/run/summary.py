"""Summary of a run and of the catalogue, in a few lines."""

from __future__ import annotations

from collections import Counter

from ...errors import printable
from ..catalogue.catalogue import Catalogue
from ..catalogue.rows import STATUSES
from ..plan.shard import ALL, Shard
from ..results.calibration_list import counts as decisions_of
from ..results.calibration_list import unusable
from ..results.query import (
    Filter,
    brief,
    captures,
    count,
    doubted,
    example_in_doubt,
    failures,
)
from .progress import RunCounts
from .work import RECOGNISED, VANISHED

WORST, REASON_LENGTH = 5, 140
DECISIONS = {
    "conform": "conforming",
    "undecided": "undecided",
    "not conform": "nonconforming",
    None: "without a limit",
}


def summary(
    counts: RunCounts, catalogue: Catalogue | None, results: str, shard: Shard = ALL
) -> tuple[str, bool]:
    """Return the text, and whether all captures, of a shard its own, were measured in full.

    Those that are no longer in the archive are left out of the latter. catalogue: None without
    results.
    """
    new = _numbers(counts.done) or "nothing new"
    lines = [f"{counts.known} done before; now: {new}"]
    if counts.passed_over:
        files = ", ".join(
            f"{n} {suffix or 'no suffix'}" for suffix, n in counts.passed_over.items()
        )
        lines.append(f"skipped, not captures: {files}")
    if counts.removed:
        lines.append(
            f"{len(counts.removed)} no longer in the archive; their results are kept: "
            f"wheelplane results {results} --gone"
        )
    if shard.n > 1:  # those of the others may be missing
        lines.append(f"when all shards are done: wheelplane results {results}")
        return "\n".join(lines), catalogue is None or _is_fine(catalogue, shard)
    if catalogue is None:
        return "\n".join(lines), True
    held = Counter({s: count(catalogue, Filter(status=(s,))) for s in STATUSES})
    lines += ["", f"results in {results}: {_numbers(held)}"]
    missing = max(0, counts.finished - held.total())
    if missing:
        lines.append(f"{missing:7} were removed while it ran: repeat the command to measure them")
    failing = failures(catalogue, examples=1)
    for group in failing[:WORST]:
        shown = _short(brief(group.reason, group.examples[0]))
        lines.append(f"{group.count:7} {group.status}, {group.stage or 'wheels'}: {shown}")
        lines.append(f"        such as {group.examples[0]}")
    if len(failing) > WORST:
        rest = sum(group.count for group in failing[WORST:])
        kinds = len(failing) - WORST
        others = f"{rest:7} for {kinds} other reason{'s' * (kinds > 1)}"
        lines.append(f"{others}: wheelplane results {results} --failures")
    if example := example_in_doubt(catalogue):
        name, note = example
        lines.append(f"{doubted(catalogue):7} in doubt, left out of statistics: {_short(note)}")
        lines.append(f"        such as {name}")
    lines += _calibrations(catalogue, results)
    lines += ["", f"next: wheelplane results {results}"]
    return "\n".join(map(printable, lines)), not missing and _is_fine(catalogue, shard)


def _is_fine(catalogue: Catalogue, shard: Shard) -> bool:
    """Return whether each capture of a shard that is in the archive was measured in full."""
    unlike = captures(catalogue, Filter(status=STATUSES[1:], removed=False))
    return not any(shard.holds(row.name) for row in unlike)


def _calibrations(catalogue: Catalogue, results: str) -> list[str]:
    """Return the verdicts on machines beside the scans, and why one has none; nothing without."""
    decided, (without, example, error) = decisions_of(catalogue), unusable(catalogue)
    if not (decided or without):
        return []
    shown = [f"{decided[key]} {word}" for key, word in DECISIONS.items() if key in decided]
    shown += [f"{without} without results"] * (without > 0)
    lines = ["", f"calibrations: {', '.join(shown)}"]
    if without:
        lines.append(f"{without:7} not calibrated: {_short(error)}")
        lines.append(f"        such as {example}: wheelplane results {results} --calibrations")
    return lines


def _short(reason: str) -> str:
    return reason if len(reason) <= REASON_LENGTH else f"{reason[: REASON_LENGTH - 3]}..."


def _numbers(counts: Counter[str]) -> str:
    statuses = (*STATUSES, RECOGNISED.status, VANISHED.status)
    return ", ".join(f"{counts[status]} {status}" for status in statuses if counts[status])
