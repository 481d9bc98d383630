"""Settings of the page: where it is served, allowed folders and limits."""

from __future__ import annotations

import os
from pathlib import Path

from ..system import frozen

GIB = 2**30


@frozen
class Endpoint:
    """Where the page is served: a host and port, or a Unix socket, to which a port is forwarded."""

    host: str = "127.0.0.1"
    port: int = 8765
    socket: Path | None = None


@frozen
class PageSettings:
    """Allowed folders and limits of the page.

    folders: the page reads and saves only here. scratch: own folder for uploads and results.
    upload_bytes, upload_files: limits of one upload. seconds, memory_bytes: limits of one
    measuring process. tree_bytes: of the points of all results, for the 3D view; the oldest go
    first. jobs: number of results kept. waiting: number of measurements that may wait.
    config: settings file (TOML) of measurements, and of who issues reports and certificates. own:
    folder with the user's targets, scanners and tolerances, which the page offers. results:
    folder of measurements that outlive the program; None: they end with it.
    """

    folders: tuple[Path, ...]
    scratch: Path
    upload_bytes: int = 2 * GIB
    upload_files: int = 200
    seconds: float = 900.0
    memory_bytes: int = 8 * GIB
    tree_bytes: int = 8 * GIB
    jobs: int = 40
    waiting: int = 16
    config: Path | None = None
    own: Path | None = None
    results: Path | None = None
    workers: int = 1 if (os.cpu_count() or 1) < 4 else 2
