"""Unpacking of a scan that is compressed, or the only one in a zip or tar, to a temporary file."""

from __future__ import annotations

import tempfile
from collections.abc import Container
from contextlib import ExitStack
from pathlib import Path, PurePosixPath

from ..errors import InputError
from ..files import ARCHIVE_SUFFIXES, COMPRESSED_SUFFIXES, Member, inflate, open_archive


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
        inflate(path, target, name)
        path = target
    return path, name


def scan_suffix(name: str) -> str:
    """Return the suffix of the scan's format, below that of a compression."""
    path = PurePosixPath(name.lower())
    return PurePosixPath(path.stem).suffix if path.suffix in COMPRESSED_SUFFIXES else path.suffix


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
