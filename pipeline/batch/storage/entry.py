"""Entry of a store's listing."""

from __future__ import annotations

import re

from ...system import frozen

OUTSIDE = "link to a folder outside"  # stamp
IMPROPER = "a name that no file can have"  # stamp
TOO_DEEP = "below too many folders"  # stamp
DENIED = "a folder without permission to list it"  # stamp
MOST_LEVELS = 200  # of folders, whose files are listed
PARTIAL = ".partial"  # folder of files being written, which is never listed
NO_TEXT = re.compile("[\udc80-\udcff]")  # a byte that is not UTF-8, as Python keeps it (PEP 383)


@frozen
class Entry:
    """File of a store.

    name: relative, with "/" between folders; size in bytes; stamp: changes with the file
    (modification time and inode, or ETag), "broken link" for a link without a target.
    """

    name: str
    size: int
    stamp: str


def legible(name: str, escape: str = "\\x") -> str:
    r"""Return the name as written in results: with \xeb for a byte that is not UTF-8."""
    if name.isascii():
        return name
    return NO_TEXT.sub(lambda found: f"{escape}{ord(found[0]) - 0xDC00:02x}", name)
