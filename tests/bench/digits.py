"""Wrong digits of the paper's five-point file that are named, and clean files that are flagged.

.venv/bin/python -m tests.bench.digits [--clean 10000] [--seed 0]

Every change of one digit to another; the u is the printed one, or that of the clean file.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from tests.support.wrong_digits import (  # noqa: E402
    clean_files,
    flagged,
    judge,
    single_digit_changes,
)


def main() -> None:
    """Print both figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    changes = single_digit_changes()
    with tempfile.TemporaryDirectory() as scratch:
        judged = judge(changes, Path(scratch))
    refused = len(changes) - len(judged)
    print(f"{len(changes)} changes, {refused} refused or without a frame, {len(judged)} measured\n")
    print(
        "| an angle moves by | changes | named | right point | with those refused "
        "| error without it, u: 95 %, worst |"
    )
    print("|---|---|---|---|---|---|")
    for size, of in ((3.0, "printed"), (3.0, "clean"), (5.0, "clean"), (10.0, "clean")):
        harmful = [one for one in judged if getattr(one, of) >= size]
        named = [one for one in harmful if one.named]
        left = np.array([one.left for one in named])
        right = sum(one.right for one in named) / len(named)
        total = (len(named) + refused) / (len(harmful) + refused)
        errors = f"{np.quantile(left, 0.95):.2f}, {left.max():.2f}"
        share = len(named) / len(harmful)
        print(
            f"| {size:g} u ({of}) | {len(harmful)} | {share:.2%} | {right:.2%} | {total:.2%} "
            f"| {errors} |"
        )
    bad = sum(bool(flagged(blocks)) for blocks in clean_files(options.clean, options.seed))
    print(f"\n{bad} of {options.clean} clean files flagged")


if __name__ == "__main__":
    main()
