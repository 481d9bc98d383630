"""The way past binary PLY elements that are not vertices."""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass

import numpy as np

from pipeline.readers.faults import fault
from pipeline.readers.ply_header import PlyElement
from pipeline.readers.raw import Source

_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


@dataclass(frozen=True)
class _Step:
    """A property of a record: a value of `size` bytes, or a counted list of them."""

    size: int
    counter: struct.Struct | None


def skip_elements(source: Source, elements: list[PlyElement], order: str) -> None:
    """Move the stream behind the elements. Raises InputError when the file ends within them."""
    for element in elements:
        start = source.stream.tell()
        # A list takes at least its own length's bytes: a lying count fails here, at once.
        shortest = sum(int((prop.count_form or prop.form)[1]) for prop in element.properties)
        end = start + element.count * shortest
        if element.has_list and element.count and end <= source.size:
            end = _list_end(source, element, order, start)
        if end > source.size:
            fact = f"the file ends within the {element.count} declared records of {element.name}"
            raise fault(source, fact, "the copy is incomplete; copy it again")
        source.stream.seek(end)


def _list_end(source: Source, element: PlyElement, order: str, start: int) -> int:
    """Where the records end, beyond the file's size when they do not fit into it."""
    steps = [
        _Step(
            prop.size, struct.Struct(order + _STRUCT[prop.count_form]) if prop.count_form else None
        )
        for prop in element.properties
    ]
    with mmap.mmap(source.stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        size = _next_record(data, steps, start) - start
        if start + element.count * size <= source.size and _regular(
            data, element, steps, start, size
        ):
            return start + element.count * size
        at = start
        for _ in range(element.count):
            at = _next_record(data, steps, at)
        return at


def _next_record(data: mmap.mmap, steps: list[_Step], at: int) -> int:
    for step in steps:
        if step.counter is None:
            at += step.size
        elif at + step.counter.size > len(data):
            return len(data) + 1
        else:
            length = step.counter.unpack_from(data, at)[0]
            # A negative length can only be damage, so the records end nowhere.
            at += step.counter.size + length * step.size if length >= 0 else len(data) + 1
    return at


def _regular(
    data: mmap.mmap, element: PlyElement, steps: list[_Step], start: int, size: int
) -> bool:
    """Whether all records have the lengths of the first, as in a mesh of triangles only."""
    at = start
    for step in steps:
        if step.counter is not None:
            kind = np.dtype(step.counter.format)
            lengths = np.ndarray((element.count,), kind, data, at, (size,))
            if (lengths != lengths[0]).any():
                return False
        at = _next_record(data, [step], at)
    return True
