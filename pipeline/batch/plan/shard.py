"""One of several runs that share an archive: which captures are its own."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from ...errors import InputError


@dataclass(frozen=True)
class Shard:
    """Part k of n, counted from 1."""

    k: int = 1
    n: int = 1

    def holds(self, name: str) -> bool:
        """Whether a capture is of this part, whatever else is in the archive."""
        number = hashlib.sha256(name.encode(errors="surrogateescape")).digest()[:8]
        return int.from_bytes(number) % self.n == self.k - 1


ALL = Shard()


def read_shard(text: str) -> Shard:
    """Of a text as `3/8`. Raises InputError that says what is needed."""
    k, _, n = text.partition("/")
    if not (k.isdecimal() and n.isdecimal() and 1 <= int(k) <= int(n)):
        raise InputError(f"--shard {text}: K/N is needed, K from 1 to N, such as 3/8")
    return Shard(int(k), int(n))
