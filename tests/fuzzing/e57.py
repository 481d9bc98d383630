"""A small E57 file by hand: two scans with poses, and pages whose checksums are put right.

Source: ASTM E2807-11; Huber, Proc. SPIE 7864 (2011) 78640A.
"""

from __future__ import annotations

import struct

import numpy as np

PAGE, HELD = 1024, 1020  # bytes of a page, and of them before its checksum
PACKET_ROWS = 2000  # a packet holds at most 64 KiB


def _table() -> np.ndarray:
    """CRC-32C of each byte, reflected polynomial 0x82F63B78."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = table >> 1 ^ np.where(table & 1, np.uint32(0x82F63B78), np.uint32(0))
    return table


_CRC = _table()


def seal_pages(data: bytes) -> bytes:
    """The file with the checksum of every whole page put right: CRC-32C, big-endian."""
    sealed = np.frombuffer(data, np.uint8).copy()
    whole = sealed[: len(data) // PAGE * PAGE].reshape(-1, PAGE)
    crc = np.full(len(whole), 0xFFFFFFFF, np.uint32)
    for column in np.ascontiguousarray(whole[:, :HELD].T):
        crc = crc >> 8 ^ _CRC[(crc ^ column) & 0xFF]
    whole[:, HELD:] = (crc ^ 0xFFFFFFFF).astype(">u4").view(np.uint8).reshape(-1, 4)
    return sealed.tobytes()


def pages(logical: bytes) -> bytes:
    """A logical file as pages with their checksums."""
    padded = np.frombuffer(logical.ljust(-(-len(logical) // HELD) * HELD, b"\0"), np.uint8)
    made = np.zeros((len(padded) // HELD, PAGE), np.uint8)
    made[:, :HELD] = padded.reshape(-1, HELD)
    return seal_pages(made.tobytes())


def physical(logical: int) -> int:
    """Offset in the file of an offset in what its pages hold."""
    return logical // HELD * PAGE + logical % HELD


def _points(xyz: np.ndarray, start: int) -> bytes:
    """A compressed vector at the logical offset `start`: its header and its data packets."""
    packets = b"".join(
        _packet(xyz[row : row + PACKET_ROWS]) for row in range(0, len(xyz), PACKET_ROWS)
    )
    return struct.pack("<B7xQQQ", 1, 32 + len(packets), physical(start + 32), 0) + packets


def _packet(xyz: np.ndarray) -> bytes:
    """Three byte streams, one a coordinate, behind their lengths; a multiple of 4 bytes."""
    streams = [xyz[:, axis].astype("<f8").tobytes() for axis in range(3)]
    body = struct.pack("<3H", *map(len, streams)) + b"".join(streams)
    body = body.ljust(-(-(len(body) + 6) // 4) * 4 - 6, b"\0")
    return struct.pack("<BBHH", 1, 0, len(body) + 5, 3) + body


_SCAN = """<vectorChild type="Structure">
<guid type="String"><![CDATA[scan-{name}]]></guid>
<name type="String"><![CDATA[{name}]]></name>
<pose type="Structure"><rotation type="Structure">
<w type="Float">{w!r}</w><x type="Float">0.0</x><y type="Float">0.0</y><z type="Float">{z!r}</z>
</rotation><translation type="Structure">
<x type="Float">0.0</x><y type="Float">0.0</y><z type="Float">{shift!r}</z></translation></pose>
<points type="CompressedVector" fileOffset="{offset}" recordCount="{count}">
<prototype type="Structure"><cartesianX type="Float"/><cartesianY type="Float"/>
<cartesianZ type="Float"/></prototype>
<codecs type="Vector" allowHeterogeneousChildren="1"></codecs></points>
</vectorChild>
"""
_FILE = """<?xml version="1.0" encoding="UTF-8"?>
<e57Root type="Structure" xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0">
<formatName type="String"><![CDATA[ASTM E57 3D Imaging Data File]]></formatName>
<guid type="String"><![CDATA[made]]></guid>
<versionMajor type="Integer">1</versionMajor><versionMinor type="Integer">0</versionMinor>
<coordinateMetadata type="String"/>
<data3D type="Vector" allowHeterogeneousChildren="1">
{scans}</data3D>
<images2D type="Vector" allowHeterogeneousChildren="1"></images2D>
</e57Root>
"""


HALF = float(np.sqrt(0.5))
UPRIGHT = (1.0, 0.0, 0.0)
TURNED = (HALF, HALF, 3.0)


def e57_file(
    xyz: np.ndarray, poses: tuple[tuple[float, float, float], ...] = (UPRIGHT, TURNED)
) -> bytes:
    """Points (N, 3) in double precision, shared out to a scan a pose.

    A pose: w and z of the quaternion, and the shift along z.
    """
    body, scans = bytes(48), ""
    for number, (part, pose) in enumerate(
        zip(np.array_split(xyz, len(poses)), poses, strict=True), 1
    ):
        offset = physical(len(body))
        w, z, shift = pose
        scans += _SCAN.format(name=number, w=w, z=z, shift=shift, offset=offset, count=len(part))
        body += _points(part, len(body))
    xml = _FILE.format(scans=scans).encode()
    size = -(-len(body + xml) // HELD) * PAGE
    head = struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, size, physical(len(body)), len(xml), PAGE)
    return pages(head + body[48:] + xml)
