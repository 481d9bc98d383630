"""A file of a store, as it is listed."""

from __future__ import annotations

from dataclasses import dataclass

PARTIAL = ".partial"  # what is being written stands below this folder, and is never listed


@dataclass(frozen=True)
class Entry:
    """A file of a store.

    name: relative, with "/" between folders; size in bytes; stamp: changes when the file does
    (time of change and inode, or the ETag), "broken link" for a link that leads nowhere.
    """

    name: str
    size: int
    stamp: str
