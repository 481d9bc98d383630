"""Instructions that `measure` and `inspect` execute on one small capture, against those noted.

    .venv/bin/python -m tests.bench.instructions [--write]

Counted by cachegrind, which is the same on a busy machine and on a quiet one (to 1e-7), in one
thread. Ends with 1 where a count is more than 20 % above the one noted in instructions.json, as CI
asks; --write notes the counts of now. Start-up is a third of them.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

NOTED = Path(__file__).with_suffix(".json")
MOST = 1.2
COMMANDS = {"measure": ["measure", "capture", "--json"], "inspect": ["inspect", "capture"]}
SPACING = ("spacing_m = 0.0009", "spacing_m = 0.004")
CACHEGRIND = (
    "valgrind", "--tool=cachegrind", "--cache-sim=no", "--branch-sim=no",
    "--cachegrind-out-file=/dev/null",
)  # fmt: skip
ALONE = {
    "PYTHONHASHSEED": "0",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "WHEELPLANE_THREADS": "1",
}
WHEELPLANE = (sys.executable, "-m", "wheelplane")


def make_capture(folder: Path) -> None:
    """Four scans of some 32,000 points."""
    text = (Path(__file__).parents[2] / "configs/scanners/default.toml").read_text()
    assert SPACING[0] in text
    (folder / "coarse.toml").write_text(text.replace(*SPACING))
    synth = (*WHEELPLANE, "synth", "capture", "--seed", "7", "--trials", "0")
    subprocess.run((*synth, "--scanner", "coarse.toml"), check=True, cwd=folder, stdout=-3)


def counted(command: list[str], folder: Path) -> int:
    """Instructions of one process, after a run that leaves compiled modules behind."""
    surroundings = {**os.environ, **ALONE}
    surroundings.pop("PYTHONDONTWRITEBYTECODE", None)
    run = {"check": True, "cwd": folder, "env": surroundings, "capture_output": True}
    subprocess.run((*WHEELPLANE, *command), **run)
    done = subprocess.run((*CACHEGRIND, *WHEELPLANE, *command), **run, text=True)
    (refs,) = re.findall(r"I\s+refs:\s+([\d,]+)", done.stderr)
    return int(refs.replace(",", ""))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="note the counts of now")
    options = parser.parse_args()
    if shutil.which("valgrind") is None:
        print("not counted: there is no valgrind")
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        make_capture(Path(scratch))
        now = {name: counted(command, Path(scratch)) for name, command in COMMANDS.items()}
    if options.write:
        NOTED.write_text(json.dumps(now, indent=1) + "\n")
    noted = json.loads(NOTED.read_text())
    for name, count in now.items():
        share = count / noted[name]
        print(f"{name:8s} {count / 1e9:6.2f}e9 instructions, {share:.3f} of those noted")
    return int(any(count > MOST * noted[name] for name, count in now.items()))


if __name__ == "__main__":
    sys.exit(main())
