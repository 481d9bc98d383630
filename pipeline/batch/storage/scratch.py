"""Folder for temporary files, which a later run removes if its owner was killed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ...system import acquire

PREFIX, LOCK, GONE = "wheelplane-run-", ".lock", "wheelplane-gone-"


@contextmanager
def scratch_folder(prefix: str = PREFIX) -> Iterator[Path]:
    """Create a folder and remove it at the end; remove those of killed processes first.

    prefix: of its name, `wheelplane-WORD-`; folders of this user with the same one are removed. Its
    lock, a file beside it, is held before the folder is there and until it is gone.
    """
    for lock in Path(tempfile.gettempdir()).glob(f"{prefix}*{LOCK}"):
        _clear(lock)
    handle, lock = _held_lock(prefix)
    folder = lock.with_suffix("")
    try:
        folder.mkdir(mode=0o700)
        yield folder
    finally:
        _remove(folder, lock)
        os.close(handle)


def _held_lock(prefix: str) -> tuple[int, Path]:
    """Create a lock and hold it, unless another process took it for an abandoned one before."""
    while True:
        handle, path = tempfile.mkstemp(prefix=prefix, suffix=LOCK)
        acquire(handle)
        if os.fstat(handle).st_nlink:
            return handle, Path(path)
        os.close(handle)


def _clear(lock: Path) -> None:
    """Remove the folder of a lock that nobody holds: it ends with its process."""
    try:
        handle = os.open(lock, os.O_RDWR)
    except OSError:
        return  # another user's, or just removed
    try:
        if _is_own(os.fstat(handle)) and acquire(handle, wait=False):
            _remove(lock.with_suffix(""), lock)
    finally:
        os.close(handle)


def _is_own(lock: os.stat_result) -> bool:
    """Return whether a lock is this user's: an administrator can open those of others, too."""
    return not hasattr(os, "geteuid") or lock.st_uid == os.geteuid()


def _remove(folder: Path, lock: Path) -> None:
    """Remove a folder, all at once for those that still work in it, and then its lock."""
    gone = folder.with_name(GONE + folder.name.rpartition("-")[2])
    with suppress(OSError):  # not there
        folder.rename(gone)
    shutil.rmtree(gone, ignore_errors=True)
    with suppress(OSError):  # Windows: it is open
        lock.unlink()
