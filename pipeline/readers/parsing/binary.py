"""Reader of fixed-size binary records, in chunks that stay in the cache."""

from __future__ import annotations

from collections.abc import Iterator

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


def read_exactly(source: Source, into: memoryview) -> None:
    """Fill the buffer. Raises InputError if the file shrank since its size was checked."""
    if source.stream.readinto(into) != len(into):
        raise fault(
            source, "the file was cut while it was read", "wait until it is written, then retry"
        )
