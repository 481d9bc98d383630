"""`wheelplane batch`: throughput by workers, cost of the runner, memory, and tiny captures.

    .venv/bin/python -m tests.bench.batch scans [--captures 200] [--repeats 3]
    .venv/bin/python -m tests.bench.batch tiny [--captures 100000]

Whole processes in turn; the best of the repeats counts, since other load only ever adds.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.batches import BATCH, descendants, five_points, settle, trees

ROOT = Path(__file__).resolve().parents[2]

SPACING_M = 0.00161  # gives scans of 200,000 points
PLAIN = """
import sys, pathlib
from wheelplane.batch.run.measure_one import Subject, measure_bytes
from wheelplane.batch.plan.settings import BatchSettings
for name in sys.argv[2:]:
    kind = "zip" if name.endswith(".zip") else "folder"
    measure_bytes(Subject(pathlib.Path(sys.argv[1], name), name, kind, BatchSettings()))
"""


@dataclass
class Use:
    """Resident megabytes of the runner, and of its largest child, over a run; and its CPU time."""

    runner: list[float] = field(default_factory=list)
    children: list[float] = field(default_factory=list)
    cpu_s: dict[int, float] = field(default_factory=dict)

    def watch(self, process: subprocess.Popen[str]) -> None:
        while process.poll() is None:
            others = descendants(process.pid)
            self.runner.append(resident_mb(process.pid))
            self.children.append(max(map(resident_mb, others), default=0.0))
            self.cpu_s |= {pid: spent for pid in (process.pid, *others) if (spent := cpu_s(pid))}
            time.sleep(0.2)

    def thirds(self, samples: list[float]) -> str:
        """Peaks of the first, the second and the last third."""
        n = max(1, len(samples) // 3)
        return " ".join(
            f"{max(s, default=0.0):.0f}"
            for s in (samples[:n], samples[n : 2 * n], samples[2 * n :])
        )


def resident_mb(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4096 / 1e6
    except OSError:
        return 0.0


def cpu_s(pid: int) -> float:
    """User and system time of a process up to now."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timed(archive: Path, results: Path, *options: str) -> tuple[float, Use, str]:
    """Wall seconds of a whole run, what it used, and what it said."""
    shutil.rmtree(results, ignore_errors=True)
    return again(archive, results, *options)


def again(archive: Path, results: Path, *options: str) -> tuple[float, Use, str]:
    """As `timed`, on what an earlier run left."""
    use = Use()
    started = time.perf_counter()
    process = subprocess.Popen(
        [*BATCH, str(archive), "-o", str(results), *options],
        cwd=ROOT,
        env=os.environ | {"WHEELPLANE_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    watcher = threading.Thread(target=use.watch, args=(process,))
    watcher.start()
    out, _ = process.communicate()
    watcher.join()
    return time.perf_counter() - started, use, out


def make_captures(archive: Path, count: int) -> list[str]:
    """Folders and zips by turns, of one in twenty a broken one; the names of the good ones."""
    base = archive.parent / "base"
    scanner = archive.parent / "coarse.toml"
    text = (ROOT / "configs/scanners/default.toml").read_text()
    scanner.write_text(text.replace("spacing_m = 0.0009", f"spacing_m = {SPACING_M}"))
    command = [sys.executable, "-m", "wheelplane", "synth", str(base), "--trials", "0"]
    subprocess.run([*command, "--scanner", str(scanner)], cwd=ROOT, check=True, capture_output=True)
    packed = shutil.make_archive(str(archive.parent / "base"), "zip", base)
    good = []
    for k in range(count):
        name = f"car-{k:04d}" + (".zip" if k % 2 else "")
        if k % 20 == 7:
            spoil(archive / f"bad-{k // 20 % 10}-{k:04d}", k // 20 % 10, base)
        elif k % 2:
            os.link(packed, archive / name)
            good.append(name)
        else:
            shutil.copytree(base, archive / name, copy_function=os.link)
            good.append(name)
    settle(archive)
    return good


def spoil(folder: Path, way: int, base: Path) -> None:
    """A capture broken in one of ten ways."""
    shutil.copytree(base, folder)
    scan, toml = folder / "rr.ply", folder / "capture.toml"
    shown = toml.read_text()
    changes = {
        0: lambda: scan.unlink(),
        1: lambda: scan.write_bytes(scan.read_bytes()[:-1000]),
        2: lambda: scan.write_bytes(b""),
        3: lambda: scan.write_bytes(b"no cloud"),
        4: lambda: toml.write_text(shown.replace("[reference]", "[referense]")),
        5: lambda: toml.write_text(shown.replace('"disc"', '"dics"')),
        6: lambda: toml.write_text(shown + "\\n[broken"),
        7: lambda: shutil.copy(folder / "rl.ply", scan),
        8: lambda: scan.write_text("ply\\nformat ascii 1.0\\nelement vertex 1\\n"),
        9: lambda: toml.write_text(shown.replace("rl.ply", "rr.ply")),
    }
    changes[way]()


def scans(count: int, repeats: int, place: Path) -> None:
    archive = place / "archive"
    archive.mkdir()
    good = make_captures(archive, count)
    points = trees_of(archive, place / "first", good)
    print(f"{count} captures, {points:,} points each; {count - len(good)} broken")
    names = sorted(path.name for path in archive.iterdir())
    walls: dict[str, list[float]] = {"plain": [], "1": [], "2": []}
    spent: dict[str, list[float]] = {"plain": [], "1": [], "2": []}
    for _ in range(repeats):
        started = time.perf_counter()
        alone = ("WHEELPLANE_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
        environment = os.environ | dict.fromkeys(alone, "1")
        command = [sys.executable, "-c", PLAIN, str(archive), *names]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, cwd=ROOT, env=environment, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        spent["plain"].append(cpu / len(good))
        walls["plain"].append((time.perf_counter() - started) / len(good))
        for workers in ("1", "2"):
            seconds, use, _ = timed(archive, place / "results", "--workers", workers)
            walls[workers].append(seconds / len(good))
            spent[workers].append(sum(use.cpu_s.values()) / len(good))
            print(f"{workers} workers: {seconds:.1f} s; MB by thirds of the run: runner", end=" ")
            print(f"{use.thirds(use.runner)}, largest child {use.thirds(use.children)}")
    best = {name: min(each) for name, each in walls.items()}
    for name, seconds in best.items():
        print(f"{name:>5}: {seconds * 1e3:.0f} ms a good capture, best of {repeats}", end="; ")
        print(f"CPU {min(spent[name]) * 1e3:.0f} ms")
    print(f"two workers: {best['1'] / best['2']:.2f} times one")
    print(f"cost of the runner: {100 * (best['1'] / best['plain'] - 1):.1f} % of time", end=", ")
    print(f"{100 * (min(spent['1']) / min(spent['plain']) - 1):.1f} % of CPU time")


def trees_of(archive: Path, results: Path, good: list[str]) -> int:
    """Run once, see that every good capture is measured and every other one is not."""
    timed(archive, results)
    found = trees(results)
    ok = {name for name, tree in found.items() if tree["batch"]["status"] == "ok"}
    assert ok == set(good)
    for name, tree in found.items():
        if name not in ok:
            batch = tree["batch"]
            print(f"  {name}: {batch['status']} {batch['stage']}: {batch['reason'][:110]}")
    return max(wheel["points_total"] for wheel in found[good[0]]["wheels"])


def tiny(count: int, place: Path) -> None:
    archive = place / "archive"
    for k in range(count):
        five_points(archive / f"{k // 1000:04d}" / f"car-{k:06d}.txt", k)
    settle(archive)
    seconds, use, out = timed(archive, place / "results")
    print(
        f"{count} five-point files: {seconds:.1f} s, {count / seconds:.0f} a second; CPU ", end=""
    )
    print(f"{sum(use.cpu_s.values()) / count * 1e3:.2f} ms each")
    print(f"MB by thirds: runner {use.thirds(use.runner)}, ", end="")
    print(f"largest child {use.thirds(use.children)}")
    for _ in range(2):
        seconds, use, out = again(archive, place / "results")
        print(f"finished run again: {seconds:.1f} s, runner {max(use.runner):.0f} MB")
    print(out.splitlines()[0])
    statuses = Counter()
    for path in (place / "results" / "measurements").rglob("*.json"):
        if path.name.startswith("00"):
            statuses[json.loads(path.read_bytes())["batch"]["status"]] += 1
    print(f"of a sample: {dict(statuses)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["scans", "tiny"])
    parser.add_argument("--captures", type=int)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="where the files go, and stay")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        place = options.folder or Path(scratch)
        place.mkdir(parents=True, exist_ok=True)
        if options.what == "scans":
            scans(options.captures or 200, options.repeats, place)
        else:
            tiny(options.captures or 100_000, place)


if __name__ == "__main__":
    main()
