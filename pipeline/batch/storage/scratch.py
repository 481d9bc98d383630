"""Folder for temporary files, which a later run removes if its owner was killed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ...system import acquire

PREFIX, LOCK = "wheelplane-run-", "lock"


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Create a folder and remove it at the end; remove those of killed processes first."""
    for left in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        if _is_abandoned(left):
            shutil.rmtree(left, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT)
    try:
        acquire(handle)
        os.write(handle, b"held")
        yield folder
    finally:
        os.close(handle)
        shutil.rmtree(folder, ignore_errors=True)


def _is_abandoned(folder: Path) -> bool:
    """Return whether its owner has ended: the lock ends with its process.

    An empty lock is one that its owner has not come to hold yet.
    """
    try:
        handle = os.open(folder / LOCK, os.O_RDWR)
    except OSError:
        return False  # another user's, just made, or just removed
    try:
        return acquire(handle, wait=False) and os.fstat(handle).st_size > 0
    except OSError:
        return False
    finally:
        os.close(handle)
