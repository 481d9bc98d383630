"""Numbers and columns as text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from ...vectors import Array
from .digits import rounded

WIDTH = 100


def vector(components: Array, decimals: int = 8) -> str:
    """Write (3,) as [+x +y +z]."""
    return f"[{' '.join(rounded(x, -decimals) for x in components)}]"


def equation(normal: Array, offset_m: float) -> str:
    """Write the plane normal . x + offset = 0."""
    terms = [f"{rounded(x, -8)} {axis}" for x, axis in zip(normal, "xyz", strict=True)]
    return f"{' '.join(terms)} {rounded(offset_m, -6)} m = 0"


def paragraph(text: str) -> str:
    """Break a text into lines of a terminal's width."""
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def aligned(rows: Sequence[tuple[str, ...]], left: int) -> str:
    """Align columns, the first `left` of them to the left; an indent of two."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            f"{cell:<{width}}" if column < left else f"{cell:>{width}}"
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append(("  " + "  ".join(cells)).rstrip())
    return "\n".join(lines)
