"""Readers driven without read_scan: bytes as an open source, and all columns of a raw cloud."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from wheelplane.readers.source import RawCloud, Source


@contextmanager
def opened(folder: Path, data: bytes, name: str = "rr.dat") -> Iterator[Source]:
    """Open the bytes, written to a file of that name."""
    path = folder / name
    path.write_bytes(data)
    with ExitStack() as stack:
        yield Source.open(path, name, stack)


def table(cloud: RawCloud) -> np.ndarray:
    """Read all blocks as rows x, y, z and, if there is one, intensity, float64."""
    rows = [np.empty((0, 4 if cloud.has_intensity else 3))]
    for block in cloud.blocks:  # whose memory the next one may overwrite
        columns = [*block.xyz, block.intensity] if cloud.has_intensity else [*block.xyz]
        rows.append(np.array(columns, dtype=np.float64).T)
    return np.vstack(rows)
