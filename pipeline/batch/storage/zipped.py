"""Stores whose zips may hold many captures: their members are files below the zip's name."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from ...errors import InputError
from ...files import MAX_LISTED_BYTES, Archive, Member, lies_in, open_archive, path_below
from .entry import Entry
from .local import LocalStore
from .remote import RemoteStore

ZIP = ".zip"
TAIL_BYTES, GROWTH = 2**16, 16  # of a zip, where its list of files stands
_Opened = tuple[Entry, Archive, dict[str, Member], ExitStack]


class Zips:
    """Zips of a store: their members by `FOLDER/NAME.zip/MEMBER`, with the stamp of their zip.

    The zip used last stays open: captures are measured in the order of their names. stat: the entry
    of a file of the store. path_of: a local path of a zip, which may last as long as the stack; or
    where its members are only listed, of a file that ends as it does.
    """

    def __init__(
        self,
        url: str,
        stat: Callable[[str], Entry | None],
        path_of: Callable[[Entry, ExitStack, bool], Path],
    ) -> None:
        self._url, self._stat, self._path_of = url, stat, path_of
        self._opened: _Opened | None = None

    def __del__(self) -> None:
        self.close()

    def members(self, packed: Entry) -> tuple[Entry, ...] | None:
        """Return the members of a zip, sorted by name; None for one that cannot be opened."""
        try:
            with ExitStack() as stack:
                _, members = self._read(packed, stack, listed=True)
        except InputError:
            return None  # which its measurement reports
        named = sorted(members.items())
        return tuple(
            Entry(f"{packed.name}/{name}", member.size, packed.stamp) for name, member in named
        )

    def stat(self, name: str) -> Entry | None:
        """Return the entry of a member; None for a name that is not in a zip."""
        found = self._member(name)
        return found and Entry(name, found[1].size, found[0].stamp)

    def fetch(self, name: str, folder: Path) -> Path | None:
        """Return the path of a member's copy at `folder` / `name`; None if it is in no zip."""
        if (found := self._member(name)) is None:
            return None
        packed, member = found
        archive, _ = self._open(packed)
        archive.unpack(path_below(folder, packed.name, self._url), (member,))
        return folder / name

    def _member(self, name: str) -> tuple[Entry, Member] | None:
        """Return the zip, and its member of this name; None for a name that is not in a zip."""
        above = zip_above(lambda one: self._stat(one) is not None, name)
        packed = above and self._stat(above)
        if not (above and packed):
            return None
        member = self._open(packed)[1].get(name[len(above) + 1 :])
        return (packed, member) if member else None

    def _open(self, packed: Entry) -> tuple[Archive, dict[str, Member]]:
        """Return a zip, which stays open, and its members by name. Raises InputError."""
        if self._opened is None or self._opened[0] != packed:
            self.close()
            with ExitStack() as stack:
                archive, members = self._read(packed, stack, listed=False)
                self._opened = packed, archive, members, stack.pop_all()
        return self._opened[1], self._opened[2]

    def _read(
        self, packed: Entry, stack: ExitStack, listed: bool
    ) -> tuple[Archive, dict[str, Member]]:
        """Open a zip within the limits; return it and its members by name. Raises InputError."""
        where, path = f"{self._url}/{packed.name}", self._path_of(packed, stack, listed)
        if not zipfile.is_zipfile(path):
            raise InputError(f"{where}: no zip, or cut: copy it again")
        scratch = Path(tempfile.gettempdir())  # whose room is looked at
        archive = stack.enter_context(open_archive(path, where, scratch))
        return archive, {member.name.removeprefix("./"): member for member in archive.members}

    def close(self) -> None:
        """Close the zip used last."""
        if self._opened is not None:
            self._opened[3].close()
        self._opened = None


class ZippedStore(LocalStore):
    """Folder whose zips may hold many captures."""

    def __init__(self, folder: Path, url: str = "", confined: bool = False) -> None:
        super().__init__(folder, url, confined)
        self.zips = Zips(self.url, super().stat, self._path_of)

    def exists(self, name: str) -> bool:
        """Return whether a file or a member has this name."""
        return super().exists(name) or self.zips.stat(name) is not None

    def stat(self, name: str) -> Entry | None:
        """Return the entry of a file or a member; None if none has this name."""
        return self.zips.stat(name) or super().stat(name)

    def fetch(self, name: str, folder: Path) -> Path:
        """Return the path of the file itself, or of a member's copy at `folder` / `name`."""
        return self.zips.fetch(name, folder) or super().fetch(name, folder)

    def _path_of(self, packed: Entry, _stack: ExitStack, _listed: bool) -> Path:
        path = self.folder / packed.name
        if self._confined and not lies_in(path, self.folder):
            raise InputError(f"{self.url}/{packed.name}: a link to a file outside: copy it")
        return path


class ZippedRemoteStore(RemoteStore):
    """Object storage whose zips may hold many captures.

    A zip is copied whole when its members are measured, and its end alone to list them.
    """

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self.zips = Zips(url, super().stat, self._path_of)

    def exists(self, name: str) -> bool:
        """Return whether an object or a member has this name."""
        return super().exists(name) or self.zips.stat(name) is not None

    def stat(self, name: str) -> Entry | None:
        """Return the entry of an object or a member; None if none has this name."""
        return self.zips.stat(name) or super().stat(name)

    def fetch(self, name: str, folder: Path) -> Path:
        """Copy an object or a member to `folder` / `name`, and return the path."""
        return self.zips.fetch(name, folder) or super().fetch(name, folder)

    def _path_of(self, packed: Entry, stack: ExitStack, listed: bool) -> Path:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="wheelplane-")))
        if not listed:
            return super().fetch(packed.name, scratch)
        path, length = scratch / "listed.zip", TAIL_BYTES
        while True:
            length = min(length, packed.size)
            with path.open("wb") as file:  # with a hole in the place of all before
                file.seek(packed.size - length)
                file.write(self.tail(packed, length))
            if length == packed.size or length > MAX_LISTED_BYTES or _is_listed(path):
                return path
            length *= GROWTH


def _is_listed(path: Path) -> bool:
    """Return whether the end of a zip holds its list of files."""
    try:
        with zipfile.ZipFile(path):
            return True
    except (zipfile.BadZipFile, ValueError, OSError):
        return False


def zip_above(exists: Callable[[str], bool], name: str) -> str | None:
    """Return the name of the zip that holds the file or capture ZIP/PATH, if any.

    exists: whether a file of a name is in the archive.
    """
    parts = name.split("/")
    above = ("/".join(parts[:at]) for at in range(1, len(parts)))
    return next((one for one in above if one.lower().endswith(ZIP) and exists(one)), None)
