"""Faults as an operator meets them: what was lost, and the last line that he saw.

    .venv/bin/python -m tests.bench.operator_faults [--captures 60]

A fault strikes in mid-run; then the same command is given again without it. Lost: results that
differ from those of an undisturbed run. The file system that becomes read-only is one in memory,
which only root can mount.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.support.batches import archive_of, five_points, left, run_process, settle, start, trees
from tests.support.failing_proxy import FailingProxy
from tests.support.object_server import stored_archive

OPTIONS = ("--workers", "2")
GONE_S = 60.0
ODD = ("line\nend", "esc\x1b[2J\x1b]0;title\x07", "\udceb\udcff bytes", "\u202etxt.rac", "-o")


class Bench:
    """An archive, and the results of an undisturbed run of it."""

    def __init__(self, place: Path, count: int) -> None:
        self.place, self.archive = place, archive_of(place / "archive", count)
        self.undisturbed = place / "undisturbed"
        assert run_process(self.archive, self.undisturbed, *OPTIONS).returncode == 0
        self.expected = left(self.undisturbed)

    def struck(
        self,
        name: str,
        strike: Callable[[Path], object],
        heal: Callable[[Path], object],
        **env: str,
    ) -> None:
        """Strike after the first results, heal when the run has ended, run again and compare."""
        results = self.place / name.replace(" ", "-")
        results.mkdir(exist_ok=True)
        process = start(self.archive, results, *OPTIONS, **env)
        while process.poll() is None and not any(results.rglob("measurements/*/*.json")):
            time.sleep(0.02)
        strike(results)
        out, err = process.communicate(timeout=300)
        heal(results)
        after = run_process(self.archive, results, *OPTIONS)
        self.report(name, process.returncode, out, err, after.returncode, left(results))

    def report(
        self, name: str, code: int, out: str, err: str, after: int, found: dict[str, bytes]
    ) -> None:
        lost = sum(found.get(key) != value for key, value in self.expected.items())
        raw = any(ord(c) < 32 and c != "\n" for c in out + err)
        last = (err.strip().splitlines() or [""])[-1]
        print(
            f"{name}: exit {code}, then {after}; {lost} lost; raw escapes {raw}; "
            f"traceback {'Traceback' in out + err}; {last[:230]!r}",
            flush=True,
        )


def folders(bench: Bench) -> None:
    """Run the faults of local folders."""
    bench.struck("results removed in mid-run", shutil.rmtree, lambda _: None)
    if os.geteuid() == 0:
        results = bench.place / "results-read-only-in-mid-run"
        results.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", str(results)]
        subprocess.run(mount, check=True)

        def remount(how: str) -> None:
            command = ["mount", "-o", f"remount,{how}", str(results)]
            while subprocess.run(command, capture_output=True, check=False).returncode:
                time.sleep(0.01)  # busy while a file is open for writing

        try:
            bench.struck(
                "results read-only in mid-run", lambda _: remount("ro"), lambda _: remount("rw")
            )
        finally:
            subprocess.run(["umount", str(results)], check=True)


def captures(bench: Bench) -> None:
    """Run the faults of captures: changed, deleted, of odd names."""
    archive = bench.place / "changing"
    shutil.copytree(bench.archive, archive)
    names = sorted(archive.rglob("*.txt"))
    process = start(archive, bench.place / "changed", *OPTIONS)
    end = time.monotonic() + 8.0
    rounds = 0
    while process.poll() is None and time.monotonic() < end:
        for path in names[::10]:
            path.write_text(f"{path.read_text()}\n")
            rounds += 1
        for path in names[5::10]:
            path.unlink(missing_ok=True)
        time.sleep(0.02)
    _, err = process.communicate(timeout=300)
    settle(archive)
    after = run_process(archive, bench.place / "changed", *OPTIONS)
    fresh = run_process(archive, bench.place / "changed-undisturbed", *OPTIONS)
    there = trees(bench.place / "changed-undisturbed")
    found = trees(bench.place / "changed")
    lost = sum(found.get(name) != tree for name, tree in there.items())
    last = (err.strip().splitlines() or [""])[-1]
    print(
        f"{rounds} changes and {len(names[5::10])} deletions of captures while they are measured: "
        f"exit {process.returncode}, then {after.returncode} ({fresh.returncode}); {lost} lost; "
        f"{last[:200]!r}",
        flush=True,
    )
    odd = bench.place / "odd"
    for k, name in enumerate(ODD):
        five_points(odd / f"{name}.txt", k)
        (odd / f"bad {name}.txt").write_text("no number\n")
    settle(odd)
    done = run_process(odd, bench.place / "odd-results", *OPTIONS)
    listed = subprocess.run(
        [*start.__globals__["BATCH"][:-1], "results", str(bench.place / "odd-results")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    text = done.stdout + done.stderr + listed.stdout + listed.stderr
    raw = {c for c in text if (ord(c) < 32 and c != "\n") or c == "\u202e"}
    rows = len(trees(bench.place / "odd-results"))
    print(f"{2 * len(ODD)} odd names: exit {done.returncode}, {rows} rows, raw: {raw}", flush=True)


def storage(bench: Bench) -> None:
    """Run the faults of object storage."""
    with stored_archive(bench.archive) as (address, files):
        for kind in ("error", "refuse", "slow", "part", "cut"):
            proxy = FailingProxy(address, 0.1, 1, (kind,))
            to = f"s3://cars/{kind}"
            done = run_process("s3://cars/archive", to, *OPTIONS, AWS_ENDPOINT_URL=proxy.address)
            after = run_process("s3://cars/archive", to, *OPTIONS, AWS_ENDPOINT_URL=address)
            files.invalidate_cache()
            files.get(f"cars/{kind}", str(bench.place / kind), recursive=True)
            name = f"object storage, {kind}: {proxy.failed} of {proxy.failed + proxy.passed}"
            found = left(bench.place / kind)
            bench.report(name, done.returncode, done.stdout, done.stderr, after.returncode, found)
            proxy.close()
        gone(bench, address, files, GONE_S)
        done = run_process(
            "s3://cars/archive", "s3://none/results", *OPTIONS, AWS_ENDPOINT_URL=address
        )
        print(f"missing bucket: exit {done.returncode}; {done.stderr.strip()[-230:]!r}", flush=True)
        both = [start("s3://cars/archive", "s3://cars/three", *OPTIONS, AWS_ENDPOINT_URL=address)
                for _ in range(3)]  # fmt: skip
        codes = [process.communicate(timeout=300) and process.returncode for process in both]
        files.get("cars/three", str(bench.place / "three"), recursive=True)
        bench.report(
            f"three runners at once: exits {codes}", 0, "", "", 0, left(bench.place / "three")
        )


def gone(bench: Bench, address: str, files: Any, seconds: float) -> None:
    """Take object storage away in mid-run."""
    proxy = FailingProxy(address, 0.0, 1)
    process = start("s3://cars/archive", "s3://cars/gone", *OPTIONS,
                    AWS_ENDPOINT_URL=proxy.address)  # fmt: skip
    while process.poll() is None and not files.glob("cars/gone/measurements/*/*.json"):
        files.invalidate_cache()
        time.sleep(0.1)
    proxy.gone = True
    threading.Timer(seconds, lambda: setattr(proxy, "gone", False)).start()
    out, err = process.communicate(timeout=seconds + 300)
    after = run_process("s3://cars/archive", "s3://cars/gone", *OPTIONS, AWS_ENDPOINT_URL=address)
    files.get("cars/gone", str(bench.place / "gone"), recursive=True)
    print("\n".join(line[:200] for line in err.splitlines()))
    name = f"object storage gone for {seconds:.0f} s"
    bench.report(name, process.returncode, out, err, after.returncode, left(bench.place / "gone"))
    proxy.close()


def main() -> None:
    """Strike, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--captures", type=int, default=60)
    parser.add_argument("--gone", type=float, help="seconds: object storage away for them alone")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), chosen.captures)
        if chosen.gone is not None:
            with stored_archive(bench.archive) as (address, files):
                gone(bench, address, files, chosen.gone)
            return
        for part in (folders, captures, storage):
            part(bench)


if __name__ == "__main__":
    main()
