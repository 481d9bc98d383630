"""One-token changes of the code, and whether the tests of its room see them.

    nice -n 10 .venv/bin/python -m tests.bench.mutants [--room ROOM] [--budget S] [--survivors]
                                                       [--since COMMIT]

The outcomes are lines of JSON in --folder, by which an interrupted run goes on. A survivor is a law
without a test, or an equivalent change: those stand in equivalent_mutants.toml and are left out.
mutant_session.py says how the tests are run.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict
from functools import partial
from pathlib import Path

from tests.bench.changes import ROOT, Change, Outcome, changes_of

ROOMS = {  # own tests first; then quick ones of other rooms that use its results
    "pipeline/vehicle": ["vehicle", "uncertainty", "kinematics", "five_point", "measurement"],
    "pipeline/plane": ["plane", "cloud", "detection", "measurement/test_measure.py"],
    "pipeline/uncertainty": ["uncertainty", "vehicle", "five_point", "measurement/test_limits.py",
                             "measurement/test_quantities.py", "measurement/test_tolerance.py",
                             "measurement/test_conformity.py", "calibration/test_calibrate.py"],
    "pipeline/centre/edge": ["centre", "targets", "measurement/test_measure.py"],
    "pipeline/batch/catalogue": ["batch/test_catalogue.py", "batch/test_results.py"],
    "pipeline/readers": ["readers"],
}  # fmt: skip


def copy_of(work: Path) -> None:
    """Copy the files under version control, as they are."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    for name in filter(None, listed.stdout.split("\0")):
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_file() or (ROOT / name).is_symlink():
            shutil.copy2(ROOT / name, work / name, follow_symlinks=False)


def lines_at(commit: str, room: str) -> set[str]:
    """Return the lines, without indent, that a room had at a commit."""
    git = ["git", "-C", os.environ["MUTANTS_COPY"]]
    run = partial(subprocess.run, capture_output=True, text=True, check=True)
    names = run([*git, "ls-tree", "-r", "--name-only", commit, f"{room}/"]).stdout.splitlines()
    texts = [
        run([*git, "show", f"{commit}:{name}"]).stdout for name in names if name.endswith(".py")
    ]
    return {line.strip() for text in texts for line in text.splitlines()}


def main() -> None:
    """Try the changes in a copy of the files, and print how many were seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", choices=ROOMS, help="this room's alone")
    parser.add_argument("--survivors", action="store_true", help="again, those that no test saw")
    parser.add_argument("--since", metavar="COMMIT", help="of lines that the room had not then")
    parser.add_argument("--tests", nargs="+", help="instead of the room's")
    parser.add_argument("--count", type=int, help="as many of each room, drawn at random")
    parser.add_argument("--budget", type=float, default=20.0, help="seconds of tests a change")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "mutants")
    chosen = parser.parse_args()
    if "MUTANTS_COPY" not in os.environ:
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
            work = Path(folder)
            copy_of(work)
            paths = os.pathsep.join([str(work / ".ci" / "editable"), str(work)])
            environment = os.environ | {"PYTHONPATH": paths, "MUTANTS_COPY": str(ROOT)}
            command = [sys.executable, "-m", "tests.bench.mutants", *sys.argv[1:]]
            sys.exit(subprocess.run(command, cwd=work, env=environment, check=False).returncode)
    chosen.folder.mkdir(parents=True, exist_ok=True)
    for room, tests in ROOMS.items():
        if chosen.room not in (None, room):
            continue
        file = chosen.folder / (room.replace("/", "-") + ".jsonl")
        known = outcomes(file)
        changes = changes_of(room)
        if chosen.since:
            before = lines_at(chosen.since, room)
            changes = [one for one in changes if one.was not in before]
        if chosen.count:
            changes = random.Random(1).sample(changes, min(chosen.count, len(changes)))
        if chosen.survivors:
            again = [one for one in changes if known.get(one.key, "") is None]
        else:
            again = [one for one in changes if one.key not in known]
        tried(room, chosen.tests or [f"tests/{one}" for one in tests], again, chosen, file)
        known = outcomes(file)
        seen = [bool(known[one.key]) for one in changes if one.key in known]
        print(f"{room}: {sum(seen)} of {len(seen)} seen, of {len(changes)}", flush=True)


def tried(
    room: str, tests: list[str], changes: list[Change], chosen: argparse.Namespace, file: Path
) -> None:
    """Try changes of one room; add their outcomes to a file, and print the survivors."""
    from tests.bench.mutant_session import Room, try_all  # once this is the copy

    def write(outcome: Outcome) -> None:
        with file.open("a") as stream:
            stream.write(json.dumps(asdict(outcome)) + "\n")
        if not outcome.seen_by:
            change = outcome.change
            text = f"{change.file}:{change.line}: {change.was}  ->  {change.now}"
            os.write(2, f"SURVIVES {outcome.tests} tests: {text}\n".encode())

    try_all(Room(room, tests, chosen.folder, chosen.budget), changes, write)


def outcomes(file: Path) -> dict[tuple[str, int, str, str], str | None]:
    """Return by which test each change was seen, by the changes' keys."""
    rows = [json.loads(line) for line in file.open()] if file.exists() else []
    return {Change(**row["change"]).key: row["seen_by"] for row in rows}


if __name__ == "__main__":
    main()
