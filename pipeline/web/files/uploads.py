"""Uploaded files: streamed to a folder of their own, limited in number, size and kind."""

from __future__ import annotations

import os
import secrets
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from ...files import ARCHIVE_SUFFIXES, COMPRESSED_SUFFIXES, path_below
from ...readers import READERS
from ..security import RefusedError
from ..settings import PageSettings
from .folders import check_name

CHUNK = 1 << 20
FILES = "files"
DEEPEST = 4
MOST_OPEN = 8
# Scans, packed scans and captures; capture.toml, the target's and scanner's files; and results.
SENT = (*ARCHIVE_SUFFIXES, *COMPRESSED_SUFFIXES, *READERS, ".toml", ".json")
SENT_SUFFIXES = sorted({suffix.lstrip(".") for suffix in SENT})


@dataclass
class Upload:
    """Folder being filled; names in lower case, since some file systems ignore case."""

    folder: Path
    bytes: int = 0
    names: set[str] = field(default_factory=set)

    @property
    def source(self) -> Path:
        """Path to be measured: the only file or folder of the upload, or all of it."""
        inside = list(self.folder.iterdir())
        return inside[0] if len(inside) == 1 else self.folder


class Uploads:
    """Uploads not yet taken by a job."""

    def __init__(self, settings: PageSettings) -> None:
        self._settings = settings
        self._open: dict[str, Upload] = {}
        self._lock = threading.Lock()

    def begin(self) -> str:
        """Begin an upload and return its name; the oldest of too many is discarded."""
        name = secrets.token_hex(12)
        folder = self._settings.scratch / f"upload-{name}" / FILES
        folder.mkdir(parents=True)
        with self._lock:
            self._open[name] = Upload(folder)
            old = list(self._open)[:-MOST_OPEN]
            discarded = [self._open.pop(each) for each in old]
        for upload in discarded:
            shutil.rmtree(upload.folder.parent, ignore_errors=True)
        return name

    def add(self, name: str, file: str, stream: BinaryIO, declared: int | None) -> None:
        """Write one file completely, or leave nothing of it. Raises RefusedError."""
        parts = _checked(file)
        key = "/".join(parts).casefold()
        with self._lock:
            upload = self._found(name)
            path = path_below(upload.folder, file, "the upload")
            if declared is None:
                raise RefusedError(411, f"{file[:100]}: the request does not state its size")
            if len(upload.names) >= self._settings.upload_files:
                most = self._settings.upload_files
                raise RefusedError(413, f"more than {most} files: pack them into a zip")
            if key in upload.names:
                raise RefusedError(409, f"{file[:100]}: a file of this name was already sent")
            pairs = ((f"{one}/", f"{key}/") for one in upload.names)
            if any(one.startswith(other) or other.startswith(one) for one, other in pairs):
                raise RefusedError(
                    409, f"{file[:100]}: this name is used for a file and for a folder"
                )
            if upload.bytes + declared > self._settings.upload_bytes:
                most = self._settings.upload_bytes
                raise RefusedError(
                    413,
                    f"{file[:100]}: the upload is larger than {most / 1e9:.3g} GB: copy the files "
                    "to an allowed folder and open them there",
                )
            upload.names.add(key)
            upload.bytes += declared
        try:
            _write(path, stream, declared, file)
        except BaseException:
            with self._lock:
                for folder in list(path.parents)[: len(parts) - 1]:
                    with suppress(OSError):  # it holds other files
                        folder.rmdir()
                upload.names.discard(key)
                upload.bytes -= declared
            raise

    @contextmanager
    def taken(self, name: str) -> Iterator[Upload]:
        """Hand over a finished upload to the caller; after an exception it stays here."""
        with self._lock:
            upload = self._found(name)
            if not upload.names:
                raise RefusedError(400, "the upload contains no file")
            del self._open[name]
        try:
            yield upload
        except BaseException:
            with self._lock:
                self._open[name] = upload
            raise

    def _found(self, name: str) -> Upload:
        """Return the upload of that name; call with the lock held. Raises RefusedError."""
        if name not in self._open:
            raise RefusedError(404, "no such upload: send the files again")
        return self._open[name]


def _checked(file: str) -> tuple[str, ...]:
    parts = PurePosixPath(file).parts
    if not parts or len(parts) > DEEPEST or file.startswith("/") or len(file) > 500:
        raise RefusedError(400, f"{file[:100]!r} is not a valid file name")
    for part in parts:
        check_name(part)
    if not file.lower().endswith(tuple(f".{suffix}" for suffix in SENT_SUFFIXES)):
        raise RefusedError(
            415,
            f"{file[:100]}: not a scan, five-point file, archive, capture.toml or measurement.json",
        )
    return parts


def _write(path: Path, stream: BinaryIO, declared: int, file: str) -> None:
    part = path.with_name(f".{path.name}.part")
    left = declared
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("xb") as out:
            while left and (chunk := stream.read(min(CHUNK, left))):
                out.write(chunk)
                left -= len(chunk)
        if left:
            raise RefusedError(400, f"{file[:100]}: ended {left} bytes too early: send it again")
        os.replace(part, path)  # noqa: PTH105 - two paths in one folder
    except OSError as error:
        raise RefusedError(
            507, f"{file[:100]}: cannot be stored ({error.strerror}): free some disk space"
        ) from error
    finally:
        part.unlink(missing_ok=True)
