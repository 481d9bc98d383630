"""One-token changes of the code, drawn at random, and whether the tests of its room see them.

    nice -n 10 .venv/bin/python -m tests.bench.mutants [--count 60] [--seed 1] [--room ROOM]
    nice -n 10 .venv/bin/python -m tests.bench.mutants --named

Each change is made in a copy of the files under version control, and the room's own tests, but for
the slow ones, run there until the first fails. A survivor is a law without a test, or an equivalent
change.
"""

from __future__ import annotations

import argparse
import ast
import io
import keyword
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = {
    "pipeline/plane": ["tests/plane"],
    "pipeline/vehicle": ["tests/vehicle"],
    "pipeline/centre/edge": ["tests/centre"],
    "pipeline/uncertainty": ["tests/uncertainty"],
    "pipeline/readers": ["tests/readers"],
    "pipeline/batch/catalogue": ["tests/batch/test_catalogue.py", "tests/batch/test_results.py"],
}
OTHERS = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "+": "-", "-": "+", "*": "/", "/": "*", "//": "*", "%": "*", "**": "*", "@": "*",
    "&": "|", "|": "&", "+=": "-=", "-=": "+=", "*=": "/=", "&=": "|=", "|=": "&=",
    "and": "or", "or": "and", "True": "False", "False": "True", "break": "continue",
    "min": "max", "max": "min", "any": "all", "all": "any", "sin": "cos", "cos": "sin",
    "argmin": "argmax", "argmax": "argmin", "minimum": "maximum", "maximum": "minimum",
}  # fmt: skip
TIME_S = 600.0
NAMED = [  # that no test saw once: module, text, other text, tests
    ("vehicle/angles.py", "MIN_OUTWARD_COSINE = 0.1", "MIN_OUTWARD_COSINE = 0.05", "vehicle"),
    ("vehicle/angles.py", "MAX_NEAREST_RATIO = 0.9", "MAX_NEAREST_RATIO = 0.95", "vehicle"),
    ("vehicle/frame.py", "wheelbase_m <= MIN_HEIGHT_TO_SPREAD * spread_m", "False", "vehicle"),
    ("plane/least_squares.py", "where=wide > 0.0", "where=wide <= 0.0", "plane"),
    ("plane/least_squares.py", "- tilt @ along[:2, 2]", "+ tilt @ along[:2, 2]", "plane"),
    ("cloud/selection.py", "min(self.reach_m, self.most_m)", "max(self.reach_m, self.most_m)",
     "cloud"),
    ("plane/fit_plane.py", "correlated.white_sigma_m / CLIPPED_SIGMA_RATIO",
     "correlated.white_sigma_m", "plane"),
    ("plane/fit_plane.py", "np.linalg.inv(self.scatter_m2)) / 2.0",
     "np.linalg.inv(self.scatter_m2))", "plane"),
    ("plane/clipped_plane.py", "or slab.is_near(plane, radius_m)", "or True", "plane"),
    ("readers/formats/ply.py", "lines < before + count", "lines < count",
     "readers/test_ply.py"),
    ("batch/catalogue/catalogue.py", "verified=workspace.locked", "verified=True",
     "batch/test_catalogue.py"),
    ("batch/catalogue/catalogue.py", "wait=not (reading and file.exists())", "wait=True",
     "batch/test_catalogue.py"),
    ("batch/catalogue/catalogue.py", "mark_verified(workspace.file, now_ns)", "pass",
     "batch/test_catalogue.py"),
]  # fmt: skip


def changes(path: Path) -> list[tuple[int, int, str, str]]:
    """Return line, column, token and other token of all changes of a module's code.

    Texts, annotations, imports, signatures and `|` of types are left out.
    """
    text = path.read_text()
    skipped: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Raise):
            skipped |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            skipped |= set(range(node.lineno, node.body[0].lineno))
        if isinstance(node, ast.AnnAssign):
            skipped |= set(range(node.lineno, (node.annotation.end_lineno or node.lineno) + 1))
        if isinstance(node, ast.ClassDef):
            skipped |= {node.lineno}
    found, before = [], None
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        line, column = token.start
        if line not in skipped:
            other = OTHERS.get(token.string) if token.type in (1, 54) else number(token.string)
            is_unary = token.string in "+-*" and (
                before is None
                or before.string in ("(", "[", ",", "=", ":", "return", "{")
                or keyword.iskeyword(before.string)
            )
            if is_unary:
                other = "" if token.string == "-" else None
            is_decorator = token.string == "@" and not token.line[:column].strip()
            if other is not None and token.type in (1, 2, 54) and not is_decorator:
                found.append((line, column, token.string, other))
        before = token
    return found


def number(text: str) -> str | None:
    """Return another number: half as much more, or one more of a whole one."""
    try:
        return str(int(text) + 1)
    except ValueError:
        pass
    try:
        return repr(1.5 * float(text) or 0.5)
    except ValueError:
        return None


def drawn(count: int, seed: int) -> list[tuple[str, Path, tuple[int, int, str, str]]]:
    """Draw the same number of changes in each room."""
    rng, found = random.Random(seed), []
    for room in ROOMS:
        paths = sorted((ROOT / room).rglob("*.py"))
        every = [(path.relative_to(ROOT), one) for path in paths for one in changes(path)]
        found += [(room, *one) for one in rng.sample(every, count // len(ROOMS))]
    return found


def tested(work: Path, tests: list[str]) -> tuple[bool, str]:
    """Return whether the tests pass there, and the first that fails."""
    environment = os.environ | {"PYTHONPATH": str(work / ".ci" / "editable")}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow", "--no-header"]
    command += ["-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command, cwd=work, env=environment, capture_output=True, text=True, timeout=TIME_S,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return False, "takes too long"
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return done.returncode == 0, (failed or [f"exit code {done.returncode}"])[0][:100]


def copy_of(work: Path) -> None:
    """Copy the files under version control."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for name in filter(None, listed.stdout.split("\0")):
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, work / name, follow_symlinks=False)


def named() -> None:
    """Make the changes of NAMED, and print whether they are seen."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        work = Path(folder)
        copy_of(work)
        for module, text, other, tests in NAMED:
            path = work / "pipeline" / module
            before = path.read_text()
            assert before.count(text) == 1, (module, text)
            path.write_text(before.replace(text, other))
            passed, which = tested(work, [f"tests/{tests}"])
            path.write_text(before)
            what = "SURVIVES" if passed else "seen"
            print(f"{what:8} {module}: {text} -> {other}  [{which}]", flush=True)


def main() -> None:
    """Change, test, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--room", choices=ROOMS, help="this room's alone")
    parser.add_argument("--named", action="store_true", help="those that no test saw once")
    chosen = parser.parse_args()
    survivors = total = 0
    if chosen.named:
        named()
        return
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        work = Path(folder)
        copy_of(work)
        for room, path, (line, column, token, other) in drawn(chosen.count, chosen.seed):
            if chosen.room not in (None, room):
                continue
            before = (work / path).read_text()
            lines = before.splitlines(keepends=True)
            old = lines[line - 1]
            lines[line - 1] = old[:column] + other + old[column + len(token) :]
            (work / path).write_text("".join(lines))
            began = time.monotonic()
            passed, which = tested(work, ROOMS[room])
            (work / path).write_text(before)
            survivors, total = survivors + passed, total + 1
            what = "SURVIVES" if passed else "seen"
            print(
                f"{what:8} {time.monotonic() - began:4.0f} s {path}:{line}: {token} -> {other}: "
                f"{old.strip()[:90]}  [{'' if passed else which}]",
                flush=True,
            )
    print(f"{survivors} of {total} survive")


if __name__ == "__main__":
    main()
