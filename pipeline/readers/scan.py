"""Scan: the record that every reader returns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..system import frozen
from ..vectors import Array, Array32


@frozen(eq=False)
class Part:
    """One scan of a file that may hold several: rows start:stop of `points_m`.

    T_file_scan: (4, 4) float64, metres: the pose that was applied to its points, once; None when
    the file states none.
    """

    name: str
    start: int
    stop: int
    T_file_scan: Array | None

    @property
    def station_m(self) -> Array | None:
        """Position of the scanner (3,) in the file's coordinates, if the file states a pose."""
        return None if self.T_file_scan is None else self.T_file_scan[:3, 3]

    @property
    def axes(self) -> Array | None:
        """Axes (3, 3) of the scan, rows in the file's coordinates, if the file states a pose."""
        return None if self.T_file_scan is None else self.T_file_scan[:3, :3].T


@frozen(eq=False)
class Scan:
    """One point cloud in the file's coordinates, the poses of its parts applied.

    points_m: (N, 3) float64, C order, finite, metres.
    intensity: (N,) float32 or None, the file's own scale.
    source: the file, as the user named it.
    invalid_points: rows without a return (NaN, or as the format marks them) that were dropped.
    grid: (N, 2) int32 or None, row and column of the scanner's raster.
    parts: the scans of the file, in its order; empty when the format has no parts.
    is_mesh: whether the points are the corners of a mesh, not returns.
    """

    points_m: Array
    intensity: Array32 | None
    source: str
    invalid_points: int
    grid: npt.NDArray[np.int32] | None = None
    parts: tuple[Part, ...] = ()
    is_mesh: bool = False
