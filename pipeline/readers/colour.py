"""Luminance of the colours of points, which stands for an intensity where a file holds none."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722  # Source: ITU-R BT.709, here of values as they stand
COLOURS = (
    ("red", "green", "blue"),
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
)
PACKED = ("rgb", "rgba")
_NAN_BITS = 0x7FC00000  # of a packed colour that text gives as `nan`


def luminance(*colour: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return the luminance (N,) of red, green and blue (N,), on their own scale; or of all in one.

    Packed are the lowest three bytes of an integer, or of a float of the same bits, as PCL has it.
    """
    if len(colour) == 1:
        return _luminance_of_packed(colour[0])
    red, green, blue = (column.astype(np.float64) for column in colour)
    return np.asarray(RED * red + GREEN * green + BLUE * blue)


def _luminance_of_packed(packed: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    is_float = packed.dtype.kind == "f"
    bits = packed.astype("<f4").view("<u4") if is_float else packed.astype("<u4")
    shade = luminance(*((bits >> shift) & 255 for shift in (16, 8, 0)))
    if is_float:
        shade[bits == _NAN_BITS] = np.nan
    return shade
