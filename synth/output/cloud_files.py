"""Writers of the cloud of a whole vehicle, block after block: one PLY, or an E57 of posed scans."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np

from ..arrays import Array, Array32
from ..scanner.stations import Station
from .files import ply_header, ply_rows

DIGITS = 12  # reserved in the header for the number of points


class Cloud(Protocol):
    """Writer of the scans, station after station."""

    def begin(self, station: Station) -> None:
        """Begin the blocks of this station."""

    def add(self, points_station_m: Array, intensity: Array32) -> None:
        """Write points (N, 3), in the axes of the site from the scanner, and intensity (N,)."""

    def close(self) -> None:
        """Finish the file."""


class PlyCloud:
    """PLY of all stations in the coordinates of the site."""

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("wb")
        self._count = 0
        self._shift_m = np.zeros(3)
        self._file.write(self._head())

    def _head(self) -> bytes:
        """Return a header of the same length for every number of points."""
        fill = "." * (DIGITS - len(str(self._count)))
        return ply_header(self._count, f"wheelplane synth {fill}")

    def begin(self, station: Station) -> None:
        """Begin the blocks of this station."""
        self._shift_m = station.position_site_m

    def add(self, points_station_m: Array, intensity: Array32) -> None:
        """Write points (N, 3), in the axes of the site from the scanner, and intensity (N,)."""
        self._file.write(ply_rows(points_station_m + self._shift_m, intensity))
        self._count += len(intensity)

    def close(self) -> None:
        """Write the number of points into the header."""
        self._file.seek(0)
        self._file.write(self._head())
        self._file.close()
