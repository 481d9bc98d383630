"""Kills, full disks and failing storage in a batch; the catalogue must equal an undisturbed run's.

    .venv/bin/python -m tests.bench.faults [--captures 3000] [--kills 20] [--seed 1]

The full disk is a small file system in memory, which only root can mount.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import tempfile
import time
from pathlib import Path

from tests.support.batches import (
    archive_of,
    descendants,
    five_points,
    kill,
    left,
    poisoned,
    settle,
    start,
)
from tests.support.batches import run_process as run
from tests.support.failing_proxy import FailingProxy
from tests.support.object_server import stored_archive

ROOT = Path(__file__).resolve().parents[2]

FEW = 400  # captures in object storage, whose imitation answers a hundred times a second
OPTIONS = ("--workers", "2", "--timeout", "5", "--memory", "400M")


class Faults:
    """An archive with bad and poisonous captures, and what an undisturbed run makes of it."""

    def __init__(self, place: Path, count: int, kills: int, seed: int) -> None:
        place.mkdir()
        self.place, self.kills, self.rng = place, kills, random.Random(seed)
        self.archive = archive_of(place / "archive", count)
        for name in ("crash", "greedy", "once"):
            five_points(self.archive / "bad" / f"{name}.txt", 1)
        (self.archive / "bad" / "letters.txt").write_text("no number\n")
        settle(self.archive)
        self.environment = poisoned(place)
        started = time.monotonic()
        self.finish(place / "undisturbed")
        self.seconds = time.monotonic() - started
        self.expected = left(place / "undisturbed")

    def finish(self, results: Path) -> None:
        done = run(self.archive, results, *OPTIONS, **self.environment)
        assert done.returncode == 1, done.stderr

    def report(self, what: str, *results: Path) -> None:
        same = all(left(each) == self.expected for each in results)
        print(f"{what}: {'the same' if same else 'ANOTHER'} catalogue", flush=True)

    def killed_runners(self) -> None:
        results = self.place / "runners"
        for _ in range(self.kills):
            process = start(self.archive, results, *OPTIONS, **self.environment)
            time.sleep(self.rng.uniform(0.5, 1.0 + 2.0 * self.seconds / self.kills))
            kill(process.pid)
            process.communicate()
        made = len(list(results.rglob("measurements/*/*.json")))
        self.finish(results)
        self.report(f"{self.kills} kills of the runner, {made} results by then", results)

    def killed_workers(self) -> None:
        runs: list[Path] = []
        killed = 0
        while killed < self.kills:
            runs.append(self.place / f"workers-{len(runs)}")
            process = start(self.archive, runs[-1], *OPTIONS, **self.environment)
            while process.poll() is None:
                time.sleep(self.rng.uniform(0.1, 1.0))
                children = descendants(process.pid)
                if len(children) > 2 and killed < self.kills:
                    kill(self.rng.choice(children))
                    killed += 1
            process.communicate()
            self.finish(runs[-1])
        what = f"{killed} kills of workers, their fork server among them, in {len(runs)} runs"
        self.report(what, *runs)

    def full_disk(self) -> None:
        results = self.place / "small"
        results.mkdir()
        size = sum(map(len, self.expected.values())) // 2
        mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(results)]
        subprocess.run(mount, check=True)
        try:
            done = run(self.archive, results, *OPTIONS, **self.environment)
            print(f"  full disk: exit code {done.returncode}: {done.stderr.splitlines()[-1]}")
            made = len(list(results.rglob("measurements/*/*.json")))
            remount = ["mount", "-o", f"remount,size={8 * size}", str(results)]
            subprocess.run(remount, check=True)
            self.finish(results)
            self.report(f"full disk after {made} results, then room", results)
        finally:
            subprocess.run(["umount", str(results)], check=True)

    def failing_storage(self) -> None:
        with stored_archive(self.archive) as (address, files):
            proxy = FailingProxy(address, share=0.1, seed=1)
            environment = self.environment | {"AWS_ENDPOINT_URL": proxy.address}
            done = run("s3://cars/archive", "s3://cars/results", *OPTIONS, **environment)
            assert done.returncode == 1, done.stderr
            files.get("cars/results", str(self.place / "s3"), recursive=True)
        what = (
            f"object storage with {proxy.failed} of {proxy.failed + proxy.passed} requests failing"
        )
        self.report(what, self.place / "s3")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--captures", type=int, default=3000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        faults = Faults(Path(scratch) / "many", options.captures, options.kills, options.seed)
        print(f"{options.captures} captures and 4 bad ones: {faults.seconds:.0f} s undisturbed")
        faults.killed_runners()
        faults.killed_workers()
        if os.geteuid() == 0:
            faults.full_disk()
        few = Faults(Path(scratch) / "few", FEW, options.kills, options.seed)
        few.failing_storage()


if __name__ == "__main__":
    main()
