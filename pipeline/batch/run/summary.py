"""What a run did and what the catalogue holds, in a few lines."""

from __future__ import annotations

from collections import Counter

from ..catalogue.catalogue import Catalogue
from ..plan.shard import ALL, Shard
from ..results.query import STATUSES, Filter, count, failures
from .progress import RunCounts

WORST, REASON_LENGTH = 5, 140


def summary(
    tally: RunCounts, catalogue: Catalogue | None, results: str, shard: Shard = ALL
) -> tuple[str, bool]:
    """The text, and whether all captures were measured whole.

    catalogue: None for a shard, whose results are not all there is, and where there are none.
    """
    fresh = _counts(tally.done) or "nothing new"
    lines = [f"{tally.known} done before; now: {fresh}"]
    if tally.passed_over:
        files = ", ".join(f"{n} {suffix or 'no suffix'}" for suffix, n in tally.passed_over.items())
        lines.append(f"passed over, being no captures: {files}")
    if tally.gone:
        lines.append(
            f"{len(tally.gone)} no longer in the archive; their results stay: "
            f"wheelplane results {results} --gone"
        )
    if catalogue is None:
        if shard.n > 1:
            lines.append(f"when all shards are done: wheelplane results {results}")
        return "\n".join(lines), not any(tally.done[status] for status in STATUSES[1:])
    held = Counter({s: count(catalogue, Filter(status=(s,))) for s in STATUSES})
    lines += ["", f"results in {results}: {_counts(held)}"]
    failing = failures(catalogue, examples=1)
    for group in failing[:WORST]:
        reason = group.reason
        shown = reason if len(reason) <= REASON_LENGTH else f"{reason[: REASON_LENGTH - 3]}..."
        lines.append(f"{group.count:7} {group.status}, {group.stage or 'wheels'}: {shown}")
        lines.append(f"        such as {group.examples[0]}")
    if len(failing) > WORST:
        rest = sum(group.count for group in failing[WORST:])
        kinds = len(failing) - WORST
        more = f"{rest:7} for {kinds} other reason{'s' * (kinds > 1)}"
        lines.append(f"{more}: wheelplane results {results} --failures")
    lines += ["", f"next: wheelplane results {results}"]
    return "\n".join(lines), held["ok"] == held.total()


def _counts(counts: Counter[str]) -> str:
    told = [f"{counts[status]} {status}" for status in STATUSES if counts[status]]
    if counts["there"]:
        told.append(f"{counts['there']} recognised")
    return ", ".join(told)
