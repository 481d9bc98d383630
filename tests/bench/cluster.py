"""Serial share of a run on a Dask cluster: CPU of runner, scheduler and workers a capture.

    nice -n 10 .venv/bin/python -m tests.bench.cluster [--captures 300 1200] [--discs] [--rounds 2]
    [--workers 2]
    .venv/bin/python -m tests.bench.cluster --share 0.12 [--captures 300 1200]

Two runs of different size on a warm cluster: what a capture takes is the slope, free
of what a run takes at its start. All go on at the same time, so that four workers are to one at
most as the worker's CPU to that of the busier of runner and scheduler; without any overlap, as
Amdahl's law says.

With --share, a machine with more cores than this one is made of slower ones: runner, scheduler and
each worker with its processes are held to that share of a core (control groups of Linux, as root),
and the time that the larger run takes on top of the smaller, with one worker and with four, says
what four give.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.batch.test_batch_places import dask_cluster
from tests.support.batches import BATCH, ROOT, archive_of, settle, zip_of_discs

TICKS = os.sysconf("SC_CLK_TCK")
WORKERS = 4
CGROUPS, PERIOD_US = Path("/sys/fs/cgroup/cpu"), 100_000


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


def run(archive: Path, results: Path, address: str, core: Path | None = None) -> float:
    """Run a batch on the cluster, on that core if one is given; return the runner's CPU seconds."""
    command = [*BATCH, str(archive), "-o", str(results), "--scheduler", address]
    runner = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    if core:
        put(runner.pid, core)
    _, status, used = os.wait4(runner.pid, 0)
    assert status == 0
    return used.ru_utime + used.ru_stime


@contextmanager
def cores(count: int, share: float) -> Iterator[list[Path]]:
    """Control groups of processes that get a share of a core each."""
    groups = [CGROUPS / f"wheelplane-{os.getpid()}-{number}" for number in range(count)]
    for group in groups:
        group.mkdir()
        (group / "cpu.cfs_period_us").write_text(str(PERIOD_US))
        (group / "cpu.cfs_quota_us").write_text(str(round(share * PERIOD_US)))
    try:
        yield groups
    finally:
        for group in groups:
            while (group / "cgroup.procs").read_text():
                time.sleep(0.1)
            group.rmdir()


def put(pid: int, core: Path) -> None:
    """Put a process, and those of its session, on a core."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # just ended
            if pid in (int(path.parent.name), int(path.read_text().rpartition(")")[2].split()[3])):
                (core / "cgroup.procs").write_text(path.parent.name)


def scaling(place: Path, captures: list[int], share: float) -> None:
    """Print the captures a second of one worker and of WORKERS, each on a core of its own."""
    rates = []
    for count in (1, WORKERS):
        with (
            cores(count + 2, share) as (first, second, *others),
            dask_cluster(place, names="abcd"[:count]) as (address, scheduler, workers),
        ):
            run(place / f"archive-{captures[0]}", place / f"warm-{count}", address)
            put(scheduler.pid, first)
            for worker, core in zip(workers, others, strict=True):
                put(worker.pid, core)
            used_s = []
            for size in captures:
                began_s = time.monotonic()
                run(place / f"archive-{size}", place / f"{count}-{size}", address, second)
                used_s.append(time.monotonic() - began_s)
        rates.append((captures[1] - captures[0]) / (used_s[1] - used_s[0]))
        print(f"{count} workers: {rates[-1]:.2f} captures/s", flush=True)
    print(f"{WORKERS} are to one {rates[1] / rates[0]:.2f}, on cores of {share:g}")


def main() -> None:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--captures", type=int, nargs=2, default=[300, 1200])
    parser.add_argument("--discs", action="store_true", help="zips of four scans, not five points")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--share", type=float, help="of a core, for each process")
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
        if chosen.share:
            scaling(place, chosen.captures, chosen.share)
        else:
            shares(place, chosen)


def shares(place: Path, chosen: argparse.Namespace) -> None:
    """Print the CPU of runner, scheduler and workers a capture, and what it allows."""
    with dask_cluster(place, names="abcdefgh"[: chosen.workers]) as (address, scheduler, workers):
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
