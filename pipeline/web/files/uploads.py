"""Files that the page sends: streamed to a folder of their own, limited in number, size, kind."""

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

from ...files import ARCHIVE_SUFFIXES, COMPRESSED_SUFFIXES
from ...readers import READERS
from ..security import RefusedError
from ..settings import Settings
from .folders import check_name

CHUNK = 1 << 20
FILES = "files"
DEEPEST = 4
MOST_OPEN = 8
# Scans, packed scans and captures; capture.toml, and the target's and scanner's files.
SENT_SUFFIXES = sorted(
    {suffix.lstrip(".") for suffix in (*ARCHIVE_SUFFIXES, *COMPRESSED_SUFFIXES, *READERS, ".toml")}
)


@dataclass
class Upload:
    """A folder that is being filled; names in lower case, as some systems tell no case apart."""

    folder: Path
    bytes: int = 0
    names: set[str] = field(default_factory=set)

    @property
    def source(self) -> Path:
        """What is to be measured: its only file or folder, or all of it."""
        inside = list(self.folder.iterdir())
        return inside[0] if len(inside) == 1 else self.folder


class Uploads:
    """Uploads that no job has taken yet."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._open: dict[str, Upload] = {}
        self._lock = threading.Lock()

    def begin(self) -> str:
        """A new upload's name; the oldest of too many is thrown away."""
        name = secrets.token_hex(12)
        folder = self._settings.scratch / f"upload-{name}" / FILES
        folder.mkdir(parents=True)
        with self._lock:
            self._open[name] = Upload(folder)
            old = list(self._open)[:-MOST_OPEN]
            gone = [self._open.pop(each) for each in old]
        for upload in gone:
            shutil.rmtree(upload.folder.parent, ignore_errors=True)
        return name

    def add(self, name: str, file: str, stream: BinaryIO, declared: int | None) -> None:
        """Write one file whole, or leave nothing of it. Raises RefusedError."""
        parts = _checked(file)
        key = "/".join(parts).casefold()
        with self._lock:
            upload = self._found(name)
            if declared is None:
                raise RefusedError(411, f"{file[:100]}: its size is not told")
            if len(upload.names) >= self._settings.upload_files:
                most = self._settings.upload_files
                raise RefusedError(413, f"more than {most} files: pack them into a zip")
            if key in upload.names:
                raise RefusedError(409, f"{file[:100]}: a file of this name was sent already")
            pairs = ((f"{one}/", f"{key}/") for one in upload.names)
            if any(one.startswith(other) or other.startswith(one) for one, other in pairs):
                raise RefusedError(
                    409, f"{file[:100]}: its name stands for a file and for a folder"
                )
            if upload.bytes + declared > self._settings.upload_bytes:
                most = self._settings.upload_bytes
                raise RefusedError(
                    413,
                    f"{file[:100]}: with it the upload is larger than {most / 1e9:.3g} GB: put the "
                    "files into an allowed folder and open them there",
                )
            upload.names.add(key)
            upload.bytes += declared
        path = upload.folder.joinpath(*parts)
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
        """A finished upload, which is the caller's from now on; where that fails, it stays here."""
        with self._lock:
            upload = self._found(name)
            if not upload.names:
                raise RefusedError(400, "the upload holds no file")
            del self._open[name]
        try:
            yield upload
        except BaseException:
            with self._lock:
                self._open[name] = upload
            raise

    def _found(self, name: str) -> Upload:
        """The upload of that name; to be asked for with the lock held."""
        if name not in self._open:
            raise RefusedError(404, "there is no such upload: send the files again")
        return self._open[name]


def _checked(file: str) -> tuple[str, ...]:
    parts = PurePosixPath(file).parts
    if not parts or len(parts) > DEEPEST or file.startswith("/") or len(file) > 500:
        raise RefusedError(400, f"{file[:100]!r} cannot be a file's name")
    for part in parts:
        check_name(part)
    if not file.lower().endswith(tuple(f".{suffix}" for suffix in SENT_SUFFIXES)):
        raise RefusedError(
            415,
            f"{file[:100]}: it is neither a scan, a five-point file, an archive nor a capture.toml",
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
            raise RefusedError(400, f"{file[:100]}: it broke off {left} bytes before its end")
        os.replace(part, path)  # noqa: PTH105 - of two paths in one folder
    except OSError as error:
        raise RefusedError(
            507, f"{file[:100]}: it cannot be stored ({error.strerror}): free some disk space"
        ) from error
    finally:
        part.unlink(missing_ok=True)
