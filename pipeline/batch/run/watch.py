"""Watch of a folder that receives scans: each capture is measured when it is complete."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path

from ...capture import open_entries
from ...errors import WheelplaneError
from ..plan.discover import FoundCapture
from .run import Batch

PATIENCE_S = 600.0  # after this an incomplete capture is measured as it is, and fails


def watch(batch: Batch, folder: Path, settle_s: float) -> None:
    """Measure each capture below `folder` once it has not changed for settle_s seconds.

    Captures with missing scans, and incomplete zips, wait. Ends with KeyboardInterrupt only; the
    catalogue is updated after each measurement.
    """
    with batch.updating_catalogue():
        _watch(batch, folder, settle_s)


def _watch(batch: Batch, folder: Path, settle_s: float) -> None:
    waiting: dict[str, tuple[str, float]] = {}
    taken: dict[str, str] = {}
    while True:
        before, waiting, ready = waiting, {}, []
        for found in batch.pending(batch.find_captures()):
            state, now_s = batch.state(found), time.monotonic()
            if taken.get(found.name) == state:
                continue
            known, since_s = before.get(found.name, (state, now_s))
            since_s = since_s if known == state else now_s
            waiting[found.name] = state, since_s
            settled_s = now_s - since_s
            if settled_s >= PATIENCE_S or (settled_s >= settle_s and is_complete(found, folder)):
                ready.append(found)
                taken[found.name] = state
        if ready:
            batch.measure(ready)
            batch.update_catalogue()
        time.sleep(settle_s / 4)


def is_complete(found: FoundCapture, folder: Path) -> bool:
    """Return whether all files that a capture names exist."""
    source = folder / found.name
    if found.kind == "zip":
        return zipfile.is_zipfile(source)
    if found.kind != "folder" or found.packed:
        return True
    try:
        with open_entries(source, within=folder):
            return True
    except WheelplaneError:
        return False
