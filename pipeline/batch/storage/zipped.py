"""Folder whose zips may hold many captures: their members are files below the zip's name."""

from __future__ import annotations

import tempfile
import zipfile
from contextlib import ExitStack
from pathlib import Path

from ...errors import InputError
from ...files import Archive, Member, lies_in, open_archive, path_below
from .entry import Entry
from .local import LocalStore

ZIP = ".zip"


class ZippedStore(LocalStore):
    """Files below a folder, and by `FOLDER/NAME.zip/MEMBER` those in its zips.

    Members bear the stamp of their zip. The zip used last stays open: captures are measured in the
    order of their names.
    """

    _opened: tuple[Entry, Archive, dict[str, Member], ExitStack] | None = None

    def __del__(self) -> None:
        self.close()

    def members(self, packed: Entry) -> tuple[Entry, ...]:
        """Return the members of a zip, sorted by name; none of one that cannot be opened."""
        try:
            _, members = self._open(packed)
        except InputError:
            return ()  # which its measurement reports
        named = sorted(members.items())
        return tuple(
            Entry(f"{packed.name}/{name}", member.size, packed.stamp) for name, member in named
        )

    def exists(self, name: str) -> bool:
        """Return whether a file or a member has this name."""
        return super().exists(name) or self._member(name) is not None

    def stat(self, name: str) -> Entry | None:
        """Return the entry of a file or a member; None if none has this name."""
        if (found := self._member(name)) is None:
            return super().stat(name)
        packed, member = found
        return Entry(name, member.size, packed.stamp)

    def fetch(self, name: str, folder: Path) -> Path:
        """Return the path of the file itself, or of a member's copy at `folder` / `name`."""
        if (found := self._member(name)) is None:
            return super().fetch(name, folder)
        packed, member = found
        archive, _ = self._open(packed)
        archive.unpack(path_below(folder, packed.name, self.url), (member,))
        return folder / name

    def _member(self, name: str) -> tuple[Entry, Member] | None:
        """Return the zip, and its member of this name; None for a name that is not in a zip."""
        above = zip_above(self.folder, name)
        packed = above and super().stat(above)
        if not (above and packed):
            return None
        member = self._open(packed)[1].get(name[len(above) + 1 :])
        return (packed, member) if member else None

    def _open(self, packed: Entry) -> tuple[Archive, dict[str, Member]]:
        """Return a zip, opened within the limits, and its members by name. Raises InputError."""
        if self._opened is None or self._opened[0] != packed:
            self.close()
            path, where = self.folder / packed.name, f"{self.url}/{packed.name}"
            if self._confined and not lies_in(path, self.folder):
                raise InputError(f"{where}: a link to a file outside: copy it")
            if not zipfile.is_zipfile(path):
                raise InputError(f"{where}: no zip, or cut: copy it again")
            with ExitStack() as stack:
                scratch = Path(tempfile.gettempdir())  # whose room is looked at
                archive = stack.enter_context(open_archive(path, where, scratch))
                members = {member.name.removeprefix("./"): member for member in archive.members}
                self._opened = packed, archive, members, stack.pop_all()
        assert self._opened is not None
        return self._opened[1], self._opened[2]

    def close(self) -> None:
        """Close the zip used last."""
        if self._opened is not None:
            self._opened[3].close()
        self._opened = None


def zip_above(folder: Path, name: str) -> str | None:
    """Return the name of the zip in a folder that holds the file or capture ZIP/PATH, if any."""
    parts = name.split("/")
    above = ("/".join(parts[:at]) for at in range(1, len(parts)))
    return next(
        (one for one in above if one.lower().endswith(ZIP) and (folder / one).is_file()), None
    )
