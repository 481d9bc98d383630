"""A store in a folder: every file whole, durable and never replaced by accident."""

from __future__ import annotations

import errno
import fcntl
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...errors import InputError
from .entry import PARTIAL, Entry

STALE_S = 3600.0  # a write takes milliseconds: what is this old was left by a killed process
LOCK = "lock"
NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}


class LocalStore:
    """Files below a folder.

    A write that returned survives a crash of the machine: content, then name, are synced to disk
    (fsync of the file and of the folders), at some 0.2 ms each on a solid-state disk.
    """

    exclusive = True

    def __init__(self, folder: Path, url: str = "") -> None:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file: name a folder")
        self.folder = folder
        self.url = url or str(folder)
        self._swept = False

    @property
    def local(self) -> Path:
        """The folder."""
        return self.folder

    def list(self, prefix: str = "") -> Iterator[Entry]:
        """Files whose name begins with `prefix`, sorted; a link into its own parent is skipped."""
        start = prefix.rpartition("/")[0]
        yield from self._below(start, prefix, ())

    def _below(self, at: str, prefix: str, above: tuple[tuple[int, int], ...]) -> Iterator[Entry]:
        folder = self.folder / at
        try:
            here = folder.stat()
            found = list(os.scandir(folder))
        except (FileNotFoundError, NotADirectoryError):
            return
        except OSError as error:
            raise self._error(at, "cannot be listed", error) from error
        identity = (here.st_dev, here.st_ino)
        if identity in above:
            return
        ahead = f"{at}/" if at else ""
        folders = {entry.name: entry.is_dir() for entry in found}
        for entry in sorted(found, key=lambda e: e.name + "/" * folders[e.name]):
            name = ahead + entry.name
            if name == PARTIAL or not (name.startswith(prefix) or prefix.startswith(f"{name}/")):
                continue
            if folders[entry.name]:
                yield from self._below(name, prefix, (*above, identity))
            elif (listed := _entry(entry, name)) is not None:
                yield listed

    def read(self, name: str) -> bytes:
        """The content of a file."""
        try:
            return (self.folder / name).read_bytes()
        except OSError as error:
            raise self._error(name, "cannot be read", error) from error

    def write_new(self, name: str, data: bytes) -> bool:
        """Write a file that is not there yet; False if it was there, which is left as it was."""
        path = self.folder / name
        with self._whole(name, data) as temporary:
            try:
                _link(temporary, path)
            except FileExistsError:
                if temporary.stat().st_nlink == 1:
                    return False
                # else NFS did link, and told so to a first request whose answer was lost
            _sync_folder(path.parent)
        return True

    def write(self, name: str, data: bytes) -> None:
        """Write or replace a file; a reader sees the old content or the new."""
        path = self.folder / name
        with self._whole(name, data) as temporary:
            temporary.replace(path)
            _sync_folder(path.parent)

    def send(self, name: str, path: Path) -> None:
        """Write or replace a file by a copy of another."""
        self.write(name, path.read_bytes())

    def exists(self, name: str) -> bool:
        """Whether a file has this name."""
        return (self.folder / name).is_file()

    def stat(self, name: str) -> Entry | None:
        """A file as it is listed; None where none has this name."""
        return _entry(self.folder / name, name)

    def remove(self, name: str) -> None:
        """Take a file away; no error if it is gone already."""
        try:
            (self.folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise self._error(name, "cannot be removed", error) from error

    def fetch(self, name: str, folder: Path) -> Path:
        """The file's own path."""
        path = self.folder / name
        if not path.is_file():
            raise InputError(f"{path}: is not there: has it been moved?")
        return path

    @contextmanager
    def _whole(self, name: str, data: bytes) -> Iterator[Path]:
        """A synced file with this content under a passing name, and the folder of `name`."""
        partial = self.folder / PARTIAL
        temporary = partial / uuid.uuid4().hex
        try:
            _make_folder(partial)
            _make_folder((self.folder / name).parent)
            self._sweep(partial)
            with temporary.open("xb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            yield temporary
        except OSError as error:
            raise self._error(name, "cannot be written", error) from error
        finally:
            temporary.unlink(missing_ok=True)

    def _sweep(self, partial: Path) -> None:
        """Clear away, once a process, what killed processes left."""
        if self._swept:
            return
        self._swept = True
        for entry in os.scandir(partial):
            try:
                if not entry.name.endswith(LOCK) and entry.stat().st_mtime < time.time() - STALE_S:
                    Path(entry.path).unlink(missing_ok=True)
            except FileNotFoundError:
                continue  # another process was faster

    def _error(self, name: str, what: str, error: OSError) -> InputError:
        mend = {
            errno.ENOSPC: "make room on the disk",
            errno.EDQUOT: "make room within the quota",
            errno.EROFS: "name a folder that can be written to",
            errno.EACCES: "see to the permissions of it and its folders",
            errno.ENOENT: "has it been moved?",
        }.get(error.errno or 0, "check it")
        return InputError(f"{self.folder / name}: {what} ({error.strerror}): {mend}")


def _entry(entry: os.DirEntry[str] | Path, name: str) -> Entry | None:
    try:
        stat = entry.stat()
    except FileNotFoundError:
        return Entry(name, 0, "broken link") if entry.is_symlink() else None  # None: just removed
    return Entry(name, stat.st_size, f"{stat.st_mtime_ns}-{stat.st_ino}")


def _link(temporary: Path, path: Path) -> None:
    """Give the file its name unless that is taken (FileExistsError): one step, race or not."""
    try:
        os.link(temporary, path)
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        with (temporary.parent / LOCK).open("w") as lock:  # FAT and some network disks
            fcntl.flock(lock, fcntl.LOCK_EX)
            if path.exists():
                raise FileExistsError(errno.EEXIST, "File exists", str(path)) from error
            temporary.rename(path)


def _make_folder(folder: Path) -> None:
    """Make a folder and its parents, each durable."""
    if folder.is_dir():
        return
    _make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    _sync_folder(folder.parent)


def _sync_folder(folder: Path) -> None:
    """Make the names in a folder durable, where the file system can."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)
