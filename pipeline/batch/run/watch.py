"""A folder into which a scanner drops files: each capture is taken when it is complete."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path

from ...capture import open_entries
from ...errors import WheelplaneError
from ..plan.discover import Found
from .run import Batch

PATIENCE_S = 600.0  # after which an incomplete capture is taken as it is, and its row says why


def watch(batch: Batch, folder: Path, settle_s: float) -> None:
    """Measure each capture below `folder` once nothing of it has changed for settle_s seconds.

    One that lacks a scan that it names, or whose zip has no end, waits. Ends with
    KeyboardInterrupt only; the catalogue is renewed whenever something was measured.
    """
    with batch.renewing():
        _watch(batch, folder, settle_s)


def _watch(batch: Batch, folder: Path, settle_s: float) -> None:
    waiting: dict[str, tuple[str, float]] = {}
    taken: dict[str, str] = {}
    while True:
        before, waiting, ready = waiting, {}, []
        for found in batch.new(batch.look()):
            mark, now_s = batch.state(found), time.monotonic()
            if taken.get(found.name) == mark:
                continue
            known, since_s = before.get(found.name, (mark, now_s))
            since_s = since_s if known == mark else now_s
            waiting[found.name] = mark, since_s
            still_s = now_s - since_s
            if still_s >= PATIENCE_S or (still_s >= settle_s and is_complete(found, folder)):
                ready.append(found)
                taken[found.name] = mark
        if ready:
            batch.measure(ready)
            batch.renew()
        time.sleep(settle_s / 4)


def is_complete(found: Found, folder: Path) -> bool:
    """Whether all that a capture names is there."""
    source = folder / found.name
    if found.kind == "zip":
        return zipfile.is_zipfile(source)
    if found.kind != "folder":
        return True
    try:
        with open_entries(source):
            return True
    except WheelplaneError:
        return False
