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
PAGE, PAGES = slice(16, 18), slice(28, 32)  # size of a page, 1 for 65536; number of pages
MARK_NS, MARKS = 100, 10_000  # unit of a mark, which NTFS keeps as well; number of marks


def write_sqlite_file(connection: sqlite3.Connection, path: Path) -> None:
    """Write the catalogue to `path`, the same bytes for the same rows, and close it.

    VACUUM orders the rows by their keys. What depends on the file's history is in its header
    (https://www.sqlite.org/fileformat2.html): change counter (24), schema cookie (40),
    version-valid-for (92) and the library's version (96), which are set to constants. The user
    version (60) holds the checksum of all the rest.
    """
    connection.execute("DELETE FROM kinds WHERE kind_id NOT IN (SELECT kind_id FROM columns)")
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


def mark_verified(path: Path, time_ns: int) -> None:
    """Set the time of a catalogue whose content is right to one of the last 2 ms before time_ns.

    Below the millisecond it repeats the checksum. Whatever is written to the file sets its time
    anew, so that the file bears this mark no longer, but for one time in MARKS.
    """
    with path.open("rb") as stream:
        stated = _stated(stream.read(HEADER)) or 0
    millisecond = MARK_NS * MARKS
    time_ns = (time_ns // millisecond - 1) * millisecond + _mark(stated) * MARK_NS
    os.utime(path, ns=(time_ns, time_ns))


def _bears_mark(path: Path) -> bool:
    """Return whether the file is whole by its header, and bears the mark of its checksum."""
    with path.open("rb") as stream:
        head, known = stream.read(HEADER), os.fstat(stream.fileno())
    stated, page = _stated(head), int.from_bytes(head[PAGE], "big")
    size = (65536 if page == 1 else page) * int.from_bytes(head[PAGES], "big")
    mark = known.st_mtime_ns // MARK_NS % MARKS
    return stated is not None and size == known.st_size and mark == _mark(stated)


def _mark(checksum: int) -> int:
    """Return the mark of a checksum, from 1: a copied file may be given the time of a second."""
    return 1 + checksum % (MARKS - 1)


def open_sqlite_file(path: Path, verified: bool = False) -> sqlite3.Connection | None:
    """Open a catalogue for reading; None if it is missing, foreign or damaged.

    verified: skip the test of the checksum, as for a file that bears the mark of `mark_verified`.
    """
    try:
        if not (verified or _bears_mark(path)):
            stated, actual = _checksums(path)
            if stated != actual:
                return None
    except OSError:
        return None
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True, check_same_thread=False
    )
    try:
        connection.execute("PRAGMA temp_store = MEMORY")  # of `--where`
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
    return _stated(head), actual


def _stated(head: bytes) -> int | None:
    """Return the checksum that a header states; None for a foreign file."""
    is_sqlite = len(head) == HEADER and head.startswith(b"SQLite format 3\0")
    return int.from_bytes(head[CHECKSUM : CHECKSUM + 4], "big") if is_sqlite else None
