"""The pose of a scan in its file: checked, and applied without losing digits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.readers.faults import fault
from pipeline.readers.raw import RawPart, Source

Array = npt.NDArray[np.float64]


def checked_pose(part: RawPart, source: Source) -> Array | None:
    """The part's (4, 4), or None where it changes nothing.

    Raises InputError for what no pose of a scanner is: not finite, flat, mirrored, or projective.
    """
    T = part.T_file_scan
    if T is None or np.array_equal(T, np.eye(4)):
        return None
    with np.errstate(all="ignore"):
        proper = np.isfinite(T).all() and np.linalg.det(T[:3, :3]) > 0.0
    if not (proper and np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0])):
        raise fault(source, f"the pose of its scan {part.name} is not a rotation and a shift")
    return T


def apply_pose(points: Array, T: Array) -> None:
    """Turn points (N, 3) to R points + t, in place.

    About the first point, so that large coordinates never meet a rotation: R (p - c) + (R c + t),
    the last term in extended precision.
    """
    if not len(points):
        return
    centre = points[0].copy()
    exact = T.astype(np.longdouble)
    shift = (exact[:3, :3] @ centre.astype(np.longdouble) + exact[:3, 3]).astype(np.float64)
    np.subtract(points, centre, out=points)
    points[:] = points @ T[:3, :3].T
    points += shift
