"""The record that every reader makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Scan:
    """One point cloud in scanner coordinates.

    points_m: (N, 3) float64, C order, finite, metres.
    intensity: (N,) float32 or None, the file's own scale.
    source: the file, as the user named it.
    missing_returns: rows of the file that held NaN coordinates and were dropped.
    """

    points_m: npt.NDArray[np.float64]
    intensity: npt.NDArray[np.float32] | None
    source: str
    missing_returns: int
