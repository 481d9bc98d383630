"""Whether the system gives leases on files, as Linux does of most file systems."""

from __future__ import annotations

import tempfile
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


def are_given() -> bool:
    """Return whether one is given on a file of the temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_bytes(b"?")
        with path.open("rb") as stream:
            try:
                fcntl.fcntl(stream, fcntl.F_SETLEASE, fcntl.F_RDLCK)
            except (AttributeError, OSError):
                return False
    return True
