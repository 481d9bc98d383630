"""Store in a folder: every file complete, durable and never replaced by accident."""

from __future__ import annotations

import errno
import os
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ...errors import InputError
from ...files import lies_in
from ...system import acquire, sync_folder
from .entry import DENIED, MOST_LEVELS, OUTSIDE, PARTIAL, TOO_DEEP, Entry

STALE_S = 3600.0  # a write takes milliseconds: older temporary files are of killed processes
LOCK = "lock"
Identity = tuple[int, int]  # of a folder: device and inode
NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}


class LocalStore:
    """Files below a folder.

    A completed write survives a crash of the machine: content, then name, are synced to disk
    (fsync of the file and of the folders), about 0.2 ms each on a solid-state disk.

    confined: links to folders outside it are listed, but not followed, and so are folders in it
    without permission.
    """

    exclusive, back_s = True, 0.0

    def __init__(self, folder: Path, url: str = "", confined: bool = False) -> None:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file: give a folder")
        self.folder = folder
        self.url = url or str(folder)
        self._confined = confined
        self._swept = False

    @property
    def local(self) -> Path:
        """The folder."""
        return self.folder

    def be_patient(self, note: Callable[[str], None] | None) -> None:
        """Do nothing: the system itself waits for a network disk."""

    def list(self, prefix: str = "") -> Iterator[Entry]:
        """Yield files whose name begins with `prefix`, sorted.

        Links to a parent are skipped, and so are further links to a folder that one leads to: a
        fan of links, two in each of thirty folders, would be a thousand million paths.
        """
        for name, found in self._walk(prefix):
            listed = found if isinstance(found, Entry) else self._entry(found, name)
            if listed is not None:
                yield listed

    def names(self, prefix: str = "") -> Iterator[str]:
        """Yield the names of the same files, without a `stat` of each."""
        return (name for name, _ in self._walk(prefix))

    def _walk(self, prefix: str) -> Iterator[tuple[str, os.DirEntry[str] | Entry]]:
        """Yield names, and what is known of them without a `stat`."""
        return self._below(prefix.rpartition("/")[0], prefix, (), set())

    def _below(
        self, at: str, prefix: str, above: tuple[Identity, ...], linked: set[Identity]
    ) -> Iterator[tuple[str, os.DirEntry[str] | Entry]]:
        """Yield the files below a folder.

        above: folders that it lies in. linked: those that a link has led to.
        """
        folder = self.folder / at
        try:
            here = folder.stat()
            if len(above) > MOST_LEVELS:
                raise OSError(errno.ENAMETOOLONG, "below too many folders")
            found = list(os.scandir(folder))
            if not os.access(folder, os.X_OK):  # names alone
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except (FileNotFoundError, NotADirectoryError):
            return
        except OSError as error:
            if error.errno == errno.ENAMETOOLONG:
                yield at, Entry(at, 0, TOO_DEEP)
                return
            if isinstance(error, PermissionError) and self._confined and at:
                yield at, Entry(at, 0, DENIED)
                return
            raise self._error(at, "cannot be listed", error) from error
        identity = (here.st_dev, here.st_ino)
        if identity in above:
            return
        if above and folder.is_symlink():
            if identity in linked:
                return
            linked.add(identity)
        ahead = f"{at}/" if at else ""
        folders = {entry.name: _is_folder(entry) for entry in found}
        for entry in sorted(found, key=lambda e: e.name + "/" * folders[e.name]):
            name = ahead + entry.name
            if name == PARTIAL or not (name.startswith(prefix) or prefix.startswith(f"{name}/")):
                continue
            if folders[entry.name] and not self._leads_out(entry):
                yield from self._below(name, prefix, (*above, identity), linked)
            else:
                yield name, entry

    def _leads_out(self, entry: os.DirEntry[str] | Path) -> bool:
        """Return whether the entry is a link to a folder that is not to be followed."""
        is_link = self._confined and entry.is_symlink() and _is_folder(entry)
        return is_link and not lies_in(Path(entry), self.folder)

    def _entry(self, entry: os.DirEntry[str] | Path, name: str) -> Entry | None:
        return Entry(name, 0, OUTSIDE) if self._leads_out(entry) else _entry(entry, name)

    def read(self, name: str) -> bytes:
        """Return the content of a file."""
        try:
            return (self.folder / name).read_bytes()
        except OSError as error:
            raise self._error(name, "cannot be read", error) from error

    def write_new(self, name: str, data: bytes) -> bool:
        """Write a new file; return False, and leave it unchanged, if the name exists."""
        path = self.folder / name
        with self._whole(name, data) as temporary:
            try:
                _link(temporary, path)
            except FileExistsError:
                if temporary.stat().st_nlink == 1:
                    return False
                # else NFS did link, in answer to a first request whose reply was lost
            sync_folder(path.parent)
        return True

    def write(self, name: str, data: bytes) -> None:
        """Write or replace a file; a reader sees either the old or the new content."""
        path = self.folder / name
        with self._whole(name, data) as temporary:
            temporary.replace(path)
            sync_folder(path.parent)

    def send(self, name: str, path: Path, stamp: str | None) -> bool:
        """Write or replace a file by a copy of the one at `path`; see `Store`."""
        entry = self.stat(name)
        if stamp != (entry and entry.stamp):
            return False
        self.write(name, path.read_bytes())
        return True

    def exists(self, name: str) -> bool:
        """Return whether a file has this name."""
        return (self.folder / name).is_file()

    def stat(self, name: str) -> Entry | None:
        """Return the entry of a file; None if no file has this name."""
        return self._entry(self.folder / name, name)

    def remove(self, name: str) -> None:
        """Remove a file; no error if it does not exist."""
        try:
            (self.folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise self._error(name, "cannot be removed", error) from error

    def fetch(self, name: str, folder: Path) -> Path:
        """Return the path of the file itself."""
        path = self.folder / name
        if not path.is_file():
            raise InputError(f"{path}: no such file: check whether it was moved")
        return path

    @contextmanager
    def _whole(self, name: str, data: bytes) -> Iterator[Path]:
        """Yield a synced temporary file with this content, after making the folder of `name`."""
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
            with suppress(OSError):  # the disk became read-only: what was raised is reported
                temporary.unlink(missing_ok=True)

    def _sweep(self, partial: Path) -> None:
        """Remove the temporary files of killed processes, once per process."""
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
        advice = {
            errno.ENOSPC: "make room on the disk",
            errno.EDQUOT: "make room within the quota",
            errno.EROFS: "give a writable folder",
            errno.EACCES: "check its permissions and those of its folders",
            errno.ENOENT: "check whether it was moved",
        }.get(error.errno or 0, "check it")
        return InputError(f"{self.folder / name}: {what} ({error.strerror}): {advice}")


def _is_folder(entry: os.DirEntry[str] | Path) -> bool:
    """Return whether an entry is a folder, or a link to one; a link to itself is none."""
    try:
        return entry.is_dir()
    except OSError:
        return False


def _entry(entry: os.DirEntry[str] | Path, name: str) -> Entry | None:
    try:
        stat = entry.stat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return Entry(name, 0, TOO_DEEP)
        if entry.is_symlink():
            return Entry(name, 0, "broken link")
        if isinstance(error, FileNotFoundError | NotADirectoryError):
            return None  # just removed
        raise
    return Entry(name, stat.st_size, f"{stat.st_mtime_ns}-{stat.st_ino}")


def _link(temporary: Path, path: Path) -> None:
    """Give the file its name, atomically. Raises FileExistsError if the name exists."""
    try:
        os.link(temporary, path)
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        with (temporary.parent / LOCK).open("w") as lock:  # FAT and some network disks
            acquire(lock.fileno())
            if path.exists():
                raise FileExistsError(errno.EEXIST, "File exists", str(path)) from error
            temporary.rename(path)


def _make_folder(folder: Path) -> None:
    """Create a folder and its parents, each synced to disk."""
    if folder.is_dir():
        return
    _make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    sync_folder(folder.parent)
