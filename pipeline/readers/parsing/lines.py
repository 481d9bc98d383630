"""Lines of a text file, in pieces that numpy parses fast; LF, CR or both end a line."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable, Iterator
from io import BufferedReader
from itertools import islice
from typing import TextIO

import numpy as np

from ...errors import InputError
from ..faults import fault
from ..source import Source

_PIECE = 1 << 19
_LONGEST_LINE = 1 << 20  # of heights too: a row of 80,000
_TAIL_BYTES = 1 << 12
_FEWEST_LINES = 1 << 12  # looked at together
_LF = 10
_NUMBER = re.compile(
    r"[+-]?((\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|nan|inf(inity)?)", re.IGNORECASE | re.ASCII
)


class Lines:
    """Lines of `text` from its position, after the lines `first`; `edit` is applied to pieces."""

    def __init__(
        self, text: TextIO, first: str = "", edit: Callable[[str], str] | None = None
    ) -> None:
        self._text, self._first, self._edit = text, first, edit
        self._ahead = ""
        self._left: int | None = None

    def end_after(self, count: int | None) -> None:
        """Set the end after `count` more lines; None for the end of the text."""
        self._left = count

    def piece(self, most: int | None = None) -> str:
        """Return some whole lines, at most `most`; an empty string at the end."""
        if self._left is not None:
            most = self._left if most is None else min(most, self._left)
        piece = self._cut(self._ahead or self._first + self._text.read(_PIECE), most)
        self._first = ""
        if self._left is not None:
            self._left -= count_of_lines(piece)
        return piece if self._edit is None else self._edit(piece)

    def rows(self, most: int, is_row: Callable[[str], object]) -> str:
        """Return some whole lines, at most `most` rows among them; an empty string at the end.

        is_row: called with each line that is not blank.
        """
        piece = self.piece(max(most, _FEWEST_LINES))
        if count_of_lines(piece) <= most:
            return piece
        end = rows = 0
        for line in io.StringIO(piece):
            rows += not line.isspace() and bool(is_row(line))
            end += len(line)
            if rows == most:
                break
        self._ahead = piece[end:] + self._ahead
        return piece[:end]

    def skip(self, lines: int) -> None:
        """Skip that many lines, or all that are left."""
        while lines and (piece := self.piece(lines)):
            lines -= count_of_lines(piece)

    def skip_rows(self, rows: int) -> int:
        """Skip that many non-blank lines; return the number of lines skipped."""
        skipped = 0
        while rows and (piece := self.rows(rows, bool)):
            skipped += count_of_lines(piece)
            rows -= rows_of(piece)
        return skipped

    def rows_left(self) -> int:
        """Skip all lines; return how many are not blank."""
        return sum(rows_of(piece) for piece in iter(self.piece, ""))

    def _cut(self, piece: str, most: int | None) -> str:
        self._ahead = ""
        if most == 0:
            self._ahead = piece
            return ""
        if piece and not piece.endswith("\n"):
            piece += self._text.readline()
        if most is not None and count_of_lines(piece) > most:
            end = -1
            for _ in range(most):
                end = piece.index("\n", end + 1)
            piece, self._ahead = piece[: end + 1], piece[end + 1 :]
        return piece


class RowLengths:
    """Lengths of the lines of a text that is given piece by piece; `name` is the file's."""

    def __init__(self, name: str) -> None:
        self._name, self._open = name, 0

    def check(self, piece: bytes) -> None:
        """Raise InputError for a line longer than any row."""
        end = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
        self._open = len(piece) - end - 1 + (self._open if end < 0 else 0)
        if self._open > _LONGEST_LINE:
            raise InputError(
                f"{self._name}: a line is longer than {_LONGEST_LINE} characters: "
                "export the scan with a point a line"
            )


def pass_lines(stream: BufferedReader, count: int) -> int:
    """Read past at most `count` lines that end with LF; return how many there were."""
    return sum(1 for _ in islice(stream, count))


def pass_blank_lines(stream: BufferedReader) -> int:
    """Read past lines of white space, which end with LF; return how many there were."""
    passed = 0
    while chunk := stream.read(_PIECE) + stream.readline(_LONGEST_LINE):
        rest = len(chunk.lstrip())
        blank = chunk[: len(chunk) - rest]
        passed += _line_feeds(blank)
        if rest:
            stream.seek(blank.rfind(b"\n") + 1 - len(chunk), os.SEEK_CUR)
            break
    return passed


def count_of_lines(piece: str) -> int:
    """Count the lines of a piece, the last one with or without its end."""
    return _line_feeds(piece.encode("utf-8", "replace")) + (piece[-1:] not in ("", "\n"))


def _line_feeds(data: bytes) -> int:
    """Count the line feeds, three times as fast as `data.count` for short lines."""
    return int(np.count_nonzero(np.frombuffer(data, np.uint8) == _LF))


def rows_of(piece: str) -> int:
    """Count the lines of a piece that are not blank."""
    return sum(not line.isspace() for line in piece.splitlines(keepends=True))


def is_number(text: str) -> bool:
    """Return whether the text is one number, nan and inf included."""
    return _NUMBER.fullmatch(text) is not None


def count_lines(source: Source) -> int:
    """Count the lines from here to the end, an upper bound; the stream keeps its position.

    A line ends with LF, CR or both; the last may lack its end. Raises InputError if it is then
    evidently cut: its last number has fewer decimals than those above it, which all have as many.
    """
    start, lines, last = source.stream.tell(), 0, b""
    for chunk in _chunks(source):
        lines += _line_feeds(chunk)
        if b"\r" in chunk:
            lines += chunk.count(b"\r") - chunk.count(b"\r\n")
        last = chunk[-1:]
    if last not in (b"\n", b"\r", b""):
        lines += 1
        source.stream.seek(max(start, source.size - _TAIL_BYTES))
        if _is_cut(source.stream.read()):
            raise fault(
                source,
                "its last line ends in the middle of a number",
                "copy the file again or, if it is whole, end the line",
            )
    source.stream.seek(start)
    return lines


def check_lines(source: Source) -> None:
    """Raise InputError for a line longer than any row; the stream keeps its position."""
    start = source.stream.tell()
    for _ in _chunks(source):
        pass
    source.stream.seek(start)


def _chunks(source: Source) -> Iterator[bytes]:
    """Yield the text from here to the end. Raises InputError for a line longer than any row."""
    rows = RowLengths(source.name)
    while chunk := source.stream.read(_PIECE):
        rows.check(chunk)
        yield chunk


def _is_cut(tail: bytes) -> bool:
    """Return whether the last number is shorter than those above it, or the only one.

    A row that ends with a delimiter is cut too, unless the one above it ends so.
    """
    lines = [line.rstrip(b" ") for line in tail.splitlines() if line and not line.startswith(b"#")]
    if lines and lines[-1].endswith((b",", b";", b"\t")):
        mark = lines[-1][-1:]
        above = lines[-2] if len(lines) > 1 else b""
        return not above.endswith(mark) or above.count(mark) != lines[-1].count(mark)
    rows = [re.sub(rb"[,;]", b" ", line).split() for line in lines]
    if not rows or not all(is_number(word.decode("latin-1")) for word in rows[-1]):
        return False
    last = [row[-1].decode("latin-1") for row in rows if row]
    decimals = [len(number.partition(".")[2]) for number in last if is_number(number)]
    if len(decimals) == 1:
        return True
    return len(decimals) > 4 and len(set(decimals[1:-1])) == 1 and decimals[-1] != decimals[1]
