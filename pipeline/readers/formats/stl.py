"""STL reader, binary and ascii, of one solid or more: the corners of the triangles, each once."""

from __future__ import annotations

import io
import re

import numpy as np

from ...vectors import Array
from ..faults import fault, too_long, too_short
from ..memory import check_memory
from ..parsing.ascii import table_blocks
from ..parsing.lines import Lines, check_lines
from ..source import RawCloud, Source
from .mesh import cloud_of, each_once, mesh_of, sampled

_HEAD, _TRIANGLE = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
_PARSED_BYTES = 200  # of memory that a triangle takes while it is read
_INCOMPLETE = "the copy is incomplete; copy it again"


def read_stl(source: Source) -> RawCloud:
    """Read the corners of the triangles, each once."""
    return cloud_of(each_once(_triangles(source).reshape(-1, 3)))


def sample_stl(source: Source, count: int) -> RawCloud:
    """Sample `count` points on the surface."""
    return sampled(mesh_of(_triangles(source)), count, source)


def _triangles(source: Source) -> Array:
    """Read the corners (T, 3, 3) of all solids."""
    head = source.stream.read(_HEAD)
    if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        return _from_text(source)
    if len(head) < _HEAD:
        raise fault(source, "the STL header is cut", "copy the file again")
    declared = int.from_bytes(head[80:], "little")
    held, extra = divmod(source.size - _HEAD, _TRIANGLE.itemsize)
    if held < declared:
        raise too_short(source, declared, held, "triangles")
    if held > declared or extra:
        more = source.size - _HEAD - declared * _TRIANGLE.itemsize
        raise too_long(source, declared, f"{more} bytes", "triangles")
    check_memory(declared, _PARSED_BYTES, source)
    source.stream.seek(_HEAD)
    records = np.frombuffer(source.stream.read(declared * _TRIANGLE.itemsize), _TRIANGLE)
    with np.errstate(invalid="ignore"):  # a signalling NaN
        return records["corners"].astype(np.float64)


def _from_text(source: Source) -> Array:
    """Read the corners of triangles written as text, whose keywords must be in balance."""
    source.stream.seek(0)
    check_lines(source)
    text = source.stream.read().lower()
    facets, corners = _count(b"facet", text), _count(b"vertex", text)
    if corners != 3 * facets or not 0 < _count(b"solid", text) == _count(b"endsolid", text):
        fact = f"it has {corners} corners for {facets} triangles, or no `endsolid` for a `solid`"
        raise fault(source, fact, _INCOMPLETE)
    check_memory(facets, _PARSED_BYTES, source)
    source.stream.seek(0)
    lines = Lines(source.text, edit=_only_corners)
    found = np.concatenate(list(table_blocks(lines, 3, None, source, 1)))
    if len(found) != corners:
        fact = f"{len(found)} of its {corners} corners could be read"
        raise fault(source, fact, "export it again, or as binary STL")
    return found.reshape(-1, 3, 3)


def _count(word: bytes, text: bytes) -> int:
    """Count the lines that begin with a keyword."""
    return len(re.findall(rb"(?:^|[\r\n])[ \t]*%b(?![a-z])" % word, text))


def _only_corners(piece: str) -> str:
    """Return the numbers of `vertex` lines, other lines blank, so that lines keep their number."""
    return "".join(
        text[6:] if (text := line.lstrip())[:6].lower() == "vertex" else "\n"
        for line in io.StringIO(piece)
    )
