"""Where users wait, as ratios within one run: reading Open3D's way, start-up, reports, batches.

    .venv/bin/python -m tests.bench.quick [--folder DIR]

Under three minutes on two idle cores. Four scans of 1.8 million points, measured as whole
processes; the least of RUNS each, in turn. Ratios of wall time, and of CPU time where said; the
commit that was measured is named. Ratios hold for this machine only, but far better than seconds.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.bench.speed import OPEN3D, WHEELPLANE, make_capture

RUNS = 3
BATCH = 8
PYTHON = (sys.executable, "-c")
ONE_COPY = """
import numpy as np, time
points = np.ones((5_000_000, 3))
start = time.perf_counter()
for _ in range(5): points.copy()
print((time.perf_counter() - start) / 5)
"""
ONE_PLANE = """
import time
import tests.bench.segmentation as bench
from tests.support.vehicle_scenes import face_cloud
points = face_cloud(5_000_000, 0).points_m
bench.ours(points)
start = time.perf_counter()
for _ in range(3): bench.ours(points)
print((time.perf_counter() - start) / 3)
"""


@dataclass(frozen=True)
class Cost:
    """A process: wall and CPU seconds, peak memory in bytes."""

    wall_s: float
    cpu_s: float
    peak: int


def cost(*command: str, **surroundings: str) -> Cost:
    """Run a process to its end."""
    start = time.perf_counter()
    quiet = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    process = os.posix_spawn(command[0], command, os.environ | surroundings, file_actions=quiet)
    _, status, usage = os.wait4(process, 0)
    wall_s = time.perf_counter() - start
    if status:
        sys.exit(f"{' '.join(command)[:80]} ended with status {status}")
    return Cost(wall_s, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024)


def in_turn(ways: dict[str, tuple[str, ...]]) -> dict[str, Cost]:
    """Run each way RUNS times, in turn; return the least of each figure."""
    found: dict[str, list[Cost]] = {name: [] for name in ways}
    for _ in range(RUNS):
        for name, command in ways.items():
            found[name].append(cost(*command))
    return {
        name: Cost(
            min(one.wall_s for one in costs),
            min(one.cpu_s for one in costs),
            min(one.peak for one in costs),
        )
        for name, costs in found.items()
    }


def line(what: str, ratio: float, unit: str) -> None:
    """Print a row of the table."""
    print(f"{what:66s} {ratio:6.2f}  {unit}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="keep the capture here")
    folder = parser.parse_args().folder
    git = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True)
    print(f"commit {git.stdout.strip() or 'unknown'}, {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as scratch:
        place = folder or Path(scratch)
        place.mkdir(parents=True, exist_ok=True)
        make_capture(place / "capture", trials=0)
        compare(place / "capture", Path(scratch))


def compare(capture: Path, scratch: Path) -> None:
    """Print the table."""
    ours = (*WHEELPLANE, "measure", str(capture), "--json")
    files = sorted(map(str, capture.glob("*.ply")))
    size = max(Path(file).stat().st_size for file in files)
    cost(*ours)  # compiles modules, fills the disk's cache
    theirs = cost(*PYTHON, OPEN3D, *files)
    out = str(scratch / "out")
    found = in_turn(
        {
            "measure": ours,
            "html": (*ours, "-o", out),
            "pdf": (*ours, "-o", out, "--pdf"),
            "inspect": (*WHEELPLANE, "inspect", str(capture)),
            "start": (*PYTHON, "import wheelplane.commands.measure"),
            "import": (*PYTHON, "import wheelplane"),
            "numpy": (*PYTHON, "import numpy"),
        }
    )
    measure, numpy = found["measure"], found["numpy"]
    line("Open3D: read, segment_plane; against measure", theirs.wall_s / measure.wall_s, "times")
    single = min((cost(*ours, WHEELPLANE_THREADS="1") for _ in range(RUNS)), key=lambda c: c.wall_s)
    line("measure on one thread against all", single.wall_s / measure.wall_s, "times")
    line("measure: peak memory, scans", measure.peak / size, "scans")
    line("inspect against measure, CPU", found["inspect"].cpu_s / measure.cpu_s, "times")
    line("report.html on top of measure, CPU", added(found["html"], measure), "of measure")
    line("report.pdf on top of that, CPU", added(found["pdf"], found["html"]), "of that")
    line("import wheelplane against numpy, CPU", found["import"].cpu_s / numpy.cpu_s, "times")
    line("measure until it reads, against numpy, CPU", found["start"].cpu_s / numpy.cpu_s, "times")
    archive = scratch / "archive"
    for k in range(BATCH):
        shutil.copytree(capture, archive / f"{k}", copy_function=os.link)
    batch = cost(
        *WHEELPLANE, "batch", str(archive), "-o", str(scratch / "results"), "--workers", "1"
    )
    share = batch.wall_s / BATCH / single.wall_s
    line("batch, a capture, one worker, against measure on one thread", share, "times")
    copy, plane = (
        min(float(subprocess.check_output((*PYTHON, text))) for _ in range(RUNS))
        for text in (ONE_COPY, ONE_PLANE)
    )
    line("plane of 5 million points against one copy of them", plane / copy, "copies")


def added(more: Cost, less: Cost) -> float:
    """Return the share of CPU time that `more` has beyond `less`."""
    return more.cpu_s / less.cpu_s - 1.0


if __name__ == "__main__":
    main()
