"""Copies of a scan in a temporary folder: unpacked, or its text as UTF-8."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Container
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from posixpath import splitext

from ..errors import InputError
from ..files import ARCHIVE_SUFFIXES, COMPRESSED_SUFFIXES, Member, inflate, open_archive
from .parsing.lines import RowLengths
from .signature import TEXT, looks_like

_PIECE, _HEAD_BYTES = 1 << 20, 1 << 12
_ASCII_BODY = re.compile(rb"^(format|DATA) ascii", re.MULTILINE)


def unpacked(path: Path, name: str, known: Container[str], stack: ExitStack) -> tuple[Path, str]:
    """Return the plain scan file and its name; the given ones if the file is not packed.

    known: suffixes of scans. The temporary files are deleted when `stack` closes.
    Raises InputError for an archive that is damaged, too large, or does not hold exactly one scan.
    """
    lower = path.name.lower()
    if lower.endswith(ARCHIVE_SUFFIXES):
        folder = _folder(stack)
        with open_archive(path, name, folder) as archive:
            member = _only_scan(archive.members, name, known)
            archive.unpack(folder, (member,))
        path, name = folder / member.name, f"{name}: {member.name}"
        lower = path.name.lower()
    if lower.endswith(COMPRESSED_SUFFIXES):
        target = _folder(stack) / path.stem
        inflate(path, target, name, _RowsOfText(name))
        path = target
    return path, name


def as_utf8(path: Path, name: str, stack: ExitStack) -> Path:
    """Copy a text that is UTF-16, by its first bytes, as UTF-8; deleted when `stack` closes."""
    copy = _folder(stack) / path.name
    try:
        with path.open(encoding="utf-16") as text, copy.open("w", encoding="utf-8") as plain:
            while piece := text.read(_PIECE):
                plain.write(piece)
    except UnicodeError:
        raise InputError(
            f"{name}: it begins as UTF-16 text, but is not: copy it again, or save it as UTF-8"
        ) from None
    return copy


def scan_suffix(name: str) -> str:
    """Return the suffix of the scan's format, below that of a compression."""
    bare, suffix = splitext(name.lower())
    return splitext(bare)[1] if suffix in COMPRESSED_SUFFIXES else suffix


class _RowsOfText:
    """A check of a scan while it is unpacked: no line of a text is longer than any row."""

    def __init__(self, name: str) -> None:
        self._rows, self._is_text = RowLengths(name), False
        self._first = True

    def __call__(self, piece: bytes) -> None:
        if self._first:
            head, self._first = piece[:_HEAD_BYTES], False
            self._is_text = looks_like(head) == TEXT or _ASCII_BODY.search(head) is not None
        if self._is_text:
            self._rows.check(piece)


def _folder(stack: ExitStack) -> Path:
    return Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="wheelplane-")))


def _only_scan(members: tuple[Member, ...], name: str, known: Container[str]) -> Member:
    scans = [
        member
        for member in members
        if scan_suffix(member.name) in known
        and not member.name.startswith("__MACOSX/")
        and not PurePosixPath(member.name).name.startswith(".")
    ]
    if len(scans) != 1:
        held = ", ".join(member.name for member in scans)[:120]
        fact = f"it holds {len(scans)} scans ({held})" if scans else "it holds no scan"
        raise InputError(f"{name}: {fact}, one is needed: unpack it and give one scan")
    return scans[0]
