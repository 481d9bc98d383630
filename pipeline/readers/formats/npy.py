"""NPY reader: arrays of points, of named fields, or of heights.

Format: numpy.lib.format, versions 1.0 to 3.0. Points are rows (N, C) of x y z, perhaps an intensity
and more, or a raster (H, W, C) of them; fields are found by their names.
"""

from __future__ import annotations

import ast
import math
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ..faults import fault, too_long, too_short
from ..parsing.binary import CHUNK_BYTES, record_blocks
from ..parsing.columns import MOST_UNNAMED, check_unnamed, find_layout, unnamed_layout
from ..parsing.heights import Heights, height_blocks
from ..source import Block, Layout, RawCloud, Source, shown

_LENGTH_FORMATS = {b"\x01\x00": "<H", b"\x02\x00": "<I", b"\x03\x00": "<I"}
_INCOMPLETE = "the copy is incomplete; copy it again"
_LONGEST_HEADER = 1 << 16
_CHECKED_ROWS = 1000
_NUMBER_KINDS = "fiu"


@frozen
class Header:
    """An NPY header; the array's bytes follow it."""

    dtype: np.dtype[Any]
    fortran_order: bool
    shape: tuple[int, ...]

    @property
    def values(self) -> int:
        """Number of the array's elements."""
        return math.prod(self.shape)


def read_npy(source: Source, *, has_shade: bool = True) -> RawCloud:
    """Read an array of numbers, or of records with named numbers.

    has_shade: whether a colour counts as the intensity where the array holds none.
    """
    header = read_header(source)
    columns = header.shape[-1]
    read: Callable[[Header, Source, bool], RawCloud]
    if header.dtype.names is not None:
        read = _read_fields
    elif source.options.pitch is not None and len(header.shape) == 2:
        read = _read_heights
    elif len(header.shape) in (2, 3) and 3 <= columns <= MOST_UNNAMED:
        read = _read_points
    else:
        action = "save rows of x y z, or give --pitch DX,DY if it is a matrix of heights"
        raise fault(source, f"the array has the shape {shown(str(header.shape))}", action)
    check_size(source, header)
    return read(header, source, has_shade) if header.values else RawCloud(0, False, iter(()))


def _read_points(header: Header, source: Source, has_shade: bool) -> RawCloud:
    columns, names = header.shape[-1], source.options.columns
    if names is not None and len(names) != columns:
        fact = f"the array has {columns} columns, --columns names {len(names)}"
        raise fault(source, fact, "name each, or - to skip it")
    if names is None:
        check_unnamed(_first_rows(mapped(header, source)), source)
    layout = unnamed_layout(columns) if names is None else find_layout(names)
    layout = layout if has_shade else replace(layout, colour=())
    rows, width = header.values // columns, header.dtype.itemsize
    if header.fortran_order:
        blocks = _raster_blocks(mapped(header, source), layout)
    else:
        offsets = [column * width for column in range(columns)]
        formats = [header.dtype.str] * columns
        blocks = record_blocks(source, rows, formats, offsets, columns * width, layout)
    return RawCloud(rows, layout.has_intensity, blocks)


def _read_fields(header: Header, source: Source, has_shade: bool) -> RawCloud:
    """Read the fields x, y, z and the intensity, or else the colour, of records."""
    assert header.dtype.names is not None
    assert header.dtype.fields is not None
    try:
        layout = find_layout(header.dtype.names)
    except ValueError as error:
        raise fault(source, str(error), "name the fields x, y, z and intensity") from None
    layout = layout if has_shade else replace(layout, colour=())
    fields = [header.dtype.fields[header.dtype.names[index]] for index in layout.used]
    for form, *_ in fields:
        if form.kind not in _NUMBER_KINDS or form.shape:
            fact = f"x, y, z, the intensity or the colour are of the type {shown(str(form))}"
            raise fault(source, fact, "save numbers")
    formats, offsets = [form.str for form, *_ in fields], [int(field[1]) for field in fields]
    size = header.dtype.itemsize
    if header.fortran_order:
        blocks = _raster_blocks(mapped(header, source), layout)
    else:
        blocks = record_blocks(source, header.values, formats, offsets, size, layout.in_order)
    return RawCloud(header.values, layout.has_intensity, blocks, unit=layout.unit)


def _read_heights(header: Header, source: Source, _has_shade: bool) -> RawCloud:
    assert source.options.pitch is not None
    heights, table = Heights(source.options.pitch), mapped(header, source)
    rows = max(1, CHUNK_BYTES // (8 * header.shape[1]))
    tables = (
        np.asarray(table[start : start + rows], dtype=np.float64)
        for start in range(0, header.shape[0], rows)
    )
    return RawCloud(header.values, False, height_blocks(heights, tables, source), has_grid=True)


def mapped(header: Header, source: Source) -> npt.NDArray[Any]:
    """Map the array, whose size was checked, into memory."""
    order = "F" if header.fortran_order else "C"
    at = source.stream.tell()
    return np.memmap(source.path, header.dtype, "r", at, header.shape, order)  # type: ignore[call-overload, no-any-return]


def _first_rows(array: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return some of the first rows (N, C) of an array of points."""
    count = _CHECKED_ROWS // (array.shape[1] if array.ndim == 3 else 1)
    with np.errstate(invalid="ignore"):  # a signalling NaN
        first = np.asarray(array[: max(1, count)], dtype=np.float64)
    return first.reshape(-1, array.shape[-1])


def _raster_blocks(array: npt.NDArray[Any], layout: Layout) -> Iterator[Block]:
    """Yield the blocks of an array that is stored column after column, its points row by row."""
    names = array.dtype.names
    step = max(1, CHUNK_BYTES // (array.itemsize * math.prod(array.shape[1:])))
    for start in range(0, len(array), step):
        part = array[start : start + step]
        used = (part[names[k]] if names else part[..., k] for k in layout.used)
        yield layout.in_order.block_of([column.ravel() for column in used])


def check_size(source: Source, header: Header) -> None:
    """Raise InputError unless exactly the declared array follows."""
    needed, held = header.values * header.dtype.itemsize, source.remaining()
    rows = header.shape[0]
    if held < needed:
        raise too_short(source, rows, held * rows // needed)
    if held > needed:
        raise too_long(source, rows, f"{held - needed} bytes")


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
    encoding = "utf-8" if prefix[6] == 3 else "latin-1"
    try:
        fields = ast.literal_eval(source.stream.read(length).decode(encoding).strip())
        descr, shape, order = fields["descr"], fields["shape"], fields["fortran_order"]
    except (ValueError, SyntaxError, TypeError, KeyError, RecursionError, MemoryError):
        raise fault(source, "the NPY header is not valid") from None
    return _checked(source, descr, shape, order)


def _checked(source: Source, descr: object, shape: object, fortran_order: object) -> Header:
    if (
        not isinstance(shape, tuple)
        or not shape
        or not all(type(n) is int and n >= 0 for n in shape)
        or not isinstance(fortran_order, bool)
    ):
        raise fault(source, f"the array has the shape {shown(str(shape))}", "save a plain array")
    return Header(_dtype(descr, source), fortran_order, shape)


def _dtype(descr: object, source: Source) -> np.dtype[Any]:
    """Return the type of the elements: numbers, or records without objects."""
    if not isinstance(descr, list):
        if not (isinstance(descr, str) and re.fullmatch(r"[<>|=]?[fiu](1|2|4|8|16)", descr)):
            raise fault(source, f"it holds values of the type {shown(str(descr))}", "save numbers")
        try:
            return np.dtype(descr)
        except TypeError:
            fact = f"this machine has no numbers of the type {descr}"
            raise fault(source, fact, "save float64") from None
    try:
        dtype = np.lib.format.descr_to_dtype(descr)
    except Exception:  # whatever a damaged description makes of numpy's own parser
        dtype = np.dtype(object)
    if dtype.hasobject or not dtype.itemsize:
        fact = f"it holds values of the type {shown(str(descr))}"
        raise fault(source, fact, "save records of numbers")
    return dtype
