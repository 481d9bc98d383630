"""NPY reader: arrays (N, 3) or (N, 4).

Format: numpy.lib.format, versions 1.0 and 2.0 (3.0 is for structured arrays only).
"""

from __future__ import annotations

import ast
import math
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..faults import fault, too_long, too_short
from ..parsing.binary import CHUNK_BYTES, read_exactly, record_blocks
from ..source import Block, Layout, RawCloud, Source, shown

_LENGTH_FORMATS = {b"\x01\x00": "<H", b"\x02\x00": "<I"}
_INCOMPLETE = "the copy is incomplete; copy it again"
_LONGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class Header:
    """An NPY header; the array's bytes follow it."""

    dtype: np.dtype[Any]
    fortran_order: bool
    shape: tuple[int, ...]


def read_npy(source: Source) -> RawCloud:
    """Read rows x y z, or x y z intensity, of any real dtype, byte order and memory order."""
    header = read_header(source)
    if len(header.shape) != 2 or header.shape[1] not in (3, 4):
        action = "save rows of x y z or of x y z intensity"
        raise fault(source, f"the array has the shape {shown(str(header.shape))}", action)
    check_size(source, header)
    rows, columns = header.shape
    layout = Layout((0, 1, 2), 3 if columns == 4 else None)
    if header.fortran_order:
        blocks = _column_blocks(source, header)
    else:
        width = header.dtype.itemsize
        offsets = [column * width for column in range(columns)]
        formats = [header.dtype.str] * columns
        blocks = record_blocks(source, rows, formats, offsets, columns * width, layout)
    return RawCloud(rows, columns == 4, blocks)


def check_size(source: Source, header: Header) -> None:
    """Raise InputError unless exactly the declared array follows."""
    rows = header.shape[0]
    itemsize = math.prod(header.shape[1:]) * header.dtype.itemsize
    held, extra = divmod(source.remaining(), itemsize)
    if held < rows:
        raise too_short(source, rows, held)
    if held > rows or extra:
        raise too_long(source, rows, f"{source.remaining() - rows * itemsize} bytes")


def read_header(source: Source) -> Header:
    """Read up to the array. Raises InputError for an array that is not of plain numbers."""
    prefix = source.stream.read(8)
    form = _LENGTH_FORMATS.get(prefix[6:8])
    if len(prefix) == 8 and form is None:
        raise fault(source, f"NPY version {prefix[6]}.{prefix[7]} is not of plain arrays")
    length_bytes = source.stream.read(struct.calcsize(form or "<I"))
    if form is None or len(length_bytes) < struct.calcsize(form):
        raise fault(source, "the NPY header is cut", _INCOMPLETE)
    length = struct.unpack(form, length_bytes)[0]
    if length > min(source.remaining(), _LONGEST_HEADER):
        fact = f"the NPY header declares {length} bytes of itself, {source.remaining()} follow"
        raise fault(source, fact, _INCOMPLETE)
    try:
        fields = ast.literal_eval(source.stream.read(length).decode("latin-1").strip())
        descr, shape, order = fields["descr"], fields["shape"], fields["fortran_order"]
    except (ValueError, SyntaxError, TypeError, KeyError, RecursionError, MemoryError):
        raise fault(source, "the NPY header is not valid") from None
    return _checked(source, descr, shape, order)


def _checked(source: Source, descr: object, shape: object, fortran_order: object) -> Header:
    if not (isinstance(descr, str) and re.fullmatch(r"[<>|=]?[fiu](1|2|4|8|16)", descr)):
        raise fault(source, f"it holds values of the type {shown(str(descr))}", "save numbers")
    try:
        dtype = np.dtype(descr)
    except TypeError:
        fact = f"this machine has no numbers of the type {descr}"
        raise fault(source, fact, "save float64") from None
    if (
        not isinstance(shape, tuple)
        or not shape
        or not all(type(n) is int and n >= 0 for n in shape)
        or not isinstance(fortran_order, bool)
    ):
        raise fault(source, f"the array has the shape {shown(str(shape))}", "save a plain array")
    return Header(dtype, fortran_order, shape)


def _column_blocks(source: Source, header: Header) -> Iterator[Block]:
    """Yield the blocks of an array that stores one column after the other."""
    start, itemsize = source.stream.tell(), header.dtype.itemsize
    rows, count = header.shape
    step = CHUNK_BYTES // itemsize
    for first in range(0, rows, step):
        columns = []
        for column in range(count):
            values = np.empty(min(step, rows - first), header.dtype)
            source.stream.seek(start + (column * rows + first) * itemsize)
            read_exactly(source, values.view(np.uint8).data)
            columns.append(values)
        x, y, z = columns[:3]
        yield Block((x, y, z), columns[3] if count == 4 else None)
