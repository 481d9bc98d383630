"""Captures of an archive: folders, zips, tars and single files, in any number.

The listing is written to a spool on disk, file by file. When a folder turns out to be a capture,
the lines written since it was entered are replaced by one. Only the open folders are in memory.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal

from ...capture import TABLES
from ...errors import InputError
from ...files import ARCHIVE_SUFFIXES, improper
from ...readers import READERS, scan_suffix
from ...vehicle import REFERENCE_WHEELS
from ..storage.entry import IMPROPER, MOST_LEVELS, OUTSIDE, TOO_DEEP, Entry

Kind = Literal["folder", "zip", "tar", "cloud", "five-point"]

NO_DATA = re.compile(r"(readme|licen[cs]e|changelog|copying)\b", re.IGNORECASE)
PASSED_OVER = re.compile(r"(^|/)(\.(?!\.?(/|$))|__MACOSX/|~\$)")  # . and .. are no hidden files
UNUSABLE = (OUTSIDE, IMPROPER, TOO_DEEP)


@dataclass(frozen=True)
class FoundCapture:
    """Capture of an archive: its name relative to the archive, its kind, its files by name."""

    name: str
    kind: Kind
    files: tuple[Entry, ...]

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(file.size for file in self.files)

    @property
    def refusal(self) -> str | None:
        """Reason why it cannot be copied from the archive, if that is known from its name."""
        if any(file.stamp == IMPROPER for file in self.files):
            return f"{self.name[:200]}: the key {improper(self.name)}: rename the object"
        if any(file.stamp == TOO_DEEP for file in self.files):
            return (
                f"{self.name[:60]}...: more than {MOST_LEVELS} folders deep, or too long a path: "
                "move it up"
            )
        return None

    @property
    def fingerprint(self) -> str:
        """Hash of the names, sizes and stamps of its files: constant while none is modified."""
        stamps = [[file.name, file.size, file.stamp] for file in self.files]
        return hashlib.sha256(json.dumps([self.kind, stamps]).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class Captures:
    """Captures that were found, listed on disk, iterable any number of times.

    passed_over: files that are neither captures nor parts of one, counted by suffix.
    """

    spool: Path
    passed_over: Counter[str]

    def __iter__(self) -> Iterator[FoundCapture]:
        with self.spool.open("rb") as lines:
            for line in lines:
                name, kind, files = json.loads(line)
                if kind:
                    yield FoundCapture(name, kind, tuple(Entry(*file) for file in files))


def discover(entries: Iterable[Entry], spool: Path, source: str) -> Captures:
    """Find the captures among the files of the archive `source`, which are sorted by name.

    Raises InputError if the archive is itself a capture.
    """
    passed_over: Counter[str] = Counter()
    with spool.open("w+b") as stream:
        opened = [_Folder("", 0)]
        for entry in entries:
            if PASSED_OVER.search(entry.name):
                continue
            folder, _, file = entry.name.rpartition("/")
            _go_to(f"{folder}/" if folder else "", opened, stream)
            kind = "folder" if entry.stamp in (OUTSIDE, TOO_DEEP) else kind_of(file)
            if kind is None and not _may_belong(file):
                passed_over[Path(file).suffix.lower()] += 1
                continue
            if entry.stamp in UNUSABLE:  # a capture, which cannot be measured
                kind = kind or "folder"
            else:
                opened[-1].is_capture |= _marks_a_capture(file)
            if opened[0].is_capture:
                raise InputError(
                    f"{source}: contains {file}, so it is itself a capture: use "
                    "`wheelplane measure`, give the folder above it, or move that file"
                )
            _put(stream, entry.name, kind, [[entry.name, entry.size, entry.stamp]])
        _go_to("", opened, stream)
    return Captures(spool, passed_over)


def kind_of(file: str) -> Kind | None:
    """Return the kind of a single file by its name; None if it is not a capture."""
    lower, suffix = file.lower(), scan_suffix(file)
    if lower.endswith(ARCHIVE_SUFFIXES):
        return "zip" if lower.endswith(".zip") else "tar"
    if suffix in TABLES:
        return None if NO_DATA.match(file) else "five-point"
    return "cloud" if suffix in READERS else None


@dataclass
class _Folder:
    """Folder whose files are being listed, and where its part of the spool begins."""

    path: str
    start: int
    is_capture: bool = False


def _go_to(path: str, opened: list[_Folder], stream: BinaryIO) -> None:
    """Close the folders that do not hold `path`, and open those that do."""
    while not path.startswith(opened[-1].path):
        _close(opened.pop(), stream)
    above = opened[-1].path
    for part in path[len(above) :].split("/")[:-1]:
        above += f"{part}/"
        opened.append(_Folder(above, stream.tell()))


def _close(folder: _Folder, stream: BinaryIO) -> None:
    """Replace the lines written since a capture was opened by a single one."""
    if folder.is_capture:
        stream.seek(folder.start)
        files = [file for line in stream for file in json.loads(line)[2]]
        stream.seek(folder.start)
        stream.truncate()
        own = [file for file in files if file[2] != IMPROPER]
        _put(stream, folder.path.rstrip("/"), "folder", own)
        for file in files:
            if file[2] == IMPROPER:
                _put(stream, file[0], "folder", [file])


def _put(stream: BinaryIO, name: str, kind: Kind | None, files: list[list[str | int]]) -> None:
    stream.write(json.dumps([name, kind, files]).encode() + b"\n")


def _marks_a_capture(file: str) -> bool:
    """Return whether a file of this name makes its folder a capture, as capture.is_capture does."""
    return file.lower() == "capture.toml" or file.split(".")[0].upper() in REFERENCE_WHEELS


def _may_belong(file: str) -> bool:
    """Return whether a file may be part of a capture without being one itself."""
    lower = file.lower()
    return lower.endswith(".toml") or lower == "readings.xlsx" or _marks_a_capture(file)
