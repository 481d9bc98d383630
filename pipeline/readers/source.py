"""Records passed between read_scan, the readers and gather: source, blocks, raw cloud, layout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from io import BufferedReader
from pathlib import Path
from typing import Any, TextIO, cast

import numpy as np
import numpy.typing as npt

from ..system import frozen
from ..vectors import Array, Mask
from .colour import luminance
from .options import AS_THE_FILE_SAYS, ReadOptions

PointColumn = npt.NDArray[Any]


@frozen
class Source:
    """An open scan file, its size in bytes, and its name in messages.

    text: the same file as lines, from wherever `stream` stands when it is first read.
    path: for libraries that open files themselves; messages use `name`.
    stack: closed when the scan has been read; holds what a reader must keep open until then.
    options: what the user states of the file.
    """

    stream: BufferedReader
    text: TextIO
    size: int
    name: str
    path: Path
    stack: ExitStack
    options: ReadOptions = AS_THE_FILE_SAYS

    @classmethod
    def open(
        cls, path: Path, name: str, stack: ExitStack, options: ReadOptions = AS_THE_FILE_SAYS
    ) -> Source:
        """Open the file at `path`, until `stack` closes it."""
        text = stack.enter_context(path.open(encoding="utf-8", errors="replace"))
        stream, size = cast(BufferedReader, text.buffer), path.stat().st_size
        return cls(stream, text, size, name, path, stack, options)

    def remaining(self) -> int:
        """Return the bytes from the current position to the end."""
        return self.size - self.stream.tell()


@frozen(eq=False)
class Block:
    """Successive points of one scan: columns of one length, in the file's own unit.

    xyz: of any real dtype, before the scan's pose is applied; NaN where there is no return.
    grid: row and column of the scanner's raster, any integer dtype.
    invalid: bool, True where the format marks a point as invalid (no return).
    part: index of the cloud's part that the points belong to; it never decreases.
    The columns may look into a buffer that the next block overwrites.
    """

    xyz: tuple[PointColumn, PointColumn, PointColumn]
    intensity: PointColumn | None = None
    grid: tuple[PointColumn, PointColumn] | None = None
    invalid: Mask | None = None
    part: int = 0


@frozen(eq=False)
class RawPart:
    """One scan of a file that may hold several.

    T_file_scan: (4, 4) float64, applied to column vectors in the file's unit, once, by `gather`;
    None when the file states no pose and its coordinates stand as they are.
    note: an assumption that the reader made about the pose, as a sentence.
    """

    name: str
    T_file_scan: Array | None = None
    note: str = ""


@frozen
class RawCloud:
    """A file with its checked header: at most `rows` points, to be read block by block.

    rows: includes invalid points. parts: empty when the format has no parts. unit: of length, if
    the file states one. is_mesh: whether the points are the corners of a mesh, not returns.
    may_mark: whether some of them may mark missing returns. record: of a file of nothing but
    `rows` points from where its stream stands, the fields `xyz`, doubles, and `intensity` of each.
    """

    rows: int
    has_intensity: bool
    blocks: Iterator[Block]
    has_grid: bool = False
    parts: tuple[RawPart, ...] = ()
    unit: str | None = None
    is_mesh: bool = False
    may_mark: bool = True
    record: np.dtype[Any] | None = None


@frozen
class Layout:
    """Indices of the file's columns x, y, z and, if any, the intensity; the unit of the three.

    colour: where there is no intensity, those of red, green and blue, or the one that packs them.
    """

    xyz: tuple[int, int, int]
    intensity: int | None
    unit: str | None = None
    colour: tuple[int, ...] = ()

    @property
    def has_intensity(self) -> bool:
        """Whether points have an intensity, or a colour, whose luminance stands for it."""
        return self.intensity is not None or bool(self.colour)

    @property
    def used(self) -> tuple[int, ...]:
        """Indices of all these columns."""
        return (*self.xyz, *(self.colour if self.intensity is None else (self.intensity,)))

    @property
    def in_order(self) -> Layout:
        """The same of these columns alone, one after the other as `used` names them."""
        after_xyz = tuple(range(3, len(self.used)))
        if self.intensity is not None:
            return Layout((0, 1, 2), 3, self.unit)
        return Layout((0, 1, 2), None, self.unit, after_xyz)

    def block(self, table: Array) -> Block:
        """Return a table (N, columns) as a block."""
        return self.block_of(list(table.T))

    def block_of(self, columns: Sequence[PointColumn]) -> Block:
        """Return columns of the same length as a block."""
        x, y, z = (columns[index] for index in self.xyz)
        if self.intensity is not None:
            return Block((x, y, z), columns[self.intensity])
        colour = [columns[index] for index in self.colour]
        return Block((x, y, z), luminance(*colour) if colour else None)


def shown(text: str | bytes) -> str:
    """Return a piece of the file, quoted and cut to 60 characters, for a one-line message."""
    piece = text.decode("latin-1") if isinstance(text, bytes) else text
    piece = piece.strip()
    return repr(piece if len(piece) <= 60 else piece[:57] + "...")
