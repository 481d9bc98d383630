"""Points on disk, sorted into the nodes of an octree: out of core, the same bytes for the same.

The file of the nodes holds one after the other: n rows of three little-endian float32, metres from
the tree's origin, then n uint32: from the lowest bit on 16 bits of residual (int16, micrometres),
8 of intensity and 8 of scan. Any prefix of a node's points is an even sample of them.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from ...cloud import CODE_BITS, LEAF, MOST_DEPTH, cell_index, divide, mixed, morton_codes
from ...errors import InputError

RECORD = np.dtype(
    [("xyz", "<f4", 3), ("intensity", "<f4"), ("residual", "<i2"), ("scan", "<u2")]
)  # a point before its place in the tree is known
FIRST_DEPTH, FURTHER = 3, 2  # depth of the cells in which points are collected; of their cells
HELD_BYTES = 1 << 27  # in memory before they are written
MOST_ROWS = 4_000_000  # are sorted in memory at once

Records = npt.NDArray[Any]
Finish = Callable[[Records], npt.NDArray[np.uint8]]  # intensities as bytes


@dataclass
class Spill:
    """Points by the cells of one depth, each cell's in the order of their arrival.

    folder: for their files, one a cell. edge_m: of the tree. most_bytes: on disk.
    """

    folder: Path
    edge_m: float
    most_bytes: int
    depth: int = FIRST_DEPTH
    counts: Counter[int] = field(default_factory=Counter)
    _held: dict[int, list[Records]] = field(default_factory=lambda: defaultdict(list))
    _held_bytes: int = 0

    def add(self, records: Records) -> None:
        """Add points. Raises InputError where the disk has no room, or not so much is allowed."""
        codes = morton_codes(records["xyz"], self.edge_m)
        cells = (codes >> np.uint64(3 * (CODE_BITS - self.depth))).astype(np.uint32)
        order = np.argsort(cells.astype(np.uint16) if self.depth <= 5 else cells, kind="stable")
        cells = cells[order]
        starts = np.flatnonzero(np.diff(cells, prepend=-1))
        for part in np.split(order, starts[1:]) if len(order) else ():
            cell = int(codes[part[0]] >> np.uint64(3 * (CODE_BITS - self.depth)))
            self._held[cell].append(records[part])
            self.counts[cell] += len(part)
        self._held_bytes += records.nbytes
        if self.counts.total() * RECORD.itemsize > self.most_bytes:
            raise no_room(f"of {self.most_bytes / 1e9:.1f} GB that the page allows")
        if self._held_bytes > HELD_BYTES:
            self._write()

    def take(self, cell: int) -> Iterator[Records]:
        """Yield the points of a cell, and remove them."""
        path = self._path(cell)
        if path.exists():
            with path.open("rb") as stream:
                while len(records := np.fromfile(stream, RECORD, MOST_ROWS)):
                    yield records
            path.unlink()
        yield from self._held.pop(cell, [])

    def leaf_above(self, cell: int) -> int | None:
        """Return the depth of the first cell around that one which is a leaf; None if none is."""
        for depth in range(self.depth):
            shift = 3 * (self.depth - depth)
            around = (n for other, n in self.counts.items() if other >> shift == cell >> shift)
            if sum(around) <= LEAF:
                return depth
        return None

    def _write(self) -> None:
        with disk_errors():
            for cell, parts in self._held.items():
                with self._path(cell).open("ab") as stream:
                    stream.write(np.concatenate(parts).view(np.uint8).data)
        self._held.clear()
        self._held_bytes = 0

    def _path(self, cell: int) -> Path:
        return self.folder / f"cell-{self.depth}-{cell}"


@dataclass
class TreeWriter:
    """Writer of the nodes of a tree, from points that were spilled.

    intensity_bytes: returns the intensities of records as bytes. on_points: called with the number
    of points sorted so far. nodes: depth, column, row, level and number of points of each, in the
    order of the file.
    """

    stream: IO[bytes]
    intensity_bytes: Finish
    on_points: Callable[[int], None]
    nodes: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    _open: dict[tuple[int, int], list[Records]] = field(default_factory=lambda: defaultdict(list))
    _before: int | None = None
    _done: int = 0

    def write(self, spill: Spill) -> None:
        """Write all nodes. Raises InputError where the disk has no room."""
        self._sort(spill)
        self._close(0)

    def _sort(self, spill: Spill) -> None:
        for cell, count in sorted(spill.counts.items()):
            if count > MOST_ROWS and spill.depth < MOST_DEPTH:
                depth = min(spill.depth + FURTHER, MOST_DEPTH)
                finer = Spill(spill.folder, spill.edge_m, spill.most_bytes, depth)
                for records in spill.take(cell):
                    finer.add(records)
                self._sort(finer)
            else:
                self._place(np.concatenate(list(spill.take(cell))), cell, spill)
            self._close(spill.depth)

    def _place(self, records: Records, cell: int, spill: Spill) -> None:
        codes = morton_codes(records["xyz"], spill.edge_m)
        for node in divide(codes, spill.depth, self._before, spill.leaf_above(cell)):
            self._open[node.depth, node.cell].append(records[node.rows])
        self._before = int(codes.max())
        self._done += len(records)
        self.on_points(self._done)

    def _close(self, depth: int) -> None:
        """Write the nodes of that depth and deeper, to which no other cell adds points."""
        for key in sorted(key for key in self._open if key[0] >= depth):
            records = np.concatenate(self._open.pop(key))
            records = records[mixed(len(records))]
            extra = records["residual"].astype("<u2").astype("<u4")
            extra |= self.intensity_bytes(records).astype("<u4") << 16
            extra |= np.minimum(records["scan"], 255).astype("<u4") << 24
            with disk_errors():
                self.stream.write(np.ascontiguousarray(records["xyz"]).tobytes())
                self.stream.write(extra.tobytes())
            self.nodes.append((key[0], *cell_index(key[1], key[0]), len(records)))


@contextmanager
def disk_errors() -> Iterator[None]:
    """Raise InputError for an error of the disk."""
    try:
        yield
    except OSError as error:
        raise no_room(f"({error.strerror})") from error


def no_room(fact: str) -> InputError:
    """Return the error for points that find no room."""
    return InputError(
        f"the temporary folder has no room for all points {fact}: free some disk space, or crop "
        "the scans to the vehicle"
    )
