"""STL and OBJ reader: the vertices of a mesh, or points sampled on its surface by area."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...vectors import Array
from ..faults import fault, too_long, too_short
from ..memory import check_memory
from ..parsing.ascii import table_blocks
from ..parsing.lines import Lines
from ..source import Block, Layout, RawCloud, Source, shown

_STL_HEAD, _STL_TRIANGLE = 84, 50
_PARSED_PER_BYTE = 12  # bytes of memory that trimesh takes per byte of text, measured
_SAMPLED_BYTES = 200  # that trimesh takes per sampled point
_VERTEX = ("v ", "v\t")
_SEED = 0


def read_obj(source: Source) -> RawCloud:
    """Read every `v` line, used by a face or not."""
    count, first = 0, ""
    for line in source.text:
        if line.startswith(_VERTEX):
            count, first = count + 1, first or line
    if not count:
        return RawCloud(0, False, iter(()))
    source.text.seek(0)
    columns = len(first.split()) - 1
    if columns not in (3, 4, 6, 7):
        fact = f"a vertex has {columns} numbers, not x y z [w] [red green blue]: {shown(first)}"
        raise fault(source, fact)
    return RawCloud(count, False, _vertex_lines(columns, source))


def _vertex_lines(columns: int, source: Source) -> Iterator[Block]:
    layout = Layout((0, 1, 2), None)
    lines = Lines(source.text, edit=_only_vertices)
    for table in table_blocks(lines, columns, None, source, 1):
        yield layout.block(table)


def _only_vertices(piece: str) -> str:
    """Return the numbers of `v` lines, other lines blank, so that lines keep their number."""
    return "".join(line[1:] if line[:2] in ("v ", "v\t") else "\n" for line in io.StringIO(piece))


def read_stl(source: Source) -> RawCloud:
    """Read the corners of the triangles, each once."""
    corners = _triangles(source).reshape(-1, 3)
    _, first = np.unique(corners, axis=0, return_index=True)
    return _cloud(corners[np.sort(first)])


def sample_stl(source: Source, count: int) -> RawCloud:
    """Sample `count` points on the surface."""
    import trimesh

    triangles = _triangles(source)
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), faces, process=False)
    return _sampled(mesh, count, source)


def sample_obj(source: Source, count: int) -> RawCloud:
    """Sample `count` points on the surface."""
    return _sampled(_load(source, "obj"), count, source)


def _triangles(source: Source) -> Array:
    """Read the corners (T, 3, 3) of an STL file, whose length is checked."""
    import trimesh

    declared = _declared_triangles(source)
    if declared == 0:
        return np.empty((0, 3, 3))
    mesh = _load(source, "stl")
    found = mesh.triangles if isinstance(mesh, trimesh.Trimesh) else np.empty((0, 3, 3))
    corners = np.asarray(found, dtype=np.float64)
    if len(corners) != declared:
        fact = f"{len(corners)} of its {declared} triangles could be read"
        raise fault(source, fact, "export it again, or as binary STL")
    return corners


def _declared_triangles(source: Source) -> int:
    """Return the number that a binary header declares, or that text holds; rewind the stream."""
    head = source.stream.read(_STL_HEAD)
    source.stream.seek(0)
    if head.lstrip()[:5].lower() == b"solid" and b"\0" not in head:
        text = source.stream.read().lower()
        source.stream.seek(0)
        facets, corners = text.count(b"facet normal"), text.count(b"vertex")
        if b"endsolid" not in text or corners != 3 * facets:
            fact = f"it has {corners} corners for {facets} triangles, or no `endsolid`"
            raise fault(source, fact, "the copy is incomplete; copy it again")
        return facets
    if len(head) < _STL_HEAD:
        raise fault(source, "the STL header is cut", "copy the file again")
    declared = int.from_bytes(head[80:], "little")
    held, extra = divmod(source.size - _STL_HEAD, _STL_TRIANGLE)
    if held < declared:
        raise too_short(source, declared, held, "triangles")
    if held > declared or extra:
        more = source.size - _STL_HEAD - declared * _STL_TRIANGLE
        raise too_long(source, declared, f"{more} bytes", "triangles")
    return declared


def _load(source: Source, kind: str) -> Any:
    import trimesh

    check_memory(source.size, _PARSED_PER_BYTE, source)
    try:
        with _silence():
            return trimesh.load(
                source.stream, file_type=kind, process=False, skip_materials=True, resolver=None
            )
    except Exception as error:
        fact = f"the mesh cannot be read ({shown(str(error))})"
        raise fault(source, fact, "export it again") from error


@contextmanager
def _silence() -> Iterator[None]:
    """Keep the library's warnings, tracebacks among them, from a user's terminal."""
    logger = logging.getLogger("trimesh")
    logger.propagate = False
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _sampled(mesh: Any, count: int, source: Source) -> RawCloud:
    import trimesh

    check_memory(count, _SAMPLED_BYTES, source)
    with _silence():
        area = float(getattr(mesh, "area", 0.0))
        if not (isinstance(mesh, trimesh.Trimesh) and 0.0 < area < np.inf):
            raise fault(source, "it has no faces to sample", "read its vertices, without --sample")
        points, _ = trimesh.sample.sample_surface(mesh, count, seed=_SEED)
    return _cloud(np.asarray(points, dtype=np.float64))


def _cloud(points: Array) -> RawCloud:
    x, y, z = points.T
    return RawCloud(len(points), False, iter([Block((x, y, z))]))
