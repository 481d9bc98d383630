"""What the page may show, and what a request may cost."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

GIB = 2**30


@dataclass(frozen=True)
class Settings:
    """folders: all that the page may read, and save to. scratch: of uploads and results, its own.

    upload_bytes, upload_files: of one upload. seconds, memory_bytes: of one measuring process.
    jobs: results that are kept; the oldest goes first. waiting: measurements that may queue.
    """

    folders: tuple[Path, ...]
    scratch: Path
    upload_bytes: int = 2 * GIB
    upload_files: int = 200
    seconds: float = 900.0
    memory_bytes: int = 8 * GIB
    jobs: int = 40
    waiting: int = 16
    workers: int = 1 if (os.cpu_count() or 1) < 4 else 2
