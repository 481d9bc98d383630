"""Location of the files of a capture: its folder, an archive that is unpacked, or one cloud."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, remedy_of
from ..files import ARCHIVE_SUFFIXES, is_archive, open_archive
from ..readers import RAW_FORMATS, READERS, scan_suffix, unknown_format
from ..vehicle import REFERENCE_WHEELS


@contextmanager
def capture_folder(source: Path) -> Iterator[Path]:
    """Yield the folder of a capture, unpacked if it is an archive; or the cloud itself."""
    if check_path(source, source.is_dir):
        yield source
    elif not source.exists():
        raise InputError(f"{source}: no such file or folder: check the path")
    elif not source.is_file():
        raise InputError(f"{source}: not a regular file: copy the capture to a folder or a file")
    elif source.stat().st_size == 0:
        raise InputError(f"{source}: an empty file: copy it again")
    elif scan_suffix(source.name) in READERS:
        yield source
    elif source.suffix.lower() in RAW_FORMATS:
        raise unknown_format(source.suffix, str(source))
    elif is_archive(source, str(source)):
        with tempfile.TemporaryDirectory(prefix="wheelplane-") as scratch:
            folder = Path(scratch) / "capture"
            folder.mkdir()
            with open_archive(source, str(source), Path(scratch)) as archive:
                archive.unpack(folder)
            yield _top(folder)
    elif source.name.lower().endswith(ARCHIVE_SUFFIXES):
        raise InputError(
            f"{source}: no zip or tar, though its suffix says so, or cut: copy it again"
        )
    else:
        raise InputError(
            f"{source}: not a folder, zip or tar with one scan for each of "
            f"{', '.join(REFERENCE_WHEELS)}, nor a cloud of the whole vehicle, by its suffix: "
            f"use one of {' '.join(READERS)}, packed or not"
        )


def check_path(source: Path, test: Callable[[], bool]) -> bool:
    """Return `test()` of `source`. Raises InputError if the system cannot look it up."""
    try:
        return test()
    except OSError as error:  # a name too long, a folder that may not be entered
        raise InputError(f"{source}: {error.strerror}: {remedy_of(error)}") from error


def _top(folder: Path) -> Path:
    """Return the archive's only folder, if it holds nothing else."""
    inside = [p for p in folder.iterdir() if p.name != "__MACOSX" and not p.name.startswith(".")]
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else folder
