"""Capture without capture.toml: wheels and trials by the names of the files."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import InputError
from ..files import COMPRESSED_SUFFIXES
from ..readers import READERS, scan_suffix
from ..vehicle import REFERENCE_WHEELS
from .declaration import CaptureFile, DeclaredTrial, find_capture_file

TABLES = (".csv", ".txt")  # may be tables of anything


def by_file_names(folder: Path, source: Path) -> CaptureFile:
    """Declare rr.* rl.* fr.* fl.* as the wheels, trial-NAME.* as trials; else one cloud of all.

    Raises InputError, which begins with `source`, if the files are neither.
    """
    files = _files(folder)
    if not _has_wheels(folder) and clouds_of(folder):
        return CaptureFile(cloud=only_cloud(folder, str(source)))
    reference = {}
    for wheel in REFERENCE_WHEELS:
        scans = [name for name in files if _stem(name).upper() == wheel]
        if len(scans) != 1:
            found = " and ".join(scans) if scans else "none"
            raise InputError(
                f"{source}: one scan {wheel.lower()}.* is needed, found {found}: "
                "add or remove files, or write a capture.toml"
            )
        reference[wheel] = scans[0]
    trials = [name for name in files if re.match(r"trial-.+\..+", name, re.IGNORECASE)]
    for name in (*reference.values(), *trials):
        check_plain(name, str(source))  # a name may hold bytes that are no text
    trials.sort(key=lambda name: [int(p) if p.isdecimal() else p for p in re.split(r"(\d+)", name)])
    return CaptureFile(
        reference=reference,
        trial=tuple(DeclaredTrial(name=_stem(name)[len("trial-") :], file=name) for name in trials),
    )


def filled_by_names(declared: CaptureFile, folder: Path, source: Path) -> CaptureFile:
    """Add the wheels and trials by file names to a declaration that names no scan.

    Raises InputError, which begins with `source`, if it states what only a cloud of all has.
    """
    if declared.reference is not None or declared.cloud is not None or not _has_wheels(folder):
        return declared
    named = by_file_names(folder, source)
    for key in ("front", "front_point", "up", "runout"):
        if key in declared.model_fields_set:
            raise InputError(
                f"{source}: capture.toml: {key} without cloud or [reference], beside scans that "
                "are named as wheels: add cloud, the file that shows all wheels, or [reference], "
                f"with the scan of each{'' if key == 'runout' else f', and leave out {key}'}"
            )
    return declared.model_copy(update={"reference": named.reference, "trial": named.trial})


def is_capture(folder: Path) -> bool:
    """Return whether a folder has a capture.toml, or a file named as a wheel."""
    stems = {name.split(".")[0].upper() for name in _files(folder)}
    return find_capture_file(folder) is not None or bool(stems & set(REFERENCE_WHEELS))


def clouds_of(folder: Path) -> list[str]:
    """Return the files of a folder that can only be point clouds, by their suffix."""
    return [name for name in _files(folder) if scan_suffix(name) in set(READERS) - set(TABLES)]


def only_cloud(folder: Path, where: str) -> str:
    """Return the only cloud of a folder. Raises InputError if it holds none or several."""
    found = clouds_of(folder)
    if len(found) != 1:
        held = f"{len(found)} ({', '.join(found)[:120]})" if found else "none"
        raise InputError(
            f"{where}: one cloud of the whole vehicle, or one scan for each of "
            f"{', '.join(REFERENCE_WHEELS)}, is needed, found {held}: name the one in a "
            'capture.toml, cloud = "FILE", or the four in its [reference]'
        )
    check_plain(found[0], where)
    return found[0]


def check_plain(name: str, where: str) -> None:
    """Raise InputError for a name that is not printable."""
    if not name.isprintable():
        raise InputError(f"{where}: the name {name!r} is not plain text: rename it")


def _has_wheels(folder: Path) -> bool:
    return any(_stem(name).upper() in REFERENCE_WHEELS for name in _files(folder))


def _files(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))


def _stem(file: str) -> str:
    """Return the name without the suffixes of the format and of a compression."""
    path = Path(file)
    return Path(path.stem).stem if path.suffix.lower() in COMPRESSED_SUFFIXES else path.stem
