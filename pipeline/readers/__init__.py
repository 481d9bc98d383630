"""Point-cloud files to scans: one door, one family of readers a module."""

from __future__ import annotations

import io
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from pipeline.errors import InputError
from pipeline.readers.gather import UNITS, gather
from pipeline.readers.npy import read_npy
from pipeline.readers.pcd import read_pcd
from pipeline.readers.ply import read_ply
from pipeline.readers.raw import RawCloud, Source
from pipeline.readers.scan import Scan
from pipeline.readers.signature import NPY, PCD, PLY, TEXT, looks_like
from pipeline.readers.text import read_text

__all__ = ["READERS", "Scan", "read_scan"]


@dataclass(frozen=True)
class Family:
    """A reader, and what the first bytes of its files may look like."""

    read: Callable[[Source], RawCloud]
    signatures: tuple[str, ...]


READERS = {
    ".ply": Family(read_ply, (PLY,)),
    ".pcd": Family(read_pcd, (PCD, TEXT)),
    ".xyz": Family(read_text, (TEXT,)),
    ".csv": Family(read_text, (TEXT,)),
    ".txt": Family(read_text, (TEXT,)),
    ".npy": Family(read_npy, (NPY,)),
}


def read_scan(path: Path, length_unit: str = "m", name: str | None = None) -> Scan:
    """Read a point cloud, whole or not at all.

    length_unit: of the file's coordinates, "m", "mm" or "in"; never guessed.
    name: how the user calls the file; the path when not given.
    Raises InputError, one line, when the file is not exactly what it declares.
    """
    shown_name = " ".join((name or str(path)).splitlines())
    if length_unit not in UNITS:
        raise InputError(
            f"{shown_name}: the length unit '{length_unit}' is unknown: use {', '.join(UNITS)}"
        )
    try:
        return _read(path, shown_name, length_unit)
    except FileNotFoundError:
        raise InputError(f"{shown_name}: there is no such file: check the name") from None
    except PermissionError:
        raise InputError(
            f"{shown_name}: no permission to read it: change the file's permissions"
        ) from None
    except MemoryError:
        raise InputError(
            f"{shown_name}: the cloud does not fit into memory: thin it, or use a larger machine"
        ) from None
    except OSError as error:
        raise InputError(
            f"{shown_name}: it cannot be read ({error.strerror}): check the path and the disk"
        ) from None


def _read(path: Path, name: str, length_unit: str) -> Scan:
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{name}: it is a folder: name a scan file in it")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{name}: it is not a regular file: copy the scan to a file")
    family = READERS.get(path.suffix.lower())
    if family is None:
        raise InputError(
            f"{name}: the suffix '{path.suffix}' is not of a known point cloud format: "
            f"use one of {' '.join(READERS)}"
        )
    if found.st_size == 0:
        raise InputError(f"{name}: the file is empty: copy or export it again")
    with path.open(encoding="utf-8", errors="replace") as text:
        stream = cast(io.BufferedReader, text.buffer)
        kind = looks_like(stream.read(4096))
        if kind not in family.signatures:
            raise InputError(
                f"{name}: the suffix is '{path.suffix}', but it does not begin like "
                f"{family.signatures[0]}; it looks like {kind}: check the file or its suffix"
            )
        stream.seek(0)
        source = Source(stream, text, found.st_size, name)
        return gather(family.read(source), source, length_unit)
