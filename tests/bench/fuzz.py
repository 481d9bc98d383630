"""Damaged files by the thousand: each must end in a reading or in one clear line.

    .venv/bin/python -m tests.bench.fuzz --mutants 20000 --seed 0 [--only I] [--keep DIR]

Within 10 s and 500 MB each; no crash, hang, traceback, warning, word on a stream, nor silent loss.
They are read in a child process, so that a crash is distinguished from a refusal and a hang is
ended. What fails is kept in DIR, with a line in failures.txt; `--only I` repeats mutant I of that
seed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from pathlib import Path

from tests.fuzzing.mutations import mutant
from tests.fuzzing.samples import samples
from tests.fuzzing.supervise import Outcome, fuzz
from tests.support.paths import FORMATS


def keep(outcome: Outcome, seed: int, samples_folder: Path, folder: Path) -> None:
    """The file that failed, and a line that says how."""
    damaged = mutant(samples(samples_folder), outcome.index, seed)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{outcome.index:06d}-{damaged.sample.file}").write_bytes(damaged.data)
    with (folder / "failures.txt").open("a", encoding="utf-8") as lines:
        lines.write(
            f"{outcome.index} {outcome.sample} ({outcome.how}) {outcome.seconds:.2f} s: "
            f"{outcome.verdict}\n"
        )


def table(outcomes: list[Outcome]) -> str:
    """Markdown, a row a format."""
    by_format: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        by_format[outcome.format].append(outcome)
    lines = ["| format | mutants | read | refused | failed | slowest, s (its number) | peak, MB |"]
    lines += ["|---|---|---|---|---|---|---|"]
    for name, group in [*sorted(by_format.items()), ("all", outcomes)]:
        read = sum(outcome.verdict == "read" for outcome in group)
        failed = sum(outcome.failed for outcome in group)
        slowest = max(group, key=lambda outcome: outcome.seconds)
        peak = max(outcome.peak_mb for outcome in group)
        lines.append(
            f"| {name} | {len(group)} | {read} | {len(group) - read - failed} | {failed} "
            f"| {slowest.seconds:.2f} ({slowest.index}) | {peak:.0f} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--mutants", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, metavar="I", help="one mutant, by its number")
    parser.add_argument("--samples", type=Path, default=FORMATS, metavar="DIR")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-failures"), metavar="DIR")
    options = parser.parse_args()
    first = 0 if options.only is None else options.only
    stop = options.mutants if options.only is None else options.only + 1
    outcomes, start = [], time.monotonic()
    for outcome in fuzz(first, stop, options.seed, options.samples):
        outcomes.append(outcome)
        if outcome.failed:
            keep(outcome, options.seed, options.samples, options.keep)
            print(f"{outcome.index} {outcome.sample} ({outcome.how}): {outcome.verdict}")
        if len(outcomes) % 1000 == 0:
            spent = time.monotonic() - start
            print(f"{len(outcomes)} of {stop - first}, {spent:.0f} s", file=sys.stderr, flush=True)
    spent = time.monotonic() - start
    failed = sum(outcome.failed for outcome in outcomes)
    print(f"\n{table(outcomes)}\n")
    print(
        f"seed {options.seed}: {len(outcomes)} mutants in {spent:.0f} s "
        f"({len(outcomes) / spent:.0f} a second), {failed} failed"
    )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
