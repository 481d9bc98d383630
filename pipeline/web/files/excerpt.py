"""Excerpt of a text file around the line of an error."""

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
    """Return the error's text and, if it names a line of a text file, the lines around it.

    source: the file or folder that was opened, relative to the current folder.
    """
    tree: dict[str, Any] = {"text": text}
    named = _LINES.search(text)
    path = _file_named(text, source) if source is not None and named else None
    if named is None or path is None:
        return tree
    first, last = int(named[1]), int(named[2] or named[1])
    shown = _lines(path, max(1, first - AROUND), last + AROUND)
    if shown:
        tree |= {"file": path.name, "first": first, "last": last, "lines": shown}
    return tree


def _file_named(text: str, source: Path) -> Path | None:
    """Return the file that the text is about: the source, or the file in it that is named."""
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
            return []  # binary
        stream.seek(0)
        return [
            [number, _shown(line)]
            for number, line in enumerate(islice(_short(stream), first - 1, last), start=first)
        ]


def _short(stream: Any) -> Iterator[bytes]:
    """Yield lines, cutting long ones."""
    while line := stream.readline(1 << 16):
        yield line
        while not line.endswith(b"\n") and (line := stream.readline(1 << 16)):
            pass


def _shown(line: bytes) -> str:
    text = line.decode(errors="replace").rstrip("\r\n")[:LONGEST_LINE]
    return "".join(c if c.isprintable() or c == "\t" else "\ufffd" for c in text)
