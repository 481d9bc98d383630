"""Reader of meshes through trimesh: OFF, GLB, 3MF; points sampled on a surface by area.

What the library passes over without a word is checked before or after it.
"""

from __future__ import annotations

import json
import logging
import re
import struct
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...files import archive_errors, open_archive
from ...vectors import Array
from ..faults import fault, too_long, too_short
from ..memory import check_memory
from ..parsing.columns import unit_of
from ..parsing.lines import check_lines
from ..sandbox.client import find_library
from ..source import Block, RawCloud, Source, shown

_PARSED_PER_BYTE = 12  # bytes of memory that trimesh takes per byte of text, measured
_SAMPLED_BYTES = 200  # that trimesh takes per sampled point
_SEED = 0
_GLB_HEAD = struct.Struct("<4sIIII")  # magic, version, bytes of all, bytes of the JSON, its type
_DRAWN_MODES = (0, 1, 4, 5)  # points, lines, triangles, a strip of them
_HARMLESS = ("KHR_materials", "KHR_texture", "EXT_texture", "KHR_lights", "KHR_xmp")
_DAMAGED_JSON = (
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)
_INCOMPLETE = "the copy is incomplete; copy it again"


def read_mesh(source: Source) -> RawCloud:
    """Read the vertices of an OFF, GLB or 3MF file where its scene puts them, each once."""
    mesh, unit = _checked(source)
    return cloud_of(each_once(_vertices(mesh, source)), unit)


def sample_mesh(source: Source, count: int) -> RawCloud:
    """Sample `count` points on the surface of an OBJ, OFF, GLB or 3MF file."""
    mesh, unit = _checked(source)
    whole = _whole(mesh, source) if hasattr(mesh, "to_mesh") else mesh
    return replace(sampled(whole, count, source), unit=unit)


def sampled(mesh: Any, count: int, source: Source) -> RawCloud:
    """Sample `count` points on the surface of a mesh of the library, by area."""
    import trimesh

    check_memory(count, _SAMPLED_BYTES, source)
    with _silence():
        if not (isinstance(mesh, trimesh.Trimesh) and 0.0 < mesh.area < np.inf):
            raise fault(source, "it has no faces to sample", "read its vertices, without --sample")
        points, _ = trimesh.sample.sample_surface(mesh, count, seed=_SEED)
    return cloud_of(np.asarray(points, dtype=np.float64))


def mesh_of(triangles: Array) -> Any:
    """Return triangles (T, 3, 3) as a mesh of the library."""
    import trimesh

    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    return trimesh.Trimesh(triangles.reshape(-1, 3), faces, process=False)


def cloud_of(points: Array, unit: str | None = None) -> RawCloud:
    """Return points (N, 3) as a cloud."""
    x, y, z = points.T
    blocks = iter([Block((x, y, z))])
    return RawCloud(len(points), False, blocks, unit=unit, is_mesh=True, may_mark=False)


def each_once(points: Array) -> Array:
    """Return points (N, 3) without those that stand above, in their order."""
    _, first = np.unique(points, axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


def _load(source: Source) -> Any:
    """Load the file by trimesh: a mesh, a cloud, or a scene of several."""
    import trimesh

    check_memory(source.size, _PARSED_PER_BYTE, source)
    source.stream.seek(0)
    kind = source.path.suffix.lower().removeprefix(".")
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


def _checked(source: Source) -> tuple[Any, str | None]:
    """Return the mesh, with all vertices that the file declares, and the unit that it states."""
    checks = {".off": _check_off, ".glb": _check_glb, ".3mf": _check_three_mf}
    suffix = source.path.suffix.lower()
    declared = checks[suffix](source) if suffix in checks else None
    mesh = _load(source)
    parts = getattr(mesh, "geometry", {"": mesh})
    held = sum(len(part.vertices) for part in parts.values())
    if declared is not None and held != declared:
        raise fault(source, f"{held} of its {declared} vertices could be read", "export it as STL")
    stated = str(mesh.metadata.get("units", "millimeters")) if suffix == ".3mf" else None
    return mesh, stated and (unit_of(stated) or stated)


def _vertices(mesh: Any, source: Source) -> Array:
    """Return the vertices (N, 3) of a mesh, or of all parts of a scene where it puts them."""
    import trimesh

    if not isinstance(mesh, trimesh.Scene):
        return np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    placed = [np.empty((0, 3))]
    try:
        for node in mesh.graph.nodes_geometry:
            T, name = mesh.graph[node]
            points = np.asarray(mesh.geometry[name].vertices, dtype=np.float64)
            with np.errstate(all="ignore"):  # coordinates are checked later
                placed.append(points @ T[:3, :3].T + T[:3, 3])
    except Exception as error:  # whatever a damaged graph makes of the library
        raise fault(source, f"its scene cannot be read ({shown(str(error))})") from error
    return np.concatenate(placed)


def _whole(scene: Any, source: Source) -> Any:
    """Return a scene's meshes as one."""
    try:
        with _silence():
            return scene.to_mesh()
    except Exception as error:
        fact = f"its scene cannot be read ({shown(str(error))})"
        raise fault(source, fact, "export it again") from error


def _check_off(source: Source) -> int:
    """Check that the lines of an OFF file are those that it declares; count its vertices."""
    check_lines(source)
    lines = [text for line in source.text if (text := line.partition("#")[0].strip())]
    first = lines.pop(0) if lines else ""
    found = re.fullmatch(r"(?:ST)?C?N?OFF([\s\d]*)", first)
    if not found:
        raise fault(source, f"it begins with {shown(first)}, not with OFF", "export it as STL")
    counts = (found[1].strip() or (lines.pop(0) if lines else "")).split()
    if len(counts) not in (2, 3) or not all(re.fullmatch("[0-9]{1,9}", word) for word in counts):
        raise fault(source, f"its counts are {shown(' '.join(counts))}", "export it again")
    declared = int(counts[0]) + int(counts[1])
    if len(lines) < declared:
        raise too_short(source, declared, len(lines), "vertices and faces")
    if len(lines) > declared:
        raise too_long(source, declared, f"{len(lines) - declared} lines", "vertices and faces")
    for words in (line.split() for line in lines[int(counts[0]) :]):
        if not words[0].isdecimal() or len(words) <= int(words[0]):
            raise fault(source, f"one of its faces is cut, {shown(' '.join(words))}", _INCOMPLETE)
    return int(counts[0])


def _check_glb(source: Source) -> int:
    """Check the length of a binary glTF file and that its geometry is plain; count its vertices."""
    source.stream.seek(0)
    head = source.stream.read(_GLB_HEAD.size)
    if len(head) < _GLB_HEAD.size:
        raise fault(source, "the glTF header is cut", _INCOMPLETE)
    _, _, size, json_bytes, _ = _GLB_HEAD.unpack(head)
    if size != source.size or json_bytes > source.remaining():
        fact = f"the header declares {size} bytes, the file has {source.size}"
        raise fault(source, fact, _INCOMPLETE)
    try:
        tree = json.loads(source.stream.read(json_bytes))
        accessors = tree.get("accessors", [])
        required = tree.get("extensionsRequired", [])
        odd = [name for name in required if not name.startswith(_HARMLESS)]
        odd += ["a sparse accessor" for a in accessors if "sparse" in a or "bufferView" not in a]
        drawn = [p for mesh in tree.get("meshes", []) for p in mesh["primitives"]]
        odd += [f"mode {p['mode']}" for p in drawn if p.get("mode", 4) not in _DRAWN_MODES]
        declared = sum(int(accessors[p["attributes"]["POSITION"]]["count"]) for p in drawn)
    except _DAMAGED_JSON:
        raise fault(source, "its description is damaged", "export it again") from None
    if odd:
        fact = f"its geometry needs what is not read here, {shown(str(odd[0]))}"
        raise fault(source, fact, "export it uncompressed, or as STL")
    return declared


def _check_three_mf(source: Source) -> int:
    """Check the archive of a 3MF file; count the vertices of its models."""
    for library in ("lxml", "networkx"):
        find_library(library, "3MF", "mesh", source)
    scratch = Path(source.path).parent
    with open_archive(source.path, source.name, scratch) as archive:
        models = [m for m in archive.members if m.name.lower().endswith(".model")]
    check_memory(sum(model.size for model in models), _PARSED_PER_BYTE, source)
    if not models:
        raise fault(source, "it is a zip without a 3D model", "export it as 3MF or STL")
    with archive_errors(source.name), zipfile.ZipFile(source.path) as opened:
        texts = [opened.read(model.name) for model in models]
    return sum(len(re.findall(rb"<(?:\w+:)?vertex[\s/>]", text)) for text in texts)
