"""The catalogue's SQLite file: byte-identical for the same rows, with a checksum."""

from __future__ import annotations

import os
import sqlite3
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from .schema import APPLICATION

HEADER, CHECKSUM = 100, 60  # length of SQLite's header; offset of our checksum in it


def write_sqlite_file(connection: sqlite3.Connection, path: Path) -> None:
    """Write the catalogue to `path`, the same bytes for the same rows, and close it.

    VACUUM orders the rows by their keys. What depends on the file's history is in its header
    (https://www.sqlite.org/fileformat2.html): change counter (24), schema cookie (40),
    version-valid-for (92) and the library's version (96), which are set to constants. The user
    version (60) holds the checksum of all the rest.
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


def open_sqlite_file(path: Path, verified: bool = False) -> sqlite3.Connection | None:
    """Open a catalogue for reading; None if it is missing, foreign or damaged.

    verified: skip the test of the checksum.
    """
    try:
        stated, actual = (None, None) if verified else _checksums(path)
        if stated != actual:
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
    """Return the stated CRC-32 (None for a foreign file) and that of all bytes but itself.

    Both from one opening of the file, which may be replaced by a newer catalogue meanwhile.
    """
    with path.open("rb") as stream:
        head = stream.read(HEADER)
        actual = zlib.crc32(head[:CHECKSUM] + head[CHECKSUM + 4 :])
        while block := stream.read(2**20):
            actual = zlib.crc32(block, actual)
    is_sqlite = len(head) == HEADER and head.startswith(b"SQLite format 3\0")
    return int.from_bytes(head[CHECKSUM : CHECKSUM + 4], "big") if is_sqlite else None, actual
