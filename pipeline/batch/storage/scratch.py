"""Folder for temporary files, which a later run removes if its owner was killed."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PREFIX, UNLOCKED = "wheelplane-run-", "wheelplane-new-"


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Create a folder and remove it at the end; remove those of killed processes first."""
    for left in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        if _is_abandoned(left):
            shutil.rmtree(left, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=UNLOCKED))
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        # Only now by a name under which others look: a folder that is not locked is abandoned.
        folder = folder.rename(folder.with_name(folder.name.replace(UNLOCKED, PREFIX)))
        yield folder
    finally:
        os.close(handle)
        shutil.rmtree(folder, ignore_errors=True)


def _is_abandoned(folder: Path) -> bool:
    """Return whether its owner has ended: the lock on a folder ends with its process."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return False  # another user's, or just removed
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(handle)
    return True
