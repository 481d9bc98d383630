"""Where files live: a folder, or object storage behind a URL."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol
from urllib.parse import unquote, urlsplit

from ...errors import InputError
from .entry import Entry

__all__ = ["Entry", "Store", "open_store"]


class Store(Protocol):
    """Files by their relative names. Every method raises InputError for what it cannot do."""

    @property
    def url(self) -> str:
        """What the user called it."""

    @property
    def local(self) -> Path | None:
        """Its folder; None for object storage."""

    @property
    def exclusive(self) -> bool:
        """Whether `write_new` lets exactly one of several writers win (see `RemoteStore`)."""

    def list(self, prefix: str = "") -> Iterator[Entry]:
        """Files whose name begins with `prefix`, sorted by name; none where nothing is there."""

    def read(self, name: str) -> bytes:
        """The content of a file."""

    def write_new(self, name: str, data: bytes) -> bool:
        """Write a file that is not there yet: whole and durable, or not at all.

        False if it was there already; it is then left as it was.
        """

    def write(self, name: str, data: bytes) -> None:
        """Write or replace a file: a reader sees the old content or the new, never a part."""

    def send(self, name: str, path: Path) -> None:
        """Write or replace a file by a copy of the local one at `path`."""

    def exists(self, name: str) -> bool:
        """Whether a file has this name."""

    def stat(self, name: str) -> Entry | None:
        """A file as it is listed; None where none has this name."""

    def remove(self, name: str) -> None:
        """Take a file away; no error if it is gone already."""

    def fetch(self, name: str, folder: Path) -> Path:
        """A local path to the file: its own, or of a copy at `folder` / `name`."""


def open_store(url: str) -> Store:
    """The store at a local path, file://, s3://, gs://, az:// or another URL that fsspec knows.

    A folder need not be there yet; a bucket must. Raises InputError, MissingDependencyError.
    """
    from .local import LocalStore

    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", url) is None:
        return LocalStore(Path(url), url)
    parts = urlsplit(url)
    if parts.scheme == "file":
        if parts.netloc not in ("", "localhost"):
            raise InputError(f"{url}: names the host {parts.netloc}: write file:///path")
        return LocalStore(Path(unquote(parts.path)), url)

    from .remote import RemoteStore

    store = RemoteStore(url.rstrip("/"))
    store.check()
    return store
