"""Store of files: a folder, or object storage at a URL."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol
from urllib.parse import unquote, urlsplit

from ...errors import InputError
from .entry import Entry

__all__ = ["Entry", "Store", "open_store"]


class Store(Protocol):
    """Files by their relative names. Every method raises InputError if it fails."""

    @property
    def url(self) -> str:
        """Path or URL as given by the user."""

    @property
    def local(self) -> Path | None:
        """Folder of the store; None for object storage."""

    @property
    def back_s(self) -> float:
        """Time at which it last answered again after a long silence, by time.monotonic()."""

    def be_patient(self, note: Callable[[str], None] | None) -> None:
        """Wait from now on for storage that does not answer, for minutes, and note it.

        None: no longer, nor in requests that wait.
        """

    @property
    def exclusive(self) -> bool:
        """Whether `write_new` lets exactly one of several writers win (see `RemoteStore`)."""

    def list(self, prefix: str = "") -> Iterator[Entry]:
        """Yield files whose name begins with `prefix`, sorted by name."""

    def names(self, prefix: str = "") -> Iterator[str]:
        """Yield the names alone, in the same order: no file of a folder need be looked at."""

    def read(self, name: str) -> bytes:
        """Return the content of a file."""

    def write_new(self, name: str, data: bytes) -> bool:
        """Write a new file, completely and durably or not at all.

        Return False, and leave it unchanged, if the name exists.
        """

    def write(self, name: str, data: bytes) -> None:
        """Write or replace a file; a reader sees either the old or the new content."""

    def send(self, name: str, path: Path, stamp: str | None) -> bool:
        """Write or replace a file by a copy of the local one at `path`.

        Return False, and leave it unchanged, if its stamp is no longer this one; None if no file
        had the name. Where the storage knows no such condition, the last of several writers wins.
        """

    def exists(self, name: str) -> bool:
        """Return whether a file has this name."""

    def stat(self, name: str) -> Entry | None:
        """Return the entry of a file; None if no file has this name."""

    def remove(self, name: str) -> None:
        """Remove a file; no error if it does not exist."""

    def fetch(self, name: str, folder: Path) -> Path:
        """Return a local path to the file: its own, or that of a copy at `folder` / `name`."""


def open_store(url: str, confined: bool = False) -> Store:
    """Open the store at a local path, file://, s3://, gs://, az:// or another URL of fsspec.

    A folder need not exist yet; a bucket must. confined: an archive of captures, whose links out of
    the folder are not followed when it is listed, and whose zips may hold many (`ZippedStore`).
    Raises InputError, MissingDependencyError.
    """
    from .local import LocalStore
    from .zipped import ZippedRemoteStore, ZippedStore

    kind = ZippedStore if confined else LocalStore
    if not url:  # as of a variable that is not set
        raise InputError("a path is empty: name a folder or URL; . is the current folder")
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", url) is None:
        return kind(Path(url), url, confined)
    parts = urlsplit(url)
    if parts.scheme == "file":
        if parts.netloc not in ("", "localhost"):
            raise InputError(f"{url}: has the host {parts.netloc}: write file:///path")
        return kind(Path(unquote(parts.path)), url, confined)

    if not parts.netloc:
        raise InputError(f"{url}: names no bucket: write {parts.scheme}://bucket/path")

    from .remote import RemoteStore

    store = (ZippedRemoteStore if confined else RemoteStore)(url.rstrip("/"))
    store.check()
    return store
