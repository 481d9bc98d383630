"""A file in memory, which libraries open by a path and child processes map."""

from __future__ import annotations

import atexit
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple


class MemoryFile(NamedTuple):
    """An open file, and the path by which this process opens it again."""

    descriptor: int
    path: str

    def write(self, content: bytes) -> None:
        """Replace its content."""
        os.lseek(self.descriptor, 0, os.SEEK_SET)
        os.ftruncate(self.descriptor, os.write(self.descriptor, content))


@contextmanager
def memory_file() -> Iterator[MemoryFile]:
    """Create an empty file in memory; where the system cannot, in the folder of temporary files."""
    descriptor = os.memfd_create("wheelplane") if hasattr(os, "memfd_create") else -1
    path = f"/proc/self/fd/{descriptor}"
    in_memory = os.access(path, os.R_OK)
    if not in_memory:
        import tempfile

        if descriptor >= 0:
            os.close(descriptor)
        descriptor, path = tempfile.mkstemp(prefix="wheelplane-")
    try:
        yield MemoryFile(descriptor, path)
    finally:
        os.close(descriptor)
        if not in_memory:
            _remove(Path(path))


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except PermissionError:  # Windows: it is still mapped
        atexit.register(path.unlink, missing_ok=True)
