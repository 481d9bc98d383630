"""LZF decompression, for PCD's binary_compressed data.

Format: Marc Lehmann's liblzf. A control byte below 32 is followed by that many + 1 literal bytes;
any other refers back: 3 bits of length (7: one more byte follows), 13 bits of distance.
"""

from __future__ import annotations

import numpy as np

# No input expands more: three bytes make at most 7 + 255 + 2.
LARGEST_RATIO = 88

_FULL_RUN = 31
_GALLOP_AFTER = 8


def decompress(packed: bytes, size: int) -> bytearray:
    """Unpack exactly `size` bytes. Raises ValueError when `packed` does not hold them."""
    out = bytearray()
    end, at, full_runs = len(packed), 0, 0
    try:
        while at < end:
            control = packed[at]
            if control < 32:
                stop = at + control + 2
                out += packed[at + 1 : stop]
                at = stop
                full_runs = full_runs + 1 if control == _FULL_RUN else 0
                if full_runs == _GALLOP_AFTER:
                    at = _copy_full_runs(packed, at, out)
                    full_runs = 0
                continue
            length = (control >> 5) + 2
            if length == 9:
                at += 1
                length += packed[at]
            written = len(out)
            start = written - ((control & 31) << 8) - packed[at + 1] - 1
            at += 2
            if start < 0 or written > size:
                raise ValueError("a back reference leaves the data")
            if start + length <= written:
                out += out[start : start + length]
            else:
                # The copy runs into what it writes: the piece repeats.
                out += (out[start:] * (length // (written - start) + 1))[:length]
            full_runs = 0
    except IndexError:
        raise ValueError("a back reference is cut") from None
    if at != end or len(out) != size:
        raise ValueError(f"they unpack to {len(out)} bytes instead of {size}")
    return out


def _copy_full_runs(packed: bytes, at: int, out: bytearray) -> int:
    """Append successive literal runs of 32 bytes; return the position behind them."""
    step = 64
    while runs := min(step, (len(packed) - at) // 33):
        table = np.frombuffer(packed, np.uint8, runs * 33, at).reshape(runs, 33)
        broken = np.flatnonzero(table[:, 0] != _FULL_RUN)
        good = int(broken[0]) if len(broken) else runs
        out += table[:good, 1:].tobytes()
        at += good * 33
        if good < runs:
            break
        step = min(step * 4, 1 << 15)
    return at
