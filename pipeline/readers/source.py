"""What the door and the families of readers hand to each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, TextIO, cast

import numpy.typing as npt

from ..vectors import Array, Mask

Column = npt.NDArray[Any]

INTENSITY_NAMES = ("intensity", "scalar_intensity", "reflectance", "scalar_reflectance")


@dataclass(frozen=True)
class Source:
    """An open scan file, its size in bytes, and the name the user knows it by.

    text: the same file as lines, from wherever `stream` stands when it is first read.
    path: for libraries that open files themselves; messages use `name`.
    stack: closed when the scan was read; for what a reader must keep until then.
    """

    stream: BufferedReader
    text: TextIO
    size: int
    name: str
    path: Path
    stack: ExitStack

    @classmethod
    def open(cls, path: Path, name: str, stack: ExitStack) -> Source:
        """Open the file at `path`, until `stack` closes it."""
        text = stack.enter_context(path.open(encoding="utf-8", errors="replace"))
        return cls(cast(BufferedReader, text.buffer), text, path.stat().st_size, name, path, stack)

    def remaining(self) -> int:
        """Bytes from the current position to the end."""
        return self.size - self.stream.tell()


@dataclass(frozen=True)
class Block:
    """Some successive points of one scan: columns of one length, the file's own unit.

    xyz: of any real dtype, before the scan's pose is applied; NaN where nothing returned.
    grid: row and column of the scanner's raster, any integer dtype.
    missing: bool, where the format says in its own way that nothing returned.
    part: which of the cloud's parts the points belong to; never less than the block's before.
    The columns may look into a buffer that the next block overwrites.
    """

    xyz: tuple[Column, Column, Column]
    intensity: Column | None = None
    grid: tuple[Column, Column] | None = None
    missing: Mask | None = None
    part: int = 0


@dataclass(frozen=True)
class RawPart:
    """One scan of a file that may hold several.

    T_file_scan: (4, 4) float64, applied to column vectors in the file's unit, once, by `gather`;
    None when the file states no pose and its coordinates stand as they are.
    note: what the reader had to settle, as a sentence.
    """

    name: str
    T_file_scan: Array | None = None
    note: str = ""


@dataclass(frozen=True)
class RawCloud:
    """A file whose header was believed: at most `rows` points, to be drawn block by block.

    rows: counts missing returns that have a row. parts: empty when the format knows no scans.
    """

    rows: int
    has_intensity: bool
    blocks: Iterator[Block]
    has_grid: bool = False
    parts: tuple[RawPart, ...] = ()


@dataclass(frozen=True)
class Layout:
    """Which of the file's columns are x, y, z and, if any, the intensity."""

    xyz: tuple[int, int, int]
    intensity: int | None

    def block(self, table: Array) -> Block:
        """A table (N, columns) as a block."""
        x, y, z = (table[:, column] for column in self.xyz)
        return Block((x, y, z), None if self.intensity is None else table[:, self.intensity])


def find_layout(names: Sequence[str]) -> Layout:
    """Find x, y, z and the intensity by name, in either case.

    Raises ValueError with the fact when a coordinate is missing or there twice.
    """
    lower = [name.lower() for name in names]
    for axis in "xyz":
        if lower.count(axis) != 1:
            fault = "missing" if axis not in lower else f"there {lower.count(axis)} times"
            raise ValueError(f"{axis} is {fault} among the columns {', '.join(names)[:120]}")
    known = (lower.index(name) for name in INTENSITY_NAMES if name in lower)
    return Layout((lower.index("x"), lower.index("y"), lower.index("z")), next(known, None))


def shown(text: str | bytes) -> str:
    """A piece of the file as it may stand in a one-line message."""
    piece = text.decode("latin-1") if isinstance(text, bytes) else text
    piece = piece.strip()
    return repr(piece if len(piece) <= 60 else piece[:57] + "...")
