"""What went wrong, and the lines of the file where it did."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

AROUND = 3  # lines before and after
LONGEST_LINE = 160
FURTHEST_LINE = 2_000_000
_LINES = re.compile(r"\blines? (\d+)(?:-(\d+))?")


def failure(text: str, source: Path | None) -> dict[str, Any]:
    """The error's text; where it names a line of a text file, that line and its neighbours.

    source: the file or folder that was opened, relative to the current folder.
    """
    told: dict[str, Any] = {"text": text}
    named = _LINES.search(text)
    path = _file_named(text, source) if source is not None and named else None
    if named is None or path is None:
        return told
    first, last = int(named[1]), int(named[2] or named[1])
    shown = _lines(path, max(1, first - AROUND), last + AROUND)
    if shown:
        told |= {"file": path.name, "first": first, "last": last, "lines": shown}
    return told


def _file_named(text: str, source: Path) -> Path | None:
    """The file that the text is about: the source itself, or the one of its files it names."""
    if source.is_file():
        return source
    if not source.is_dir():
        return None
    files = (p for p in source.iterdir() if p.is_file() and not p.is_symlink() and p.name in text)
    return max(files, key=lambda path: len(path.name), default=None)


def _lines(path: Path, first: int, last: int) -> list[list[Any]]:
    if last > FURTHEST_LINE:
        return []
    with path.open("rb") as stream:
        if b"\0" in stream.read(4096):
            return []  # no text
        stream.seek(0)
        return [
            [number, _shown(line)]
            for number, line in enumerate(islice(_short(stream), first - 1, last), start=first)
        ]


def _short(stream: Any) -> Iterator[bytes]:
    """Lines, of which a long one is cut."""
    while line := stream.readline(1 << 16):
        yield line
        while not line.endswith(b"\n") and (line := stream.readline(1 << 16)):
            pass


def _shown(line: bytes) -> str:
    text = line.decode(errors="replace").rstrip("\r\n")[:LONGEST_LINE]
    return "".join(c if c.isprintable() or c == "\t" else "\ufffd" for c in text)
