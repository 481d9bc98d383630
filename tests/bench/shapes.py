"""Error of the centre in its plane, by shape of the target: unobstructed, and 40 % occluded.

.venv/bin/python -m tests.bench.shapes [--seeds 100] [--target disc-250 ...]
Noise 0.8 mm, 15 degrees of incidence, a point every 1.8 mm.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from tests.support.plates import found, in_target
from tests.support.printing import setup_of
from tests.support.scenes import Setup, make
from wheelplane.commands.targets import known_targets
from wheelplane.errors import NotMeasuredError
from wheelplane.targets.registry import load_target

BASE = Setup(spacing_m=0.0018, half_width_m=0.26, pairs=12)
VIEWS = {
    "whole": BASE,
    "40 % hidden": BASE.but(hidden=0.4),
    "no background": BASE.but(background_m=None),
}


def errors(seed: int, name: str, view: str) -> dict[str, tuple[float, float, float]] | str:
    """By method: error (m), standard uncertainty per axis (m), NEES; or why there is none."""
    target = load_target(name)
    cloud = make(setup_of(target, VIEWS[view]), seed)
    try:
        result = found(cloud, target, seed)
    except NotMeasuredError as error:
        return error.status
    rows = {"": (float(np.hypot(*result.error_m)), result.u_m, result.nees)}
    for other in result.fitted.others:
        alone = in_target(cloud, other)
        rows[other.method] = (float(np.hypot(*alone.error_m)), alone.u_m, alone.nees)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--target", nargs="*", default=known_targets())
    options = parser.parse_args()
    print("target               view           by        scans   rms    worst   u/axis    NEES")
    with ProcessPoolExecutor(2) as pool:
        for name in options.target:
            for view in VIEWS:
                one = partial(errors, name=name, view=view)
                rows = list(pool.map(one, range(options.seeds)))
                seen = [row for row in rows if not isinstance(row, str)]
                for method in sorted({key for row in seen for key in row}):
                    table = np.array([row[method] for row in seen if method in row])
                    rms, u = np.sqrt(np.mean(table[:, :2] ** 2, axis=0)) * 1e6
                    print(
                        f"{name:20s} {view:14s} {method:9s} {len(table):5d} {rms:6.0f} um "
                        f"{table[:, 0].max() * 1e6:5.0f} um {u:5.0f} um {table[:, 2].mean():7.2f}",
                        flush=True,
                    )
                for status in sorted({row for row in rows if isinstance(row, str)}):
                    print(f"{name:20s} {view:14s} {status}: {rows.count(status)}", flush=True)


if __name__ == "__main__":
    main()
