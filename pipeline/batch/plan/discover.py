"""The captures of an archive, one after another, however many: folders, zips, tars, single files.

The listing goes to a spool on disk, file by file. A folder that turns out to be a capture takes
back what was written since it was entered, so that nothing but the open folders is held in memory.
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
from ...files import ARCHIVE_SUFFIXES
from ...readers import READERS, scan_suffix
from ...vehicle import REFERENCE_WHEELS
from ..storage.entry import Entry

Kind = Literal["folder", "zip", "tar", "cloud", "five-point"]

NO_DATA = re.compile(r"(readme|licen[cs]e|changelog|copying)\b", re.IGNORECASE)
PASSED_OVER = re.compile(r"(^|/)(\.|__MACOSX/|~\$)")


@dataclass(frozen=True)
class Found:
    """A capture: its name relative to the archive, what it is, and its files, sorted by name."""

    name: str
    kind: Kind
    files: tuple[Entry, ...]

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(file.size for file in self.files)

    @property
    def fingerprint(self) -> str:
        """Of names, sizes and stamps of its files: the same while none of them is touched."""
        stamps = [[file.name, file.size, file.stamp] for file in self.files]
        return hashlib.sha256(json.dumps([self.kind, stamps]).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class Captures:
    """The captures that were found, on disk, to be read as often as needed.

    passed_over: files that are neither captures nor parts of one, counted by their suffix.
    """

    spool: Path
    passed_over: Counter[str]

    def __iter__(self) -> Iterator[Found]:
        with self.spool.open("rb") as lines:
            for line in lines:
                name, kind, files = json.loads(line)
                if kind:
                    yield Found(name, kind, tuple(Entry(*file) for file in files))


def discover(entries: Iterable[Entry], spool: Path, source: str) -> Captures:
    """Find the captures among the files of the archive `source`, which come sorted by name.

    Raises InputError where the archive is itself a capture.
    """
    passed_over: Counter[str] = Counter()
    with spool.open("w+b") as stream:
        opened = [_Folder("", 0)]
        for entry in entries:
            if PASSED_OVER.search(entry.name):
                continue
            folder, _, file = entry.name.rpartition("/")
            _go_to(f"{folder}/" if folder else "", opened, stream)
            opened[-1].is_capture |= _marks_a_capture(file)
            if opened[0].is_capture:
                raise InputError(
                    f"{source}: holds {file}, so it is itself a capture: use `wheelplane measure`, "
                    "name the folder above it, or move that file"
                )
            kind = kind_of(file)
            if kind is None and not _may_belong(file):
                passed_over[Path(file).suffix.lower()] += 1
                continue
            _put(stream, entry.name, kind, [[entry.name, entry.size, entry.stamp]])
        _go_to("", opened, stream)
    return Captures(spool, passed_over)


def kind_of(file: str) -> Kind | None:
    """What a file that stands alone is, by its name; None for no capture."""
    lower, suffix = file.lower(), scan_suffix(file)
    if lower.endswith(ARCHIVE_SUFFIXES):
        return "zip" if lower.endswith(".zip") else "tar"
    if suffix in TABLES:
        return None if NO_DATA.match(file) else "five-point"
    return "cloud" if suffix in READERS else None


@dataclass
class _Folder:
    """A folder whose files are being listed, and where its part of the spool begins."""

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
    """Of a capture, make one line of all that was written since it was opened."""
    if folder.is_capture:
        stream.seek(folder.start)
        files = [file for line in stream for file in json.loads(line)[2]]
        stream.seek(folder.start)
        stream.truncate()
        _put(stream, folder.path.rstrip("/"), "folder", files)


def _put(stream: BinaryIO, name: str, kind: Kind | None, files: list[list[str | int]]) -> None:
    stream.write(json.dumps([name, kind, files]).encode() + b"\n")


def _marks_a_capture(file: str) -> bool:
    """As capture_names.is_capture has it."""
    return file.lower() == "capture.toml" or file.split(".")[0].upper() in REFERENCE_WHEELS


def _may_belong(file: str) -> bool:
    """Whether a file may be a part of a capture, though none by itself."""
    return file.lower().endswith(".toml") or _marks_a_capture(file)
