"""Identity of a capture: its name, the content of its files, and all that changes its result."""

from __future__ import annotations

import posixpath
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ... import __version__
from ...capture import files_of, find_capture_file, read_capture_file
from ...errors import WheelplaneError
from ...files import improper, lies_in, path_below, sha256
from ...report.json.measurement import SCHEMA
from ...system import frozen
from ..storage.entry import Entry
from ..storage.store import Store
from .discover import FoundCapture
from .settings import BatchSettings, digest

RACY_NS = 2_000_000_000  # a file this recent may change once more without a new time stamp
UNREADABLE, OUTSIDE = "unreadable", "outside the archive"
MISSING = "missing"  # stamp


@frozen
class Identity:
    """Capture identified by its content.

    inputs: `sha256:` of each file by its name inside the capture, or "unreadable", or "outside the
    archive" of a link to there. files: all files as listed at that time. elsewhere: files outside
    its folder, but in the archive, that its capture.toml names. lasting: the same fingerprint will
    mean the same content.
    """

    key: str
    inputs: dict[str, str]
    files: tuple[Entry, ...]
    elsewhere: tuple[Entry, ...]
    lasting: bool

    @property
    def vanished(self) -> bool:
        """Whether a file of it is no longer in the archive."""
        return is_incomplete(self.files[: len(self.files) - len(self.elsewhere)])


@contextmanager
def local_copy(store: Store, found: FoundCapture) -> Iterator[Path]:
    """Yield a local folder that holds the capture by its name: the archive, or a temporary copy."""
    if store.local is not None and not found.packed:
        yield store.local
        return
    with tempfile.TemporaryDirectory(prefix="wheelplane-") as scratch:
        archive = Path(scratch)
        for file in found.files:
            store.fetch(file.name, archive)
        for name in _named_elsewhere(found, archive):
            if store.exists(name):
                _copy(store, name, archive)
        yield archive


def _copy(store: Store, name: str, folder: Path) -> None:
    """Copy a file of the archive to a folder, but for a link that leads out of the archive."""
    path = store.fetch(name, folder)
    if store.local is not None and path == store.local / name and lies_in(path, store.local):
        copy = path_below(folder, name, store.url)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)


def identify(store: Store, found: FoundCapture, archive: Path, settings: BatchSettings) -> Identity:
    """Hash all files of the capture, which lies in the local folder `archive`."""
    started_ns = time.time_ns()
    elsewhere = listed(store, _named_elsewhere(found, archive))
    own = found.files if store.local is None else listed(store, [f.name for f in found.files])
    inputs = {
        _inside(found, file.name): _hash(archive / file.name, archive)
        for file in sorted((*own, *elsewhere), key=lambda file: file.name)
    }
    settled = own == found.files and UNREADABLE not in inputs.values()
    racy = store.local is not None and any(
        _written_ns(file) > started_ns - RACY_NS for file in (*own, *elsewhere)
    )
    key = _key(found, inputs, settings)
    return Identity(key, inputs, (*own, *elsewhere), elsewhere, settled and not racy)


def unreadable(found: FoundCapture, settings: BatchSettings) -> Identity:
    """Return the identity of a capture none of whose files can be read."""
    inputs = {_inside(found, file.name): UNREADABLE for file in found.files}
    lasting = found.refusal is not None
    return Identity(_key(found, inputs, settings), inputs, found.files, (), lasting)


def unchanged(store: Store, known: Identity) -> bool:
    """Return whether the files of a local capture are still those that were hashed."""
    return store.local is None or listed(store, [f.name for f in known.files]) == known.files


def listed(store: Store, names: Iterable[str]) -> tuple[Entry, ...]:
    """List files as they are now; a missing one has the stamp MISSING."""
    return tuple(store.stat(name) or Entry(name, 0, MISSING) for name in names)


def is_incomplete(files: Iterable[Entry]) -> bool:
    """Return whether any of the files is missing."""
    return any(file.stamp == MISSING for file in files)


def _named_elsewhere(found: FoundCapture, archive: Path) -> list[str]:
    """Return the other files of the archive, by name, that the capture.toml of a folder names."""
    folder = archive / found.name
    path = find_capture_file(folder) if found.kind == "folder" and folder.is_dir() else None
    if path is None or not lies_in(path, archive):
        return []
    try:
        declared = read_capture_file(path, found.name)
    except WheelplaneError:
        return []  # the measurement will raise the same error
    names = {posixpath.normpath(posixpath.join(found.name, file)) for file in files_of(declared)}
    names = {name for name in names if improper(name) is None}
    return sorted(names - {file.name for file in found.files})


def _inside(found: FoundCapture, name: str) -> str:
    """Return the name of a file inside its capture; its own name if it is the capture."""
    return posixpath.relpath(name, found.name) if found.kind == "folder" else found.name


def _key(found: FoundCapture, inputs: dict[str, str], settings: BatchSettings) -> str:
    of_settings = settings.digest(found.kind)
    return digest([SCHEMA, __version__, found.name, found.kind, inputs, of_settings])


def _hash(path: Path, archive: Path) -> str:
    try:
        if not lies_in(path, archive):
            return OUTSIDE
        return sha256(path) if path.is_file() else UNREADABLE  # a pipe would never end
    except OSError:
        return UNREADABLE


def _written_ns(file: Entry) -> int:
    stamp = file.stamp.partition("-")[0]
    return int(stamp) if stamp.isdecimal() else 0
