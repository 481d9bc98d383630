"""Points of a scan file block by block, as `read_scan` returns them whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..system import frozen
from ..vectors import Array, Array32
from .gather import Placer, PointRows
from .missing import LookedAt, Markers, find_markers
from .options import AS_THE_FILE_SAYS, ReadOptions
from .read_scan import open_cloud


@frozen(eq=False)
class PlacedBlock:
    """Successive valid points of one scan of a file, its pose applied.

    points_m: (N, 3) float64, metres. intensity: (N,) or None. part: index of the scan. parts: names
    of all scans of the file; empty when the format has none.
    """

    points_m: Array
    intensity: Array32 | None
    part: int
    parts: tuple[str, ...]


def read_blocks(
    path: Path,
    length_unit: str = "m",
    name: str | None = None,
    options: ReadOptions = AS_THE_FILE_SAYS,
    *,
    has_missing: bool = True,
) -> Iterator[PlacedBlock]:
    """Yield the valid points of a scan file; Raises InputError as `read_scan`.

    has_missing: whether points may mark missing returns, which takes a pass of its own to find.
    """
    markers = _find_missing(path, length_unit, name, options) if has_missing else None
    yield from _placed(path, length_unit, name, options, markers)


def _placed(
    path: Path, length_unit: str, name: str | None, options: ReadOptions, markers: Markers | None
) -> Iterator[PlacedBlock]:
    with open_cloud(path, length_unit, name, options) as (cloud, source):
        parts = tuple(part.name for part in cloud.parts)
        placer = Placer(cloud, source, length_unit, markers if cloud.may_mark else None)
        for block in cloud.blocks:
            room = PointRows.room(len(block.xyz[0]), cloud)
            with np.errstate(over="ignore", invalid="ignore"):
                rows = room.part(0, placer.place(block, room))
            yield PlacedBlock(rows.points, rows.intensity, block.part, parts)


def _find_missing(
    path: Path, length_unit: str, name: str | None, options: ReadOptions
) -> Markers | None:
    """Find what marks missing returns, by the points that `read_scan` looks at."""
    looked_at = LookedAt()
    for block in _placed(path, length_unit, name, options, None):
        looked_at.add(block.points_m)
    some_m = looked_at.points_m()
    return find_markers(some_m) if len(some_m) else None
