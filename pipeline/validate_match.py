"""Which block of a five-point file shows what which scan shows."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.errors import InputError
from pipeline.reference_frame import REFERENCE_WHEELS

NONE = "-"  # a block that no scan shows


def match_blocks(
    scans: Sequence[str], blocks: int, mapping: str | None, source: str
) -> dict[str, int]:
    """The block (from 0) of each scan that has one; RR, RL, FR, FL first, as in `scans`.

    scans: names of a capture's scans. blocks: how many the file holds. mapping: the scan's name of
    each block, by commas, `-` for none; None: in the order of the scans, where the counts fit.
    Raises InputError, which lists what each holds.
    """
    held = f"{source} holds {blocks} blocks, the capture {len(scans)} scans ({','.join(scans)})"
    if mapping is None:
        if blocks != len(scans):
            raise InputError(f"{held}: name the scan of each block with --blocks, {NONE} for none")
        return {scan: index for index, scan in enumerate(scans)}
    named = [name.strip() for name in mapping.split(",")]
    if len(named) != blocks:
        raise InputError(f"--blocks names {len(named)}, but {held}: name one scan a block")
    found: dict[str, int] = {}
    for index, name in enumerate(named):
        if name == NONE:
            continue
        if name not in scans:
            raise InputError(f"--blocks names {name!r} for block {index + 1}, but {held}")
        if name in found:
            raise InputError(f"--blocks names {name!r} twice: name another, or {NONE}")
        found[name] = index
    lacking = [wheel for wheel in REFERENCE_WHEELS if wheel not in found]
    if lacking:
        raise InputError(f"--blocks lacks {lacking[0]}: the frame needs all four reference wheels")
    return {scan: found[scan] for scan in scans if scan in found}
