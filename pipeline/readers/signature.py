"""Format of a file by its first bytes, whatever its suffix."""

from __future__ import annotations

import re

PLY = "a PLY file"
PCD = "a PCD file"
NPY = "a NumPy array"
E57 = "an E57 file"
LAS = "a LAS or LAZ file"
STL = "an STL file"
ZIP = "a zip archive"
BINARY = "binary data"
TEXT = "text"
GLB = "a binary glTF file"
UTF16 = "UTF-16 text"

_MAGIC = (
    (re.compile(rb"ply\s"), PLY),
    (re.compile(rb"\x93NUMPY"), NPY),
    (re.compile(rb"(?:[ \t\r]*(?:#[^\n]*)?\n)*[ \t]*(?:VERSION|FIELDS|COLUMNS)\s"), PCD),
    (re.compile(rb"LASF"), LAS),
    (re.compile(rb"ASTM-E57"), E57),
    (re.compile(rb"PK\x03\x04"), ZIP),
    (re.compile(rb"glTF"), GLB),
    (re.compile(rb"\x1f\x8b"), "a gzip file"),
    (re.compile(rb"\xff\xfe|\xfe\xff"), UTF16),
    (re.compile(rb"version https://git-lfs"), "a Git LFS pointer, not the file itself"),
    (re.compile(rb"\s*<(!doctype|html|\?xml)", re.IGNORECASE), "a web page or XML"),
)


def looks_like(head: bytes) -> str:
    """Name the format of a file that begins with `head`."""
    for magic, kind in _MAGIC:
        if magic.match(head):
            return kind
    return BINARY if b"\0" in head else TEXT
