"""Reader of fixed-size binary records, in chunks that stay in the cache."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..faults import fault
from ..source import Block, Layout, Source

CHUNK_BYTES = 1 << 20


def record_blocks(
    source: Source,
    count: int,
    formats: list[str],
    offsets: list[int],
    itemsize: int,
    layout: Layout,
) -> Iterator[Block]:
    """Yield blocks of `count` records of `itemsize` bytes from the current position.

    formats, offsets: numpy scalar type and byte offset of each column that `layout` refers to.
    The caller has checked that the file holds the records.
    """
    rows = max(1, CHUNK_BYTES // itemsize)
    buffer = bytearray(rows * itemsize)
    columns = [
        np.ndarray((rows,), np.dtype(form), buffer, offset, (itemsize,))
        for form, offset in zip(formats, offsets, strict=True)
    ]
    done = 0
    while done < count:
        wanted = min(rows, count - done)
        read_exactly(source, memoryview(buffer)[: wanted * itemsize])
        yield layout.block_of([column[:wanted] for column in columns])
        done += wanted


def point_record(
    formats: Sequence[str], offsets: Sequence[int], itemsize: int, layout: Layout
) -> np.dtype[Any] | None:
    """Return the fields `xyz` (3,) and `intensity` of such records, for use where they lie.

    None where x, y, z are no doubles of this machine, one behind the other, or colours stand for
    the intensity.
    """
    x, y, z = (offsets[index] for index in layout.xyz)
    double = np.dtype(np.float64)
    if any(np.dtype(formats[k]) != double for k in layout.xyz) or (y, z) != (x + 8, x + 16):
        return None
    fields: dict[str, tuple[Any, int]] = {"xyz": ((double, 3), x)}
    if layout.intensity is not None:
        fields["intensity"] = formats[layout.intensity], offsets[layout.intensity]
    elif layout.colour:
        return None
    kinds, starts = zip(*fields.values(), strict=True)
    return np.dtype({"names": [*fields], "formats": kinds, "offsets": starts, "itemsize": itemsize})


def read_exactly(source: Source, into: memoryview) -> None:
    """Fill the buffer. Raises InputError if the file shrank since its size was checked."""
    if source.stream.readinto(into) != len(into):
        raise fault(
            source, "the file was cut while it was read", "wait until it is written, then retry"
        )
