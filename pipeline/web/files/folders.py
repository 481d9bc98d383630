"""Folders that the page may read and save to, and no path outside them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from ...capture import TABLES, is_capture
from ...files import ARCHIVE_SUFFIXES
from ...readers import READERS, scan_suffix
from ...report.json.stored import RECORD, is_measurement
from ...system import frozen
from ..security import RefusedError

MOST_LISTED = 2000
TEXTS = (*TABLES, ".xyz")
FIVE_POINT_BYTES = 200_000  # a text file up to this size is taken for five points a wheel
LONGEST_NAME = 120
RESULTS = ("measurements", "run/state")  # folders, of which results of a batch have one or both


@frozen
class Item:
    """File or folder that the page lists.

    kind: folder, capture, results, measurement, archive, cloud, or five-point.
    """

    name: str
    kind: str
    size: int


@frozen
class Listing:
    """Entries of a folder to open; is_cut: whether more are in it than MOST_LISTED, the first."""

    items: list[Item]
    is_cut: bool


@frozen
class Folders:
    """Allowed folders `roots`, resolved."""

    roots: tuple[Path, ...]

    def path(self, root: int, relative: str) -> Path:
        """Resolve a path below a root, following links. Raises RefusedError for any other."""
        if not 0 <= root < len(self.roots):
            raise RefusedError(404, f"folder {root} is not one of the allowed folders")
        if "\0" in relative or "\\" in relative or len(relative) > 4000:
            raise RefusedError(403, "the path has invalid characters or is too long")
        try:
            found = (self.roots[root] / relative).resolve()
        except (OSError, RuntimeError, ValueError):  # a loop of links
            raise RefusedError(403, f"{relative[:100]}: the path cannot be resolved") from None
        if not found.is_relative_to(self.roots[root]):
            raise RefusedError(403, f"{relative[:100]}: outside the allowed folder")
        return found

    def existing(self, root: int, relative: str) -> Path:
        """Resolve the path of an existing file or folder. Raises RefusedError."""
        found = self.path(root, relative)
        if not os.access(found, os.R_OK):
            raise RefusedError(404, f"{relative[:100]}: no such file or folder")
        return found

    def listing(self, root: int, relative: str) -> Listing:
        """List what can be opened of the first in a folder by name: folders first."""
        folder = self.existing(root, relative)
        if not folder.is_dir():
            raise RefusedError(404, f"{relative[:100]}: not a folder")
        with os.scandir(folder) as entries:
            ordered = sorted(entries, key=lambda entry: (entry.name.casefold(), entry.name))
        listed = self._items(root, ordered[:MOST_LISTED])
        items = [item for item in listed if item is not None]
        items.sort(key=lambda item: (item.kind != "folder", item.name.casefold()))
        return Listing(items, len(ordered) > MOST_LISTED)

    def free_name(self, root: int, relative: str, name: str) -> Path:
        """Return the path of a new report. Raises RefusedError for a taken or invalid name."""
        check_name(name)
        path = self.path(root, relative) / name
        if os.path.lexists(path):
            raise RefusedError(409, f"{name}: a file of this name exists: choose another name")
        return path

    def _items(self, root: int, entries: Iterable[os.DirEntry[str]]) -> Iterator[Item | None]:
        for entry in entries:
            if entry.name.startswith(".") or not entry.name.isprintable():
                continue
            path = Path(entry.path)
            if not entry.is_symlink() or self._leads_inside(root, path):
                yield _item(path)

    def _leads_inside(self, root: int, link: Path) -> bool:
        try:
            return link.resolve().is_relative_to(self.roots[root])
        except (OSError, RuntimeError):  # a loop of links
            return False


def kind_of_file(path: Path) -> str | None:
    """Return the kind of a file by its name and size; None if it cannot be opened."""
    name = path.name.lower()
    suffix = scan_suffix(name)
    if name.endswith(".json"):
        return "measurement" if is_measurement(path) else None
    if name.endswith(ARCHIVE_SUFFIXES):
        return "archive"
    if suffix in TEXTS and path.stat().st_size <= FIVE_POINT_BYTES:
        return "five-point"
    return "cloud" if suffix in READERS else None


def kind_of_folder(folder: Path) -> str:
    """Return the kind of a folder: results, capture, measurement, or folder."""
    if any((folder / name).is_dir() for name in RESULTS):
        return "results"
    if is_capture(folder):
        return "capture"
    return "measurement" if (folder / RECORD).is_file() else "folder"


def check_name(name: str) -> None:
    """Raise RefusedError unless `name` is a plain file name."""
    plain = name == name.strip() and name.isprintable() and not set(name) & set('/\\<>:"|?*')
    if not plain or not 0 < len(name) <= LONGEST_NAME or name.startswith("."):
        raise RefusedError(
            400, f"{name[:80]!r} is not a valid file name: use letters, digits, spaces, - and _"
        )


def _item(path: Path) -> Item | None:
    try:
        if path.is_dir():
            return Item(path.name, kind_of_folder(path), 0)
        kind = kind_of_file(path) if path.is_file() else None
        return Item(path.name, kind, path.stat().st_size) if kind else None
    except OSError:
        return None
