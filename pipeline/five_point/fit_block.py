"""Fit of the plane through the five points of one block."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..plane import total_least_squares
from ..system import frozen
from ..vectors import Array
from ..vehicle import MAX_COORDINATE_M

# Less than any target is wide, and far above the step of float64 at 1e7 m.
MIN_LENGTH_M = 1e-3
# Five points 40 mm apart on one line reach 0.02 by 1 mm of noise; no target is so narrow.
MIN_WIDTH_TO_LENGTH = 0.05


@frozen
class BlockFit:
    """The plane of one block by total least squares, in the coordinates of its points.

    centre_m: (3,) mean of the points. normal: (3,) unit, its largest component positive.
    offset_m: normal . x + offset = 0. rms_m: root of the mean squared residual.
    scatter_m2: (3,) sums of squares about the centre along the rows of axes (3, 3), smallest first;
    axes[0] is the normal. Noise sigma (m) across the plane tilts the normal towards axes[i],
    i = 1, 2, by sigma/sqrt(scatter_m2[i]).
    """

    centre_m: Array
    normal: Array
    offset_m: float
    rms_m: float
    scatter_m2: Array
    axes: Array


def fit_block(points_m: npt.ArrayLike) -> BlockFit:
    """Fit the plane of one block by orthogonal (total) least squares.

    points_m: (5, 3), metres, any frame. Raises InputError for coincident or collinear points.
    """
    points = np.asarray(points_m, dtype=np.float64)
    if points.shape != (5, 3) or not bool(np.all(np.abs(points) <= MAX_COORDINATE_M)):
        raise InputError(f"a block is 5 finite points of 3 coordinates, got shape {points.shape}")
    fit = fit_points(points)
    length_m, width_m = np.sqrt(fit.scatter_m2[:0:-1] / 5)
    if length_m < MIN_LENGTH_M:
        raise InputError(
            f"its five points lie within {length_m:.1e} m of each other: "
            "check the points and the length unit"
        )
    if width_m < MIN_WIDTH_TO_LENGTH * length_m:
        line = f"on one line within {width_m:.1e} m (length {length_m:.4f} m)"
        raise InputError(
            _far_point(points)
            or f"its five points lie {line}, so they define no plane: measure them around the wheel"
        )
    return fit


def fit_points(points_m: Array) -> BlockFit:
    """Fit the plane of a block, or of what is left of it, (n, 3), by total least squares."""
    return _fitted(np.ascontiguousarray(points_m).tobytes())


def _far_point(points_m: Array) -> str:
    """Describe the point that lies far from the other four, if these define a plane."""
    from_middle = np.linalg.norm(points_m - np.median(points_m, axis=0), axis=1)
    index = int(np.argmax(from_middle))
    rest = np.delete(points_m, index, axis=0)
    length_m, width_m = np.sqrt(fit_points(rest).scatter_m2[:0:-1] / 4)
    if length_m < MIN_LENGTH_M or width_m < MIN_WIDTH_TO_LENGTH * length_m:
        return ""
    distance_m = float(np.linalg.norm(points_m[index] - rest.mean(axis=0)))
    return f"its point {index + 1} lies {distance_m:.4g} m from the other four: check its numbers"


@lru_cache(maxsize=64)  # blocks are fitted when the file is checked, and again
def _fitted(data: bytes) -> BlockFit:
    """Fit points (n, 3), bytes of float64; the result is shared, so its arrays are read-only."""
    points = np.frombuffer(data).reshape(-1, 3)
    plane = total_least_squares(points)
    for array in (plane.centroid_m, plane.basis, plane.scatter_m2):
        array.flags.writeable = False
    return BlockFit(
        centre_m=plane.centroid_m,
        normal=plane.normal,
        offset_m=-float(plane.normal @ plane.centroid_m),
        rms_m=float(np.sqrt(plane.scatter_m2[2] / len(points))),
        scatter_m2=plane.scatter_m2[::-1],
        axes=plane.basis[::-1],
    )
