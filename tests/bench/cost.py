"""Share of `measure`'s time spent on uncertainty: python -m tests.bench.cost CAPTURE"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture

PARTS = (
    ("wheelplane.plane.fit_plane", "correlated_noise"),
    ("wheelplane.centre.locate_centre", "_plane_components"),
    ("wheelplane.centre.locate_centre", "centre_component"),
    ("wheelplane.measure", "with_type_b"),
    ("wheelplane.measurement.evaluate", "propagate"),
)
BOUND = 0.05


def main(source: Path, runs: int = 5) -> int:
    """Time every part within whole measurements; the best of `runs` of each."""
    spent = dict.fromkeys((name for _, name in PARTS), 0.0)

    def timed(function, name):
        def run(*args, **kwargs):
            start = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                spent[name] += time.perf_counter() - start

        return run

    for path, name in PARTS:  # a function may bear the name of its module
        module = sys.modules[path]
        setattr(module, name, timed(getattr(module, name), name))
    best = (float("inf"), {})
    for _ in range(runs):
        spent.update(dict.fromkeys(spent, 0.0))
        start = time.perf_counter()
        with open_capture(source) as capture:
            measure_capture(capture, Config())
        best = min(best, (time.perf_counter() - start, dict(spent)), key=lambda found: found[0])
    whole, parts = best
    print("| part | ms | share |\n|---|---|---|")
    for name, seconds in parts.items():
        print(f"| {name} | {seconds * 1e3:.1f} | {seconds / whole:.2%} |")
    share = sum(parts.values()) / whole
    print(f"| all | {sum(parts.values()) * 1e3:.1f} | {share:.2%} of {whole * 1e3:.0f} ms |")
    return 0 if share < BOUND else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
