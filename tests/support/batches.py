"""Archives of small captures, runs of `wheelplane batch` on them, and what they leave."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from types import ModuleType
from unittest import mock

import numpy as np

from wheelplane.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAPER = ROOT / "tests" / "data" / "paper" / "figure-4.txt"
BATCH = [sys.executable, "-m", "wheelplane", "batch"]


def five_points(path: Path, seed: int, planes: int = 4) -> Path:
    """A file of five points a plane: the paper's, moved at random by half a millimetre."""
    rows = [line.replace(",", " ").split() for line in PAPER.read_text().split("\n") if line]
    points = np.array(rows, dtype=float)[: 5 * planes]
    points += np.random.default_rng(seed).normal(0.0, 0.0005, points.shape)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join("{:.4f} {:.4f} {:.4f}\n".format(*row) for row in points))
    return path


def archive_of(folder: Path, count: int, first: int = 0) -> Path:
    """A folder of so many five-point files, ten a sub-folder."""
    for k in range(first, first + count):
        five_points(folder / f"{k // 10:02d}" / f"car-{k:04d}.txt", k)
    settle(folder)
    return folder


def zip_of_discs(path: Path, seed: int, spacing_m: float = 0.006) -> Path:
    """A zip of four scans of a disc each, which are measured in a fifth of a second."""
    rng = np.random.default_rng(seed)
    steps = np.arange(-0.125, 0.126, spacing_m)
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    inside = np.hypot(u, v) < 0.125
    disc = np.column_stack([u, np.zeros(u.size), v])[inside]
    centres = {"rr": (0, -0.75), "rl": (0, 0.75), "fr": (2.6, -0.75), "fl": (2.6, 0.75)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr(zipfile.ZipInfo("capture.toml"), 'target = "disc-250"\n')
        for wheel, (x, y) in centres.items():
            points = disc + np.array([x, y, 0.3]) + rng.normal(0.0, 0.0003, disc.shape)
            text = "".join("{:.5f} {:.5f} {:.5f}\n".format(*point) for point in points)
            packed.writestr(zipfile.ZipInfo(f"{wheel}.xyz"), text)
    return path


def settle(folder: Path) -> None:
    """Make all files an hour old, so that their times are believed."""
    then = time.time() - 3600.0
    for path in folder.rglob("*"):
        os.utime(path, (then, then))


def start(
    archive: Path | str, results: Path | str, *options: str, **environment: str
) -> subprocess.Popen[str]:
    """A run in a process group of its own."""
    return subprocess.Popen(
        [*BATCH, str(archive), "-o", str(results), *options],
        cwd=ROOT,
        env=os.environ | environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def run_process(
    archive: Path | str, results: Path | str, *options: str, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run `wheelplane batch` in a process of its own, to its end."""
    process = start(archive, results, *options, **environment)
    out, err = process.communicate(timeout=300)
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def run(
    archive: Path | str, results: Path | str, *options: str
) -> subprocess.CompletedProcess[str]:
    """Run `wheelplane batch` in this process, whose fork server serves all runs."""
    return call("batch", archive, "-o", results, *options)


def call(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, as its console script does; environment and signals stay."""
    argv = ["wheelplane", *map(str, arguments)]
    out = io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True)
    err = io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", write_through=True)
    handler = signal.getsignal(signal.SIGTERM)
    runner = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")  # or each worker process would import pytest
    code: object = None
    try:
        with (
            mock.patch.dict(os.environ),
            mock.patch.object(sys, "argv", argv),
            redirect_stdout(out),
            redirect_stderr(err),
        ):
            main()
    except SystemExit as end:
        code = end.code
    finally:
        sys.modules["__main__"] = runner
        signal.signal(signal.SIGTERM, handler)
    assert isinstance(code, int)
    texts = (stream.buffer.getvalue().decode() for stream in (out, err))
    return subprocess.CompletedProcess(argv, code, *texts)


def poisoned(marks: Path) -> dict[str, str]:
    """The environment in which captures of certain names kill their child."""
    path = [str(ROOT / "tests" / "poison"), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {"PYTHONPATH": os.pathsep.join(path), "WHEELPLANE_POISON_MARKS": str(marks)}


def left(results: Path) -> dict[str, bytes]:
    """All that is meant to last: the JSONs and the catalogue."""
    files = [*(results / "measurements").rglob("*.json"), results / "catalogue.sqlite"]
    return {str(path.relative_to(results)): path.read_bytes() for path in files}


def trees(results: Path) -> dict[str, dict]:
    """The JSONs by the names of their captures."""
    found = [json.loads(path.read_bytes()) for path in (results / "measurements").rglob("*.json")]
    assert len({tree["capture"] for tree in found}) == len(found)
    return {tree["capture"]: tree for tree in found}


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they did."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            child = int(path.parent.name)
            found += [child, *descendants(child)]
    return found


def kill(pid: int) -> None:
    """SIGKILL, to whom is still there."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return
