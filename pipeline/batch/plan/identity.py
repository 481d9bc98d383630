"""Which capture this is: its name, the bytes of its files, and all that changes its result."""

from __future__ import annotations

import posixpath
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ... import __version__
from ...capture import files_of, find_capture_file, read_capture_file
from ...errors import WheelplaneError
from ...files import sha256
from ...report.json.measurement import SCHEMA
from ..storage.entry import Entry
from ..storage.store import Store
from .discover import Found
from .settings import Settings, digest

RACY_NS = 2_000_000_000  # what was written this shortly before it is hashed may change unseen
UNREADABLE = "unreadable"


@dataclass(frozen=True)
class Identity:
    """A capture by its contents.

    inputs: `sha256:` of each file by its name inside the capture, or "unreadable". files: all of
    them as they were listed then. elsewhere: those that its capture.toml names beyond its folder.
    lasting: whether the same fingerprint will mean the same contents.
    """

    key: str
    inputs: dict[str, str]
    files: tuple[Entry, ...]
    elsewhere: tuple[Entry, ...]
    lasting: bool


@contextmanager
def at_hand(store: Store, found: Found) -> Iterator[Path]:
    """The local path of a capture; of a remote one that of a passing copy."""
    if store.local is not None:
        yield store.local / found.name
        return
    with tempfile.TemporaryDirectory(prefix="wheelplane-") as scratch:
        source = Path(scratch) / found.name
        for file in found.files:
            store.fetch(file.name, Path(scratch))
        for name in _named_elsewhere(found, source):
            if not name.startswith(("../", "/")) and store.exists(name):
                store.fetch(name, Path(scratch))
        yield source


def identify(store: Store, found: Found, source: Path, settings: Settings) -> Identity:
    """Hash all that the capture, which is at hand at `source`, is made of."""
    begun_ns = time.time_ns()
    elsewhere = listed(store, _named_elsewhere(found, source))
    own = found.files if store.local is None else listed(store, [f.name for f in found.files])
    inputs = {
        _inside(found, file.name): _hash(_path(found, source, file.name))
        for file in sorted((*own, *elsewhere), key=lambda file: file.name)
    }
    settled = own == found.files and UNREADABLE not in inputs.values()
    racy = store.local is not None and any(
        _written_ns(file) > begun_ns - RACY_NS for file in (*own, *elsewhere)
    )
    key = _key(found, inputs, settings)
    return Identity(key, inputs, (*own, *elsewhere), elsewhere, settled and not racy)


def unreadable(found: Found, settings: Settings) -> Identity:
    """Of a capture none of whose files can be read."""
    inputs = {_inside(found, file.name): UNREADABLE for file in found.files}
    return Identity(_key(found, inputs, settings), inputs, found.files, (), lasting=False)


def unchanged(store: Store, known: Identity) -> bool:
    """Whether the files of a local capture are still those that were hashed."""
    return store.local is None or listed(store, [f.name for f in known.files]) == known.files


def listed(store: Store, names: Iterable[str]) -> tuple[Entry, ...]:
    """Files as they are listed now; of one that is missing, that it is."""
    return tuple(store.stat(name) or Entry(name, 0, "missing") for name in names)


def _named_elsewhere(found: Found, source: Path) -> list[str]:
    """Files, by their names in the archive, that a folder's capture.toml names beyond it."""
    path = find_capture_file(source) if found.kind == "folder" else None
    if path is None:
        return []
    try:
        declared = read_capture_file(path, found.name)
    except WheelplaneError:
        return []  # measuring it will say what is wrong
    names = {posixpath.normpath(posixpath.join(found.name, file)) for file in files_of(declared)}
    return sorted(names - {file.name for file in found.files})


def _inside(found: Found, name: str) -> str:
    """A file's name inside its folder, or its own where it is the capture."""
    return posixpath.relpath(name, found.name) if found.kind == "folder" else found.name


def _path(found: Found, source: Path, name: str) -> Path:
    return source / _inside(found, name) if found.kind == "folder" else source


def _key(found: Found, inputs: dict[str, str], settings: Settings) -> str:
    told = settings.digest(found.kind)
    return digest([SCHEMA, __version__, found.name, found.kind, inputs, told])


def _hash(path: Path) -> str:
    try:
        return sha256(path) if path.is_file() else UNREADABLE  # a pipe would never end
    except OSError:
        return UNREADABLE


def _written_ns(file: Entry) -> int:
    stamp = file.stamp.partition("-")[0]
    return int(stamp) if stamp.isdecimal() else 0
