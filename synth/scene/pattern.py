"""The print of a target: its reflectance at any point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Mask
from ..errors import SynthError
from ..parameters.pattern_file import PatternFile
from ..parameters.plate_file import TargetFile

LIGHT, DARK = 0.8, 0.1


@dataclass(frozen=True)
class Pattern:
    """A print of `file`, shifted along u and v. bits (K, n, n): cells of markers, True is light."""

    file: PatternFile
    shift_m: tuple[float, float]
    bits: Mask

    def reflectance(self, uv_m: Array) -> Array:
        """Return the reflectance (N,) at points (N, 2) of the face."""
        turn = np.radians(self.file.turn_deg)
        own = uv_m - self.file.offset - self.shift_m
        x = own[:, 0] * np.cos(turn) + own[:, 1] * np.sin(turn)
        y = own[:, 1] * np.cos(turn) - own[:, 0] * np.sin(turn)
        dark = {"circles": self._circles, "checkerboard": self._squares, "aruco": self._markers}[
            self.file.kind
        ](x, y)
        return np.where(dark, DARK, LIGHT)

    def _nearest(self, x: Array, y: Array) -> tuple[npt.NDArray[np.int64], Array, Array]:
        """Return the nearest circle or marker of each point, and the point from its centre."""
        f = self.file
        column = np.clip(np.rint(x / f.pitch + (f.columns - 1) / 2), 0, f.columns - 1)
        row = np.clip(np.rint((f.rows - 1) / 2 - y / f.pitch), 0, f.rows - 1)
        number = (row * f.columns + column).astype(np.int64)
        return (
            number,
            x - (column - (f.columns - 1) / 2) * f.pitch,
            y - ((f.rows - 1) / 2 - row) * f.pitch,
        )

    def _circles(self, x: Array, y: Array) -> Mask:
        _, a, b = self._nearest(x, y)
        return np.asarray(np.hypot(a, b) < (self.file.circle_diameter or 0.0) / 2)

    def _squares(self, x: Array, y: Array) -> Mask:
        """Return the dark squares; the upper left one is dark."""
        f = self.file
        column = np.floor(x / f.pitch + (f.columns + 1) / 2)
        row = np.floor((f.rows + 1) / 2 - y / f.pitch)
        on = (column >= 0) & (column <= f.columns) & (row >= 0) & (row <= f.rows)
        return np.asarray(on & ((column + row) % 2 == 0))

    def _markers(self, x: Array, y: Array) -> Mask:
        number, a, b = self._nearest(x, y)
        size, cells = self.file.marker_size or 1.0, self.bits.shape[1]
        column = np.floor((a / size + 0.5) * cells).astype(np.int64)
        row = np.floor((0.5 - b / size) * cells).astype(np.int64)
        on = (column >= 0) & (column < cells) & (row >= 0) & (row < cells)
        column, row = np.where(on, column, 0), np.where(on, row, 0)
        return np.asarray(on & ~self.bits[number, row, column])


def pattern_on(target: TargetFile, wheel: str, shift_m: tuple[float, float]) -> Pattern | None:
    """Return the print on the target of a wheel, if any."""
    if not isinstance(target, PatternFile):
        return None
    bits = np.zeros((0, 1, 1), dtype=bool)
    if target.kind == "aruco":
        bits = np.stack([_marker(target.dictionary or "", one) for one in target.ids_of(wheel)])
    return Pattern(target, shift_m, bits)


def _marker(dictionary: str, number: int) -> Mask:
    """Return a marker's cells (n, n) with its dark border, from the upper row; True is light."""
    import cv2

    known = [name for name in vars(cv2.aruco) if name.startswith("DICT_")]
    if dictionary not in known:
        raise SynthError(f"target dictionary {dictionary!r}: not known; one is DICT_4X4_50")
    table = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    count = len(table.bytesList)
    if not 0 <= number < count:
        raise SynthError(
            f"target ids: {dictionary} has markers 0 to {count - 1}, not {number}; correct the ids"
        )
    picture = table.generateImageMarker(number, table.markerSize + 2)
    return np.asarray(picture) > 127
