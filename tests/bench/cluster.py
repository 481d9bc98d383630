"""Serial share of a run on a Dask cluster: CPU of runner, scheduler and workers a capture.

    nice -n 10 .venv/bin/python -m tests.bench.cluster [--captures 300 1200] [--discs] [--rounds 2]
    [--workers 2]

Two runs of different size on a warm cluster: what a capture takes is the slope, free
of what a run takes at its start. All go on at the same time, so that four workers are to one at
most as the worker's CPU to that of the busier of runner and scheduler; without any overlap, as
Amdahl's law says.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

from tests.batch.test_batch_places import dask_cluster
from tests.support.batches import BATCH, ROOT, archive_of, settle, zip_of_discs

TICKS = os.sysconf("SC_CLK_TCK")
WORKERS = 4


def cpu_s(*groups: int) -> float:
    """CPU seconds of all processes of these groups, and of those that they waited for."""
    total = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:  # just ended
            continue
        if int(fields[2]) in groups:
            total += sum(map(int, fields[11:15]))
    return total / TICKS


def process_s(pid: int) -> float:
    """CPU seconds of one process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / TICKS


def run(archive: Path, results: Path, address: str) -> float:
    """Run a batch on the cluster, and return the runner's CPU seconds."""
    command = [*BATCH, str(archive), "-o", str(results), "--scheduler", address]
    runner = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(runner.pid, 0)
    assert status == 0
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--captures", type=int, nargs=2, default=[300, 1200])
    parser.add_argument("--discs", action="store_true", help="zips of four scans, not five points")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for count in (*chosen.captures, 4):
            archive = place / f"archive-{count}"
            if chosen.discs:
                for k in range(count):
                    zip_of_discs(archive / f"{k}.zip", k)
                settle(archive)
            else:
                archive_of(archive, count)
        with dask_cluster(place, names="abcdefgh"[: chosen.workers]) as (
            address,
            scheduler,
            workers,
        ):
            groups = [worker.pid for worker in workers]
            run(place / "archive-4", place / "warm", address)
            for number in range(chosen.rounds):
                used = []
                for count in chosen.captures:
                    at = process_s(scheduler.pid), cpu_s(*groups)
                    own = run(place / f"archive-{count}", place / f"{number}-{count}", address)
                    after = process_s(scheduler.pid), cpu_s(*groups)
                    used.append((own, after[0] - at[0], after[1] - at[1]))
                    print(count, *(f"{s:.2f} s" for s in used[-1]), flush=True)
                more = chosen.captures[1] - chosen.captures[0]
                runner, relay, worker = ((b - a) / more for a, b in zip(*used, strict=True))
                fed = worker / max(runner, relay)
                amdahl = (runner + worker) / (runner + worker / WORKERS)
                print(
                    f"a capture: runner {1e3 * runner:.2f} ms, scheduler {1e3 * relay:.2f} ms, "
                    f"worker {1e3 * worker:.2f} ms; serial share {runner / (runner + worker):.1%}; "
                    f"up to {fed:.0f} workers can be fed; {WORKERS} are to one at most "
                    f"{min(WORKERS, fed):.2f}, without overlap {amdahl:.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
