"""E57 and LAS files with known content, written by their libraries, and ways to doctor them."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import laspy
import numpy as np
from pye57 import libe57

PAGE, PAYLOAD = 1024, 1020


@dataclass(frozen=True)
class Double:
    def node(self, image):
        return libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE)


@dataclass(frozen=True)
class Single:
    def node(self, image):
        return libe57.FloatNode(image, 0.0, libe57.E57_SINGLE)


@dataclass(frozen=True)
class Integer:
    low: int
    high: int

    def node(self, image):
        return libe57.IntegerNode(image, self.low, self.low, self.high)


@dataclass(frozen=True)
class Scaled:
    low: int
    high: int
    scale: float
    offset: float = 0.0

    def node(self, image):
        arguments = (image, self.low, self.low, self.high, self.scale, self.offset)
        return libe57.ScaledIntegerNode(*arguments)


@dataclass(frozen=True)
class E57Scan:
    """columns: by field name its type in the file and its values (raw integers where scaled)."""

    columns: dict
    name: str | None = "scan"
    pose: dict | None = None
    children: dict = field(default_factory=dict)


def xyz(points, kind=None):
    kind = kind or Double()
    names = ("cartesianX", "cartesianY", "cartesianZ")
    return {name: (kind, column) for name, column in zip(names, np.transpose(points), strict=True)}


def pose(rotation=None, translation=None):
    """A pose as it may stand in a file: with either part missing."""
    parts = {"rotation": ("wxyz", rotation), "translation": ("xyz", translation)}
    return {part: dict(zip(*it, strict=True)) for part, it in parts.items() if it[1] is not None}


def write_e57(path: Path, *scans: E57Scan) -> Path:
    image = libe57.ImageFile(str(path), "w")
    root = image.root()
    image.extensionsAdd("", libe57.E57_V1_0_URI)
    root.set("formatName", libe57.StringNode(image, "ASTM E57 3D Imaging Data File"))
    root.set("guid", libe57.StringNode(image, "{file}"))
    root.set("versionMajor", libe57.IntegerNode(image, 1))
    root.set("versionMinor", libe57.IntegerNode(image, 0))
    vector = libe57.VectorNode(image, True)
    root.set("data3D", vector)
    for number, scan in enumerate(scans):
        _write_scan(image, vector, scan, number)
    image.close()
    return path


def _write_scan(image, vector, scan: E57Scan, number: int) -> None:
    node = libe57.StructureNode(image)
    node.set("guid", libe57.StringNode(image, f"{{guid-{number}}}"))
    if scan.name is not None:
        node.set("name", libe57.StringNode(image, scan.name))
    if scan.pose is not None:
        node.set("pose", _structure(image, scan.pose))
    prototype = libe57.StructureNode(image)
    for name, (kind, _) in scan.columns.items():
        prototype.set(name, kind.node(image))
    points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
    node.set("points", points)
    vector.append(node)
    buffers = libe57.VectorSourceDestBuffer()
    rows, kept = 0, []
    for name, (kind, values) in scan.columns.items():
        raw = isinstance(kind, Scaled | Integer)
        # libE57's binding takes "q" for 64 bits, and numpy's own letter for it is "l".
        values = np.array(values, np.int64 if raw else np.float64)
        column = memoryview(values.tobytes() or bytes(8)).cast("B").cast("q" if raw else "d")
        kept.append(column)
        rows = len(values)
        arguments = (image, name, column, max(rows, 1), True, False)
        buffers.append(libe57.SourceDestBuffer(*arguments))
    writer = points.writer(buffers)
    if rows:
        writer.write(rows)
    writer.close()


def _structure(image, tree):
    node = libe57.StructureNode(image)
    for name, value in tree.items():
        leaf = isinstance(value, dict)
        child = _structure(image, value) if leaf else libe57.FloatNode(image, float(value))
        node.set(name, child)
    return node


def crc32c(data: bytes) -> int:
    """RFC 3720, bit by bit."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def payload(data: bytes) -> bytes:
    """What the pages of an E57 file hold."""
    return b"".join(data[at : at + PAYLOAD] for at in range(0, len(data), PAGE))


def paged(content: bytes) -> bytes:
    """Pages with right checksums."""
    pieces = [content[at : at + PAYLOAD] for at in range(0, len(content), PAYLOAD)]
    pieces = [piece.ljust(PAYLOAD, b"\0") for piece in pieces]
    return b"".join(piece + struct.pack(">I", crc32c(piece)) for piece in pieces)


def xml_of(data: bytes) -> bytes:
    at, count = struct.unpack_from("<QQ", data, 24)
    start = at // PAGE * PAYLOAD + at % PAGE
    return payload(data)[start : start + count]


def with_xml(data: bytes, xml: bytes) -> bytes:
    """The file with another XML section, everything else right."""
    content = payload(data)
    content += bytes(-len(content) % PAYLOAD)
    at, pages = len(content) // PAYLOAD * PAGE, -(-len(content + xml) // PAYLOAD)
    header = struct.pack("<QQQ", pages * PAGE, at, len(xml))
    return paged(content[:16] + header + content[40:] + xml)


def with_bytes(data: bytes, at: int, new: bytes) -> bytes:
    """The file with other logical bytes, the checksums right."""
    content = payload(data)
    return paged(content[:at] + new + content[at + len(new) :])


def write_las(path, integers, intensity, *, point_format=0, version="1.2", scale, shift):
    """LAS or LAZ by the path's suffix; integers (N, 3)."""
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales, header.offsets = np.array(scale), np.array(shift)
    las = laspy.LasData(header)
    las.X, las.Y, las.Z = np.transpose(integers)
    las.intensity = intensity
    las.write(str(path))
    return path
