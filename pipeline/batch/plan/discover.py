"""Captures of an archive: folders, zips, tars and single files, in any number.

A zip is one capture, as a folder of its own, unless it holds several: then these are captures named
by the zip and their path in it, found as in folders.

The listing is written to a spool on disk, file by file. When a folder turns out to be a capture,
the lines written since it was entered are replaced by one. Only the open folders are in memory.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal, NamedTuple

from ...capture import TABLES
from ...errors import InputError
from ...files import ARCHIVE_SUFFIXES, improper
from ...readers import READERS, scan_suffix
from ...system import frozen
from ...vehicle import REFERENCE_WHEELS
from ..storage.entry import DENIED, IMPROPER, MOST_LEVELS, OUTSIDE, TOO_DEEP, Entry

Kind = Literal["folder", "zip", "tar", "cloud", "five-point"]

NO_DATA = re.compile(r"(readme|licen[cs]e|changelog|copying)\b", re.IGNORECASE)
PASSED_OVER = re.compile(r"(^|/)(\.(?!\.?(/|$))|__MACOSX/|~\$|lost\+found(/|$))")
# . and .. are no hidden files; lost+found is of the file system, and root's
NOT_LISTED = (OUTSIDE, TOO_DEEP, DENIED)
UNUSABLE = (*NOT_LISTED, IMPROPER)
FIVE_POINT_S, SCANS_S, BYTES_PER_S = 0.008, 0.3, 1e8  # of one core: see `expected_s`


@frozen
class FoundCapture:
    """Capture of an archive: its name relative to the archive, its kind, its files by name.

    packed: name of the zip of several captures that holds it; empty if none does.
    """

    name: str
    kind: Kind
    files: tuple[Entry, ...]
    packed: str = ""

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(file.size for file in self.files)

    @property
    def expected_s(self) -> float:
        """Seconds that one core takes for it, roughly: for their ratio to those of others."""
        return _expected_s(self.kind, self.size)

    @property
    def refusal(self) -> str | None:
        """Reason why it cannot be copied from the archive, if that is known from its name."""
        if any(file.stamp == IMPROPER for file in self.files):
            return f"{self.name}: the key {improper(self.name)}: rename the object"
        if any(file.stamp == TOO_DEEP for file in self.files):
            fact = f"more than {MOST_LEVELS} folders deep, or too long a path"
            return f"{self.name}: {fact}: move it up"
        for file in self.files:
            if file.stamp == DENIED:
                return f"{file.name}: no permission to list the folder: check its permissions"
        return None

    @property
    def fingerprint(self) -> str:
        """Hash of the names, sizes and stamps of its files: constant while none is modified."""
        return _fingerprint(self.kind, [_listed(file) for file in self.files])

    @property
    def listed(self) -> ListedCapture:
        """Name, fingerprint and expected seconds, which are compared with earlier runs."""
        return ListedCapture(self.name, self.fingerprint, self.expected_s)


class ListedCapture(NamedTuple):
    """Name, fingerprint and expected seconds of a `FoundCapture`."""

    name: str
    fingerprint: str
    expected_s: float


@frozen
class Captures:
    """Captures that were found, listed on disk, iterable any number of times.

    passed_over: files that are neither captures nor parts of one, counted by suffix. unlisted:
    folders and zips that could not be listed, so that what lies in them is unknown.
    """

    spool: Path
    passed_over: Counter[str]
    unlisted: tuple[str, ...] = ()

    def __iter__(self) -> Iterator[FoundCapture]:
        for name, kind, listed, packed in self._lines():
            files = tuple(Entry(*file) for file in listed)
            yield FoundCapture(name, kind, files, packed[0] if packed else "")

    def listed(self) -> Iterator[ListedCapture]:
        """Yield what is compared with earlier runs."""
        for name, kind, files, _ in self._lines():
            expected_s = _expected_s(kind, sum(size for _, size, _ in files))
            yield ListedCapture(name, _fingerprint(kind, files), expected_s)

    def _lines(self) -> Iterator[tuple[str, Kind, list[Listed], Listed | None]]:
        with self.spool.open("rb") as lines:
            for line in lines:
                name, kind, files, packed = json.loads(line.decode())
                if kind:
                    yield name, kind, files, packed


Inside = Callable[[Entry], tuple[Entry, ...] | None]


def discover(
    entries: Iterable[Entry], spool: Path, source: str, inside: Inside = lambda _: ()
) -> Captures:
    """Find the captures among the files of the archive `source`, which are sorted by name.

    inside: the members of a zip, by their names in the archive, likewise sorted; none for a zip
    that is not to be opened, None for one that cannot be. Raises InputError if the archive is
    itself a capture.
    """
    passed_over: Counter[str] = Counter()
    unlisted: list[str] = []
    with spool.open("w+b") as stream:
        opened = [_Folder("", 0)]
        for entry, packed in _unpacked(entries, inside, unlisted):
            if PASSED_OVER.search(entry.name):
                continue
            folder, _, file = entry.name.rpartition("/")
            _go_to(f"{folder}/" if folder else "", opened, stream)
            kind = "folder" if entry.stamp in NOT_LISTED else kind_of(file)
            if kind is None and not _may_belong(file):
                passed_over[Path(file).suffix.lower()] += 1
                continue
            if entry.stamp in UNUSABLE:  # a capture, which cannot be measured
                kind = kind or "folder"
                unlisted += [entry.name] if entry.stamp in (DENIED, TOO_DEEP) else []
            else:
                opened[-1].is_capture |= _marks_a_capture(file)
            if opened[0].is_capture:
                raise InputError(
                    f"{source}: contains {file}, so it is itself a capture: use "
                    "`wheelplane measure`, give the folder above it, or move that file"
                )
            of = None if packed is None else _listed(packed)
            _put(stream, entry.name, kind, [_listed(entry)], of)
        _go_to("", opened, stream)
    return Captures(spool, passed_over, tuple(unlisted))


def _unpacked(
    entries: Iterable[Entry], inside: Inside, unlisted: list[str]
) -> Iterator[tuple[Entry, Entry | None]]:
    """Yield the files, and in the place of a zip of several captures its members and the zip.

    Adds the zips that cannot be opened to `unlisted`.
    """
    for entry in entries:
        if not entry.name.lower().endswith(".zip"):
            yield entry, None
            continue
        file = entry.name.rpartition("/")[2]
        if entry.stamp not in UNUSABLE and not (
            _marks_a_capture(file) or PASSED_OVER.search(entry.name)
        ):
            members = inside(entry)
            if members is None:
                unlisted.append(entry.name)
            elif holds_several(member.name[len(entry.name) + 1 :] for member in members):
                yield from ((member, entry) for member in members)
                continue
        yield entry, None


def holds_several(members: Iterable[str]) -> bool:
    """Return whether a zip of these members is several captures, and not one of its own.

    One of its own has scans or capture.toml at its root, or in the only folder there.
    """
    names = [name for name in members if not PASSED_OVER.search(name)]
    top = {name.partition("/")[0] for name in names}
    if len(top) == 1 and all("/" in name for name in names):
        names = [name.partition("/")[2] for name in names]
    found = set()
    for name in names:
        folder, _, file = name.rpartition("/")
        is_marked, kind = _marks_a_capture(file), kind_of(file)
        if not folder and (is_marked or kind == "cloud"):
            return False
        if is_marked or kind is not None:
            found.add(folder if is_marked else name)
    return len(found) > 1


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
        files: list[Listed] = []
        packed: Listed | None = None
        for line in stream:
            _, _, listed, packed = json.loads(line)
            if packed and not folder.path.startswith(f"{packed[0]}/"):
                listed, packed = [packed], None  # a zip among the files of a capture
            files += [file for file in listed if file not in files[-1:]]
        stream.seek(folder.start)
        stream.truncate()
        own = [file for file in files if file[2] != IMPROPER]
        _put(stream, folder.path.rstrip("/"), "folder", own, packed)
        for file in files:
            if file[2] == IMPROPER:
                _put(stream, file[0], "folder", [file], None)


Listed = tuple[str, int, str]  # name, size and stamp of an entry; a list when read back


def _listed(entry: Entry) -> Listed:
    return entry.name, entry.size, entry.stamp


def _put(
    stream: BinaryIO, name: str, kind: Kind | None, files: list[Listed], packed: Listed | None
) -> None:
    stream.write(json.dumps([name, kind, files, packed]).encode() + b"\n")


def _fingerprint(kind: Kind, files: list[Listed]) -> str:
    return hashlib.sha256(json.dumps([kind, files]).encode()).hexdigest()[:32]


def _expected_s(kind: Kind, size: int) -> float:
    return FIVE_POINT_S if kind == "five-point" else SCANS_S + size / BYTES_PER_S


def _marks_a_capture(file: str) -> bool:
    """Return whether a file of this name makes its folder a capture, as capture.is_capture does."""
    return file.lower() == "capture.toml" or file.split(".")[0].upper() in REFERENCE_WHEELS


def _may_belong(file: str) -> bool:
    """Return whether a file may be part of a capture without being one itself."""
    lower = file.lower()
    return lower.endswith(".toml") or lower == "readings.xlsx" or _marks_a_capture(file)
