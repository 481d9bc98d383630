"""Outer layer of an E57 file: a header, and pages that each end with a checksum.

Format: ASTM E2807-11, 6.1 to 6.3. Physical offsets count the checksums, logical ones do not.
"""

from __future__ import annotations

import struct
from functools import cache

import numpy as np
import numpy.typing as npt

from ...system import frozen
from ..faults import fault
from ..source import Source

PAGE, PAYLOAD = 1024, 1020
INCOMPLETE = "the copy is incomplete; copy it again"
DAMAGED = "the file is damaged; copy it again"
MAX_XML_BYTES = 16 << 20  # 2,000 scans of 8 kB; points are not in it
_HEADER = struct.Struct("<8sIIQQQQ")
_CASTAGNOLI = 0x82F63B78  # the polynomial of CRC-32C, reflected


@frozen
class Pages:
    """Payload of the pages of an E57 file."""

    source: Source

    @property
    def size(self) -> int:
        """Number of logical bytes."""
        return self.source.size // PAGE * PAYLOAD

    def logical(self, physical: int) -> int:
        """Return the logical offset of a physical one; -1 in a checksum or beyond the file."""
        page, within = divmod(physical, PAGE)
        return page * PAYLOAD + within if within < PAYLOAD and physical < self.source.size else -1

    def read(self, at: int, count: int, *, checked: bool) -> bytes:
        """Return the logical bytes at:at+count; the caller has checked that they exist.

        checked: raise InputError unless the checksums of their pages match.
        """
        first, last = at // PAYLOAD, (at + count - 1) // PAYLOAD
        self.source.stream.seek(first * PAGE)
        raw = self.source.stream.read((last + 1 - first) * PAGE)
        if len(raw) < (last + 1 - first) * PAGE:
            raise fault(self.source, "the file was cut while it was read", "retry")
        pages = np.frombuffer(raw, np.uint8).reshape(-1, PAGE)
        if checked:
            stored = pages[:, PAYLOAD:].copy().view(">u4")[:, 0]
            bad = np.flatnonzero(checksums(pages[:, :PAYLOAD]) != stored)
            if len(bad):
                fact = f"the checksum of its page {first + bad[0] + 1} does not match"
                raise fault(self.source, fact, DAMAGED)
        return pages[:, :PAYLOAD].tobytes()[at % PAYLOAD :][:count]


def checksums(payloads: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """Compute CRC-32C (RFC 3720, B.4) of each row, all rows at once."""
    table = _table()
    crc = np.full(len(payloads), 0xFFFFFFFF, np.uint32)
    for column in payloads.T:
        crc = table[(crc ^ column) & 0xFF] ^ (crc >> 8)
    return ~crc


@cache
def _table() -> npt.NDArray[np.uint32]:
    table = []
    for crc in range(256):
        for _ in range(8):
            crc = (crc >> 1) ^ (crc & 1) * _CASTAGNOLI
        table.append(crc)
    return np.array(table, np.uint32)


def read_xml(pages: Pages) -> bytes:
    """Read the XML section, which describes the scans.

    Raises InputError when the header does not fit the file's size.
    """
    source = pages.source
    head = source.stream.read(_HEADER.size)
    if len(head) < _HEADER.size:
        raise fault(source, f"its {source.size} bytes are no E57 file", INCOMPLETE)
    _, major, minor, size, xml_at, xml_bytes, page_bytes = _HEADER.unpack(head)
    if (major, minor) != (1, 0):
        raise fault(source, f"E57 version {major}.{minor} is not 1.0", "export E57 1.0")
    if page_bytes != PAGE:
        raise fault(source, f"it declares pages of {page_bytes} bytes, E57 has {PAGE}", DAMAGED)
    if size != source.size:
        fact = f"the header declares {size} bytes, the file has {source.size}"
        raise fault(source, fact, INCOMPLETE)
    if source.size % PAGE:
        raise fault(source, f"its {source.size} bytes are not whole pages of {PAGE}", INCOMPLETE)
    at = pages.logical(xml_at)
    if at < _HEADER.size or not 0 < xml_bytes <= pages.size - at:
        fact = f"its XML of {xml_bytes} bytes at byte {xml_at} is not within its {size} bytes"
        raise fault(source, fact, INCOMPLETE)
    if xml_bytes > MAX_XML_BYTES:
        raise fault(source, f"its XML has {xml_bytes} bytes, {MAX_XML_BYTES} at most")
    pages.read(0, _HEADER.size, checked=True)
    return pages.read(at, xml_bytes, checked=True)
