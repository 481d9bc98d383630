"""Digest of a file; archives and compressed files, unpacked within limits."""

from __future__ import annotations

import bz2
import errno
import gzip
import hashlib
import lzma
import os
import re
import shutil
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from io import BufferedIOBase, FileIO
from itertools import islice
from pathlib import Path
from typing import IO

from .errors import InputError, remedy_of
from .system import frozen

MAX_UNPACKED_BYTES = 64 * 2**30
MAX_RATIO = 200  # the unpacked of the packed size: text of `0 0 0 0.5` packs to a 300th, ...
FREE_BYTES = 2**28  # ... and is bounded by this size instead
MAX_MEMBERS = 10_000
MAX_LISTED_BYTES = 4 << 20  # the list of files of a zip, names and all
MAX_HEADER_BYTES = 16 << 10  # a long name or the attributes of a member of a tar
MAX_PART_BYTES = 255  # of a name between two "/": what file systems take
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f]")
MAX_DIGITS = 200  # in a row in attributes: Python before 3.11.10 reads them in quadratic time
ARCHIVE_SUFFIXES = (".zip", ".tar", ".tgz", ".tar.gz", ".tar.bz2", ".tar.xz")
COMPRESSED_SUFFIXES = (".gz", ".bz2", ".xz")

_TAR_BLOCK = 512
_TAR_HEADERS = (
    tarfile.GNUTYPE_LONGNAME,
    tarfile.GNUTYPE_LONGLINK,
    tarfile.XHDTYPE,
    tarfile.XGLTYPE,
    tarfile.SOLARIS_XHDTYPE,
)
_CHUNK = 1 << 20
_DECOMPRESSORS: dict[bytes, Callable[[Path], BufferedIOBase]] = {
    b"\x1f\x8b": gzip.GzipFile,
    b"BZh": bz2.BZ2File,
    b"\xfd7zXZ\x00": lzma.LZMAFile,
}
# Raised by zipfile, tarfile and their decompressors for damaged and for locked archives.
_FAULTS = (
    zipfile.BadZipFile,
    tarfile.TarError,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    LookupError,
    struct.error,
    lzma.LZMAError,
    zlib.error,
)


@frozen
class Member:
    """A file in an archive: its name as written there, and its unpacked size in bytes."""

    name: str
    size: int


class Archive:
    """An open zip or tar whose members have been checked."""

    def __init__(self, opened: zipfile.ZipFile | tarfile.TarFile, name: str) -> None:
        self._opened, self._name = opened, name
        if isinstance(opened, zipfile.ZipFile):
            infos = [info for info in opened.infolist() if not info.filename.endswith("/")]
            if any(info.flag_bits & 1 for info in infos):
                raise InputError(f"{name}: is locked with a password: unpack it by hand")
            self.members = tuple(Member(info.filename, info.file_size) for info in infos)
        else:
            files = [member for member in _counted(opened, name) if member.isfile()]
            _check_end(opened)
            self.members = tuple(Member(member.name, member.size) for member in files)

    def unpack(self, folder: Path, members: tuple[Member, ...] | None = None) -> None:
        """Unpack `members`, or all, below `folder`, without links and devices."""
        names = {member.name for member in (self.members if members is None else members)}
        with archive_errors(self._name):
            for name, content in self._contents(names):
                path = path_below(folder, _plain_name(name), self._name)
                path.parent.mkdir(parents=True, exist_ok=True)
                with content, path.open("wb") as file:  # no owner, mode or date
                    shutil.copyfileobj(content, file)

    def _contents(self, names: set[str]) -> Iterator[tuple[str, IO[bytes]]]:
        """Yield the files of these names, opened one after another."""
        if isinstance(self._opened, zipfile.ZipFile):
            yield from ((name, self._opened.open(name)) for name in sorted(names))
            return
        for member in self._opened.getmembers():
            if member.isfile() and member.name in names:
                content = self._opened.extractfile(member)
                assert content is not None
                yield member.name, content


def is_archive(path: Path, name: str) -> bool:
    """Return whether the file is a zip or a tar, compressed or not."""
    with archive_errors(name):
        return zipfile.is_zipfile(path) or _is_tar(path)


@contextmanager
def open_archive(path: Path, name: str, scratch: Path) -> Iterator[Archive]:
    """Open a zip or tar. scratch: an existing folder for what a compressed tar unpacks to.

    Raises InputError for one that is damaged or locked, whose members point outside, or that
    unpacks to more than the limits.
    """
    with ExitStack() as stack:
        with archive_errors(name):
            if zipfile.is_zipfile(path):
                listed = stack.enter_context(_Listed(path))
                archive = Archive(stack.enter_context(zipfile.ZipFile(listed)), name)
            else:
                plain = _plain(path, name, scratch)
                tar = tarfile.open(plain, "r:", tarinfo=_TarMember)  # noqa: SIM115 - in the stack
                archive = Archive(stack.enter_context(tar), name)
        _check_members(archive.members, path.stat().st_size, name, scratch)
        yield archive


def inflate(
    path: Path, target: Path, name: str, check: Callable[[bytes], None] = lambda _: None
) -> None:
    """Write the contents of a gzip, bzip2 or xz file to `target`, piece by piece.

    check: called with each piece before it is written; what it raises ends the writing.
    """
    opener = _decompressor(path)
    if opener is None:
        raise InputError(f"{name}: it is not compressed, though its suffix says so: rename it")
    limit = _limit(path.stat().st_size)
    room = shutil.disk_usage(target.parent).free
    with archive_errors(name), opener(path) as packed, target.open("wb") as plain:
        written = 0
        while chunk := packed.read(_CHUNK):
            written += len(chunk)
            _check_size(name, written, limit, room, "more than ")
            check(chunk)
            plain.write(chunk)


@contextmanager
def archive_errors(name: str) -> Iterator[None]:
    """Turn the errors of archive libraries into one InputError."""
    try:
        yield
    except PermissionError as error:
        fact = f"cannot be read ({error.strerror})"
        raise InputError(f"{name}: {fact}: {remedy_of(error)}") from error
    except _FAULTS as error:
        fact = " ".join(str(error)[:100].split()) or type(error).__name__
        raise InputError(
            f"{name}: the archive cannot be unpacked ({fact}): pack or copy it again"
        ) from error


def _decompressor(path: Path) -> Callable[[Path], BufferedIOBase] | None:
    with path.open("rb") as file:
        head = file.read(8)
    return next(
        (opener for magic, opener in _DECOMPRESSORS.items() if head.startswith(magic)), None
    )


class _Listed(FileIO):
    """A zip whose list of files, which `zipfile` reads at once, is bounded."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read bytes. Raises BadZipFile for more than the longest list."""
        if size is not None and size > MAX_LISTED_BYTES:
            raise zipfile.BadZipFile(
                f"its list of files takes {size / 2**20:.3g} MiB, {MAX_LISTED_BYTES >> 20} at most"
            )
        return super().read(size) or b""


class _TarMember(tarfile.TarInfo):
    """A member of a tar whose long name and attributes are bounded."""

    def _proc_member(self, tar: tarfile.TarFile) -> tarfile.TarInfo:
        """Read what describes the member: the entry point for subclasses, as `tarfile` says."""
        if self.type in _TAR_HEADERS:
            if self.size > MAX_HEADER_BYTES:
                fact = f"a name or attribute of {self.size} bytes, {MAX_HEADER_BYTES} at most"
                raise tarfile.ReadError(fact)
            assert tar.fileobj is not None
            start = tar.fileobj.tell()
            if re.search(rb"\d{%d}" % MAX_DIGITS, tar.fileobj.read(self.size)):
                raise tarfile.ReadError(f"a name or attribute of {MAX_DIGITS} digits in a row")
            tar.fileobj.seek(start)
        return super()._proc_member(tar)  # type: ignore[misc,no-any-return]


def _counted(tar: tarfile.TarFile, name: str) -> list[tarfile.TarInfo]:
    """Return the members of a tar, no more than MAX_MEMBERS."""
    members = list(islice(tar, MAX_MEMBERS + 1))
    if len(members) > MAX_MEMBERS:
        raise _too_many(name, f"more than {MAX_MEMBERS}")
    return members


def _is_tar(path: Path) -> bool:
    """Return whether the file begins with the header of a tar's member, or ends a tar."""
    opener = _decompressor(path) or FileIO
    try:
        with opener(path) as file:
            head = file.read(_TAR_BLOCK)
            if head != bytes(_TAR_BLOCK):  # zeros: a tar of nothing
                tarfile.TarInfo.frombuf(head, "utf-8", "surrogateescape")
    except (tarfile.HeaderError, EOFError, OSError, zlib.error, lzma.LZMAError):
        return False
    return True


def _plain(path: Path, name: str, scratch: Path) -> Path:
    """Return the tar itself, unpacked within the limits if it is compressed."""
    opener = _decompressor(path)
    if opener is None:
        return path
    with opener(path) as packed:  # its first header, before all is unpacked
        tarfile.open(fileobj=packed, mode="r:", tarinfo=_TarMember).close()
    plain = scratch / "plain.tar"
    inflate(path, plain, name)
    return plain


def _check_end(tar: tarfile.TarFile) -> None:
    """Reject a tar whose end-of-archive marker is not a zero block: a damaged header."""
    assert tar.fileobj is not None
    tar.fileobj.seek(tar.offset)
    if tar.fileobj.read(_TAR_BLOCK) != bytes(_TAR_BLOCK):
        raise tarfile.ReadError("it is cut, or the header of a member is damaged")


def _check_members(members: tuple[Member, ...], packed: int, name: str, scratch: Path) -> None:
    if len(members) > MAX_MEMBERS:
        raise _too_many(name, str(len(members)))
    for member in members:
        fault = improper(_plain_name(member.name).replace("\\", "/"))
        if fault is not None:
            raise InputError(f"{name}: its member {member.name[:100]!r} {fault}: pack it again")
    room = shutil.disk_usage(scratch).free
    _check_size(name, sum(member.size for member in members), _limit(packed), room)


def _too_many(name: str, count: str) -> InputError:
    """Return the error for an archive of more than MAX_MEMBERS files."""
    return InputError(f"{name}: holds {count} files, {MAX_MEMBERS} at most: unpack it by hand")


def _limit(packed: int) -> int:
    """Return the bytes that a file of `packed` bytes may unpack to."""
    return min(MAX_UNPACKED_BYTES, max(FREE_BYTES, MAX_RATIO * packed))


def _check_size(name: str, size: int, limit: int, room: int, more: str = "") -> None:
    """Raise InputError for a size above the limit, or above the free space of the disk."""
    fact = f"{name}: unpacks to {more}{size / 2**30:.3g} GiB"
    if size > limit:
        raise InputError(f"{fact}, {limit / 2**30:.3g} GiB at most: unpack it by hand")
    if size > room:
        full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        raise InputError(f"{fact}, {room / 2**30:.3g} GiB are free: make room in TMPDIR") from full


def _plain_name(name: str) -> str:
    """Return a member's name without the "./" that `tar` begins it with."""
    return name.removeprefix("./")


def improper(name: str) -> str | None:
    """Return why a file of this name cannot be copied below a folder; None if it can.

    "/" separates the parts of a name, as in archives, keys of object storage and addresses.
    """
    parts = name.split("/")
    if name.startswith("/"):
        return "points outside: it is absolute"
    if ".." in parts:
        return "points outside by a part '..'"
    if "" in parts or "." in parts:
        return "has an empty part" if "" in parts else "has a part '.'"
    if CONTROL.search(name):
        return "has a control character"
    longest = max(len(part.encode(errors="replace")) for part in parts)
    if longest > MAX_PART_BYTES:
        return f"has a part of {longest} bytes, {MAX_PART_BYTES} at most"
    return None


def path_below(folder: Path, name: str, where: str) -> Path:
    """Return the path below a folder at which a file of this name is written.

    All that is copied, unpacked or uploaded goes through here. where: what holds the file, for the
    message. Raises InputError for an improper name, and if a link leads the path out of the folder.
    """
    fault = improper(name)
    if fault is None and not lies_in(folder / name, folder):
        fault = "leads out of its folder"
    if fault is not None:
        raise InputError(f"{where}: the name {name[:100]!r} {fault}: rename it")
    return folder / name


def lies_in(path: Path, folder: Path) -> bool:
    """Return whether a path leads into a folder, both with their links followed."""
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links, a name that cannot be one
        return False


def sha256(path: Path) -> str:
    """Return the digest of a file's bytes as `sha256:` and 64 hexadecimal digits."""
    with path.open("rb") as stream:
        return f"sha256:{hashlib.file_digest(stream, 'sha256').hexdigest()}"


def sha256_of(content: memoryview) -> str:
    """Return the digest of bytes in memory, or of an array in C order."""
    return f"sha256:{hashlib.sha256(content).hexdigest()}"
