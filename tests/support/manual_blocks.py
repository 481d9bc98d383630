"""The blocks of the manual: files to write, commands to run, and their printed output."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from wheelplane.cli import main
from wheelplane.config import config_file
from wheelplane.manual.build import chapter_files
from wheelplane_synth.output.archive import write_capture

FENCE = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PROMPT = re.compile(r"^\$ ([^\n]*)\n(.*?)(?=^\$ |\Z)", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"\s*# exit code (\d)$")
# Not run: installers, other programs, and the repository's own tools.
OTHERS = ("pip ", "make ", ".venv/bin/python ")
# Servers and watchers do not end: only their arguments are checked.
ENDLESS = re.compile(r"wheelplane view|.* --watch")
PROGRESS = re.compile(r"^\d+ of \d+, .*\n", re.MULTILINE)  # shown where a batch takes its time
NUMBER = re.compile(r"""[+-]?\d+°\d+'\d+(?:\.\d+)?"|[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?""")


@dataclass(frozen=True)
class Command:
    """A command of the manual, with the output that the manual shows, or None."""

    where: str
    line: str
    code: int
    shown: str | None
    span: tuple[int, int] = (0, 0)  # of the shown output, in the text of the chapter


@dataclass(frozen=True)
class File:
    """A file that the reader writes."""

    where: str
    name: str
    text: str

    def write(self) -> None:
        """Write it below the current folder."""
        Path(self.name).parent.mkdir(parents=True, exist_ok=True)
        Path(self.name).write_text(self.text, encoding="utf-8")


def prepare(path: Path) -> None:
    """Write to a reader's folder the capture that `wheelplane demo` leaves, with fewer points."""
    coarse = next(one for one in blocks() if isinstance(one, File) and one.name == "coarse.toml")
    (path / "coarse.toml").write_text(coarse.text)
    write_capture(
        path / "demo-output" / "capture",
        seed=1,
        vehicle=config_file("vehicles", "saloon"),
        scanner=path / "coarse.toml",
        target=config_file("targets", "disc-250"),
        trials=0,
    )


def blocks() -> Iterator[Command | File]:
    """Yield the blocks of all chapters in the order of reading."""
    for path in chapter_files():
        text = path.read_text(encoding="utf-8")
        for found in FENCE.finditer(text):
            line = text.count("\n", 0, found.start()) + 1
            where = f"{path.name}:{line}"
            language, name, body = found.groups()
            if name:
                yield File(where, name, body)
            elif language == "sh":
                yield from (_command(where, one) for one in _lines(body))
            elif language == "console":
                for part in PROMPT.finditer(body):
                    start, end = (found.start(3) + at for at in part.span(2))
                    yield _command(where, part[1], part[2], (start, end))


def _lines(body: str) -> list[str]:
    whole = body.replace("\\\n", " ").splitlines()
    return [line for line in whole if line.strip() and not line.startswith("#")]


def _command(
    where: str, line: str, shown: str | None = None, span: tuple[int, int] = (0, 0)
) -> Command:
    found = CODE.search(line)
    return Command(where, CODE.sub("", line), int(found[1]) if found else 0, shown, span)


def run(line: str) -> tuple[int, str]:
    """Run `wheelplane ...`; return its exit code and what it prints to stdout and stderr.

    A batch, which has child processes and signals of its own, runs in a process of its own.
    """
    if line.startswith("wheelplane batch"):
        command = [sys.executable, "-m", "wheelplane", *shlex.split(line)[1:]]
        done = subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        return done.returncode, PROGRESS.sub("", done.stdout)
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", shlex.split(line))
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            try:
                main()
            except SystemExit as end:
                return int(end.code or 0), printed.getvalue()
    raise AssertionError("main() ends by SystemExit")


@contextlib.contextmanager
def folder(path: Path) -> Iterator[None]:
    """Change the current folder for the duration of a block."""
    before = Path.cwd()
    os.chdir(path)
    try:
        yield
    finally:
        os.chdir(before)


def differs(shown: str, printed: str) -> str:
    """Describe the first difference between shown and printed output; empty where none.

    `...` on a line of its own stands for any lines. Words must be the same; numbers may differ by
    what another processor's rounding of a ray at an edge moves: 3 seconds of arc, else 5 % or 0.05.
    """
    rest = printed.rstrip("\n").split("\n")
    pieces = re.split(r"^\.\.\.\n", shown.rstrip("\n") + "\n", flags=re.MULTILINE)
    for place, piece in enumerate(pieces):
        wanted = piece.rstrip("\n").split("\n") if piece.strip() else []
        if not wanted:
            if place == len(pieces) - 1:
                rest = []
            continue
        starts = range(len(rest) - len(wanted) + 1) if place else range(1)
        for start in starts:
            if all(alike(a, b) for a, b in zip(wanted, rest[start:], strict=False)):
                rest = rest[start + len(wanted) :]
                break
        else:
            return _first_difference(wanted, rest)
    return "" if not rest or pieces[-1].strip() == "" else f"more is printed: {rest[0]!r}"


def _first_difference(wanted: list[str], rest: list[str]) -> str:
    for line, other in zip(wanted, [*rest, *[""] * len(wanted)], strict=False):
        if not alike(line, other):
            return f"shown {line!r}, printed {other!r}"
    return f"{len(wanted)} lines are shown, {len(rest)} left"


def alike(line: str, other: str) -> bool:
    """Return whether two lines have the same words and nearly the same numbers."""
    if NUMBER.sub("#", line).split() != NUMBER.sub("#", other).split():
        return False
    pairs = zip(NUMBER.findall(line), NUMBER.findall(other), strict=True)
    return all(_near(a, b) for a, b in pairs)


def _near(one: str, other: str) -> bool:
    if "°" in one or "°" in other:
        return "°" in one and "°" in other and abs(_seconds(one) - _seconds(other)) <= 3.0
    a, b = float(one), float(other)
    return abs(a - b) <= max(0.05, 0.05 * abs(a))


def _seconds(text: str) -> float:
    degrees, minutes, seconds = (float(x) for x in re.findall(r"\d+(?:\.\d+)?", text))
    size = 3600.0 * degrees + 60.0 * minutes + seconds
    return -size if text.startswith("-") else size
