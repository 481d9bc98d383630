"""A million five-point captures: found and measured, the finished run repeated, results asked.

    .venv/bin/python -m tests.bench.million DIR [--count 1000000] [--form folders|zips|both]
        [--workers 2] [--copied]

DIR takes 4 GB of captures in folders of 100,000, or 0.4 GB as zips of 1,000 (both: the first half
in folders, the second as zips), and 62 GB of results; what is there already is used again, and an
interrupted run goes on. --copied: no more than one is
measured, and the results are copies of it with other names, keys and numbers, the fields that the
catalogue reads alone (4 kB of 60), and the index that a run writes beside them. Wall and CPU
seconds of whole processes, the runner's largest resident memory sampled every 0.2 s.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import sys
import time
import uuid
import zipfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from tests.bench.batch import Use
from tests.support.batches import BATCH, PAPER, start
from wheelplane.batch.plan.discover import Captures, discover
from wheelplane.batch.plan.settings import BatchSettings
from wheelplane.batch.storage.zipped import ZippedStore

A_FOLDER, A_ZIP = 100_000, 1000
A_RESULT, A_CAPTURE = 61_440, 4096  # bytes on a disk of blocks of 4 kB
IN_FOLDERS = {"folders": 1.0, "zips": 0.0, "both": 0.5}
ROWS = 20
OF_WHEEL = ("name", "role", "wheel", "status", "toe_deg", "camber_deg", "u_toe_deg", "u_camber_deg",
            "points_on_target", "points_total", "plane_rms_m")  # fmt: skip
QUESTIONS = {
    "counted by SQL": ("--sql", "SELECT status, count(*) FROM captures GROUP BY status"),
    "a name": ("--name", "car-0512345", "--limit", "5"),
    "two ranges, of a quantity and an angle": (
        *("--where", "RR toe", "-0.34..-0.33", "--where", "rear_total_toe", "..-0.3"),
        *("--limit", "20"),
    ),
    "mean of a quantity by SQL": (
        "--sql",
        "SELECT avg(value), count(*) FROM quantities WHERE kind = 'rear_total_toe'",
    ),
    "first 50": ("--limit", "50"),
    "failures": ("--failures",),
    "summary of one quantity": ("--summary", "--quantity", "RR toe"),
    "summary of all quantities": ("--summary",),
    "drift of all quantities": ("--drift",),
    "worst of all quantities": ("--worst", "20"),
}


def name_of(i: int) -> str:
    """Name of the i-th capture."""
    return f"{i // A_FOLDER:03d}/car-{i:07d}.txt"


def captures(count: int) -> Iterator[tuple[int, str]]:
    """Yield number and text of the captures: five points a plane, moved by half a mm."""
    lines = [line.replace(",", " ").split() for line in PAPER.read_text().split("\n") if line]
    rows = [tuple(map(float, line)) for line in lines[:ROWS]]
    rng = random.Random(1)
    for i in range(count):
        moved = (tuple(x + rng.gauss(0.0, 0.0005) for x in row) for row in rows)
        yield i, "".join("%.4f %.4f %.4f\n" % row for row in moved)  # noqa: UP031 (three times as fast)


def make_archive(folder: Path, count: int, in_folders: int) -> None:
    """Write the captures: the first into folders, the others into zips."""
    folder.mkdir(parents=True)
    then = time.time() - 3600.0
    made = captures(count)
    for i, text in islice(made, in_folders):
        path = folder / name_of(i)
        if i % A_FOLDER == 0:
            path.parent.mkdir()
        path.write_text(text)
        os.utime(path, (then, then))
    while some := list(islice(made, A_ZIP)):
        with zipfile.ZipFile(folder / f"{some[0][0] // A_ZIP:04d}.zip", "w") as target:
            for i, text in some:
                target.writestr(name_of(i), text, zipfile.ZIP_DEFLATED)


def found(archive: Path, scratch: Path) -> Captures:
    """Find the captures as a run does."""
    store = ZippedStore(archive)
    return discover(store.list(), scratch / "captures", str(archive), store.zips.members)


def make_results(folder: Path, archive: Path, count: int) -> None:
    """Finish a run of one capture, and copy its result for all others."""
    run(BATCH, "one measured", archive, folder, "--limit", "1", "--workers", "1")
    (path,) = (folder / "measurements").rglob("*.json")
    tree, rng = json.loads(path.read_text()), random.Random(1)
    path.unlink()
    form = {"ensure_ascii": False, "separators": (",", ":")}
    rest = {"frame": tree["frame"], "provenance": {"version": tree["provenance"]["version"]}}
    tail = ",\n".join(f'"{key}":{json.dumps(value, **form)}' for key, value in rest.items())
    wheels = [{key: wheel[key] for key in OF_WHEEL} for wheel in tree["wheels"]]
    seen = folder / "run" / "seen" / BatchSettings().settings_hash[:16]
    for old in seen.iterdir():
        old.unlink()
    for digits in range(256):
        (folder / "measurements" / f"{digits:02x}").mkdir(parents=True, exist_ok=True)
    lines = []
    for i, one in enumerate(found(archive, folder.parent)):
        key = hashlib.sha256(one.name.encode()).hexdigest()
        failed = i % 50 == 49
        batch = tree["batch"] | {"key": key, "date": f"2026-{1 + i % 12:02d}-{1 + i % 28:02d}"}
        if failed:
            reason = f"no plane: {i} points lie on a line"
            batch |= {"status": "failed", "stage": "plane", "reason": reason}
        head = {"schema": tree["schema"], "capture": one.name, "batch": batch}
        head["wheels"] = [] if failed else [moved(wheel, rng) for wheel in wheels]
        head["vehicle"] = {} if failed else moved(tree["vehicle"], rng)
        text = ",\n".join(f'"{k}":{json.dumps(v, **form)}' for k, v in head.items())
        path = folder / "measurements" / key[:2] / f"{key}.json"
        path.write_text(f"{{{text},\n{tail}}}\n")
        lines.append(json.dumps((one.name, one.fingerprint, key, "[]")))
        if len(lines) == 2000 or i == count - 1:
            (seen / f"{uuid.uuid4().hex}.jsonl").write_text("\n".join(lines) + "\n")
            lines = []


def moved(numbers: dict, rng: random.Random) -> dict:
    """Return the same numbers, with angles that scatter by 0.03 degrees."""
    angles = [key for key in numbers if key.endswith("_deg") and not key.startswith("u_")]
    return numbers | {
        key: numbers[key] + rng.gauss(0.0, 0.03) for key in angles if numbers[key] is not None
    }


def run(command: list[str], name: str, *arguments: object) -> None:
    """Print wall and CPU seconds, and the runner's and its children's largest memory in MB."""
    began, use = time.monotonic(), Use()
    process = start_of(command, *map(str, arguments))
    use.watch(process)
    out, err = process.communicate()
    took_s, cpu = time.monotonic() - began, sum(use.cpu_s.values())
    last = (err or out).strip().splitlines()[-1:]
    print(
        f"{name:42} {took_s:8.1f} s {cpu:8.1f} s of CPU, {max(use.runner, default=0.0):6.0f} MB, "
        f"children {max(use.children, default=0.0):.0f} MB, by thirds {use.thirds(use.runner)}; "
        f"exit {process.returncode}; {last}",
        flush=True,
    )


def start_of(command: list[str], *arguments: str):
    """Start `batch` or `results`, its output in pipes that hold what it prints."""
    if command is BATCH:
        archive, results, *options = arguments
        return start(archive, results, *options)
    import subprocess

    return subprocess.Popen(
        [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def main() -> None:
    """Make, run, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--form", choices=IN_FOLDERS, default="folders")
    parser.add_argument("--workers", default="2")
    parser.add_argument("--copied", action="store_true")
    chosen = parser.parse_args()
    archive, results = chosen.folder / chosen.form, chosen.folder / f"results-of-{chosen.form}"
    chosen.folder.mkdir(parents=True, exist_ok=True)
    needed = chosen.count * ((A_CAPTURE if chosen.copied else A_RESULT) + A_CAPTURE)
    if not results.is_dir() and shutil.disk_usage(chosen.folder).free < 1.05 * needed:
        sys.exit(f"{chosen.folder}: {1.05 * needed / 1e9:.0f} GB of free space are needed")
    if not archive.is_dir():
        began = time.monotonic()
        make_archive(archive, chosen.count, int(chosen.count * IN_FOLDERS[chosen.form]))
        print(f"{chosen.count:,} captures made in {time.monotonic() - began:.0f} s", flush=True)
    if chosen.copied and not results.is_dir():
        began = time.monotonic()
        make_results(results, archive, chosen.count)
        print(f"{chosen.count:,} results made in {time.monotonic() - began:.0f} s", flush=True)
    ask = [sys.executable, "-m", "wheelplane", "results", str(results)]
    if chosen.copied:
        run(ask, "catalogue made of the results", "--limit", "1")
    else:
        run(BATCH, "found and measured", archive, results, "--workers", chosen.workers)
    print(f"catalogue: {(results / 'catalogue.sqlite').stat().st_size / 1e6:.0f} MB", flush=True)
    for again in ("finished run repeated", "and once more"):
        run(BATCH, again, archive, results, "--workers", chosen.workers)
    for name, options in QUESTIONS.items():
        run(ask, name, *options)


if __name__ == "__main__":
    main()
