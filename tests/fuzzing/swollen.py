"""Small files that swell: what they unpack or parse to is a thousand times larger, or slow."""

from __future__ import annotations

import gzip
import struct
import tarfile

MEBI = 1 << 20
ENTRY_BYTES = 54  # of a list of files in a zip
PLY = b"ply\nformat ascii 1.0\nelement vertex 3\n"
PLY += b"".join(b"property float %c\n" % axis for axis in b"xyz") + b"end_header\n"
REFERENCE = "".join(f'{w} = "{w.lower()}.xyz"\n' for w in ("RR", "RL", "FR", "FL"))
CAPTURE = f'[target]\nshape = "disc"\ndiameter = 0.25\n[reference]\n{REFERENCE}'


def packed(head: bytes, fill: bytes, mebibytes: int, tail: bytes = b"") -> bytes:
    """A gzip file of head, one byte over and over, and tail."""
    piece = min(mebibytes, 16)
    filled = gzip.compress(fill * (piece * MEBI), mtime=0) * (mebibytes // piece)
    return gzip.compress(head, mtime=0) + filled + gzip.compress(tail, mtime=0)


def tar_head(size: int, kind: bytes) -> bytes:
    """The header of what describes the next member of a tar, in `size` bytes."""
    member = tarfile.TarInfo("name")
    member.size, member.type = size, kind
    return member.tobuf(tarfile.GNU_FORMAT)


def tar_header(size: int, *, pax: bool, packed: bool) -> bytes:
    """A long name, or attributes that are digits, for the first member of a tar."""
    fill = b"1" * size + bytes(-size % 512)
    head = tar_head(size, tarfile.XHDTYPE if pax else tarfile.GNUTYPE_LONGNAME) + fill
    return gzip.compress(head, mtime=0) if packed else head


def long_name(mebibytes: int) -> bytes:
    """A tar.gz whose first name is that long."""
    head = tar_head(mebibytes * MEBI, tarfile.GNUTYPE_LONGNAME)
    return packed(head, b"\0", mebibytes)


def digits(size: int) -> bytes:
    """A tar whose first member has attributes of digits alone."""
    return tar_header(size, pax=True, packed=False) + tar_head(0, b"0") + bytes(1024)


def many_members(count: int) -> bytes:
    """A tar.gz of empty files."""
    thousand = gzip.compress(tar_head(0, b"0") * 1000, mtime=0)
    return thousand * (count // 1000) + gzip.compress(bytes(1024), mtime=0)


def many_entries(data: bytes, count: int) -> bytes:
    """A zip with that many entries more, all of its first member."""
    entry = b"PK\1\2" + bytes(24) + struct.pack("<H", 8) + bytes(16)
    entries = b"".join(entry + b"%08d" % n for n in range(count))
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 0, 0, len(entries), len(data), 0)
    return data + entries + end


def long_key(parts: int) -> str:
    return ".".join(["a"] * parts) + " = 1\n" + CAPTURE


def many_runouts(count: int) -> str:
    return CAPTURE + "".join(
        f'[[runout]]\nname = "n{k}"\nfile = "f{k}.xyz"\nwheel = "RR"\nangle_deg = 1.0\n'
        for k in range(count)
    )


def in_mm(number: str) -> str:
    """A capture.toml with a number in place of its target's diameter."""
    return 'length_unit = "mm"\n' + CAPTURE.replace("0.25", number)
