"""The catalogue's file: the same rows, the same bytes, and not one of them changed unseen."""

from __future__ import annotations

import os
import sqlite3
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from .schema import APPLICATION

HEADER, CHECKSUM = 100, 60  # bytes of SQLite's header, and where in it ours stands


def seal(connection: sqlite3.Connection, path: Path) -> None:
    """Write the catalogue to `path` so that the same rows give the same bytes; close it.

    VACUUM lays the rows out in the order of their keys. What remains of history stands in the
    file's header (https://www.sqlite.org/fileformat2.html): change counter (24), schema cookie
    (40), version-valid-for (92) and the library's version (96), which are set to constants. The
    user version (60) holds the checksum of all the rest.
    """
    connection.execute(
        "DELETE FROM kinds WHERE NOT EXISTS "
        "(SELECT 1 FROM quantity_rows AS q WHERE q.kind_id = kinds.kind_id)"
    )
    connection.execute("DELETE FROM layouts WHERE layout NOT IN (SELECT layout FROM packed)")
    connection.execute("VACUUM INTO ?", (str(path),))
    connection.close()
    with path.open("r+b") as stream:
        for offset, value in ((24, 1), (40, 1), (92, 1), (96, 3_040_000)):
            _patch(stream, offset, value)
        stream.flush()
        _patch(stream, CHECKSUM, _checksums(path)[1])
        stream.flush()
        os.fsync(stream.fileno())


def _patch(stream: BinaryIO, offset: int, value: int) -> None:
    stream.seek(offset)
    stream.write(struct.pack(">I", value))


def opened(path: Path, verified: bool = False) -> sqlite3.Connection | None:
    """A catalogue to be read; None if it is not there, none of ours, or has one bit changed.

    verified: no need to look for changed bits.
    """
    try:
        stated, found = (None, None) if verified else _checksums(path)
        if stated != found:
            return None
    except OSError:
        return None
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True, check_same_thread=False
    )
    try:
        if connection.execute("PRAGMA application_id").fetchone() == (APPLICATION,):
            return connection
    except sqlite3.Error:
        pass
    connection.close()
    return None


def _checksums(path: Path) -> tuple[int | None, int]:
    """CRC-32 that a catalogue states, None for another file; and that of the file but for itself.

    Of one opening: the name may go to a newer catalogue meanwhile.
    """
    with path.open("rb") as stream:
        head = stream.read(HEADER)
        found = zlib.crc32(head[:CHECKSUM] + head[CHECKSUM + 4 :])
        while block := stream.read(2**20):
            found = zlib.crc32(block, found)
    ours = len(head) == HEADER and head.startswith(b"SQLite format 3\0")
    return int.from_bytes(head[CHECKSUM : CHECKSUM + 4], "big") if ours else None, found
