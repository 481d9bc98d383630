"""Shards: the captures of one of several runs that share an archive."""

from __future__ import annotations

import hashlib

from ...errors import InputError
from ...system import frozen


@frozen
class Shard:
    """Shard k of n, counted from 1."""

    k: int = 1
    n: int = 1

    def holds(self, name: str) -> bool:
        """Return whether a capture belongs to this shard; depends on its name alone."""
        if self.n == 1:
            return True
        number = hashlib.sha256(name.encode(errors="surrogateescape")).digest()[:8]
        return int.from_bytes(number) % self.n == self.k - 1


ALL = Shard()


def read_shard(text: str) -> Shard:
    """Parse a shard such as `3/8`. Raises InputError."""
    k, _, n = text.partition("/")
    if not (k.isdecimal() and n.isdecimal() and 1 <= int(k) <= int(n)):
        raise InputError(f"--shard {text}: not K/N: give K from 1 to N, such as 3/8")
    return Shard(int(k), int(n))
