"""Time to build, update and query a catalogue of many results.

    .venv/bin/python -m tests.bench.catalogue [--count 100000] [--folder DIR] [--keep]

The results are those of one synthetic capture of six scans with varied numbers, written as
`batch` writes them (some 90 kB each). Commands are whole processes; wall time and peak memory as
the system accounts them.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

WHEELPLANE = [sys.executable, "-m", "wheelplane"]
FIRST_DAY = datetime.date(2026, 1, 1)
HEAD = ("schema", "capture", "vehicle_name", "batch", "wheels", "frame", "vehicle")


def make_results(folder: Path, count: int) -> None:
    """`count` results, unless they are there already; one in fifty is a failure."""
    if (folder / "measurements").is_dir():
        return
    demo = folder / "demo"
    subprocess.run([*WHEELPLANE, "demo", str(demo)], check=True, stdout=subprocess.DEVNULL)
    tree = json.loads((demo / "results" / "measurement.json").read_text())
    shutil.rmtree(demo)
    tail = json.dumps({k: v for k, v in tree.items() if k not in HEAD}, indent=1)[1:]
    rng = random.Random(1)
    for i in range(count):
        write_one(folder, tree, tail, i, rng)


def write_one(folder: Path, tree: dict, tail: str, i: int, rng: random.Random) -> None:
    """The i-th result: angles about those of the capture, drifting a little."""
    key = hashlib.sha256(f"capture {i}".encode()).hexdigest()
    failed = i % 50 == 49
    day = FIRST_DAY + datetime.timedelta(days=i % 300)
    head = {name: tree.get(name) for name in HEAD} | {
        "capture": f"{day:%Y/%m}/capture-{i:07d}",
        "vehicle_name": f"car {i % 40}",
        "wheels": [] if failed else [moved(wheel, i, rng) for wheel in tree["wheels"]],
        "batch": {
            "key": key,
            "kind": "folder",
            "date": day.isoformat(),
            "status": "failed" if failed else "ok",
            "stage": "segment" if failed else "",
            "reason": f"rr.ply: no target among {i} points: see to the scan" if failed else "",
            "config_sha256": "c" * 64,
        },
    }
    head |= (
        {"frame": None, "vehicle": {}} if failed else {"vehicle": moved(tree["vehicle"], i, rng)}
    )
    path = folder / "measurements" / key[:2] / f"{key}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{json.dumps(head, indent=1)[:-2]},{tail}\n")


def moved(numbers: dict, i: int, rng: random.Random) -> dict:
    """The same, with angles that scatter by 0.03 degrees and drift."""
    angles = [key for key in numbers if key.endswith("_deg") and not key.startswith("u_")]
    return numbers | {key: numbers[key] + rng.gauss(1e-5 * (i % 300), 0.03) for key in angles}


def command(name: str, *arguments: str) -> None:
    """Wall and CPU seconds and peak megabytes of one whole process."""
    start = time.perf_counter()
    process = os.posix_spawn(
        WHEELPLANE[0],
        [*WHEELPLANE, "results", *arguments],
        os.environ,
        file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
    )
    _, status, usage = os.wait4(process, 0)
    seconds = time.perf_counter() - start
    if os.waitstatus_to_exitcode(status) not in (0, 1):
        sys.exit(f"{name} ended with status {status}")
    cpu, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0
    print(f"{name:42} {seconds:8.2f} s {cpu:8.2f} s of CPU {peak:6.0f} MB", flush=True)


def timed(name: str, act: Callable[[], object]) -> None:
    """Wall seconds of a call."""
    start = time.perf_counter()
    shown = act()
    print(f"{name:42} {time.perf_counter() - start:8.2f} s   ({shown})", flush=True)


def replace_one(folder: Path) -> None:
    """Write one result again, with another vehicle."""
    from wheelplane.batch.storage.store import open_store

    path = next((folder / "measurements").rglob("*.json"))
    text = path.read_text().replace('"vehicle_name": "', f'"vehicle_name": "{time.time_ns()} ', 1)
    open_store(str(folder)).write(path.relative_to(folder).as_posix(), text.encode())


def main() -> None:
    """Make, ask, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--keep", action="store_true")
    chosen = parser.parse_args()
    folder = chosen.folder or Path(tempfile.mkdtemp(prefix="catalogue-"))
    folder.mkdir(parents=True, exist_ok=True)
    timed(f"{chosen.count:,} results made", lambda: make_results(folder, chosen.count))
    results = str(folder)
    command("rebuilt, and counted by SQL", results, "--rebuild", "--sql", COUNT)
    size = (folder / "catalogue.sqlite").stat().st_size / 1e6
    print(f"{'size of catalogue.sqlite':42} {size:8.1f} MB")
    command("counted by SQL", results, "--sql", COUNT)
    replace_one(folder)
    command("one result replaced, updated, counted", results, "--sql", COUNT)
    command("looked through by SQL: mean of a quantity", results, "--sql", MEAN)
    command("filtered by two ranges and a date", results, *RANGES)
    command("failures", results, "--failures")
    command("worst 20", results, "--worst", "20")
    command("summary of 25 quantities", results, "--summary")
    command("drift of one quantity", results, "--drift", "--quantity", "RR toe")
    command("drift of 25 quantities", results, "--drift")
    command("drift of one vehicle", results, "--drift", "--vehicle", "car 7")
    command("listed, first 50", results, "--limit", "50")
    command("listed, all", results)
    command("listed as JSON, all", results, "--json")
    for kind in ("csv", "parquet", "xlsx"):
        command(f"written as {kind}", results, f"--{kind}", str(folder / f"table.{kind}"))
        (folder / f"table.{kind}").unlink()
    if not chosen.keep and chosen.folder is None:
        shutil.rmtree(folder)


COUNT = "SELECT status, count(*) FROM captures GROUP BY status"
MEAN = "SELECT avg(value), count(*) FROM quantities WHERE kind = 'rear_total_toe'"
RANGES = ("--where", "RR toe", "-0.6..-0.52", "--where", "rear_total_toe", "..-0.3")
RANGES += ("--since", "2026-03-01")

if __name__ == "__main__":
    main()
