"""A file of a store, as it is listed."""

from __future__ import annotations

import re
from dataclasses import dataclass

PARTIAL = ".partial"  # what is being written stands below this folder, and is never listed
NO_TEXT = re.compile("[\udc80-\udcff]")  # a byte that is no UTF-8, as Python holds it (PEP 383)


@dataclass(frozen=True)
class Entry:
    """A file of a store.

    name: relative, with "/" between folders; size in bytes; stamp: changes when the file does
    (time of change and inode, or the ETag), "broken link" for a link that leads nowhere.
    """

    name: str
    size: int
    stamp: str


def legible(name: str, escape: str = "\\x") -> str:
    r"""The name as results tell it: with \xeb for a byte that is no UTF-8."""
    return NO_TEXT.sub(lambda found: f"{escape}{ord(found[0]) - 0xDC00:02x}", name)
